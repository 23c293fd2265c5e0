#include "scaling_page.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "csv.hpp"
#include "files/atomic_file.hpp"
#include "markdown.hpp"
#include "phyxel/error.hpp"
#include "scaling_model.hpp"

namespace phyxel::app {
namespace {

namespace fs = std::filesystem;

/// What two ranks on two cores are to reach from 200,000 phyxels on.
constexpr double asked_of_two = 1.8;

/// Both, unless one says what the other does.
void add_fact(CsvTable& table, const std::string& name, const std::string& more) {
  for (auto& [key, value] : table.facts) {
    if (key == name && value.find(more) == std::string::npos) value += ", " + more;
  }
}

/// The tables `<kind>_ranks_<n>*.csv` there are, by their number of ranks: rows of several calls
/// are those of one, which tells all commits and days.
std::map<int, CsvTable> tables_in(const fs::path& results, const std::string& kind) {
  std::map<int, CsvTable> tables;
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(results)) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with(kind + "_ranks_") && name.ends_with(".csv")) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  for (const fs::path& file : files) {
    CsvTable table = read_page_table(file);
    if (table.rows.empty()) continue;
    const double ranks = table.number(0, "ranks");
    if (!(ranks >= 1 && ranks <= 1e6)) {
      throw InputError(fmt::format("{}: of {} ranks; allowed: 1 to 1000000", file.string(), ranks));
    }
    CsvTable& of_ranks = tables[static_cast<int>(ranks)];
    if (of_ranks.rows.empty()) {
      of_ranks = std::move(table);
    } else {
      of_ranks.rows.insert(of_ranks.rows.end(), table.rows.begin(), table.rows.end());
      // Older tables have fewer columns: new ones come last.
      if (table.columns.size() > of_ranks.columns.size()) of_ranks.columns = table.columns;
      for (auto& row : of_ranks.rows) row.resize(of_ranks.columns.size());
      add_fact(of_ranks, "program", table.fact("program"));
      add_fact(of_ranks, "compiler", table.fact("compiler"));
      add_fact(of_ranks, "date", table.fact("date"));
    }
  }
  return tables;
}

const std::vector<std::string> head{
    "phyxels",    "precision", "cut by",     "ghost rings", "transport",   "10⁶ phyxel-steps/s",
    "one alone",  "speed-up",  "efficiency", "spread",      "most ghosts", "kB sent a step",
    "exchanging", "set-up [s]"};

/// NCCL does not tell how long it waits.
std::string exchanging(const CsvTable& table, std::size_t r) {
  if (table.text(r, "transport").starts_with("NCCL")) return "–";
  return fmt::format("{:.1f}%", 100 * table.number(r, "exchanging"));
}

std::vector<std::string> cells(const CsvTable& table, std::size_t r, double speed_up, int ranks) {
  const std::string asked = table.text(r, "partitioner"), cut_by = table.text(r, "cut_by");
  return {table.text(r, "phyxels"),
          table.text(r, "precision"),
          asked == cut_by ? cut_by : fmt::format("{} ({})", cut_by, asked),
          table.text(r, "rings"),
          table.text(r, "transport"),
          fmt::format("{:.2f}", table.number(r, "phyxel_steps_per_s") * 1e-6),
          fmt::format("{:.2f}", table.number(r, "phyxel_steps_per_s_alone") * 1e-6),
          fmt::format("{:.2f}", speed_up),
          fmt::format("{:.0f}%", 100 * speed_up / ranks),
          fmt::format("{:.0f}%, {:.0f}%", 100 * table.number(r, "spread"),
                      100 * table.number(r, "spread_alone")),
          table.text(r, "most_ghosts"),
          fmt::format("{:.1f}", table.number(r, "bytes_per_step") * 1e-3),
          exchanging(table, r),
          table.text(r, "set_up_s")};
}

const std::vector<std::string> head_without_one{
    "phyxels",    "precision",  "cut by",         "transport",   "10⁶ phyxel-steps/s",
    "steps/s",    "spread",     "most of a rank", "most ghosts", "kB sent a step",
    "exchanging", "shares [s]", "backend [s]",    "host [GB]"};

std::vector<std::string> cells_without_one(const CsvTable& table, std::size_t r) {
  const auto newer = [&](const char* column) {
    return table.has(column) ? table.text(r, column) : std::string();
  };
  return {table.text(r, "phyxels"),
          table.text(r, "precision"),
          table.text(r, "cut_by"),
          table.text(r, "transport"),
          fmt::format("{:.2f}", table.number(r, "phyxel_steps_per_s") * 1e-6),
          table.text(r, "steps_per_s"),
          fmt::format("{:.0f}%", 100 * table.number(r, "spread")),
          table.text(r, "most"),
          table.text(r, "most_ghosts"),
          fmt::format("{:.1f}", table.number(r, "bytes_per_step") * 1e-3),
          exchanging(table, r),
          table.text(r, "set_up_s"),
          newer("backend_s"),
          newer("host_gb")};
}

std::string section(const CsvTable& table, int ranks, bool gpus) {
  std::string text = fmt::format(
      "### {} {}\n\nMeasured by {} on {}{}; {}; {}.\n\n", ranks,
      gpus ? "ranks, a GPU each" : "CPU ranks", table.fact("program"), table.fact("hardware"),
      gpus ? fmt::format(", {} × {}", table.fact("gpus"), table.fact("gpu")) : "",
      table.fact("compiler"), table.fact("date"));
  std::vector<std::vector<std::string>> strong, weak, large;
  double best = 0;
  for (std::size_t r = 0; r < table.rows.size(); ++r) {
    if (table.text(r, "phyxels_alone").empty()) {
      large.push_back(cells_without_one(table, r));
      continue;
    }
    const double gain =
        table.number(r, "phyxel_steps_per_s") / table.number(r, "phyxel_steps_per_s_alone");
    const bool same = table.number(r, "phyxels_alone") == table.number(r, "phyxels");
    (same ? strong : weak).push_back(cells(table, r, gain, ranks));
    if (same && table.number(r, "phyxels") > 150'000 && table.text(r, "rings") == "1") {
      best = std::max(best, gain);
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
  if (!large.empty()) {
    text += "Measured without one rank beside:\n\n" + table_text(head_without_one, large);
  }
  return text;
}

std::string sections(const fs::path& results, const std::string& kind) {
  std::string text;
  std::vector<CsvTable> tables;
  for (const auto& [ranks, table] : tables_in(results, kind)) {
    if (ranks > 1) text += section(table, ranks, kind == "gpu");
    tables.push_back(table);
  }
  const fs::path sizes = results / (kind + "_sizes.csv");
  if (fs::exists(sizes)) text += scaling_model(tables, read_page_table(sizes));
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
      "twice. *One alone*: 10⁶ phyxel-steps/s of the first rank by itself, with the whole body or "
      "with one rank's part of it, measured in turn with all ranks; *speed-up*: over that; "
      "*efficiency*: that by rank; *spread*: (largest - smallest) / median of the repeats, of all "
      "and of one. *Exchanging* is the largest share of a "
      "rank's time for packing, waiting and unpacking, in which uneven work shows, too. *Shares*: "
      "until each rank has its part of the body; *backend*: from there until it can step; *host*: "
      "what all ranks' programs have had of the host's memory at most.\n\n";
  text += "## GPUs\n\n";
  text += gpus.empty() ? "Not measured yet.\n\n"
                       : "Asked of 8 GPUs in float: 80% of 17 million phyxels, 50% of 2 million, "
                         "95% of 16 million a GPU.\n\n" +
                             gpus;
  if (!cpus.empty()) text += "## CPUs\n\nA thread a rank.\n\n" + cpus;
  write_whole_file(page, text, Durable::no);
}

}  // namespace phyxel::app
