/// phyxel export: a trajectory in one file.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "command.hpp"
#include "kind.hpp"
#include "outside_text.hpp"
#include "phyxel/error.hpp"
#include "phyxel/recorder.hpp"

namespace phyxel::app {
namespace {

struct ExportOptions {
  std::filesystem::path series, single;
  bool force = false, json = false;
};

void export_command(const ExportOptions& options) {
  expect_kind(options.series, {Kind::series});
  const std::size_t frames = read_series(options.series).size();
  export_single(options.series, options.single, options.force);
  const std::uintmax_t bytes = std::filesystem::file_size(options.single);
  if (options.json) {
    const nlohmann::ordered_json said{
        {"file", options.single.string()}, {"frames", frames}, {"bytes", bytes}};
    fmt::print("{}\n", json_text(said));
    return;
  }
  fmt::print("{}: {} frames, {:.1f} MB\n", options.single.string(), frames,
             static_cast<double>(bytes) / 1e6);
}

}  // namespace

void add_export(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "export", "Write a series of frames to one temporal VTKHDF file (ParaView 5.12 and later)");
  auto options = std::make_shared<ExportOptions>();
  command->add_option("series", options->series, "A .hdf.series file of a run")->required();
  command->add_option("--single", options->single, "The file to write, .vtkhdf or .hdf")
      ->required();
  command->add_flag("--force", options->force, "Replace the file if it exists");
  command->add_flag("--json", options->json, "What was written as JSON, nothing else on stdout");
  command->footer(
      "Example:\n"
      "  phyxel export out/dino/surface.hdf.series --single dino.vtkhdf");
  command->callback([options] { export_command(*options); });
}

}  // namespace phyxel::app
