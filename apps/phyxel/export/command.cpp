/// phyxel export: a trajectory in files of other programs.
#include "command.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <nlohmann/json.hpp>

#include "export/gltf.hpp"
#include "export/paraview.hpp"
#include "export/vtu.hpp"
#include "files/atomic_file.hpp"
#include "kind.hpp"
#include "outside_text.hpp"
#include "phyxel/error.hpp"
#include "phyxel/recorder.hpp"
#include "terminal.hpp"
#include "trajectory_options.hpp"

namespace phyxel::app {
namespace {

namespace fs = std::filesystem;

struct ExportOptions {
  fs::path input, single, out, scene_folder;
  std::string format;
  FrameChoice choice;
  ColourOptions colours;
  double megabytes = 500, seconds = 0;
  bool force = false, json = false;
};

/// An exported file, or the one that refers to the others.
struct Exported {
  fs::path file;
  std::size_t frames = 0;
  std::uintmax_t bytes = 0;  ///< Of all files.
};

/// The folder of a run, given by its path or that of a series in it.
fs::path folder_of(const fs::path& input) {
  return fs::is_directory(input) ? input : input.parent_path();
}

Exported export_vtkhdf(const ExportOptions& options) {
  expect_kind(options.input, {Kind::series});
  const std::size_t frames = read_series(options.input).size();
  export_single(options.input, options.single, options.force);
  return {options.single, frames, fs::file_size(options.single)};
}

Exported export_gltf(const ExportOptions& options, GltfContainer container) {
  expect_kind(options.input, {Kind::folder, Kind::series});
  GltfRequest request{.input = options.input,
                      .choice = options.choice,
                      .colours = options.colours.request(),
                      .megabytes = options.megabytes,
                      .scene_folder = options.scene_folder,
                      .container = container};
  if (options.seconds > 0) request.seconds = options.seconds;
  fs::path out = options.out;
  if (out.empty()) out = folder_of(options.input) / ("surface." + options.format);
  check_output_file(out, options.force, Output::file);
  const GltfExport made = gltf_of_run(request);
  for (const std::string& note : made.notes) {
    fmt::print(stderr, "phyxel: {}{}\n", warning_word(), note);
  }
  if (out.has_parent_path()) make_writable_folder(out.parent_path());
  write_whole_file(out, made.content, Durable::yes);
  return {out, made.frames, made.content.size()};
}

Exported export_vtu_files(const ExportOptions& options) {
  expect_kind(options.input, {Kind::folder, Kind::series});
  const fs::path folder = options.out.empty() ? folder_of(options.input) / "vtu" : options.out;
  const std::vector<fs::path> files =
      export_vtu(options.input, folder, options.choice, options.force);
  Exported made{.file = folder};
  for (const fs::path& file : files) {
    made.bytes += fs::file_size(file);
    if (file.filename().string().starts_with("surface_")) ++made.frames;
  }
  if (made.frames == 0) made.frames = files.size() - 1;  // phyxels alone, and their collection
  return made;
}

Exported export_paraview(const ExportOptions& options) {
  expect_kind(options.input, {Kind::folder});
  const fs::path out = options.out.empty() ? options.input / "open_in_paraview.py" : options.out;
  if (out.filename() == "paraview.py") {
    throw InputError(fmt::format(
        "--out {}: is the name of ParaView's own module, which the script then would not find; "
        "allowed: another name",
        out.string()));
  }
  check_output_file(out, options.force, Output::file);
  const std::string script = paraview_state(options.input, options.colours.request());
  if (out.has_parent_path()) make_writable_folder(out.parent_path());
  write_whole_file(out, script, Durable::yes);
  return {out, find_trajectory(options.input, {}).shots.size(), script.size()};
}

/// A format of --format, and the options that it takes beside --out.
struct Format {
  const char* name;
  Exported (*write)(const ExportOptions&);
  std::vector<std::string> options;
};

const std::vector<Format>& formats() {
  const std::vector<std::string> of_gltf = {"--frames",  "--count",         "--every",
                                            "--colour",  "--range",         "--scale",
                                            "--seconds", "--max-megabytes", "--scene-folder"};
  static const std::vector<Format> all = {
      {"glb", [](const ExportOptions& o) { return export_gltf(o, GltfContainer::binary); },
       of_gltf},
      {"gltf", [](const ExportOptions& o) { return export_gltf(o, GltfContainer::json); }, of_gltf},
      {"vtu", export_vtu_files, {"--frames", "--count", "--every"}},
      {"paraview", export_paraview, {"--colour", "--range", "--scale"}}};
  return all;
}

/// Refuses options that a format does not take.
/// @param format as the user chose it @param taken options that it takes
void refuse_other_options(const CLI::App& command, const std::string& format,
                          std::vector<std::string> taken) {
  for (const Format& other : formats()) {
    for (const std::string& option : other.options) {
      const bool takes = std::find(taken.begin(), taken.end(), option) != taken.end();
      if (takes || command.get_option(option)->count() == 0) continue;
      taken.insert(taken.begin(), format == "--single" ? "--force" : "--out");
      throw InputError(
          fmt::format("{} with {}: allowed: {}", option, format, fmt::join(taken, ", ")));
    }
  }
}

Exported export_format(const CLI::App& command, const ExportOptions& options) {
  const Format& format = *std::find_if(formats().begin(), formats().end(),
                                       [&](const Format& f) { return options.format == f.name; });
  refuse_other_options(command, "--format " + options.format, format.options);
  return format.write(options);
}

void export_command(const CLI::App& command, const ExportOptions& options) {
  if (options.single.empty() == options.format.empty()) {
    throw InputError("phyxel export: allowed: one of --format and --single");
  }
  if (options.format.empty()) refuse_other_options(command, "--single", {});
  const Exported made =
      options.format.empty() ? export_vtkhdf(options) : export_format(command, options);
  if (options.json) {
    const nlohmann::ordered_json said{
        {"file", made.file.string()}, {"frames", made.frames}, {"bytes", made.bytes}};
    fmt::print("{}\n", json_text(said));
    return;
  }
  fmt::print("{}: {} frame{}, {:.1f} MB\n", made.file.string(), made.frames,
             made.frames == 1 ? "" : "s", static_cast<double>(made.bytes) / 1e6);
}

void add_format_options(CLI::App& command, ExportOptions& options, CLI::Option* single) {
  auto* format = command
                     .add_option("--format", options.format,
                                 "glb or gltf: surfaces and obstacles in motion as glTF 2.0, for "
                                 "Blender, browsers and slides; vtu: frames with all fields for "
                                 "meshio and VTK; paraview: a Python state, which opens the run in "
                                 "ParaView with colours, times and view")
                     ->check(CLI::IsMember({"glb", "gltf", "vtu", "paraview"}))
                     ->excludes(single);
  command
      .add_option("--out", options.out,
                  "The file to write, or the folder of vtu (default, in the run's folder: "
                  "surface.glb, surface.gltf, vtu, open_in_paraview.py)")
      ->needs(format);
  add_frame_options(command, options.choice);
  add_colour_options(command, options.colours);
  command
      .add_option("--seconds", options.seconds,
                  "Duration of the animation, faster or slower than the run (default: that of the "
                  "run) [s]")
      ->check(CLI::Range(1e-3, 1e6))
      ->needs(format);
  command
      .add_option("--max-megabytes", options.megabytes,
                  "Largest size of the file; evenly spaced frames are left out to keep it")
      ->check(CLI::Range(0.001, 4000.0))
      ->capture_default_str()
      ->needs(format);
  command
      .add_option("--scene-folder", options.scene_folder,
                  "Folder of the scene, with the meshes of its obstacles (default: the current "
                  "one)")
      ->needs(format);
}

}  // namespace

void add_export(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "export", "Write a trajectory to files for other programs: glTF, VTK's XML, ParaView");
  auto options = std::make_shared<ExportOptions>();
  command
      ->add_option("input", options->input,
                   "Folder of a run, or a .hdf.series file of it, as --single needs")
      ->required();
  auto* single = command->add_option(
      "--single", options->single,
      "Write the frames of a series to this file, .vtkhdf or .hdf (ParaView 5.12 and later)");
  add_format_options(*command, *options, single);
  command->add_flag("--force", options->force, "Replace the file if it exists");
  command->add_flag("--json", options->json, "What was written as JSON, nothing else on stdout");
  command->footer(
      "Examples:\n"
      "  phyxel export out/dino --format glb\n"
      "  phyxel export out/dino --format glb --colour von_mises --seconds 5 --out dino.glb\n"
      "  phyxel export out/dino --format vtu --every 10\n"
      "  phyxel export out/dino --format paraview --colour von_mises\n"
      "  phyxel export out/dino/surface.hdf.series --single dino.vtkhdf");
  command->callback([command, options] { export_command(*command, *options); });
}

}  // namespace phyxel::app
