/// phyxel sample: a body file from a mesh filled with phyxels.
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>

#include "command.hpp"
#include "device_option.hpp"
#include "files/atomic_file.hpp"
#include "kind.hpp"
#include "mesh/filling_device.hpp"
#include "outside_text.hpp"
#include "phyxel/body_file.hpp"
#include "phyxel/error.hpp"
#include "phyxel/mesh.hpp"
#include "progress.hpp"
#include "stopwatch.hpp"
#include "version.hpp"

namespace phyxel::app {
namespace {

struct SampleOptions {
  std::filesystem::path mesh, out;
  std::int64_t phyxels = 0, relaxations = SampleRequest{}.relaxations, seed = SampleRequest{}.seed;
  std::optional<bool> on_surface;
  std::optional<double> ratio;  ///< Set for a graded body.
  Grading grading;              ///< But for its ratio and its finer regions.
  std::vector<double> balls;    ///< Centres and radii of finer regions, four numbers each [m].
  std::string device = "auto";
  bool force = false, json = false;
};

/// The grading that the options ask for, if any.
std::optional<Grading> grading_of(const SampleOptions& options) {
  if (!options.ratio) return {};
  Grading grading = options.grading;
  grading.ratio = *options.ratio;
  for (std::size_t k = 0; k + 3 < options.balls.size(); k += 4) {
    const double* const b = &options.balls[k];
    if (!(b[3] > 0)) {
      throw InputError(
          fmt::format("--finer {:g} {:g} {:g} {:g}: the radius is {:g} m; allowed: > 0", b[0], b[1],
                      b[2], b[3], b[3]));
    }
    SpaceRegion ball;
    ball.is_ball = true;
    ball.centre = {b[0], b[1], b[2]};
    ball.radius = b[3];
    grading.finer.push_back({ball, grading.ratio});
  }
  return grading;
}

SampleRequest request_of(const SampleOptions& options) {
  constexpr std::int64_t most = std::numeric_limits<Index>::max(), most_relaxations = 10000;
  if (options.phyxels < 1 || options.phyxels > most) {
    throw InputError(fmt::format("--phyxels {}: out of range: allowed 1 to {}, within the memory",
                                 options.phyxels, most));
  }
  if (options.relaxations < 0 || options.relaxations > most_relaxations) {
    throw InputError(fmt::format("--relaxations {}: out of range: allowed 0 to {}",
                                 options.relaxations, most_relaxations));
  }
  if (options.seed < 0) {
    throw InputError(fmt::format("--seed {}: out of range: allowed 0 to {}", options.seed,
                                 std::numeric_limits<std::int64_t>::max()));
  }
  return {.phyxels = static_cast<Index>(options.phyxels),
          .seed = static_cast<std::uint64_t>(options.seed),
          .relaxations = static_cast<int>(options.relaxations),
          .on_surface = options.on_surface,
          .cuts = {},
          .grading = grading_of(options)};
}

/// Checks in advance that the output can be written. @throws InputError
void check_output(const SampleOptions& options) {
  namespace fs = std::filesystem;
  const fs::path& out = options.out;
  std::error_code ignored;
  if (fs::equivalent(out, options.mesh, ignored)) {
    throw InputError(
        fmt::format("--out {}: is the mesh itself; allowed: another file", out.string()));
  }
  check_output_file(out, options.force, Output::file);
  const fs::path folder = out.has_parent_path() ? out.parent_path() : fs::path(".");
  if (!fs::is_directory(folder, ignored)) {
    throw InputError(
        fmt::format("--out {}: the folder {} does not exist", out.string(), folder.string()));
  }
  if (access(folder.c_str(), W_OK | X_OK) != 0) {
    throw InputError(
        fmt::format("--out {}: the folder {} cannot be written to", out.string(), folder.string()));
  }
}

void say_json(const SampleOptions& options, const Cloud& cloud, const SampleReport& report,
              double seconds) {
  const SurfaceDefects& defects = report.defects;
  const nlohmann::ordered_json j = {{"program", program_version()},
                                    {"mesh", options.mesh.string()},
                                    {"file", options.out.string()},
                                    {"phyxels", cloud.position.size()},
                                    {"on_surface", report.on_surface},
                                    {"surfels", cloud.surface.position.size()},
                                    {"triangles", cloud.surface.triangle.size()},
                                    {"parts", defects.parts},
                                    {"volume_m3", report.volume},
                                    {"mean_spacing_m", report.spacing},
                                    {"smallest_gap_m", report.smallest_gap},
                                    {"watertight", defects.open_edges == 0},
                                    {"open_edges", defects.open_edges},
                                    {"doubtful_fraction", report.doubtful_fraction},
                                    {"seed", options.seed},
                                    {"relaxations", options.relaxations},
                                    {"warnings", report.warnings},
                                    {"seconds", seconds}};
  fmt::print("{}\n", json_text(j));
}

void say_summary(const SampleOptions& options, const Cloud& cloud, const SampleReport& report,
                 double seconds) {
  fmt::print("{}: {} -> {}\n", program_version(), options.mesh.string(), options.out.string());
  fmt::print("  phyxels     {}, in {:.6g} m^3\n", cloud.position.size(), report.volume);
  if (report.on_surface > 0) fmt::print("  on surface  {}\n", report.on_surface);
  if (cloud.position.size() > 1) {
    fmt::print(
        "  spacing     {:.4g} m to the nearest on average, {:.4g} m at the least ({:.2f} of it)\n",
        report.spacing, report.smallest_gap, report.smallest_gap / report.spacing);
  }
  if (!cloud.spacing.empty()) {
    const auto [finest, coarsest] = std::ranges::minmax(cloud.spacing);
    fmt::print("  graded      for distances of {:.4g} to {:.4g} m\n", finest, coarsest);
  }
  fmt::print("  surfels     {}, in {} triangles\n", cloud.surface.position.size(),
             cloud.surface.triangle.size());
  fmt::print("  surface     {}\n", report.defects.describe());
  for (const std::string& warning : report.warnings) fmt::print("  warning     {}\n", warning);
  fmt::print("  took        {:.2f} s, {:.4g} phyxels/s\n", seconds,
             static_cast<double>(cloud.position.size()) / seconds);
}

/// The device that the user has asked for. "auto" stands for none where the host fills a body
/// sooner alone.
ChosenDevice device_for(const SampleOptions& options, const SampleRequest& request) {
  check_device_name(options.device, "--device");
  if (options.device == "auto" && !is_worth_device(request)) return {};
  return choose_device(options.device);
}

void sample(const SampleOptions& options) {
  const auto start = Clock::now();
  const SampleRequest request = request_of(options);
  expect_kind(options.mesh, {Kind::mesh});
  check_output(options);
  const ChosenDevice device = device_for(options, request);
  SampleReport report;
  Cloud cloud;
  {
    const SetupProgress progress(options.json ? nullptr : stderr);
    const Surface surface = read_mesh(options.mesh);
    try {
      cloud = sample_surface(surface, request, device, &report);
    } catch (const InputError& error) {
      throw InputError(fmt::format("{}: {}", options.mesh.string(), error.what()));
    }
  }
  write_body(options.out, cloud, options.force);
  const double seconds = seconds_since(start);
  (options.json ? say_json : say_summary)(options, cloud, report, seconds);
}

}  // namespace

void add_sample(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "sample", "Fill a closed surface with phyxels; its vertices become the surfels");
  auto options = std::make_shared<SampleOptions>();
  command->add_option("mesh", options->mesh, "Surface in metres: OBJ, PLY or STL")->required();
  command->add_option("--phyxels", options->phyxels, "Exact number of phyxels")->required();
  command->add_option("--out", options->out, "File to write (body.h5)")->required();
  command
      ->add_option("--seed", options->seed,
                   "The same seed gives the same phyxels, on any number of threads")
      ->capture_default_str();
  command
      ->add_option("--relaxations", options->relaxations,
                   "Sweeps that spread the phyxels evenly; 0 for none")
      ->capture_default_str();
  CLI::Option* const on_surface = command->add_flag_callback(
      "--on-surface", [options] { options->on_surface = true; },
      "Also place phyxels on the surface, its corners and its sharp edges: far more accurate in "
      "bending. Default: if the mesh allows it");
  command
      ->add_flag_callback(
          "--inside", [options] { options->on_surface = false; }, "Place all phyxels inside")
      ->excludes(on_surface);
  CLI::Option* const ratio = command->add_option(
      "--ratio", options->ratio,
      "Grades the body: largest over smallest distance between neighbours, 1 to 10; nearer where "
      "the surface curves and where the body is thin");
  command
      ->add_option("--growth", options->grading.growth,
                   "Growth of that distance along a path, by the path's length, 0.05 to 0.5")
      ->capture_default_str()
      ->needs(ratio);
  command
      ->add_option("--per-radius", options->grading.per_radius,
                   "Phyxels over a radius of curvature; 0: however the surface curves. Default: 8, "
                   "or 0 with --finer")
      ->needs(ratio);
  command
      ->add_option("--across", options->grading.across,
                   "Phyxels through thin places, 2 at least. Default: 5, or 2 with --finer")
      ->needs(ratio);
  command
      ->add_option("--finer", options->balls,
                   "Centre x y z and radius of a ball with the smallest distances [m]; repeatable")
      ->type_size(4)
      ->expected(-1)
      ->needs(ratio);
  command
      ->add_option(
          "--device", options->device,
          std::string(device_help) +
              ". A GPU helps with closed meshes, 20,000 phyxels and more, without --ratio; "
              "the body is the same")
      ->capture_default_str();
  command->add_flag("--force", options->force, "Replace the file if it exists");
  command->add_flag("--json", options->json, "The summary as JSON, nothing else on stdout");
  command->footer(
      "Examples:\n"
      "  phyxel sample bunny.obj --phyxels 5000 --out bunny.h5\n"
      "  phyxel sample scan.ply --phyxels 200000 --out scan.h5 --seed 7 --force\n"
      "  phyxel sample gear.stl --phyxels 20000 --out gear.h5 --relaxations 100 --on-surface\n"
      "  phyxel sample gear.stl --phyxels 20000 --out gear.h5 --ratio 5 --finer 0.02 0 0.01 0.005");
  command->callback([options] { sample(*options); });
}

}  // namespace phyxel::app
