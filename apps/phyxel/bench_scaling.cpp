#include "bench_scaling.hpp"

#include <fmt/format.h>
#include <omp.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <span>

#include "csv.hpp"
#include "device_option.hpp"
#include "ensemble.hpp"
#include "partition/partition.hpp"
#include "phyxel/phyxel.hpp"
#include "setup.hpp"
#include "stopwatch.hpp"

namespace phyxel::app {
namespace {

struct Options {
  std::vector<Index> sizes{8000, 50653, 195112};
  std::vector<std::string> partitioners = partitioner_names();
  std::vector<std::string> precisions{"float"};
  std::vector<int> rings{1, 2};
  double seconds = 1;
  int repeats = 5;
  std::string csv;
  bool force = false;
  std::string device = "cpu", transport = "auto";
  bool weak = false;  ///< Sizes are of one rank.
};

/// A jittered cube of about so many phyxels, under gravity.
Scene cube_scene(Index phyxels) {
  Scene scene;
  scene.time.end = 1;
  scene.gravity = {0, 0, -9.81};
  BodyRequest body;
  body.name = "cube";
  body.where = "phyxel bench scaling";
  body.source.shape.name = "beam";
  body.source.shape.size = {1, 1, 1};
  body.source.shape.spacing = 1 / std::round(std::cbrt(phyxels));
  body.source.shape.jitter = 0.1;
  body.source.shape.surface = false;
  body.material = {.young = 1e5, .poisson = 0.3, .density = 1000, .strain = Strain::green};
  scene.bodies.push_back(body);
  return scene;
}

/// Distinct ones. Collective.
std::size_t gpus_of_ranks(const ChosenDevice& device) {
  const std::vector<int> indices = ranks().gathered(std::span<const int>(&device.gpu->index, 1));
  std::set<std::pair<int, int>> gpus;
  for (int r = 0; r < ranks().size(); ++r) gpus.emplace(ranks().host_of(r), indices[r]);
  return gpus.size();
}

struct Measured {
  Median steps_per_s;
  double bytes_per_step = 0, exchanging = 0;  // of the rank that has most; share of the time
  std::string transport;
};

Measured measure(const Ensemble& ensemble, const Scene& scene, Precision precision,
                 const ChosenDevice& device, const Options& options) {
  const Model& model = ensemble.here();
  const auto backend = make_backend(model, precision, device, 1, options.transport);
  // A tenth of the sound step: any speed, no risk.
  const BodyRequest& body = scene.bodies[0];
  const double dt = 0.1 * body.source.shape.spacing / pressure_wave_speed(body.material);
  Solver solver(*backend, initial_state(model, scene, dt));
  // Ranks agree on numbers of steps, so that all take as many.
  const auto timed = [&](std::int64_t steps) {
    ranks().barrier();
    const auto start = Clock::now();
    for (std::int64_t s = 0; s < steps; ++s) solver.step();
    backend->wait();
    return ranks().largest(seconds_since(start));
  };
  timed(device.gpu ? 64 : 2);  // two graphs of steps, and the step before them
  const double one = device.gpu ? timed(64) / 64 : timed(5) / 5;
  const auto steps = std::max<std::int64_t>(2, std::llround(options.seconds / one));
  const Traffic before = most_traffic(*backend);
  std::vector<double> rates;
  double total = 0;
  for (int repeat = 0; repeat < options.repeats; ++repeat) {
    const double seconds = timed(steps);
    total += seconds;
    rates.push_back(static_cast<double>(steps) / seconds);
  }
  const Traffic after = most_traffic(*backend);
  return {median_of(rates),
          static_cast<double>(after.bytes_sent - before.bytes_sent) /
              static_cast<double>(steps * options.repeats),
          (after.seconds - before.seconds) / total,
          backend->exchanges() ? backend->exchanges()->transport : "none"};
}

void bench_scaling(const Options& options) {
  const bool leads = ranks().rank() == 0, alone = ranks().size() == 1;
  const ChosenDevice device = choose_device_of_rank(options.device);
  // Of all ranks, which may be bound to some.
  const auto cores = static_cast<int>(std::min<std::int64_t>(
      ranks().sum(std::int64_t{omp_get_num_procs()}), sysconf(_SC_NPROCESSORS_ONLN)));
  Facts facts = machine_facts(cores);
  for (const auto& fact : device_facts(device)) facts.push_back(fact);
  if (device.gpu) facts.emplace_back("gpus", std::to_string(gpus_of_ranks(device)));
  CsvTable table{facts,
                 {"ranks", "threads_each", "partitioner", "rings", "precision", "phyxels",
                  "neighbours", "fewest", "most", "most_ghosts", "steps_per_s",
                  "phyxel_steps_per_s", "spread", "bytes_per_step", "exchanging", "transport"},
                 {}};
  ranks().together([&] {
    if (!leads) return;
    if (!options.csv.empty() && std::filesystem::exists(options.csv) && !options.force) {
      throw InputError(fmt::format("{}: exists; allowed: another --csv, or --force", options.csv));
    }
    fmt::print("{}", csv_text(table));
  });
  for (const Index size : options.sizes) {
    const Scene scene = cube_scene(options.weak ? size * ranks().size() : size);
    for (const std::string& partitioner : options.partitioners) {
      for (const int rings : options.rings) {
        if (device.gpu && rings != 1) continue;
        const Ensemble ensemble(scene, device, {partitioner, rings});
        const Ensemble::Shares& shares = ensemble.shares();
        for (const std::string& precision : options.precisions) {
          const Measured m = measure(ensemble, scene, precision_option(precision), device, options);
          ranks().together([&] {
            if (!leads) return;
            const Model& model = ensemble.here();
            const double n = model.whole_size();
            table.rows.push_back(
                {std::to_string(ranks().size()), "1", alone ? "none" : partitioner,
                 alone ? "0" : std::to_string(rings), precision, std::to_string(model.whole_size()),
                 fmt::format("{:.1f}", static_cast<double>(model.pairs()) / n),
                 std::to_string(shares.fewest), std::to_string(shares.most),
                 std::to_string(shares.most_ghosts), fmt::format("{:.5g}", m.steps_per_s.value),
                 fmt::format("{:.5g}", m.steps_per_s.value * n),
                 fmt::format("{:.3f}", m.steps_per_s.spread),
                 fmt::format("{:.0f}", m.bytes_per_step), fmt::format("{:.4f}", m.exchanging),
                 m.transport});
            fmt::print("{}\n", fmt::join(table.rows.back(), ","));
            std::fflush(stdout);
            if (!options.csv.empty()) write_csv(options.csv, table);
          });
        }
        if (alone) break;
      }
      if (alone) break;
    }
  }
}

}  // namespace

void add_bench_scaling(CLI::App& bench) {
  CLI::App* command = bench.add_subcommand(
      "scaling", "Steps per second of a cube on the ranks that mpirun has started, or on one");
  auto options = std::make_shared<Options>();
  command->add_option("--phyxels", options->sizes, "Sizes, comma separated (rounded to cubes)")
      ->delimiter(',')
      ->check(CLI::Range(8, 2'000'000'000));
  command->add_flag("--weak", options->weak, "Sizes are those of a rank, not of the body");
  command->add_option("--partitioner", options->partitioners, "metis, curve, bisection, auto")
      ->delimiter(',')
      ->check(CLI::IsMember(partitioner_choices()));
  command->add_option("--device", options->device, device_help);
  command->add_option("--transport", options->transport, "auto, direct, host: between GPUs")
      ->check(CLI::IsMember(transport_names()));
  command->add_option("--ghost-rings", options->rings, "1, 2; GPUs: 1")
      ->delimiter(',')
      ->check(CLI::Range(1, 2));
  command->add_option("--precision", options->precisions, "float, double, mixed")
      ->delimiter(',')
      ->check(CLI::IsMember({"float", "double", "mixed"}));
  command->add_option("--seconds", options->seconds, "Length of one repeat [s]")
      ->check(CLI::Range(0.01, 60.0));
  command->add_option("--repeat", options->repeats, "Repeats; the median is reported")
      ->check(CLI::Range(1, 1000));
  command->add_option("--csv", options->csv, "Also write the table to this file");
  command->add_flag("--force", options->force, "Replace the CSV file");
  command->callback([options] { bench_scaling(*options); });
}

}  // namespace phyxel::app
