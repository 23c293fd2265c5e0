/// phyxel as a library: two loads that scenes do not have, set before each step. A spinning block
/// hangs from a spring whose other end is pulled up, and a pressure follows its top face. Internal
/// forces cancel, so its momentum must equal the impulse of spring, pressure and gravity.
#include <algorithm>
#include <cstdio>
#include <phyxel/phyxel.hpp>

namespace {

/// A spring to an anchor that the caller moves.
struct Spring {
  double stiffness;      ///< [N/m]
  phyxel::Vec3d anchor;  ///< [m]

  phyxel::Vec3d force(phyxel::Vec3d held) const { return stiffness * (anchor - held); }
};

phyxel::Vec3d centre_of(const std::vector<phyxel::Index>& phyxels, const phyxel::Model& model,
                        const phyxel::StateView& state) {
  phyxel::Vec3d sum;
  for (const phyxel::Index i : phyxels) sum += model.position[i] + state.displacement(i);
  return sum / static_cast<double>(phyxels.size());
}

/// Adds the forces of a pressure on triangles of surfels, which follow the body: p A n, a third for
/// each corner, distributed over the phyxels that carry it. @returns the sum of the forces [N]
phyxel::Vec3d add_pressure(double pressure, const std::vector<phyxel::Triangle>& face,
                           const phyxel::Model& model, const phyxel::SurfelState& surfels,
                           std::vector<phyxel::Vec3d>& force) {
  phyxel::Vec3d sum;
  for (const phyxel::Triangle& t : face) {
    const phyxel::Vec3d a = surfels.position[t[0]];
    const phyxel::Vec3d on_triangle =
        (-0.5 * pressure) * cross(surfels.position[t[1]] - a, surfels.position[t[2]] - a);
    sum += on_triangle;
    for (const phyxel::Index corner : t) {
      const auto carriers = model.surfels.carriers.row(corner);
      const double share = 1.0 / (3.0 * static_cast<double>(carriers.size()));
      for (const phyxel::Index i : carriers) force[i] += share * on_triangle;
    }
  }
  return sum;
}

}  // namespace

int main() {
  phyxel::Scene scene;
  scene.gravity = {0, 0, -9.81};
  phyxel::BodyRequest& block = scene.bodies.emplace_back();
  block.name = "block";
  block.material = {.young = 2e5, .poisson = 0.3, .density = 1000, .hourglass = 0.1};
  block.spin = {0, 2, 0};  // [rad/s]

  phyxel::ShapeRequest shape;
  shape.name = "block";
  shape.size = {0.2, 0.2, 0.2};
  shape.spacing = 0.02;
  shape.placement = phyxel::ShapeRequest::Placement::nodes;
  const phyxel::Cloud cloud = phyxel::make_shape(shape);
  const phyxel::Model model = phyxel::build_model(scene, {&cloud, 1});
  const std::vector<phyxel::Index>& top = cloud.regions.at("z+");
  std::vector<phyxel::Triangle> top_triangles;
  for (const phyxel::Triangle& t : model.surfels.triangle) {
    const auto is_on_top = [&](phyxel::Index s) { return model.surfels.normal[s].z > 0.99; };
    if (std::all_of(t.begin(), t.end(), is_on_top)) top_triangles.push_back(t);
  }

  const double dt = 0.8 * phyxel::step_limit(model).largest_step;
  const auto backend = phyxel::make_cpu_backend(model, phyxel::Precision::double_);
  phyxel::Solver solver(*backend, phyxel::initial_state(model, scene, dt));
  const phyxel::StateView state = *backend->view();

  Spring spring{2000, {0, 0, 0.15}};
  const double pressure = 500;  // [Pa]
  const double mass = model.parts[0].mass;
  const auto momentum = [&] {
    phyxel::Vec3d sum;
    for (phyxel::Index i = 0; i < model.size(); ++i) sum += model.mass[i] * state.velocity(i);
    return sum;
  };
  const phyxel::Vec3d before = momentum();
  phyxel::Vec3d impulse;
  std::vector<phyxel::Vec3d> force;
  phyxel::SurfelState surfels;
  while (solver.time() < 0.2) {
    spring.anchor.z = 0.15 + 0.5 * solver.time();  // [m]
    backend->advect_surfels(surfels);
    force.assign(model.position.size(), {});
    const phyxel::Vec3d pull = spring.force(centre_of(top, model, state));
    for (const phyxel::Index i : top) force[i] += (1.0 / static_cast<double>(top.size())) * pull;
    const phyxel::Vec3d push = add_pressure(pressure, top_triangles, model, surfels, force);
    backend->set_external_forces(force);
    impulse += dt * (pull + push + mass * scene.gravity);
    solver.step();
  }
  const phyxel::Vec3d gained = momentum() - before;
  std::printf("%d phyxels, %lld steps, %zu triangles under pressure\n", model.size(),
              static_cast<long long>(solver.steps()), top_triangles.size());
  std::printf("upwards: momentum gained %.5f kg m/s; impulse %.5f kg m/s\n", gained.z, impulse.z);
  std::printf("sideways: momentum gained %.5f kg m/s; impulse %.5f kg m/s\n", gained.x, impulse.x);
}
