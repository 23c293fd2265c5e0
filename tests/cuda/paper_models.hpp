/// Models, deformations and runs that the tests of the 2008 program share.
#pragma once

#include <map>
#include <random>

#include "device.hpp"
#include "paper/paper_backend.hpp"
#include "paper/paper_model.hpp"
#include "phyxel/solver.hpp"
#include "support/clouds.hpp"

namespace phyxel::paper {

/// Half the distance of two numbers at 1, in float and in double.
inline constexpr double single = 0x1p-24, twice = 0x1p-53;

/// True if this machine has no GPU.
inline bool no_gpu() {
  static const bool none = cuda_devices().empty();
  return none;
}

/// A box of phyxels displaced by up to 0.3 spacings, fixed at one end, with surfels throughout.
inline Model random_cloud(int nx, int ny, int nz, std::uint64_t seed,
                          const char* law = "st-venant-kirchhoff") {
  Scene scene = testing::one_body(testing::rubber());
  scene.gravity = {0, 0, -9.81};
  scene.bodies[0].material.law = law;
  scene.bodies[0].fixed.push_back({.select = {.indices = {{0, 1, 9, 10, 81}}}});
  use_paper_rules(scene.bodies[0]);
  Cloud cloud = testing::lattice(nx, ny, nz, 0.1, 0.3, seed);
  std::mt19937_64 engine(seed);
  for (int s = 0; s < 400; ++s) {
    cloud.surface.position.push_back({testing::uniform(engine, 0, 0.1 * nx),
                                      testing::uniform(engine, 0, 0.1 * ny),
                                      testing::uniform(engine, 0, 0.1 * nz)});
    cloud.surface.normal.push_back(normalised(testing::uniform_vector(engine, 1)));
  }
  return paper_model(scene, cloud);
}

/// The paper's bodies and the random clouds, each made once.
inline const Model& model_named(std::string name) {
  static std::map<std::string, Model> models;
  auto found = models.find(name);
  if (found == models.end()) {
    Model model = name == "random"          ? random_cloud(9, 9, 9, 1)
                  : name == "random_2"      ? random_cloud(7, 13, 8, 2)
                  : name == "random_3"      ? random_cloud(20, 6, 5, 3)
                  : name == "random_cauchy" ? random_cloud(9, 9, 9, 4, "small-strain")
                                            : paper_model(body_scene(name));
    found = models.emplace(name, std::move(model)).first;
  }
  return found->second;
}
inline const std::vector<std::string> all_models{"horn_bug", "alien_head", "dino",         "random",
                                                 "random_2", "random_3",   "random_cauchy"};

/// Displacements with strains of about 10%, random by a hundredth of the spacing, exact in float.
inline std::vector<Vec3d> deformation(const Model& model) {
  std::vector<Vec3d> u;
  std::mt19937_64 engine(11);
  for (const Vec3d& x : model.position) {
    const Vec3d rough = testing::uniform_vector(engine, 1e-3);
    const Vec3d v{0.1 * x.y + 0.05 * x.z * x.z + rough.x, -0.08 * x.z + rough.y,
                  0.06 * x.x - 0.07 * x.y * x.x + rough.z};
    u.push_back({static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)});
  }
  return u;
}

/// A block of exactly `n` phyxels.
inline Model block_of(Index n) {
  Cloud cloud = testing::lattice(41, 41, 40, 0.1);
  cloud.position.resize(static_cast<std::size_t>(n));
  cloud.volume.clear();
  Scene scene = testing::one_body();
  use_paper_rules(scene.bodies[0]);
  return paper_model(scene, cloud);
}

/// The state at the time `seconds`.
inline State after(PaperBackend& backend, const State& start, double seconds) {
  Solver solver(backend, start);
  while (solver.time() < seconds) solver.step();
  return solver.state();
}

/// The state at rest with half the largest step.
inline State hanging_start(const Model& model, const std::string& name) {
  return initial_state(model, body_scene(name), 0.5 * step_limit(model).largest_step);
}

}  // namespace phyxel::paper
