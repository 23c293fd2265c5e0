/// Errors of the kernels of 2008 relative to the same equations in higher precision: kernel by
/// kernel, and over a second of motion.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "paper.hpp"
#include "paper/paper_backend.hpp"
#include "paper/paper_model.hpp"
#include "phyxel/physics/hooke.hpp"
#include "phyxel/physics/strain.hpp"
#include "phyxel/solver.hpp"

namespace phyxel::app {
namespace {

using paper::PaperBackend;

double size_of(double a) { return std::abs(a); }
double size_of(Vec3d a) { return norm(a); }
double size_of(const Mat3d& a) {
  double sum = 0;
  for (int e = 0; e < 9; ++e) sum += a(e / 3, e % 3) * a(e / 3, e % 3);
  return std::sqrt(sum);
}

/// The largest |a - b| over the largest |b|.
template <class T>
double distance(const std::vector<T>& a, const std::vector<T>& b) {
  double error = 0, size = 0;
  for (std::size_t k = 0; k < b.size(); ++k) {
    const double apart = size_of(a[k] - b[k]);
    if (!std::isfinite(apart)) return apart;  // std::max would hide NaN
    error = std::max(error, apart);
    size = std::max(size, size_of(b[k]));
  }
  return size > 0 ? error / size : error;
}

/// The results of all kernels after one step from a state.
struct Results {
  PaperBackend::ImmutableValues immutable;
  std::vector<Mat3d> gradient;
  std::vector<Vec3d> pair_forces, forces;
  SurfelState surfels;
  State next;
};
Results results_of(PaperBackend& backend, const State& state) {
  Results r;
  r.immutable = backend.immutable_values();
  backend.upload(state);
  backend.displacement_gradients(r.gradient);
  r.pair_forces = backend.pair_forces();
  backend.internal_forces(r.forces);
  backend.advect_surfels(r.surfels);
  backend.stress();
  backend.advance(0, state.dt);
  backend.download(r.next);
  return r;
}

CsvTable new_table(const PaperRequest& request, std::vector<std::string> columns) {
  CsvTable table;
  table.facts = paper_facts(request);
  table.columns = std::move(columns);
  return table;
}

}  // namespace

State bent_and_twisted(const Model& model) {
  State state;
  state.dt = 0x1p-12;
  for (const Vec3d& x : model.position) {
    const Vec3d u{0.1 * x.y + 0.05 * x.z * x.z, -0.08 * x.z, 0.06 * x.x - 0.07 * x.y * x.x};
    state.displacement.push_back(
        {static_cast<float>(u.x), static_cast<float>(u.y), static_cast<float>(u.z)});
  }
  state.velocity.resize(state.displacement.size());
  return state;
}

CsvTable measure_kernels(const PaperRequest& request) {
  CsvTable table =
      new_table(request, {"body", "program", "precision", "kernel", "quantity", "relative_error"});
  for (const std::string& name : request.bodies) {
    const Model model = paper::paper_model(paper::body_scene(name));
    const State state = bent_and_twisted(model);
    const Results exact = results_of(*paper::make_sequential_backend<long double>(model), state);
    for (const PaperProgram& program : paper_programs(request)) {
      const Results r = results_of(*program.make(model), state);
      const auto add = [&](const char* kernel, const char* quantity, double error) {
        table.rows.push_back({name, program.name, program.precision, kernel, quantity,
                              fmt::format("{:.2e}", error)});
        say(fmt::format("{:10} {:20} {:6} {:22} {:24} {:.2e}", name, program.name,
                        program.precision, kernel, quantity, error));
      };
      add("precalcImutableValues", "weights", distance(r.immutable.omega, exact.immutable.omega));
      add("precalcImutableValues", "inverse moment matrices",
          distance(r.immutable.inverse_moment, exact.immutable.inverse_moment));
      add("precalcImutableValues", "volumes", distance(r.immutable.volume, exact.immutable.volume));
      add("calcStrainStressA", "displacement gradients", distance(r.gradient, exact.gradient));
      if (!r.pair_forces.empty()) {
        add("calcStrainStressA", "forces on neighbours",
            distance(r.pair_forces, exact.pair_forces));
      }
      add("calcStrainStressB", "summed forces", distance(r.forces, exact.forces));
      add("integrate", "displacements", distance(r.next.displacement, exact.next.displacement));
      add("updateSurfels", "vertices", distance(r.surfels.position, exact.surfels.position));
      add("updateSurfels", "normals", distance(r.surfels.normal, exact.surfels.normal));
    }
  }
  return table;
}

namespace {

/// The states of a body at some times.
std::vector<State> follow(PaperBackend& backend, const State& start,
                          std::initializer_list<double> times) {
  Solver solver(backend, start);
  std::vector<State> stops{};
  for (const double time : times) {
    while (solver.time() < time) solver.step();
    stops.push_back(solver.state());
  }
  return stops;
}

double largest_displacement(const State& state) {
  double largest = 0;
  for (const Vec3d& u : state.displacement) largest = std::max(largest, norm(u));
  return largest;
}

}  // namespace

CsvTable measure_trajectories(const PaperRequest& request) {
  CsvTable table = new_table(request, {"body", "program", "precision", "time_s", "steps",
                                       "relative_error", "largest_displacement_m"});
  for (const std::string& name : request.bodies) {
    const Scene scene = paper::body_scene(name);
    const Model model = paper::paper_model(scene);
    const State start = initial_state(model, scene, 0.5 * step_limit(model).largest_step);
    const auto times = {0.25, 0.5, 0.75, 1.0};
    const auto exact = follow(*paper::make_sequential_backend<long double>(model), start, times);
    for (const PaperProgram& program : paper_programs(request)) {
      const auto found = follow(*program.make(model), start, times);
      for (std::size_t k = 0; k < exact.size(); ++k) {
        const double error = distance(found[k].displacement, exact[k].displacement);
        const double time = times.begin()[k];
        table.rows.push_back({name, program.name, program.precision, fmt::format("{}", time),
                              std::to_string(exact[k].step), fmt::format("{:.2e}", error),
                              fmt::format("{:.3g}", largest_displacement(exact[k]))});
        say(fmt::format("{:10} {:20} {:6} after {:4} s, {:5} steps: {:.2e}", name, program.name,
                        program.precision, time, exact[k].step, error));
      }
    }
  }
  return table;
}

CsvTable measure_young(const PaperRequest& request) {
  CsvTable table =
      new_table(request, {"body", "young_pa", "step_s", "steps", "program", "precision",
                          "relative_error", "largest_displacement_m", "inverted_phyxels"});
  for (const std::string& name : request.bodies) {
    Scene scene = paper::body_scene(name);
    const std::vector<Cloud> placed = make_clouds(scene, {});
    for (const double young : {softest, stiffest}) {
      scene.bodies[0].material.young = young;
      const Model model = paper::paper_model(scene, placed);
      const State start = initial_state(model, scene, 0.5 * step_limit(model).largest_step);
      const State exact =
          follow(*paper::make_sequential_backend<long double>(model), start, {1.0})[0];
      for (const PaperProgram& program : paper_programs(request)) {
        const auto backend = program.make(model);
        const State found = follow(*backend, start, {1.0})[0];
        std::vector<Mat3d> gradient;
        backend->displacement_gradients(gradient);
        const auto inverted = std::count_if(gradient.begin(), gradient.end(), [](const Mat3d& g) {
          return !(1 + volume_change(g) > 0);
        });
        const double error = distance(found.displacement, exact.displacement);
        table.rows.push_back({name, fmt::format("{:g}", young), fmt::format("{:.4g}", start.dt),
                              std::to_string(found.step), program.name, program.precision,
                              fmt::format("{:.2e}", error),
                              fmt::format("{:.3g}", largest_displacement(found)),
                              std::to_string(inverted)});
        say(
            fmt::format("{:10} E = {:g} Pa, {:20} {:6} after 1 s, {:5} steps: {:.1e}, largest "
                        "displacement {:.3g} m, {} phyxels inverted",
                        name, young, program.name, program.precision, found.step, error,
                        largest_displacement(found), inverted));
      }
    }
  }
  return table;
}

}  // namespace phyxel::app
