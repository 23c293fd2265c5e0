#include "accuracy_studies.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "accuracy/accuracy.hpp"
#include "accuracy/bar.hpp"
#include "phyxel/solver.hpp"
#include "printed_table.hpp"
#include "stopwatch.hpp"
#include "studies.hpp"

namespace phyxel::studies {
namespace {

using app::AccuracyCase;
using app::bar;
using app::Discretisation;
using app::Filling;

using Add = std::function<void(const StudyRow&)>;

struct Stepped {
  State end;
  std::int64_t evaluations = 0;
  double seconds = 0;
};
Stepped step_through(const Model& model, Scene scene, Precision precision, Method method,
                     double step, double end) {
  scene.solver.method = method;
  const auto backend = make_cpu_backend(model, precision);
  const auto steps = static_cast<std::int64_t>(std::ceil(end / step - 1e-9));
  const double dt = end / static_cast<double>(steps);
  const auto start = app::Clock::now();
  Solver solver(model, *backend, initial_state(model, scene, dt), method);
  solver.step(steps - solver.steps());
  return {solver.state(), solver.work().evaluations, app::seconds_since(start)};
}

/// Measures the error of a spinning block in free fall for a second, by precision.
void measure_precision(const Add& add) {
  for (double young = 1e3; young < 2e12; young *= 10) {
    Scene scene = bar({.filling = Filling::cells, .across = 3}, 0.3, 0.3);
    scene.bodies[0].material.young = young;
    scene.bodies[0].velocity = {1, 0, 2};
    scene.bodies[0].spin = {0.3, 0.5, 1};
    scene.gravity = {0, 0, -9.81};
    const Model model = build_model(scene);
    const double step = 0.8 * step_limit(model).largest_step;
    for (const Precision precision : {Precision::double_, Precision::mixed, Precision::single}) {
      const Stepped s = step_through(model, scene, precision, Method::verlet, step, 1);
      Vec3d centre;
      for (Index i = 0; i < model.size(); ++i) {
        centre += (model.mass[i] / model.parts[0].mass) * s.end.displacement[i];
      }
      const Vec3d expected{1, 0, 2 - 0.5 * 9.81};
      add({precision_name(precision), young, norm(centre - expected) / norm(expected),
           s.evaluations, s.seconds});
    }
  }
}

/// Measures the error of a bar that sways for a second, about one period, by step.
void measure_steps(const Add& add) {
  constexpr double end = 1;
  Scene scene =
      app::clamped(bar({.filling = Filling::nodes, .hourglass = 0.1, .across = 2}, 0.6, 0.1));
  scene.gravity = {0, 0, -1};
  const Model model = build_model(scene);
  const double limit = step_limit(model).largest_step;
  const State truth =
      step_through(model, scene, Precision::double_, Method::verlet, 0.05 * limit, end).end;
  const auto measure = [&](Method method, double step) {
    const Stepped s = step_through(model, scene, Precision::double_, method, step, end);
    double squares = 0, all = 0;
    for (std::size_t i = 0; i < truth.displacement.size(); ++i) {
      const Vec3d off = s.end.displacement[i] - truth.displacement[i];
      squares += dot(off, off);
      all += dot(truth.displacement[i], truth.displacement[i]);
    }
    add({method_name(method), step, std::sqrt(squares / all), s.evaluations, s.seconds});
  };
  for (const double share : {0.98, 0.8, 0.4}) measure(Method::verlet, share * limit);
  for (const int steps : {25, 50, 100, 200, 400}) measure(Method::implicit, end / steps);
}

/// Measures the bar of "gravity", by support.
void measure_neighbours(const Add& add) {
  const std::pair<const char*, Discretisation> ways[] = {
      {"nodes", {.hourglass = 0.1, .across = 6}},
      {"nodes, jitter 0.2, closed",
       {.jitter = 0.2, .hourglass = 0.1, .closure = 1e-3, .across = 6}},
      {"mesh, closed", {.filling = Filling::mesh, .hourglass = 0.1, .closure = 1e-3, .across = 6}}};
  const std::vector<AccuracyCase> cases = app::accuracy_cases();
  const auto gravity = std::find_if(cases.begin(), cases.end(),
                                    [](const AccuracyCase& c) { return c.name == "gravity"; });
  for (const auto& [way, fixed] : ways) {
    for (const double factor : {1.3, 1.5, 1.65, 1.8, 2.0, 2.2, 2.5}) {
      Discretisation d = fixed;
      d.factor = factor;
      const app::Solution s = gravity->solve(d);
      add({way, s.neighbours, std::abs(s.found[0].error()), s.evaluations,
           s.seconds + s.setup_seconds});
    }
  }
}

void measure(const Study& study, const app::TableOptions& options) {
  app::PrintedTable table(options, {"way", study.x, "error", "evaluations", "seconds"});
  study.measure([&](const StudyRow& row) {
    table.row({row.way, fmt::format("{:.4g}", row.x), fmt::format("{:.3e}", row.error),
               std::to_string(row.evaluations), fmt::format("{:.4g}", row.seconds)});
  });
}

}  // namespace

std::vector<Study> accuracy_studies() {
  return {
      {"neighbours",
       "The bar of *gravity* at 1,519 phyxels with α = 0.1, with supports of 1.3 to 2.5 times the "
       "mean distance to the ten nearest phyxels: benefit and cost of more neighbours. The default "
       "of scenes is 1.8.",
       "neighbours", "neighbours", false, measure_neighbours},
      {"precision",
       "A spinning block of 64 phyxels is thrown and falls for a second, in steps of 0.8 of the "
       "stability limit, which shrinks as E grows. Error: that of the centre of mass, relative to "
       "its displacement. In float, the increment per step falls below the last digit of a "
       "displacement.",
       "E_Pa", "E [Pa]", false, measure_precision},
      {"steps",
       "A bar (0.6 m by 0.1 m, 189 phyxels) released at rest swings under its weight for a second, "
       "about a period. Error: the norm of the error of all displacements at the end, relative to "
       "Verlet's method with steps of a twentieth of the stability limit.",
       "step_s", "time [s]", true, measure_steps},
  };
}

void add_accuracy_studies(CLI::App& program) {
  for (const Study& study : accuracy_studies()) {
    CLI::App* command = program.add_subcommand(study.name, study.what);
    auto options = std::make_shared<app::TableOptions>();
    app::add_table_options(*command, *options);
    command->footer(
        fmt::format("Example:\n"
                    "  phyxel_studies {} --csv {}.csv",
                    study.name, study.name));
    command->callback([=] { measure(study, *options); });
  }
}

}  // namespace phyxel::studies
