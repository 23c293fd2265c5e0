#include "model/graded_hash.hpp"

#include <cmath>
#include <limits>
#include <map>

#include "model/box.hpp"
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
  for (auto& [power, octave] : found) {
    const std::vector<Vec3d> here = tabulated(
        octave.member.size(), [&](std::size_t k) { return position[octave.member[k]]; });
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

}  // namespace phyxel
