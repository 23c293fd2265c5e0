/// The points of surfaces that supports hold or move along all axes, where free rigid bodies meet
/// them.
#pragma once

#include <vector>

#include "model/contact_groups.hpp"
#include "phyxel/model.hpp"
#include "phyxel/physics/obstacles.hpp"

namespace phyxel {

/// Places the held points of a model step by step. Their paths are known to all ranks, whatever
/// device steps the phyxels.
class PlacedHeldPoints {
 public:
  /// @param model must outlive this
  explicit PlacedHeldPoints(const Model& model);

  /// Places the points at the end of the step of `dt` [s] from `time` [s].
  void place(double time, double dt);
  /// Calls each(point, x, velocity, gap) for the points that are inside an obstacle: their places
  /// [m] and velocities over the step [m/s].
  /// @param at where the obstacle is at the end of the step
  template <class Each>
  void for_each_inside(const Obstacle& obstacle, const ObstacleStep& at, Each&& each) const {
    ObstacleShapes::with(obstacle.form, [&](const auto& shape) {
      for (const Group& group : groups_) {
        if (is_clear_of(obstacle, at, group.box, group.offset)) continue;
        for (std::size_t k = group.begin; k < group.end; ++k) {
          const HeldPoint& point = model_.held_points[k];
          Gap gap = gap_to(shape, at, now_[k].place);
          gap.distance -= point.offset;
          if (gap.distance < 0) each(point, now_[k].place, now_[k].velocity, gap);
        }
      }
    });
  }

 private:
  /// A range of points, one after the other, with the box around them.
  struct Group {
    std::size_t begin = 0, end = 0;
    double offset = 0;  // the largest distance of its points from their surface [m]
    Box box = no_box;
  };
  struct Placed {
    Vec3d place, velocity;  // [m], [m/s]
  };

  const Model& model_;
  bool stands_still_ = true;  // true if no support moves
  std::vector<Placed> now_;   // shape [points]
  std::vector<Group> groups_;
};

}  // namespace phyxel
