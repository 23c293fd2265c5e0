/// Limits of the program of 2008: memory, 16-bit indices, and single precision.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "paper.hpp"
#include "paper/paper_backend.hpp"
#include "paper/paper_model.hpp"
#include "phyxel/error.hpp"
#include "phyxel/physics/hooke.hpp"
#include "phyxel/physics/laws.hpp"
#include "phyxel/physics/strain.hpp"
#include "phyxel/solver.hpp"
#include "stopwatch.hpp"

namespace phyxel::app {
namespace {

using paper::PaperBackend;

double steps_per_second(PaperBackend& backend, const Model& model, const PaperRequest& request) {
  State state;
  state.displacement.resize(static_cast<std::size_t>(model.size()));
  state.velocity.resize(state.displacement.size());
  state.dt = 1e-4;
  Solver solver(backend, state);
  const auto steps_take = [&](int steps) {
    const auto start = Clock::now();
    solver.step(steps);
    backend.wait();
    return seconds_since(start);
  };
  steps_take(3);
  const int steps =
      std::clamp(static_cast<int>(request.seconds / (steps_take(10) / 10)), 10, 100000);
  std::vector<double> rates;
  for (int r = 0; r < request.repeat; ++r) rates.push_back(steps / steps_take(steps));
  return median_of(rates).value;
}

std::size_t bytes_of(const Backend& backend) {
  std::size_t sum = 0;
  for (const ArrayBytes& array : backend.memory()) sum += array.bytes;
  return sum;
}

}  // namespace

CsvTable measure_memory(const PaperRequest& request) {
  CsvTable table;
  table.facts = paper_facts(request);
  table.columns = {"phyxels",     "bodies",         "numbers_a_pair", "program",
                   "array_bytes", "measured_bytes", "steps_per_s",    "answer"};
  const auto add = [&](Index n, int bodies, int numbers, const char* program, std::size_t arrays,
                       std::size_t measured, double rate, const std::string& answer) {
    table.rows.push_back({std::to_string(n), std::to_string(bodies), std::to_string(numbers),
                          program, std::to_string(arrays), std::to_string(measured),
                          rate > 0 ? fmt::format("{:.4g}", rate) : "", answer});
    say(fmt::format(
        "{:6} phyxels x {} {:16} {:3} numbers a pair: {:10.2f} MiB measured, {:9.4g} steps/s {}", n,
        bodies, program, numbers, static_cast<double>(measured) / (1 << 20), rate, answer));
  };

  const Index sizes[] = {238, 575, 666, 1000, 2000, 5000, 10000, 20000, 40000, paper::most_phyxels};
  for (const Index n : sizes) {
    const Model model = paper_block(n);
    for (const auto store : {paper::ForceStore::dense, paper::ForceStore::csr}) {
      const bool dense = store == paper::ForceStore::dense;
      const int numbers = dense ? 3 : 0;
      const char* program = dense ? "kernels of 2008" : "CSR gather";
      try {
        const std::size_t before = cuda_free_memory();
        const auto backend =
            paper::make_gpu_backend(model, {.store = store, .device = request.gpu->index});
        const std::size_t taken = before - cuda_free_memory();
        add(n, 1, numbers, program, bytes_of(*backend), taken,
            steps_per_second(*backend, model, request), "fits");
      } catch (const DeviceError& error) {
        add(n, 1, numbers, program, 0, 0, 0, error.what());
      }
    }
    // The paper's 34.33 MB for 1,000 phyxels correspond to nine numbers a pair.
    const std::size_t nine =
        9 * sizeof(float) * static_cast<std::size_t>(n) * static_cast<std::size_t>(n);
    try {
      add(n, 1, 9, "matrix alone", nine,
          cuda_measured_allocation(
              nine, fmt::format("a matrix of nine numbers a pair for {} phyxels", n)),
          0, "fits");
    } catch (const DeviceError& error) {
      add(n, 1, 9, "matrix alone", nine, 0, 0, error.what());
    }
  }

  // Several of the largest bodies, until the matrices do not fit.
  const Model largest = paper_block(paper::most_phyxels);
  std::vector<std::unique_ptr<PaperBackend>> bodies;
  const std::size_t before = cuda_free_memory();
  std::string answer = "fits";
  while (answer == "fits" && bodies.size() < 64) {
    std::size_t arrays = 0;
    try {
      bodies.push_back(paper::make_gpu_backend(largest, {.device = request.gpu->index}));
    } catch (const DeviceError& error) {
      answer = error.what();
    }
    for (const auto& body : bodies) arrays += bytes_of(*body);
    add(paper::most_phyxels, static_cast<int>(bodies.size()) + (answer != "fits"), 3,
        "kernels of 2008", arrays, before - cuda_free_memory(), 0, answer);
  }
  bodies.clear();

  // One phyxel more than 16-bit indices allow.
  const Model more = paper_block(paper::most_phyxels + 1);
  try {
    paper::make_gpu_backend(more, {.device = request.gpu->index});
  } catch (const InputError& error) {
    add(more.size(), 1, 3, "kernels of 2008", 0, 0, 0, error.what());
  }
  return table;
}

namespace {

/// A free bar of 54 phyxels that spins about its middle at 10 rad/s: displacements become as large
/// as the bar, while strains fall with 1/E. The rounding of float shows in the stress.
struct Spinning {
  static constexpr double spin = 10, density = 1000, end = 0.1, spacing = 0.1;
  Scene scene;
  Model model;

  explicit Spinning(double young) {
    BodyRequest body;
    body.name = "bar";
    body.where = "phyxel paper";
    body.source.shape = {.name = "block",
                         .size = {0.6, 0.3, 0.3},
                         .spacing = spacing,
                         .jitter = 0.1,
                         .surface = false};
    body.spin = {0, spin, 0};
    body.material = {.young = young,
                     .poisson = 0.34,
                     .density = density,
                     .law = StVenantKirchhoff<double>::name,
                     .hourglass = 0};
    paper::use_paper_rules(body);
    scene.bodies.push_back(body);
    model = paper::paper_model(scene);
  }
};

struct SpunState {
  std::vector<Vec3d> displacement;
  std::vector<Sym3d> stress;  ///< Second Piola–Kirchhoff stress [Pa].
};

SpunState spin(PaperBackend& backend, const Spinning& bar, double dt, std::int64_t steps) {
  Solver solver(backend, initial_state(bar.model, bar.scene, dt));
  solver.step(steps);
  SpunState state;
  state.displacement = solver.state().displacement;
  std::vector<Mat3d> gradient;
  backend.displacement_gradients(gradient);
  const Material& m = bar.model.parts[0].material;
  for (const Mat3d& g : gradient) {
    state.stress.push_back(Hooke<double>{m.lame_lambda(), m.lame_mu()}.stress(green_strain(g)));
  }
  return state;
}

double size_of(const Sym3d& s) { return std::sqrt(contract(s, s)); }

struct SpinErrors {
  double displacement = 0, stress = 0, largest_stress = 0;
};
SpinErrors errors_of(const SpunState& found, const SpunState& exact) {
  SpinErrors e;
  double largest_u = 0;
  for (std::size_t i = 0; i < exact.stress.size(); ++i) {
    e.displacement = std::max(e.displacement, norm(found.displacement[i] - exact.displacement[i]));
    e.stress = std::max(e.stress, size_of(found.stress[i] + (-1.0) * exact.stress[i]));
    if (!is_finite(found.displacement[i])) e.displacement = e.stress = HUGE_VAL;
    largest_u = std::max(largest_u, norm(exact.displacement[i]));
    e.largest_stress = std::max(e.largest_stress, size_of(exact.stress[i]));
  }
  e.displacement /= largest_u;
  e.stress /= e.largest_stress;
  return e;
}

struct SpinCase {
  double young, fraction;
  Spinning bar;
  double dt = 0;
  std::int64_t steps = 0;
  SpunState exact;
};

}  // namespace

CsvTable measure_stiffness(const PaperRequest& request) {
  CsvTable table;
  table.facts = paper_facts(request);
  table.columns = {
      "young_pa",           "step_of_limit", "step_s",           "steps", "program", "precision",
      "displacement_error", "stress_error",  "largest_stress_pa"};
  std::vector<SpinCase> cases;
  for (double young = 1e4; young < 2e12; young *= 10) {
    for (const double fraction : {0.1, 0.5, 0.9, 1.1}) {
      SpinCase c{young, fraction, Spinning(young), 0, 0, {}};
      c.dt = fraction * step_limit(c.bar.model, 1).largest_step;
      c.steps = static_cast<std::int64_t>(std::ceil(Spinning::end / c.dt));
      cases.push_back(std::move(c));
    }
  }
  // The reference has 64 bits of mantissa; the longest runs go first.
  const auto count = static_cast<std::ptrdiff_t>(cases.size());
  say(fmt::format("reference runs in long double: {} cases", count));
#pragma omp parallel for schedule(dynamic)
  for (std::ptrdiff_t k = 0; k < count; ++k) {
    SpinCase& c = cases[static_cast<std::size_t>(count - 1 - k)];
    // Above the limit the exact motion also diverges with the same scheme, so the reference there
    // is the motion at half the step.
    const bool above = c.fraction >= 1;
    c.exact = spin(*paper::make_sequential_backend<long double>(c.bar.model), c.bar,
                   above ? c.dt / 2 : c.dt, above ? 2 * c.steps : c.steps);
  }
  const char* measured = request.gpu ? "kernels of 2008" : "sequential of 2008";
  std::vector<PaperProgram> programs = paper_programs(request);
  std::erase_if(programs, [&](const PaperProgram& p) { return p.name != measured; });
  for (const SpinCase& c : cases) {
    for (const PaperProgram& p : programs) {
      const SpinErrors e = errors_of(spin(*p.make(c.bar.model), c.bar, c.dt, c.steps), c.exact);
      table.rows.push_back({fmt::format("{:g}", c.young), fmt::format("{:g}", c.fraction),
                            fmt::format("{:.4g}", c.dt), std::to_string(c.steps), p.name,
                            p.precision, fmt::format("{:.2e}", e.displacement),
                            fmt::format("{:.2e}", e.stress),
                            fmt::format("{:.4g}", e.largest_stress)});
      say(fmt::format(
          "E = {:g} Pa, {:g} of the largest step, {:6}: displacement {:.1e}, stress {:.1e}",
          c.young, c.fraction, p.precision, e.displacement, e.stress));
    }
  }
  return table;
}

}  // namespace phyxel::app
