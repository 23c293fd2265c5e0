#include "shapes/layers.hpp"

#include <algorithm>
#include <cmath>

namespace phyxel {

Layers::Layers(double low, double length, double spacing, std::array<bool, 2> on_end,
               std::span<const double> planes)
    : on_high_(on_end[1]) {
  double first = 0;
  for (std::size_t s = 0; s <= planes.size(); ++s) {
    const bool is_first = s == 0, is_last = s == planes.size();
    const double from = is_first ? low : planes[s - 1];
    const double size = planes.empty() ? length : (is_last ? low + length : planes[s]) - from;
    const bool on_low = !is_first || on_end[0], on_high = !is_last || on_end[1];
    // A free end is half a distance from its layer.
    const double distances = on_low == on_high
                                 ? std::max(1.0, std::round(size / spacing))
                                 : std::max(0.0, std::ceil(size / spacing - 1 - 1e-9)) + 0.5;
    const double free = 0.5 * ((on_low ? 0 : 1) + (on_high ? 0 : 1));
    const double between = distances - 1 + free;
    const double end = first + between + (on_low ? 1 : 0) + (is_last && on_high ? 1 : 0);
    stretches_.push_back({.low = from,
                          .spacing = size / distances,
                          .within = on_low ? 0 : 0.5,
                          .first = first,
                          .end = end});
    first = end;
  }
}

std::size_t Layers::stretch_of(double layer) const {
  std::size_t s = 0;
  while (s + 1 < stretches_.size() && layer >= stretches_[s].end) ++s;
  return s;
}

double Layers::place(double layer) const {
  const Stretch& s = stretches_[stretch_of(layer)];
  return s.low + (layer - s.first + s.within) * s.spacing;
}

bool Layers::is_laid(double layer) const {
  const Stretch& s = stretches_[stretch_of(layer)];
  return (s.within == 0 && layer == s.first) || (on_high_ && layer == count() - 1);
}

std::array<double, 2> Layers::shares(double layer) const {
  const std::size_t at = stretch_of(layer);
  const double here = 0.5 * stretches_[at].spacing;
  std::array<double, 2> share{here, here};
  if (stretches_[at].within == 0 && layer == stretches_[at].first) {
    share[0] = at > 0 ? 0.5 * stretches_[at - 1].spacing : 0;
  }
  if (on_high_ && layer == count() - 1) share[1] = 0;
  return share;
}

double Layers::first_above(double place) const {
  double low = 0, high = count();  // the answer lies in [low, high]
  while (low < high) {
    const double middle = std::floor(0.5 * (low + high));
    if (this->place(middle) > place) {
      high = middle;
    } else {
      low = middle + 1;
    }
  }
  return low;
}

}  // namespace phyxel
