/// phyxel report: a run or measurements as one page.
#include "command.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "files/atomic_file.hpp"
#include "kind.hpp"
#include "outside_text.hpp"
#include "phyxel/error.hpp"
#include "report/report.hpp"

namespace phyxel::app {
namespace {

namespace fs = std::filesystem;

struct ReportOptions {
  std::vector<fs::path> inputs;
  fs::path out;
  double megabytes = 64;
  bool no_stress = false, force = false, json = false;
};

bool is_table(const fs::path& file) { return kind_of(file) == Kind::table; }

/// Tables of a folder that holds no trajectory.
std::vector<fs::path> tables_in(const fs::path& folder) {
  std::vector<fs::path> tables;
  if (!fs::is_directory(folder) || fs::exists(folder / "surface.hdf.series") ||
      fs::exists(folder / "phyxels.hdf.series")) {
    return tables;
  }
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (is_table(entry.path())) tables.push_back(entry.path());
  }
  std::sort(tables.begin(), tables.end());
  return tables;
}

fs::path default_out(const fs::path& input) {
  return fs::is_directory(input) ? input / "report.html"
                                 : fs::path(input).replace_extension("html");
}

void report_command(const ReportOptions& options) {
  std::vector<fs::path> tables;
  bool only_tables = true;
  for (const fs::path& input : options.inputs) {
    if (!fs::exists(input)) {
      throw InputError(fmt::format("{}: no such file or folder", input.string()));
    }
    expect_kind(input, {Kind::folder, Kind::series, Kind::hdf5, Kind::table});
    const std::vector<fs::path> found = is_table(input) ? std::vector{input} : tables_in(input);
    only_tables = only_tables && !found.empty();
    tables.insert(tables.end(), found.begin(), found.end());
  }
  if (!only_tables && options.inputs.size() > 1) {
    throw InputError(fmt::format("{} inputs: allowed: one run, or any number of tables (.csv)",
                                 options.inputs.size()));
  }
  const fs::path out = options.out.empty() ? default_out(options.inputs.front()) : options.out;
  check_output_file(out, options.force, Output::file_or_stream);
  const Report report = only_tables ? results_page(tables)
                                    : replay_page({.input = options.inputs.front(),
                                                   .megabytes = options.megabytes,
                                                   .stress = !options.no_stress});
  if (out.has_parent_path()) make_writable_folder(out.parent_path());
  write_whole_file(out, report.html, Durable::no);
  if (options.json) {
    nlohmann::ordered_json said{{"file", out.string()}, {"bytes", report.html.size()}};
    if (only_tables) {
      said["tables"] = tables.size();
    } else {
      said.update({{"frames", report.frames},
                   {"phyxels", report.phyxels},
                   {"surfels", report.surfels},
                   {"colours", report.fields},
                   {"notes", report.notes}});
    }
    fmt::print("{}\n", json_text(said));
    return;
  }
  const std::string holds =
      only_tables
          ? fmt::format("{} table{}", tables.size(), tables.size() == 1 ? "" : "s")
          : fmt::format("{} frames of {} phyxels and {} surfels, coloured by {}", report.frames,
                        report.phyxels, report.surfels, fmt::join(report.fields, ", "));
  fmt::print("{}: {}; {:.1f} MB\n", out.string(), holds,
             static_cast<double>(report.html.size()) / 1e6);
  for (const std::string& note : report.notes) fmt::print("  note: {}\n", note);
}

}  // namespace

void add_report(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "report",
      "One page for a browser, offline: a run to turn and replay, with its energies and timing; or "
      "tables of measurements with charts");
  auto options = std::make_shared<ReportOptions>();
  command
      ->add_option("input", options->inputs,
                   "Folder of a run, a .series file, one frame (.hdf); or tables (.csv) that other "
                   "commands wrote, or a folder of them")
      ->required();
  command->add_option("-o,--out", options->out,
                      "The page (default: report.html in the folder, or beside the file)");
  command
      ->add_option("--max-megabytes", options->megabytes,
                   "Leave out frames, then phyxels, until the page is no larger")
      ->check(CLI::Range(1.0, 1e4))
      ->capture_default_str();
  command->add_flag(
      "--no-stress", options->no_stress,
      "Do not build the scene again to find strains and stresses that frames lack (it "
      "is built if it asks for no more phyxels than the frames have, and for no file "
      "outside the run's folder unless the scene's own file is still the same)");
  command->add_flag("--force", options->force, "Replace the page if it exists");
  command->add_flag("--json", options->json, "What was written as JSON, nothing else on stdout");
  command->footer(
      "Examples:\n"
      "  phyxel report out/dino -o dino.html\n"
      "  phyxel report out/dino --max-megabytes 10 --force\n"
      "  phyxel report docs/results/accuracy.csv docs/results/gpu_sizes.csv -o results.html\n"
      "  phyxel report docs/results/paper -o paper.html");
  command->callback([options] { report_command(*options); });
}

}  // namespace phyxel::app
