/// phyxel as a library: a step loop of the caller's pulls a bar, and reads forces, energies and,
/// without a copy, the state after each step. It compares the work with the energy that the bar has
/// gained.
#include <cstdio>
#include <phyxel/phyxel.hpp>

int main() {
  constexpr double length = 1, thickness = 0.2;  // [m]
  constexpr double pull = 0.001, duration = 1;   // [m], [s]: far slower than the bar rings

  phyxel::Scene scene;
  phyxel::BodyRequest& bar = scene.bodies.emplace_back();
  bar.name = "bar";
  bar.material = {.young = 1e6, .poisson = 0.3, .density = 1000};
  bar.fixed.resize(1);  // a smooth wall: free to grow thinner
  bar.fixed[0].select.region = "x-";
  bar.fixed[0].axes = {.x = true, .y = false, .z = false};
  bar.motions.resize(1);
  bar.motions[0].select.region = "x+";
  bar.motions[0].axes = {.x = true, .y = false, .z = false};
  bar.motions[0].displacement = {pull, 0, 0};
  bar.motions[0].duration = duration;

  phyxel::ShapeRequest shape;
  shape.name = "beam";
  shape.size = {length, thickness, thickness};
  shape.spacing = thickness / 5;
  shape.placement = phyxel::ShapeRequest::Placement::nodes;
  const phyxel::Cloud cloud = phyxel::make_shape(shape);
  const phyxel::Model model = phyxel::build_model(scene, {&cloud, 1});
  const std::vector<phyxel::Index>& end = cloud.regions.at("x+");

  const double dt = 0.8 * phyxel::step_limit(model).largest_step;
  const auto backend = phyxel::make_cpu_backend(model, phyxel::Precision::double_);
  backend->upload(phyxel::initial_state(model, scene, dt));
  const phyxel::StateView state = *backend->view();  // a view of the state after each step

  const auto pulling_force = [&](const std::vector<phyxel::Vec3d>& force) {
    double sum = 0;
    for (const phyxel::Index i : end) sum -= force[i].x;
    return sum;
  };
  std::vector<phyxel::Vec3d> force;
  double work = 0, pulled = 0, pulling = 0;
  std::int64_t steps = 0;
  // The work of `Solver::step`, and of its caller.
  for (; static_cast<double>(steps) * dt < duration; ++steps) {
    backend->step(steps, dt);
    const double now_pulled = state.displacement(end[0]).x;
    backend->internal_forces(force);
    const double now_pulling = pulling_force(force);
    work += 0.5 * (pulling + now_pulling) * (now_pulled - pulled);
    pulled = now_pulled;
    pulling = now_pulling;
  }
  const phyxel::Diagnostics now = phyxel::diagnose(model, *backend, steps, dt);

  // Hooke's law for a small stretch, which every material law obeys: F = E ε A.
  const double theory = bar.material.young * pulled / length * thickness * thickness;
  std::printf("%d phyxels, %lld steps to a pull of %.3f mm\n", model.size(),
              static_cast<long long>(steps), 1e3 * pulled);
  std::printf("force: %.2f N; Hooke says %.2f N\n", pulling, theory);
  std::printf("work: %.6f J; energy gained: %.6f J\n", work, now.total_energy());
}
