/// phyxel as a library: a clamped beam comes to rest under its own weight, and its tip is compared
/// with beam theory.
#include <cstdio>
#include <phyxel/phyxel.hpp>

int main() {
  constexpr double length = 1, thickness = 0.2;  // [m]

  phyxel::Scene scene;
  scene.gravity = {0, 0, -9.81};
  phyxel::BodyRequest beam;
  beam.name = "beam";
  beam.material = {.young = 1e7, .poisson = 0.3, .density = 1000, .damping = 40};
  beam.fixed.resize(1);
  beam.fixed[0].select.region = "x-";  // the outermost layer of phyxels on that side
  scene.bodies.push_back(beam);

  phyxel::ShapeRequest shape;
  shape.name = "beam";
  shape.size = {length, thickness, thickness};
  shape.spacing = thickness / 6;
  const phyxel::Cloud cloud = phyxel::make_shape(shape);
  const phyxel::Model model = phyxel::build_model(scene, {&cloud, 1});

  const double step = 0.8 * phyxel::step_limit(model).largest_step;
  const auto backend = phyxel::make_cpu_backend(model, phyxel::Precision::double_);
  phyxel::Solver solver(*backend, phyxel::initial_state(model, scene, step));
  while (solver.time() < 1) solver.step();

  const phyxel::State state = solver.state();
  double sag = 0;
  for (const phyxel::Vec3d& u : state.displacement) sag = u.z < -sag ? -u.z : sag;

  // A cantilever under a uniform load q: bending q L⁴ / (8 E I) and shear q L² / (2 ⅚ G A).
  const phyxel::Material& m = beam.material;
  const double area = thickness * thickness, inertia = area * area / 12;
  const double load = m.density * 9.81 * area;
  const double theory = load * length * length *
                        (length * length / (8 * m.young * inertia) + 0.6 / (m.lame_mu() * area));
  std::printf("%d phyxels, %lld steps: the tip sags %.1f mm; beam theory says %.1f mm\n",
              model.size(), static_cast<long long>(solver.steps()), 1e3 * sag, 1e3 * theory);
}
