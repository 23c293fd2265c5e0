/// phyxel report: a run as one page.
#include "command.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
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
  fs::path input, out;
  double megabytes = 16;
  bool no_stress = false, force = false, json = false;
};

fs::path default_out(const fs::path& input) {
  return fs::is_directory(input) ? input / "report.html"
                                 : fs::path(input).replace_extension("html");
}

void report_command(const ReportOptions& options) {
  if (!fs::exists(options.input)) {
    throw InputError(fmt::format("{}: no such file or folder", options.input.string()));
  }
  expect_kind(options.input, {Kind::folder, Kind::series, Kind::hdf5});
  const fs::path out = options.out.empty() ? default_out(options.input) : options.out;
  check_output_file(out, options.force, Output::file_or_stream);
  const Report report = replay_page(
      {.input = options.input, .megabytes = options.megabytes, .stress = !options.no_stress});
  if (out.has_parent_path()) make_writable_folder(out.parent_path());
  write_whole_file(out, report.html, Durable::no);
  if (options.json) {
    fmt::print("{}\n", json_text({{"file", out.string()},
                                  {"bytes", report.html.size()},
                                  {"frames", report.frames},
                                  {"phyxels", report.phyxels},
                                  {"surfels", report.surfels},
                                  {"colours", report.fields},
                                  {"obstacles", report.obstacles},
                                  {"notes", report.notes}}));
    return;
  }
  fmt::print("{}: {} frames of {} phyxels and {} surfels, coloured by {}; {:.1f} MB\n",
             out.string(), report.frames, report.phyxels, report.surfels,
             fmt::join(report.fields, ", "), static_cast<double>(report.html.size()) / 1e6);
  for (const std::string& note : report.notes) fmt::print("  note: {}\n", note);
}

}  // namespace

void add_report(CLI::App& program) {
  CLI::App* command = program.add_subcommand("report",
                                             "Write an offline HTML page that replays a run in 3D "
                                             "with its obstacles, energies and timing");
  auto options = std::make_shared<ReportOptions>();
  command
      ->add_option("input", options->input, "Folder of a run, a .series file, or one frame (.hdf)")
      ->required();
  command->add_option("-o,--out", options->out,
                      "The page (default: report.html in the folder, or beside the file)");
  command
      ->add_option("--max-megabytes", options->megabytes,
                   "Largest size of the page [MB]; surfels beyond what a hundred frames leave room "
                   "for, frames "
                   "and phyxels are omitted to stay below it")
      ->check(CLI::Range(1.0, 1e4))
      ->capture_default_str();
  command->add_flag(
      "--no-stress", options->no_stress,
      "Do not rebuild the scene to compute strains and stresses that frames lack (it is rebuilt if "
      "it has no more phyxels than the frames, and needs no file outside the run's folder unless "
      "the scene file is unchanged)");
  command->add_flag("--force", options->force, "Replace the page if it exists");
  command->add_flag("--json", options->json, "What was written as JSON, nothing else on stdout");
  command->footer(
      "Examples:\n"
      "  phyxel report out/dino -o dino.html\n"
      "  phyxel report out/dino --max-megabytes 64 --force");
  command->callback([options] { report_command(*options); });
}

}  // namespace phyxel::app
