#include "model/graded_hash.hpp"

#include <bit>
#include <cmath>
#include <limits>
#include <map>

#include "model/box.hpp"
#include "model/space_filling_curve.hpp"
#include "tabulated.hpp"

namespace phyxel {

GradedHash::GradedHash(std::span<const Vec3d> position, std::span<const double> size) {
  const Box box = box_around(position);
  low_ = box.low;
  high_ = box.high;
  std::map<int, Octave> found;
  double largest = 0;
  for (std::size_t i = 0; i < position.size(); ++i) {
    const int power = size[i] > 0 ? std::ilogb(size[i]) : std::numeric_limits<int>::min();
    Octave& octave = found[power];
    octave.member.push_back(static_cast<Index>(i));
    octave.largest = std::max(octave.largest, size[i]);
    largest = std::max(largest, size[i]);
  }
  for (auto& entry : found) {
    Octave& octave = entry.second;
    const std::vector<Vec3d> here =
        tabulated(octave.member.size(), [&](std::size_t k) { return position[octave.member[k]]; });
    // From level to level cells are four times as large. One more level could be of use only to
    // balls larger than every size.
    for (double cell = octave.largest;; cell *= 4) {
      octave.levels.emplace_back(here, cell);
      if (!(cell > 0) || cell >= largest) break;
    }
    octaves_.push_back(std::move(octave));
  }
}

double GradedHash::farthest(Vec3d place) const {
  const auto far = [](double x, double low, double high) {
    return std::max(std::abs(x - low), std::abs(x - high));
  };
  return (1 + 1e-9) * norm(Vec3d{far(place.x, low_.x, high_.x), far(place.y, low_.y, high_.y),
                                 far(place.z, low_.z, high_.z)});
}

GradedHash::Nearest GradedHash::nearest(Vec3d place, double limit, Index except) const {
  Nearest found;
  if (octaves_.empty()) return found;
  const double farthest_point = std::min(limit, farthest(place));
  for (double radius = octaves_.front().levels.front().cell_size();; radius *= 2) {
    const bool last = radius >= farthest_point;
    const double reach = last ? farthest_point : radius;
    visit_ball(
        place, [&](double) { return reach; },
        [&](const Entry& entry) {
          if (entry.index == except) return;
          const Vec3d d = entry.position - place;
          const double distance2 = dot(d, d);
          if (distance2 < found.distance2) found = {d, distance2, entry.index};
        });
    if (last || found.distance2 <= radius * radius) return found;
  }
}

std::vector<double> local_sizes(std::span<const Vec3d> position) {
  constexpr std::size_t few = 8;
  const Box box = box_around(position);
  const HilbertFrame frame = HilbertFrame::around(box.low, box.high);
  const std::vector<Index> order = curve_order(position, 0, static_cast<Index>(position.size()));
  const std::vector<std::uint64_t> key =
      tabulated(order.size(), [&](std::size_t k) { return frame.key_of(position[order[k]]); });
  std::vector<double> size(order.size(), 0);
  if (!(frame.scale > 0)) return size;
#pragma omp parallel for schedule(static)
  for (std::size_t k = 0; k < order.size(); ++k) {
    int bits = 3 * hilbert_bits;  // lowest ones, in which the keys of a cell differ
    for (std::size_t first = k < few ? 0 : k - few; first <= k; first += few / 2) {
      const std::size_t last = std::min(order.size() - 1, first + few);
      bits = std::min(bits, static_cast<int>(std::bit_width(key[first] ^ key[last])));
    }
    size[order[k]] = std::ldexp(1 / frame.scale, (bits + 2) / 3);
  }
  return size;
}

}  // namespace phyxel
