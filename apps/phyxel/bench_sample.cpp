#include "bench_sample.hpp"

#include <fmt/format.h>
#include <omp.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <map>

#include "bench_body.hpp"
#include "command.hpp"
#include "device_option.hpp"
#include "kind.hpp"
#include "model/host_memory.hpp"
#include "model/neighbour_search.hpp"
#include "phyxel/mesh.hpp"
#include "phyxel/phyxel.hpp"
#include "printed_table.hpp"
#include "stopwatch.hpp"

namespace phyxel::app {
namespace {

struct BenchSampleOptions {
  std::vector<std::string> meshes;
  std::vector<Index> sizes = {1000, 10000, 100000};
  std::vector<int> threads = {omp_get_num_procs()};
  int repeats = 1, relaxations = SampleRequest{}.relaxations;
  std::string device = "auto";
  TableOptions table;
};

/// Stages of the sampler, and the columns of their times.
const std::vector<std::pair<std::string, std::string>> stages = {
    {"inspecting the surface", "inspect_s"}, {"filling the surface", "fill_s"},
    {"phyxels on the surface", "surface_s"}, {"placing phyxels", "place_s"},
    {"evening out distances", "relax_s"},    {"volumes of phyxels", "volumes_s"}};

/// Time spent in each stage [s].
class StageTimes {
 public:
  StageTimes() : observe_([this](std::string_view stage, double share) { hear(stage, share); }) {}
  double of(const std::string& stage) const {
    const auto found = seconds_.find(stage);
    return found == seconds_.end() ? 0 : found->second;
  }

 private:
  void hear(std::string_view stage, double share) {
    if (share == 0) start_ = Clock::now();
    if (share == 1) seconds_[std::string(stage)] += seconds_since(start_);
  }
  std::map<std::string, double> seconds_;
  Clock::time_point start_;
  ObserveStages observe_;
};

/// Standard deviation over mean.
double spread_of(const std::vector<double>& values) {
  double sum = 0, squares = 0;
  for (const double v : values) sum += v;
  const double mean = sum / static_cast<double>(values.size());
  for (const double v : values) squares += (v - mean) * (v - mean);
  return std::sqrt(squares / static_cast<double>(values.size())) / mean;
}

/// Fills a surface `repeats` times. @returns the cells of its row that follow `threads`
std::vector<std::string> measured(const Surface& surface, Index size, const ChosenDevice& device,
                                  const BenchSampleOptions& options) {
  std::vector<double> seconds;
  std::vector<std::string> stage_cells;  // of the last repeat, as all that follows
  SampleReport report;
  Cloud cloud;
  double bytes = 0;
  for (int repeat = 0; repeat < options.repeats; ++repeat) {
    cloud = {};
    stage_cells.clear();
    const MemoryGrowth memory;
    const StageTimes times;
    const auto start = Clock::now();
    cloud = sample_surface(surface, {.phyxels = size, .relaxations = options.relaxations}, device,
                           &report);
    seconds.push_back(seconds_since(start));
    bytes = memory.largest();
    for (const auto& [stage, column] : stages) {
      stage_cells.push_back(fmt::format("{:.4g}", times.of(stage)));
    }
  }
  const Median median = median_of(seconds);
  const double gap_spread = size > 1 ? spread_of(mean_spacing(cloud.position, 1)) : 0;
  std::vector<std::string> cells = {
      std::to_string(size), std::to_string(report.on_surface), fmt::format("{:.4g}", median.value),
      fmt::format("{:.3f}", median.spread), fmt::format("{:.4g}", size / median.value)};
  cells.insert(cells.end(), stage_cells.begin(), stage_cells.end());
  cells.push_back(fmt::format("{:.0f}", bytes / size));
  cells.push_back(fmt::format("{:.3f}", report.smallest_gap / report.spacing));
  cells.push_back(fmt::format("{:.3f}", gap_spread));
  cells.push_back(fmt::format("{:.3f}", spread_of(cloud.volume)));
  return cells;
}

void bench_sample(const BenchSampleOptions& options) {
  for (const std::string& mesh : options.meshes) expect_kind(mesh, {Kind::mesh});
  std::vector<std::string> columns = {"mesh",       "triangles", "threads", "phyxels",
                                      "on_surface", "seconds",   "spread",  "phyxels_per_s"};
  for (const auto& [stage, column] : stages) columns.push_back(column);
  for (const char* column : {"bytes_per_phyxel", "smallest_gap", "gap_spread", "volume_spread"}) {
    columns.emplace_back(column);
  }
  const ChosenDevice device = choose_device(options.device);
  PrintedTable table(options.table, columns, device_facts(device));
  for (const std::string& mesh : options.meshes) {
    const Surface surface = read_mesh(mesh);
    for (const int threads : options.threads) {
      omp_set_num_threads(threads);
      for (const Index size : options.sizes) {
        std::vector<std::string> row = {std::filesystem::path(mesh).filename().string(),
                                        std::to_string(surface.triangle.size()),
                                        std::to_string(threads)};
        try {
          for (std::string& cell : measured(surface, size, device, options)) {
            row.push_back(std::move(cell));
          }
        } catch (const InputError& error) {
          throw InputError(fmt::format("{}: {}", mesh, error.what()));
        }
        table.row(row);
      }
    }
  }
}

}  // namespace

void add_bench_sample(CLI::App& bench) {
  CLI::App* command = bench.add_subcommand(
      "sample",
      "Measure how fast meshes are filled with phyxels, stage by stage, and how even the clouds "
      "are");
  auto options = std::make_shared<BenchSampleOptions>();
  command->add_option("mesh", options->meshes, "Surfaces in metres: OBJ, PLY or STL")->required();
  command->add_option("--phyxels", options->sizes, "Numbers of phyxels, comma separated")
      ->delimiter(',')
      ->check(CLI::Range(1, 2'000'000'000));
  add_repeats(*command, options->repeats);
  command
      ->add_option("--relaxations", options->relaxations,
                   "Sweeps that spread the phyxels evenly; 0 for none")
      ->check(CLI::Range(0, 10000))
      ->capture_default_str();
  add_thread_counts(*command, options->threads);
  command->add_option("--device", options->device, device_help)->capture_default_str();
  add_table_options(*command, options->table);
  command->footer(
      "A GPU helps with bodies of 20,000 phyxels and more, whose clouds are the same.\n"
      "Columns: *_s are the seconds of each stage; bytes_per_phyxel is the most memory in use at\n"
      "a time, with the cloud; smallest_gap is the smallest distance to the nearest phyxel over\n"
      "the mean distance; gap_spread and volume_spread are standard deviations over means.\n"
      "Examples:\n"
      "  phyxel bench sample bunny.obj\n"
      "  phyxel bench sample bunny.obj --phyxels 10000,100000 --threads 1,2 --csv sample.csv");
  command->callback([options] { bench_sample(*options); });
}

}  // namespace phyxel::app
