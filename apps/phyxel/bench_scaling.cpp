#include "bench_scaling.hpp"

#include <fmt/format.h>
#include <omp.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <set>
#include <span>

#include "bench_body.hpp"
#include "device_option.hpp"
#include "model/host_memory.hpp"
#include "partition/partition.hpp"
#include "phyxel/phyxel.hpp"
#include "printed_table.hpp"
#include "program_ranks.hpp"
#include "setup.hpp"
#include "stopwatch.hpp"

namespace phyxel::app {
namespace {

struct Options {
  std::vector<Index> sizes{8000, 50653, 195112};
  std::vector<std::string> partitioners = partitioner_names();
  std::vector<std::string> precisions{"float"};
  double seconds = 1;
  int repeats = 5;
  TableOptions table;
  std::string device = "cpu", transport = "auto";
  bool weak = false;         ///< True if sizes are those of one rank.
  bool without_one = false;  ///< True if the first rank alone is not measured.
};

/// A jittered cube of about `phyxels` phyxels under gravity.
Scene cube_scene(Index phyxels) {
  Scene scene = bench_scene("green");
  scene.time.end = 1;
  scene.bodies[0].where = "phyxel bench scaling";
  scene.bodies[0].source.shape = bench_shape(phyxels);
  return scene;
}

/// Number of different GPUs of all ranks. Collective.
std::size_t gpus_of_ranks(const ChosenDevice& device) {
  const std::vector<int> indices = ranks().gathered(std::span<const int>(&device.gpu->index, 1));
  std::set<std::pair<int, int>> gpus;
  for (int r = 0; r < ranks().size(); ++r) gpus.emplace(ranks().host_of(r), indices[r]);
  return gpus.size();
}

/// A body whose steps are timed, in turn with those of another body.
class Stepped {
 public:
  Stepped(const Model& model, const Scene& scene, Precision precision, const ChosenDevice& device,
          const Options& options)
      : backend_(make_backend(model, precision, device, 1, options.transport)),
        solver_(*backend_, initial_state(model, scene, step_of(scene))) {}

  /// Takes steps. @returns their time [s]
  double take(std::int64_t steps) {
    const auto start = Clock::now();
    for (std::int64_t s = 0; s < steps; ++s) solver_.step();
    backend_->wait();
    return seconds_since(start);
  }
  const Backend& backend() const { return *backend_; }

 private:
  /// A tenth of the acoustic step [s]: always stable, and the speed does not depend on it.
  static double step_of(const Scene& scene) {
    const BodyRequest& body = scene.bodies[0];
    return 0.1 * body.source.shape.spacing / pressure_wave_speed(body.material);
  }

  std::unique_ptr<Backend> backend_;
  Solver solver_;
};

struct Measured {
  Median steps_per_s;
  std::optional<Median> alone_per_s;          // steps per second of the first rank alone
  double bytes_per_step = 0, exchanging = 0;  // of the rank with most; share of the time
  std::string transport;
  double upload = 0;  // time to construct and upload the backend [s]
};

/// Repeated timings of a number of steps that fill the length of a repeat.
class Repeats {
 public:
  /// @param take takes a number of steps and returns their time [s], equal on all ranks
  Repeats(std::function<double(std::int64_t)> take, const ChosenDevice& device,
          const Options& options)
      : take_(std::move(take)) {
    take_(device.gpu ? 64 : 2);  // warm-up; on a GPU two graphs of steps and the step before them
    const double one = device.gpu ? take_(64) / 64 : take_(5) / 5;
    steps_ = std::max<std::int64_t>(2, std::llround(options.seconds / one));
  }
  void repeat() {
    const double seconds = take_(steps_);
    seconds_ += seconds;
    rates_.push_back(static_cast<double>(steps_) / seconds);
  }
  Median per_second() const { return median_of(rates_); }
  double seconds() const { return seconds_; }
  double steps() const { return static_cast<double>(steps_) * static_cast<double>(rates_.size()); }

 private:
  std::function<double(std::int64_t)> take_;
  std::int64_t steps_ = 0;
  double seconds_ = 0;
  std::vector<double> rates_;
};

/// Measures all ranks and, in turn with them, the first rank alone, since the machine's speed
/// drifts.
/// @param one model of the first rank alone; null on other ranks, and if it is not measured
Measured measure(const SharedModel& ensemble, const Scene& scene, const Model* one,
                 const Scene& scene_of_one, Precision precision, const ChosenDevice& device,
                 const Options& options) {
  ranks().barrier();
  const auto start = Clock::now();
  Stepped shared(ensemble.here(), scene, precision, device, options);
  const double upload = ranks().largest(seconds_since(start));
  std::optional<Stepped> alone;
  ranks().collectively([&] {
    if (one) alone.emplace(*one, scene_of_one, precision, device, options);
  });
  Repeats together(
      [&](std::int64_t steps) {
        ranks().barrier();
        return ranks().largest(shared.take(steps));
      },
      device, options);
  std::optional<Repeats> by_one;
  if (one) by_one.emplace([&](std::int64_t steps) { return alone->take(steps); }, device, options);
  const Traffic before = most_traffic(shared.backend());
  for (int repeat = 0; repeat < options.repeats; ++repeat) {
    together.repeat();
    if (by_one) by_one->repeat();
  }
  const Traffic after = most_traffic(shared.backend());
  Measured m{together.per_second(),
             std::nullopt,
             static_cast<double>(after.bytes_sent - before.bytes_sent) / together.steps(),
             (after.seconds - before.seconds) / together.seconds(),
             shared.backend().exchanges() ? shared.backend().exchanges()->transport : "none",
             upload};
  if (by_one) m.alone_per_s = by_one->per_second();
  ranks().barrier();  // before memory into which other ranks store is freed
  return m;
}

const std::vector<std::string> columns{"ranks",
                                       "threads_each",
                                       "partitioner",
                                       "cut_by",
                                       "rings",
                                       "precision",
                                       "phyxels",
                                       "neighbours",
                                       "fewest",
                                       "most",
                                       "most_ghosts",
                                       "set_up_s",
                                       "steps_per_s",
                                       "phyxel_steps_per_s",
                                       "spread",
                                       "phyxels_alone",
                                       "phyxel_steps_per_s_alone",
                                       "spread_alone",
                                       "bytes_per_step",
                                       "exchanging",
                                       "transport",
                                       "backend_s",
                                       "host_gb"};

std::vector<std::string> row_of(const SharedModel& ensemble, const std::string& partitioner,
                                const std::string& precision, double set_up, Index phyxels_alone,
                                double host_gb, const Measured& m) {
  const bool alone = ranks().size() == 1;
  const Model& model = ensemble.here();
  const double n = model.global_count();
  const SharedModel::Shares& shares = ensemble.shares();
  std::vector<std::string> row{std::to_string(ranks().size()),
                               "1",
                               alone ? "none" : partitioner,
                               alone ? "none" : ensemble.partitioner(),
                               alone ? "0" : "1",
                               precision,
                               std::to_string(model.global_count()),
                               fmt::format("{:.1f}", static_cast<double>(model.pairs()) / n),
                               std::to_string(shares.fewest),
                               std::to_string(shares.most),
                               std::to_string(shares.most_ghosts),
                               fmt::format("{:.3g}", set_up),
                               fmt::format("{:.5g}", m.steps_per_s.value),
                               fmt::format("{:.5g}", m.steps_per_s.value * n),
                               fmt::format("{:.3f}", m.steps_per_s.spread)};
  if (m.alone_per_s) {
    row.insert(row.end(), {std::to_string(phyxels_alone),
                           fmt::format("{:.5g}", m.alone_per_s->value * phyxels_alone),
                           fmt::format("{:.3f}", m.alone_per_s->spread)});
  } else {
    row.insert(row.end(), {"", "", ""});
  }
  row.insert(row.end(),
             {fmt::format("{:.0f}", m.bytes_per_step), fmt::format("{:.4f}", m.exchanging),
              m.transport, fmt::format("{:.3g}", m.upload), fmt::format("{:.4g}", host_gb)});
  return row;
}

void bench_scaling(const Options& options) {
  const bool leads = ranks().rank() == 0, alone = ranks().size() == 1;
  const ChosenDevice device = choose_device(options.device);
  // The cores of all ranks, each of which may be bound to some.
  const auto cores = static_cast<int>(std::min<std::int64_t>(
      ranks().sum(std::int64_t{omp_get_num_procs()}), sysconf(_SC_NPROCESSORS_ONLN)));
  Facts facts = device_facts(device);
  if (device.gpu) facts.emplace_back("gpus", std::to_string(gpus_of_ranks(device)));
  std::optional<PrintedTable> table;  // on the first rank
  ranks().collectively([&] {
    if (leads) table.emplace(options.table, columns, facts, cores);
  });
  for (const Index size : options.sizes) {
    const std::int64_t all = options.weak ? std::int64_t{size} * ranks().size() : size;
    ranks().collectively([&] {
      if (all <= std::numeric_limits<Index>::max()) return;
      throw InputError(fmt::format("--phyxels {} on {} ranks are {}: allowed are {}", size,
                                   ranks().size(), all, std::numeric_limits<Index>::max()));
    });
    const Scene scene = cube_scene(static_cast<Index>(all)), scene_of_one = cube_scene(size);
    std::optional<Model> one;
    ranks().collectively([&] {
      if (leads && !alone && !options.without_one) one = build_model(scene_of_one, device);
    });
    for (const std::string& partitioner : options.partitioners) {
      ranks().barrier();
      const auto start = Clock::now();
      const SharedModel ensemble(all_ranks(), scene, device, {partitioner});
      const double set_up = ranks().largest(seconds_since(start));
      for (const std::string& precision : options.precisions) {
        const Measured m = measure(ensemble, scene, one ? &*one : nullptr, scene_of_one,
                                   precision_option(precision), device, options);
        // The peak of the host so far, which is this body's if larger bodies come last.
        const double host_gb = 1e-9 * ranks().size() * ranks().largest(peak_memory());
        ranks().collectively([&] {
          if (!table) return;
          table->row(
              row_of(ensemble, partitioner, precision, set_up, one ? one->size() : 0, host_gb, m));
        });
      }
      if (alone) break;
    }
  }
}

}  // namespace

void add_bench_scaling(CLI::App& bench) {
  CLI::App* command = bench.add_subcommand(
      "scaling", "Measure the steps per second of a cube on the ranks of mpirun, or on one rank");
  auto options = std::make_shared<Options>();
  add_size_options(*command, options->sizes, options->repeats);
  command->add_flag("--weak", options->weak,
                    "Numbers of phyxels are per rank, not of the whole "
                    "body");
  command->add_flag("--without-one", options->without_one,
                    "Do not measure the first rank alone, the reference of speed-ups");
  command
      ->add_option("--partitioner", options->partitioners,
                   "Partitioners: metis, curve, "
                   "bisection, auto")
      ->delimiter(',')
      ->check(CLI::IsMember(partitioner_choices()));
  command->add_option("--device", options->device, device_help);
  command
      ->add_option("--transport", options->transport,
                   "Transport between GPUs: auto, direct, nccl, "
                   "mpi, host")
      ->check(CLI::IsMember(transport_names()));
  command->add_option("--precision", options->precisions, "Precisions: float, double, mixed")
      ->delimiter(',')
      ->check(CLI::IsMember({"float", "double", "mixed"}));
  add_seconds_option(*command, options->seconds);
  add_table_options(*command, options->table);
  command->footer(
      "Examples:\n"
      "  mpirun -n 2 phyxel bench scaling\n"
      "  mpirun -n 4 phyxel bench scaling --phyxels 16000000 --weak --csv ranks.csv");
  command->callback([options] { bench_scaling(*options); });
}

}  // namespace phyxel::app
