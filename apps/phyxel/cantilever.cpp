#include "cantilever.hpp"

#include <fmt/format.h>

#include <cmath>

#include "phyxel/error.hpp"
#include "setup.hpp"
#include "stopwatch.hpp"

namespace phyxel::app {
namespace {

constexpr double L = cantilever_length, A = cantilever_height * cantilever_height, I = A * A / 12;
const Material& m = cantilever_material;

/// Number of frames of the scene: four times what a beam twice as soft as Timoshenko's needs.
constexpr double most_frames = 200;

/// Mean displacement of the loaded layer along the load [m].
double deflection_of(const Model& model, const State& state) {
  double sum = 0;
  for (const Index i : model.loads[0].phyxels) sum -= state.displacement[i].z;
  return sum / static_cast<double>(model.loads[0].phyxels.size());
}

}  // namespace

Scene cantilever_scene(int across, double factor) {
  const double spacing = cantilever_height / across;
  const double first_mode = 1.8751 * 1.8751 * std::sqrt(m.young * I / (m.density * A)) / (L * L);
  BodyRequest beam;
  beam.name = fmt::format("cantilever, {} across, factor {:g}", across, factor);
  // Layers are in the middle of cells, so there is one cell more than gaps between layers.
  beam.source.shape = {.name = "beam",
                       .size = {L + spacing, cantilever_height, cantilever_height},
                       .spacing = spacing,
                       .surface = false};
  beam.material = m;
  beam.material.damping = 2 * first_mode;
  // The ten nearest are six neighbours at one spacing, and four at √2 spacings.
  beam.neighbourhood.radius = factor * (6 + 4 * std::sqrt(2)) / 10 * spacing;
  beam.fixed.push_back({.select = {.region = "x-"}});
  beam.loads.push_back({.select = {.region = "x+"}, .force = {0, 0, -cantilever_shear}});
  Scene scene;
  scene.bodies.push_back(beam);
  scene.output.frames_per_second = first_mode;
  scene.time.end = most_frames / first_mode;
  return scene;
}

double timoshenko_deflection() {
  const double kappa = 10 * (1 + m.poisson) / (12 + 11 * m.poisson);
  return cantilever_shear * (L * L * L / (3 * m.young * I) + L / (kappa * A * m.lame_mu()));
}

double known_deflection() { return 0.9934 * timoshenko_deflection(); }

Settled settle(const Scene& scene, const Model& model, Backend& backend, std::int64_t frames) {
  const StepPlan plan = plan_steps(scene, model, backend, false);
  Solver solver(backend, initial_state(model, scene, plan.dt));
  Settled beam;
  const auto done = [&] {
    return frames ? beam.frames == frames : beam.change < cantilever_settled;
  };
  do {
    if (beam.steps >= plan.steps || !std::isfinite(beam.deflection)) {
      throw DivergedError(
          fmt::format("{}: not settled after {} steps: in the last {} the deflection, {:g} m, "
                      "changed by {:.2g} "
                      "of itself; allowed {:g}",
                      model.parts[0].name, beam.steps, plan.steps_per_frame, beam.deflection,
                      beam.change, cantilever_settled));
    }
    const auto start = Clock::now();
    solver.step(plan.steps_per_frame);
    backend.wait();
    beam.seconds += seconds_since(start);
    beam.steps = solver.steps();
    ++beam.frames;
    const double before = beam.deflection;
    beam.state = solver.state();
    beam.deflection = deflection_of(model, beam.state);
    beam.change = std::abs(beam.deflection - before) / std::abs(beam.deflection);
  } while (!done());
  return beam;
}

}  // namespace phyxel::app
