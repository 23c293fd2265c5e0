/// The parts into which cuts divide the inside of a body.
#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "phyxel/cloud.hpp"

namespace phyxel {

/// The parts of space that the cells of points end with: room k + 1 is the region of the k-th cut
/// without those of earlier ones, and room 0 is outside all regions.
class Rooms {
 public:
  /// @param point of the whole body [m]; those on a cut are outside its region
  Rooms(const SupportCuts& cuts, std::span<const Vec3d> point)
      : cuts_(cuts), points_(cuts.list.size() + 1) {
    for (std::size_t k = 0; k < point.size(); ++k) {
      const auto deep_inside = [&](const SpaceRegion& wall) {
        return wall.shrunk(4 * cuts.depth).contains(point[k]);
      };
      points_[first_room(deep_inside)].push_back(k);
    }
  }

  std::size_t size() const { return points_.size(); }
  /// Indices of the points in a room, ascending.
  const std::vector<std::size_t>& points_in(std::size_t room) const { return points_[room]; }
  /// The room to whose points a place belongs: room 0 has the space of regions without points.
  std::size_t room_of(Vec3d place) const {
    const std::size_t room =
        first_room([&](const SpaceRegion& wall) { return wall.contains(place); });
    return points_[room].empty() ? 0 : room;
  }
  /// False if no place of a ball belongs to the room. Points of the room may be far from such a
  /// ball, and a search for the nearest would visit them all.
  bool may_reach(std::size_t room, Vec3d middle, double radius) const {
    for (std::size_t k = 0; k < cuts_.list.size(); ++k) {
      const double distance = cuts_.list[k].wall.distance(middle);
      if (k + 1 == room) return distance <= radius;
      if (room == 0 && points_[k + 1].empty() && distance <= radius) return true;
      // A little less, since sample points are rounded to float.
      if (distance < -(1 + 1e-5) * radius) return false;
    }
    return true;
  }

 private:
  /// The number of the first region with contains(region), from 1; 0 if there is none.
  template <class Contains>
  std::size_t first_room(Contains&& contains) const {
    std::size_t k = 0;
    while (k < cuts_.list.size() && !contains(cuts_.list[k].wall)) ++k;
    return k < cuts_.list.size() ? k + 1 : 0;
  }

  const SupportCuts& cuts_;
  std::vector<std::vector<std::size_t>> points_;
};

}  // namespace phyxel
