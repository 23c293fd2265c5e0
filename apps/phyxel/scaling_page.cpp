#include "scaling_page.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "csv.hpp"
#include "files/atomic_file.hpp"
#include "markdown.hpp"

namespace phyxel::app {
namespace {

namespace fs = std::filesystem;

/// What two ranks on two cores are to reach from 200,000 phyxels on.
constexpr double asked_of_two = 1.8;

/// The tables there are, of one rank, of two, and so on.
std::vector<CsvTable> tables_in(const fs::path& results) {
  std::vector<std::pair<int, CsvTable>> found;
  for (const auto& entry : fs::directory_iterator(results)) {
    const std::string name = entry.path().filename().string();
    if (!name.starts_with("cpu_ranks_") || !name.ends_with(".csv")) continue;
    CsvTable table = read_csv(entry.path());
    if (!table.rows.empty()) {
      const int ranks = std::stoi(table.text(0, "ranks"));
      found.emplace_back(ranks, std::move(table));
    }
  }
  std::sort(found.begin(), found.end(),
            [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<CsvTable> tables;
  for (auto& [ranks, table] : found) tables.push_back(std::move(table));
  return tables;
}

std::string section(const CsvTable& one, const CsvTable& many) {
  const std::string ranks = many.text(0, "ranks");
  std::string text = fmt::format(
      "## {} ranks\n\nMeasured by {} on {}; {}; {}. *Speed-up*: over one rank of one thread, with "
      "the same binary on the same machine ({}).\n\n",
      ranks, many.fact("program"), many.fact("hardware"), many.fact("compiler"), many.fact("date"),
      one.fact("date"));
  std::vector<std::vector<std::string>> rows;
  double large = 0;  // as a run is cut by default
  for (std::size_t r = 0; r < many.rows.size(); ++r) {
    const auto alone =
        one.find({{"phyxels", many.text(r, "phyxels")}, {"precision", many.text(r, "precision")}});
    if (!alone) continue;
    const double gain = many.number(r, "steps_per_s") / one.number(*alone, "steps_per_s");
    if (many.number(r, "phyxels") > 150'000 && many.text(r, "precision") == "float" &&
        many.text(r, "partitioner") == "metis" && many.text(r, "rings") == "1") {
      large = gain;
    }
    rows.push_back(
        {many.text(r, "phyxels"), many.text(r, "precision"), many.text(r, "partitioner"),
         many.text(r, "rings"), fmt::format("{:.2f}", many.number(r, "phyxel_steps_per_s") * 1e-6),
         fmt::format("{:.2f}", gain), fmt::format("{:.0f}%", 100 * many.number(r, "spread")),
         many.text(r, "most_ghosts"),
         fmt::format("{:.1f}", many.number(r, "bytes_per_step") * 1e-3),
         fmt::format("{:.1f}%", 100 * many.number(r, "exchanging"))});
  }
  if (ranks == "2" && large > 0) {
    text += fmt::format(
        "Two ranks on two cores, 200,000 phyxels, cut by METIS with one ring of "
        "ghosts, the default: {:.2f} ({:g} asked).\n\n",
        large, asked_of_two);
  }
  return text +
         table_text({"phyxels", "precision", "cut by", "ghost rings", "10⁶ phyxel-steps/s",
                     "speed-up", "spread", "most ghosts", "kB sent a step", "exchanging"},
                    rows) +
         "\n";
}

}  // namespace

void write_scaling_page(const fs::path& results, const fs::path& page) {
  const std::vector<CsvTable> tables = tables_in(results);
  if (tables.empty() || tables[0].text(0, "ranks") != "1") return;
  std::string text =
      "# Scaling\n\nWritten by `phyxel bench page` from the tables of `phyxel bench scaling` in "
      "`docs/results/`: one jittered cube under gravity with Green's strain, stepped by ranks that "
      "`mpirun -n N` starts. Every rank count, partitioner and number of ghost rings gives the "
      "same positions to the last bit (`tests/mpi/share_test.cpp`, `tests/apps/mpirun_test.cpp`), "
      "so the error of a scaled run is that of one rank. One ring of ghosts: displacements and "
      "stresses are exchanged; two: displacements of both, and the inner ring's stresses are found "
      "twice. *Exchanging* is the largest share of a rank's time for packing, waiting and "
      "unpacking, in which uneven work shows, too.\n\nRanks step on CPUs so far.\n\n";
  for (std::size_t t = 1; t < tables.size(); ++t) text += section(tables[0], tables[t]);
  write_whole_file(page, text, Durable::no);
}

}  // namespace phyxel::app
