/// The places by which rigid bodies touch each other.
#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "phyxel/model.hpp"
#include "phyxel/physics/obstacles.hpp"

namespace phyxel {

/// The numbers of the obstacles that are free bodies, ascending.
std::vector<std::size_t> free_bodies(const Model& model);

/// The balls on the surfaces of a model's obstacles that stick out (corners, edges, rims, vertices
/// of a mesh; the whole of a ball or capsule), and where those of one body are inside another.
class RigidTips {
 public:
  /// @param model must outlive this. Nothing is found in models without free bodies.
  explicit RigidTips(const Model& model);

  /// A body at an instant.
  struct Placed {
    std::size_t obstacle = 0;
    int free = -1;  ///< Number among the free bodies; -1: it is none.
    ObstacleStep step;
    Vec3d centre;       ///< Centre of a ball around its tips, there [m].
    double reach = -1;  ///< Radius of that ball [m]; negative: it has no tips.
  };
  /// Places the bodies. @param step_of returns where an obstacle is, and how it moves
  void place(const std::function<ObstacleStep(std::size_t obstacle)>& step_of);
  /// Calls each(of_tips, other, x, gap) for the tips of a body inside another one, one of the two a
  /// free body: x is where a tip is deepest [m].
  template <class Each>
  void for_each_inside(Each&& each) const {
    for (const Placed& body : placed_) {
      if (body.free < 0) continue;
      for (const Placed& other : placed_) {
        if (other.obstacle == body.obstacle) continue;
        look_inside(body, other, each);
        if (other.free < 0 && other.reach >= 0) look_inside(other, body, each);
      }
    }
  }

 private:
  template <class Each>
  void look_inside(const Placed& of_tips, const Placed& other, Each& each) const {
    const double radius = radius_[of_tips.obstacle];
    ObstacleShapes::with(model_.obstacles[other.obstacle].form, [&](const auto& shape) {
      if (gap_to(shape, other.step, of_tips.centre).distance > of_tips.reach) return;
      const std::vector<Vec3d>& tips = tips_[of_tips.obstacle];
      for (std::size_t k = 0; k < tips.size(); ++k) {
        const Vec3d x = of_tips.step.turn * tips[k] + of_tips.step.place;
        Gap gap = gap_to(shape, other.step, x);
        if (!(gap.distance < radius)) continue;
        // On edges and corners of the other body, the face through which the tip has come is the
        // one nearest to a place inside its own body. The centre of a ball is such a place.
        if (radius == 0) {
          const Vec3d inside =
              of_tips.step.turn * inside_[of_tips.obstacle][k] + of_tips.step.place;
          const Gap from = gap_to(shape, other.step, inside);
          constexpr double alike = 0.7;  // cosine
          if (dot(from.normal, gap.normal) < alike) {
            gap = {from.distance + dot(from.normal, x - inside), from.normal};
          }
        }
        gap.distance -= radius;
        if (gap.distance < 0) each(of_tips, other, x - radius * gap.normal, gap);
      }
    });
  }

  const Model& model_;
  std::vector<std::vector<Vec3d>> tips_;    // of each obstacle, in its own coordinates [m]
  std::vector<double> radius_;              // of the tips of each obstacle [m]
  std::vector<Vec3d> middle_;               // of the ball around them, likewise [m]
  std::vector<std::vector<Vec3d>> inside_;  // places inside the body beside these, likewise [m]
  std::vector<Placed> placed_;              // of each obstacle
};

/// The error of a model in which a free body overlaps another obstacle at the start; empty if none
/// does. Of a share: the same on all ranks.
std::string rigid_overlap_at_start(const Model& model, const Scene& scene);

}  // namespace phyxel
