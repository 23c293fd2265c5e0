/// Models of contact problems and their time stepping.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "accuracy/accuracy.hpp"
#include "phyxel/diagnostics.hpp"
#include "phyxel/model.hpp"
#include "phyxel/solver.hpp"
#include "stopwatch.hpp"

namespace phyxel::app {

/// A model of touching bodies, stepped by Verlet's method in double with 0.8 of the largest stable
/// step, as scenes are by default.
class Touching {
 public:
  /// @param clouds function that returns the clouds of the scene's bodies, in place
  Touching(const Scene& scene, const std::function<std::vector<Cloud>()>& clouds);

  const Model& model() const { return model_; }
  Backend& backend() const { return *backend_; }
  Solver& solver() { return *solver_; }
  double dt() const { return dt_; }  ///< [s]
  Index begin(std::size_t part) const { return model_.parts[part].begin; }
  Index end(std::size_t part) const { return model_.parts[part].end; }

  /// Displacement of a body's centre of mass [m].
  Vec3d moved(std::size_t part) const;
  /// Velocity of a body's centre of mass half a step ago [m/s].
  Vec3d velocity(std::size_t part) const;
  /// Angular momentum of a body about its centre of mass [kg m²/s].
  Vec3d turning(std::size_t part) const;

  /// The solution; its time ends now.
  Solution solution(std::vector<Quantity> found) const;

 private:
  Clock::time_point begin_ = Clock::now(), start_;
  std::vector<Cloud> clouds_;
  Model model_;
  std::unique_ptr<Backend> backend_;
  double dt_ = 0;
  std::unique_ptr<Solver> solver_;
};

/// Solves for the rest of a scene of one body by Newton's method, in double.
/// @param find returns the quantities of the state at rest
Solution solve_at_rest(
    const Scene& scene, const std::function<Cloud()>& cloud,
    const std::function<std::vector<Quantity>(const Model&, Backend&, const Solver&)>& find);

/// A body with the material and the terms of a contact problem, without a source.
BodyRequest contact_body(const Discretisation& d, const char* name, double poisson);
/// A plane as an obstacle.
ObstacleRequest plane(const char* name, Vec3d normal, Vec3d at, double friction = 0);
/// A plane that moves by `by` [m] within `duration` [s].
ObstacleRequest ram(Vec3d normal, Vec3d at, Vec3d by, double duration);
/// A block about the origin, with its surface. @param spacing between nodes [m]
Cloud block_cloud(const Discretisation& d, Vec3d size, double spacing);
/// A ball about the origin, with its surface. `across` counts cells of the diameter. Cells or a
/// mesh.
Cloud ball_cloud(const Discretisation& d, double radius);
/// The cloud moved by `by` [m].
Cloud moved_cloud(Cloud cloud, Vec3d by);

}  // namespace phyxel::app
