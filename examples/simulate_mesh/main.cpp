/// phyxel as a library: a closed surface from a file is filled with phyxels, fixed at its top,
/// released, and written as frames for ParaView.
///
///     simulate_mesh examples/mesh/ring.obj out/ring
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <phyxel/phyxel.hpp>

namespace {

phyxel::Scene hanging_body(const phyxel::Surface& surface, const std::filesystem::path& directory) {
  double top = surface.position[0].z, bottom = top;
  for (const phyxel::Vec3d& x : surface.position) {
    top = std::max(top, x.z);
    bottom = std::min(bottom, x.z);
  }
  phyxel::Scene scene;
  scene.gravity = {0, 0, -9.81};  // [m/s^2]
  scene.time.end = 0.4;           // [s]
  scene.output.directory = directory;
  phyxel::BodyRequest& body = scene.bodies.emplace_back();
  body.name = "body";
  body.material = {.young = 4e5, .poisson = 0.35, .density = 1000, .hourglass = 0.1};
  body.fixed.resize(1);  // the uppermost tenth
  body.fixed[0].select.box =
      phyxel::Selection::Box{{-1e3, -1e3, top - 0.1 * (top - bottom)}, {1e3, 1e3, 1e3}};
  return scene;
}

void write_frame(phyxel::Recorder& recorder, phyxel::Backend& backend, const phyxel::State& state,
                 const phyxel::Diagnostics& now) {
  phyxel::SurfelState surfels;
  backend.advect_surfels(surfels);
  recorder.write({.state = &state, .surfels = &surfels, .diagnostics = now});
}

void simulate(const char* mesh, const char* directory) {
  const phyxel::Surface surface = phyxel::read_mesh(mesh);
  const phyxel::Cloud cloud = phyxel::sample_surface(surface, {.phyxels = 2000});
  const phyxel::Scene scene = hanging_body(surface, directory);
  const phyxel::Model model = phyxel::build_model(scene, {&cloud, 1});

  const auto backend = phyxel::make_cpu_backend(model, phyxel::Precision::double_);
  const double step = 0.8 * phyxel::step_limit(model).largest_step;
  phyxel::Solver solver(*backend, phyxel::initial_state(model, scene, step));
  phyxel::Recorder recorder(model, scene, false);  // refuses a folder with frames in it

  const double frame_time = 1 / scene.output.frames_per_second;
  phyxel::Diagnostics now = phyxel::diagnose(model, *backend, solver.now());
  phyxel::StabilityWatch watch(model, now);
  const double energy = now.total_energy();
  double fallen = 0, drift = 0;
  for (int frame = 0; frame <= scene.time.end / frame_time; ++frame) {
    while (solver.time() < frame * frame_time) solver.step();
    now = phyxel::diagnose(model, *backend, solver.now());
    watch.check(now);  // throws DivergedError
    write_frame(recorder, *backend, solver.state(), now);
    fallen = std::max(fallen, -now.gravity_energy);
    drift = std::max(drift, std::abs(now.total_energy() - energy));
  }
  std::printf("%d phyxels, %lld steps, %lld frames in %s\n", model.size(),
              static_cast<long long>(solver.steps()),
              static_cast<long long>(recorder.frames_written()), recorder.directory().c_str());
  std::printf("energy: gravity gave %.6f J; the sum of all changed by %.6f J\n", fallen, drift);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "usage: simulate_mesh <surface.obj> <folder>\n");
    return 2;
  }
  try {
    simulate(argv[1], argv[2]);
  } catch (const phyxel::Error& error) {
    std::fprintf(stderr, "simulate_mesh: error: %s\n", error.what());
    return static_cast<int>(error.code());
  }
}
