#include "scaling_page.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

#include "csv.hpp"
#include "files/atomic_file.hpp"
#include "markdown.hpp"

namespace phyxel::app {
namespace {

namespace fs = std::filesystem;

/// What two ranks on two cores are to reach from 200,000 phyxels on.
constexpr double asked_of_two = 1.8;

/// The tables `<kind>_ranks_<n>*.csv` there are, by their number of ranks: rows of several calls
/// are those of one.
std::map<int, CsvTable> tables_in(const fs::path& results, const std::string& kind) {
  std::map<int, CsvTable> tables;
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(results)) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with(kind + "_ranks_") && name.ends_with(".csv")) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  for (const fs::path& file : files) {
    CsvTable table = read_csv(file);
    if (table.rows.empty()) continue;
    CsvTable& of_ranks = tables[std::stoi(table.text(0, "ranks"))];
    if (of_ranks.rows.empty()) {
      of_ranks = std::move(table);
    } else {
      of_ranks.rows.insert(of_ranks.rows.end(), table.rows.begin(), table.rows.end());
    }
  }
  return tables;
}

/// The row of one rank that a row of many is measured against: the same body, or one `ranks` times
/// smaller, to the percent that cubes leave.
std::optional<std::size_t> alone(const CsvTable& one, const CsvTable& many, std::size_t row,
                                 int ranks) {
  const double phyxels = many.number(row, "phyxels");
  for (std::size_t r = 0; r < one.rows.size(); ++r) {
    if (one.text(r, "precision") == many.text(row, "precision") &&
        std::abs(ranks * one.number(r, "phyxels") / phyxels - 1) < 0.015) {
      return r;
    }
  }
  return std::nullopt;
}

const std::vector<std::string> head{
    "phyxels",  "precision",  "cut by", "ghost rings", "transport",      "10⁶ phyxel-steps/s",
    "speed-up", "efficiency", "spread", "most ghosts", "kB sent a step", "exchanging"};

std::vector<std::string> cells(const CsvTable& many, std::size_t r, double speed_up, int ranks) {
  return {many.text(r, "phyxels"),
          many.text(r, "precision"),
          many.text(r, "partitioner"),
          many.text(r, "rings"),
          many.text(r, "transport"),
          fmt::format("{:.2f}", many.number(r, "phyxel_steps_per_s") * 1e-6),
          fmt::format("{:.2f}", speed_up),
          fmt::format("{:.0f}%", 100 * speed_up / ranks),
          fmt::format("{:.0f}%", 100 * many.number(r, "spread")),
          many.text(r, "most_ghosts"),
          fmt::format("{:.1f}", many.number(r, "bytes_per_step") * 1e-3),
          fmt::format("{:.1f}%", 100 * many.number(r, "exchanging"))};
}

std::string section(const CsvTable& one, const CsvTable& many, int ranks, bool gpus) {
  std::string text = fmt::format(
      "### {} {}\n\nMeasured by {} on {}{}; {}; {}. One rank: {}.\n\n", ranks,
      gpus ? "ranks, a GPU each" : "CPU ranks", many.fact("program"), many.fact("hardware"),
      gpus ? fmt::format(", {} × {}", many.fact("gpus"), many.fact("gpu")) : "",
      many.fact("compiler"), many.fact("date"), one.fact("date"));
  std::vector<std::vector<std::string>> strong, weak;
  double best = 0;
  for (std::size_t r = 0; r < many.rows.size(); ++r) {
    const double speed = many.number(r, "phyxel_steps_per_s");
    if (const auto same = alone(one, many, r, 1)) {
      const double gain = speed / one.number(*same, "phyxel_steps_per_s");
      strong.push_back(cells(many, r, gain, ranks));
      if (many.number(r, "phyxels") > 150'000 && many.text(r, "rings") == "1") {
        best = std::max(best, gain);
      }
    }
    if (const auto part = alone(one, many, r, ranks)) {
      weak.push_back(cells(many, r, speed / one.number(*part, "phyxel_steps_per_s"), ranks));
    }
  }
  if (!gpus && ranks == 2 && best > 0) {
    text += fmt::format(
        "Two ranks on two cores from 200,000 phyxels on, one ring of ghosts: {:.2f} by the best "
        "cut ({:g} asked).\n\n",
        best, asked_of_two);
  }
  if (!strong.empty()) text += "The same body on more ranks:\n\n" + table_text(head, strong);
  if (!weak.empty()) text += "A body that grows with the ranks:\n\n" + table_text(head, weak);
  return text;
}

std::string sections(const fs::path& results, const std::string& kind) {
  const std::map<int, CsvTable> tables = tables_in(results, kind);
  if (!tables.contains(1)) return "";
  std::string text;
  for (const auto& [ranks, table] : tables) {
    if (ranks > 1) text += section(tables.at(1), table, ranks, kind == "gpu");
  }
  return text;
}

}  // namespace

void write_scaling_page(const fs::path& results, const fs::path& page) {
  const std::string cpus = sections(results, "cpu"), gpus = sections(results, "gpu");
  if (cpus.empty() && gpus.empty()) return;
  std::string text =
      "# Scaling\n\nWritten by `phyxel bench page` from the tables of `phyxel bench scaling` in "
      "`docs/results/`: one jittered cube under gravity with Green's strain, stepped by ranks that "
      "`mpirun -n N` starts. Every rank count, partitioner and number of ghost rings gives the "
      "same positions to the last bit (`tests/mpi/share_test.cpp`, `tests/apps/mpirun_test.cpp`), "
      "so the error of a scaled run is that of one rank. One ring of ghosts: displacements and "
      "stresses are exchanged; two: displacements of both, and the inner ring's stresses are found "
      "twice. *Speed-up*: over one rank, in phyxel-steps per second, with the same binary on the "
      "same kind of machine; *efficiency*: that by rank. *Exchanging* is the largest share of a "
      "rank's time for packing, waiting and unpacking, in which uneven work shows, too.\n\n";
  text += "## GPUs\n\n";
  text += gpus.empty() ? "Not measured yet.\n\n"
                       : "Asked of 8 GPUs in float: 80% of 17 million phyxels, 50% of 2 million, "
                         "95% of 16 million a GPU.\n\n" +
                             gpus;
  if (!cpus.empty()) text += "## CPUs\n\nA thread a rank.\n\n" + cpus;
  write_whole_file(page, text, Durable::no);
}

}  // namespace phyxel::app
