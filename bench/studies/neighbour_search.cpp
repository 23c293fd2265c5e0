/// phyxel_studies neighbour-search: the time of spacings, lists and their transpose on the CPU.
#include <fmt/format.h>
#include <omp.h>

#include <algorithm>

#include "bench_body.hpp"
#include "phyxel/phyxel.hpp"
#include "printed_table.hpp"
#include "stopwatch.hpp"
#include "studies.hpp"

namespace phyxel::studies {
namespace {

struct SearchOptions {
  std::vector<Index> sizes{10648, 103823, 1000000, 9938375};
  std::vector<int> threads;
  int repeats = 2;
  app::TableOptions table;
};

void measure_search(const SearchOptions& options) {
  app::PrintedTable table(options.table,
                          {"threads", "phyxels", "neighbours", "spacing_us_per_phyxel",
                           "search_us_per_phyxel", "transpose_us_per_phyxel"});
  for (const int threads : options.threads) {
    omp_set_num_threads(threads);
    for (const Index size : options.sizes) {
      const Cloud cloud = app::bench_cube(size);
      const double n = static_cast<double>(cloud.position.size());
      std::vector<double> spacing_time, search_time, transpose_time;
      double pairs = 0;
      for (int repeat = 0; repeat < (size > 3'000'000 ? 1 : options.repeats); ++repeat) {
        auto start = app::Clock::now();
        const std::vector<double> spacing = mean_spacing(cloud.position, 10);
        spacing_time.push_back(app::seconds_since(start));
        start = app::Clock::now();
        const Neighbourhood hood = find_neighbours(cloud.position, spacing, {});
        search_time.push_back(app::seconds_since(start));
        start = app::Clock::now();
        const Csr inverse = transpose(hood.neighbours, hood.neighbours.rows());
        transpose_time.push_back(app::seconds_since(start));
        pairs = static_cast<double>(inverse.entries());
      }
      const auto microseconds = [&](const std::vector<double>& times) {
        return fmt::format("{:.3f}", app::median_of(times).value / n * 1e6);
      };
      table.row({std::to_string(threads), std::to_string(cloud.position.size()),
                 fmt::format("{:.1f}", pairs / n), microseconds(spacing_time),
                 microseconds(search_time), microseconds(transpose_time)});
    }
  }
}

}  // namespace

void add_neighbour_search(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "neighbour-search", "Measure the time of a neighbour search by the number of phyxels");
  auto options = std::make_shared<SearchOptions>();
  for (int t = 1; t <= std::min(2, omp_get_num_procs()); ++t) options->threads.push_back(t);
  app::add_size_options(*command, options->sizes, options->repeats);
  app::add_thread_counts(*command, options->threads);
  app::add_table_options(*command, options->table);
  command->footer(
      "Examples:\n"
      "  phyxel_studies neighbour-search\n"
      "  phyxel_studies neighbour-search --threads 1,2 --csv neighbours.csv");
  command->callback([options] { measure_search(*options); });
}

}  // namespace phyxel::studies
