/// phyxel bench: speed, beside the error and the limits of the machine.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <omp.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <random>
#include <thread>

#include "bench_body.hpp"
#include "bench_error.hpp"
#include "bench_sample.hpp"
#include "bench_scaling.hpp"
#include "cantilever.hpp"
#include "command.hpp"
#include "device_option.hpp"
#include "known_names.hpp"
#include "model/box.hpp"
#include "phyxel/phyxel.hpp"
#include "printed_table.hpp"
#include "setup.hpp"
#include "stopwatch.hpp"
#include "version.hpp"

namespace phyxel::app {
namespace {

struct BenchOptions {
  std::vector<Index> sizes;
  std::vector<int> threads;
  std::vector<std::string> precisions = {"float", "double", "mixed"};
  std::vector<std::string> terms;
  std::string device = "cpu", shape = "cube";
  int repeats = 5, bodies = 1;
  std::vector<int> across;
  std::vector<double> factors = {NeighbourhoodRule{}.factor};
  double seconds = 0.3;
  TableOptions table;
};

/// Copy bandwidth of `threads` threads between arrays far larger than the caches [bytes/s], reads
/// and writes counted; the best of five.
double copy_bandwidth(int threads) {
  const std::size_t count = std::size_t{1} << 25;  // 256 MiB of double
  std::vector<double> from(count, 1.0), to(count, 0.0);
  double best = 0;
  for (int repeat = 0; repeat < 5; ++repeat) {
    const auto start = Clock::now();
#pragma omp parallel for schedule(static) num_threads(threads)
    for (std::size_t i = 0; i < count; ++i) to[i] = from[i];
    best = std::max(best, 2.0 * sizeof(double) * static_cast<double>(count) / seconds_since(start));
  }
  return to[count / 2] == 1.0 ? best : 0;
}

/// Round-trip time of two cores through a cache line [ns], the best of five. It bounds the cost of
/// synchronising threads, and shows whether a virtual machine moves its cores.
double core_round_trip() {
  constexpr int trips = 2000;
  double best = HUGE_VAL;
  for (int repeat = 0; repeat < 5; ++repeat) {
    alignas(128) std::atomic<int> ball{0};
    const auto play = [&ball](int first) {
      for (int turn = first; turn < 2 * trips; turn += 2) {
        while (ball.load(std::memory_order_acquire) != turn) {
        }
        ball.store(turn + 1, std::memory_order_release);
      }
    };
    const auto start = Clock::now();
    std::thread other(play, 1);
    play(0);
    other.join();
    best = std::min(best, seconds_since(start) / trips * 1e9);
  }
  return best;
}

/// The cloud of a cube, or of a body of the 2008 paper.
Cloud bench_cloud(const std::string& shape, Index n, bool surfels) {
  return shape == "cube" ? bench_cube(n, surfels) : make_shape({.name = shape, .surface = surfels});
}

const std::vector<std::string> all_terms = bench_terms();

/// A state with strains of 10%.
State deformed(const Model& model) {
  std::mt19937_64 engine(3);
  State state;
  for (const Vec3d& x : model.position) {
    const auto noise = [&] {
      return 0.002 * (static_cast<double>(engine() >> 11) * 0x1p-53 - 0.5);
    };
    state.displacement.push_back(
        {0.1 * x.y + noise(), -0.05 * x.z + noise(), 0.02 * x.x + noise()});
  }
  state.velocity.resize(state.displacement.size());
  return state;
}

/// Puts equal bodies on each other.
void pile_up(std::vector<Cloud>& clouds) {
  const Box box = box_around(clouds[0].surface.position);
  for (std::size_t b = 0; b < clouds.size(); ++b) {
    const Vec3d up{0, 0, static_cast<double>(b) * (box.high.z - box.low.z)};
    for (Vec3d& x : clouds[b].position) x += up;
    for (Vec3d& x : clouds[b].surface.position) x += up;
  }
}

std::vector<Vec3d> forces_of(Backend& backend, const State& state) {
  std::vector<Vec3d> force;
  backend.upload(state);
  backend.internal_forces(force);
  return force;
}

/// Reference forces in double [N] on the same device; empty for bodies so large that a second
/// backend may not fit.
std::vector<Vec3d> exact_forces(const Model& model, const ChosenDevice& device) {
  constexpr Index most = 50'000'000;
  if (model.size() > most) return {};
  return forces_of(*make_backend(model, Precision::double_, device, 0), deformed(model));
}

/// Largest difference from the exact vectors, relative to the largest of them.
std::string largest_error(const std::vector<Vec3d>& vectors, const std::vector<Vec3d>& exact) {
  double worst = 0, largest = 0;
  for (std::size_t i = 0; i < vectors.size(); ++i) {
    worst = std::max(worst, norm(vectors[i] - exact[i]));
    largest = std::max(largest, norm(exact[i]));
  }
  return fmt::format("{:.2e}", worst / largest);
}

/// Relative error of internal forces; "" without exact ones.
std::string force_error(const Model& model, Backend& backend, const std::vector<Vec3d>& exact) {
  return exact.empty() ? "" : largest_error(forces_of(backend, deformed(model)), exact);
}

/// How a backend steps: the part of its name after the precision.
std::string path_of(const Backend& backend) {
  std::string name = backend.name();
  for (int parts = 0; parts < 2; ++parts) name = name.substr(name.find(", ") + 2);
  std::replace(name.begin(), name.end(), ',', ':');
  return name;
}

/// A row of `bench step`.
struct StepCase {
  std::string terms;
  Index size;
  double factor;  ///< Support factor.
};

std::vector<StepCase> step_cases(const BenchOptions& options) {
  // A body of the paper has one size.
  const std::vector<Index> sizes = options.shape == "cube" ? options.sizes : std::vector<Index>{0};
  std::vector<StepCase> cases;
  for (const std::string& terms : options.terms) {
    for (const Index size : sizes) {
      for (const double factor : options.factors) cases.push_back({terms, size, factor});
    }
  }
  return cases;
}

void bench_step(const BenchOptions& options) {
  const ChosenDevice device = choose_device(options.device);
  check_known("--terms", options.terms, all_terms);
  PrintedTable table(options.table,
                     {"shape", "bodies", "terms", "precision", "path", "threads", "phyxels",
                      "neighbours", "surfels", "steps_per_s", "phyxel_steps_per_s", "spread",
                      "pairs_per_s", "bytes_per_phyxel_step", "bytes_per_s", "copy_bytes_per_s",
                      "memory_bytes_per_phyxel", "force_error", "core_round_trip_ns"},
                     device_facts(device));
  // The thread count of a GPU is 0.
  const std::vector<int> all_threads = device.gpu ? std::vector<int>{0} : options.threads;
  std::vector<double> copy;
  for (const int threads : all_threads) {
    copy.push_back(device.gpu ? cuda_copy_bandwidth() : copy_bandwidth(threads));
  }
  for (const auto& [terms, size, factor] : step_cases(options)) {
    Scene scene = bench_scene(terms, factor, options.bodies);
    std::vector<Cloud> clouds;
    const bool surfels = terms == "surfels";
    // Closed gradients and contact need a surface, which then is not moved.
    const bool has_surface =
        surfels || terms == "closure" || terms == "obstacle" || terms == "contact";
    clouds.push_back(bench_cloud(options.shape, size, has_surface));
    for (ObstacleRequest& floor : scene.obstacles) {
      floor.translation.z = box_around(clouds[0].surface.position).low.z;
    }
    clouds.resize(scene.bodies.size(), clouds[0]);
    if (terms == "contact") pile_up(clouds);
    const Model model = build_model(scene, clouds, device);
    const std::vector<Vec3d> exact = exact_forces(model, device);
    const double pairs = static_cast<double>(model.pairs());
    for (const std::string& precision : options.precisions) {
      for (std::size_t t = 0; t < all_threads.size(); ++t) {
        const int threads = all_threads[t];
        const auto backend = make_backend(model, precision_option(precision), device, threads);
        const std::string error = force_error(model, *backend, exact);
        // The speed does not depend on the step; a tenth of the acoustic step is always stable.
        const double dt =
            0.1 * model.neighbourhood.support[0] / pressure_wave_speed(model.parts[0].material);
        Solver solver(*backend, initial_state(model, scene, dt));
        solver.step(1, surfels);  // what touches is found, kernels are loaded
        const auto warm = Clock::now();
        int steps = 0;
        while (seconds_since(warm) < 0.2 * options.seconds || steps < 2) {
          solver.step(16, surfels);
          steps += 16;
          backend->wait();
        }
        steps = std::max(2, static_cast<int>(steps * options.seconds / seconds_since(warm)));
        std::vector<double> rate;
        for (int repeat = 0; repeat < options.repeats; ++repeat) {
          const auto start = Clock::now();
          solver.step(steps, surfels);
          backend->wait();
          rate.push_back(steps / seconds_since(start));
        }
        const Median median = median_of(rate);
        const double n = model.size();
        std::size_t memory = 0;
        for (const ArrayBytes& array : backend->memory()) memory += array.bytes;
        const double traffic = static_cast<double>(backend->step_traffic());
        const bool shared = threads > 1 && omp_get_num_procs() > 1;
        table.row(
            {options.shape, std::to_string(options.bodies), terms, precision, path_of(*backend),
             std::to_string(threads), std::to_string(model.size()),
             fmt::format("{:.1f}", pairs / n), std::to_string(model.surfels.position.size()),
             fmt::format("{:.5g}", median.value), fmt::format("{:.5g}", median.value * n),
             fmt::format("{:.3f}", median.spread), fmt::format("{:.5g}", median.value * 2 * pairs),
             fmt::format("{:.1f}", traffic / n), fmt::format("{:.4g}", median.value * traffic),
             fmt::format("{:.4g}", copy[t]), fmt::format("{:.1f}", static_cast<double>(memory) / n),
             error, fmt::format("{:.0f}", shared ? core_round_trip() : 0.0)});
      }
    }
  }
}

/// Settles a cantilever of known deflection in each precision on each cloud. Double always comes
/// first: it determines when the beam has settled, and how much of the other errors is rounding.
void bench_cantilever(const BenchOptions& options) {
  const ChosenDevice device = choose_device(options.device);
  std::vector<Precision> precisions{Precision::double_};
  for (const std::string& name : options.precisions) {
    if (name != "double") precisions.push_back(precision_option(name));
  }
  PrintedTable table(options.table,
                     {"across", "factor", "precision", "path", "threads", "phyxels", "neighbours",
                      "steps", "seconds", "phyxel_steps_per_s", "deflection_m", "over_timoshenko",
                      "discretisation_error", "rounding_error", "last_change"},
                     device_facts(device));
  for (const int across : options.across) {
    for (const double factor : options.factors) {
      const Scene scene = cantilever_scene(across, factor);
      const Model model = build_model(scene, device);
      const double n = model.size();
      Settled exact;
      for (const Precision precision : precisions) {
        const auto backend = make_backend(model, precision, device, omp_get_max_threads());
        const Settled beam = settle(scene, model, *backend, exact.frames);
        if (precision == Precision::double_) exact = beam;
        table.row({std::to_string(across), fmt::format("{:g}", factor), precision_name(precision),
                   path_of(*backend), std::to_string(backend->threads()),
                   std::to_string(model.size()),
                   fmt::format("{:.1f}", static_cast<double>(model.pairs()) / n),
                   std::to_string(beam.steps), fmt::format("{:.4g}", beam.seconds),
                   fmt::format("{:.5g}", static_cast<double>(beam.steps) * n / beam.seconds),
                   fmt::format("{:.9g}", beam.deflection),
                   fmt::format("{:.5f}", beam.deflection / timoshenko_deflection()),
                   fmt::format("{:.3e}", std::abs(beam.deflection / known_deflection() - 1)),
                   largest_error(beam.state.displacement, exact.state.displacement),
                   fmt::format("{:.1e}", beam.change)});
      }
    }
  }
}

void add_factors(CLI::App& command, BenchOptions& options) {
  command
      .add_option("--factor", options.factors,
                  "Support radii, in mean distances to the ten nearest phyxels")
      ->delimiter(',')
      ->check(CLI::Range(1.0, 4.0));
}

void add_device_options(CLI::App& command, BenchOptions& options) {
  command.add_option("--device", options.device, device_help)->capture_default_str();
  command.add_option("--precision", options.precisions, "Precisions: float, double, mixed")
      ->delimiter(',');
}

void add_bench_step(CLI::App& bench) {
  CLI::App* command = bench.add_subcommand(
      "step", "Measure the time steps per second of a jittered cube, per term and precision");
  auto options = std::make_shared<BenchOptions>();
  options->sizes = {1000, 10648, 103823, 1000000};
  for (int t = 1; t <= std::min(2, omp_get_num_procs()); ++t) options->threads.push_back(t);
  options->terms = all_terms;
  add_size_options(*command, options->sizes, options->repeats);
  add_thread_counts(*command, options->threads);
  add_table_options(*command, options->table);
  add_device_options(*command, *options);
  command
      ->add_option("--terms", options->terms,
                   fmt::format("Term sets: {}", fmt::join(all_terms, ", ")))
      ->delimiter(',');
  command->add_option("--shape", options->shape, "Body: cube, or one of the 2008 paper")
      ->check(CLI::IsMember({"cube", "horn_bug", "dino", "alien_head"}));
  add_factors(*command, *options);
  command->add_option("--bodies", options->bodies, "Number of bodies side by side")
      ->check(CLI::Range(1, 100'000));
  add_seconds_option(*command, options->seconds);
  command->footer(
      "Examples:\n"
      "  phyxel bench step\n"
      "  phyxel bench step --terms green,hourglass --phyxels 1000000 --csv step.csv\n"
      "  phyxel bench step --shape dino --bodies 100 --device cuda");
  command->callback([options] { bench_step(*options); });
}

void add_bench_cantilever(CLI::App& bench) {
  CLI::App* command = bench.add_subcommand(
      "cantilever",
      "Measure the time to solution of a beam with a known deflection, with discretisation and "
      "rounding errors");
  auto options = std::make_shared<BenchOptions>();
  options->across = {4, 6, 8, 12, 16, 24};
  options->factors = {1.4, 1.6, 1.8, 2};
  command
      ->add_option("--across", options->across,
                   "Numbers of phyxels across the height, which is a tenth of the length")
      ->delimiter(',')
      ->check(CLI::Range(2, 200))
      ->capture_default_str();
  add_factors(*command, *options);
  add_device_options(*command, *options);
  add_table_options(*command, options->table);
  command->footer(
      "Examples:\n"
      "  phyxel bench cantilever\n"
      "  phyxel bench cantilever --across 8,16 --factor 1.8 --device cuda --csv cantilever.csv");
  command->callback([options] { bench_cantilever(*options); });
}

}  // namespace

void add_bench(CLI::App& program) {
  CLI::App* bench = program.add_subcommand("bench", "Measure speed, with errors and bandwidth");
  bench->require_subcommand(1);
  add_bench_step(*bench);
  add_bench_cantilever(*bench);
  add_bench_error(*bench);
  add_bench_scaling(*bench);
  add_bench_sample(*bench);
  bench->footer(
      "Examples:\n"
      "  phyxel bench step\n"
      "  phyxel bench cantilever --across 4,8\n"
      "  phyxel bench error gravity\n"
      "  mpirun -n 2 phyxel bench scaling\n"
      "  phyxel bench sample bunny.obj\n"
      "More: phyxel bench step --help");
}

}  // namespace phyxel::app
