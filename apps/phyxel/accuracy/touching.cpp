#include "accuracy/touching.hpp"

#include "accuracy/bar.hpp"
#include "phyxel/mesh.hpp"

namespace phyxel::app {
namespace {

constexpr double safety = 0.8;  ///< Time step over the stability limit.

/// The mean over a body, by mass. @param value of a phyxel
template <class Value>
Vec3d mean_over(const Model& model, std::size_t part, Value&& value) {
  Vec3d sum;
  for (Index i = model.parts[part].begin; i < model.parts[part].end; ++i) {
    sum += model.mass[i] * value(i);
  }
  return sum / model.parts[part].mass;
}

}  // namespace

Touching::Touching(const Scene& scene, const std::function<std::vector<Cloud>()>& clouds)
    : clouds_(clouds()), model_(build_model(scene, clouds_)) {
  backend_ = make_cpu_backend(model_, Precision::double_);
  dt_ = safety * step_limit(model_).largest_step;
  solver_ = std::make_unique<Solver>(model_, *backend_, initial_state(model_, scene, dt_),
                                     Method::verlet);
  start_ = Clock::now();
}

Vec3d Touching::moved(std::size_t part) const {
  const StateView view = *backend_->view();
  return mean_over(model_, part, [&](Index i) { return view.displacement(i); });
}

Vec3d Touching::velocity(std::size_t part) const {
  const StateView view = *backend_->view();
  return mean_over(model_, part, [&](Index i) { return view.velocity(i); });
}

Vec3d Touching::turning(std::size_t part) const {
  const StateView view = *backend_->view();
  const Vec3d centre = model_.parts[part].centre + moved(part);
  Vec3d sum;
  for (Index i = begin(part); i < end(part); ++i) {
    const Vec3d arm = model_.position[i] + view.displacement(i) - centre;
    sum += model_.mass[i] * cross(arm, view.velocity(i));
  }
  return sum;
}

Solution Touching::solution(std::vector<Quantity> found) const {
  return {.phyxels = model_.size(),
          .neighbours = static_cast<double>(model_.pairs()) / model_.size(),
          .evaluations = solver_->steps(),
          .seconds = seconds_since(start_),
          .setup_seconds = std::chrono::duration<double>(start_ - begin_).count(),
          .found = std::move(found)};
}

Solution solve_at_rest(
    const Scene& scene, const std::function<Cloud()>& cloud,
    const std::function<std::vector<Quantity>(const Model&, Backend&, const Solver&)>& find) {
  const auto begin = Clock::now();
  const Cloud points = cloud();
  const Model model = build_model(scene, std::span(&points, 1));
  const auto backend = make_cpu_backend(model, Precision::double_);
  Solver solver(model, *backend, initial_state(model, scene, 1), Method::equilibrium);
  Solution solution{.phyxels = model.size(),
                    .neighbours = static_cast<double>(model.pairs()) / model.size(),
                    .setup_seconds = seconds_since(begin)};
  const auto start = Clock::now();
  solver.step();
  solution.found = find(model, *backend, solver);
  solution.seconds = seconds_since(start);
  solution.evaluations = solver.work().evaluations;
  return solution;
}

BodyRequest contact_body(const Discretisation& d, const char* name, double poisson) {
  BodyRequest body;
  body.name = name;
  body.where = "phyxel accuracy";
  body.material = {
      .young = E, .poisson = poisson, .density = rho, .law = d.law, .hourglass = d.hourglass};
  body.neighbourhood.factor = d.factor;
  body.closure = d.closure;
  return body;
}

ObstacleRequest plane(const char* name, Vec3d normal, Vec3d at, double friction) {
  ObstacleRequest obstacle;
  obstacle.name = name;
  obstacle.shape = "plane";
  obstacle.normal = normal;
  obstacle.translation = at;
  obstacle.friction = friction;
  obstacle.where = "phyxel accuracy";
  return obstacle;
}

ObstacleRequest ram(Vec3d normal, Vec3d at, Vec3d by, double duration) {
  ObstacleRequest obstacle = plane("ram", normal, at);
  obstacle.motion.displacement = by;
  obstacle.motion.duration = duration;
  return obstacle;
}

Cloud block_cloud(const Discretisation& d, Vec3d size, double spacing) {
  BodyRequest body = contact_body(d, "block", 0);
  body.source.shape = {.name = "block",
                       .size = size,
                       .spacing = spacing,
                       .jitter = d.jitter,
                       .placement = placement_of(d.filling)};
  Cloud cloud = make_cloud(body);
  if (d.filling != Filling::mesh) return cloud;
  return sample_surface(cloud.surface,
                        {.phyxels = static_cast<Index>(cloud.position.size()), .on_surface = true});
}

Cloud ball_cloud(const Discretisation& d, double radius) {
  BodyRequest body = contact_body(d, "ball", 0);
  body.source.shape = {.name = "sphere",
                       .radius = radius,
                       .spacing = 2 * radius / d.across,
                       .jitter = d.jitter,
                       .placement = d.filling == Filling::cells ? ShapeRequest::Placement::cells
                                                                : ShapeRequest::Placement::fitted};
  return make_cloud(body);
}

Cloud moved_cloud(Cloud cloud, Vec3d by) {
  for (Vec3d& x : cloud.position) x += by;
  for (Vec3d& x : cloud.surface.position) x += by;
  return cloud;
}

}  // namespace phyxel::app
