/// phyxel info: the content of a file.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <nlohmann/json.hpp>
#include <optional>

#include "command.hpp"
#include "files/frame_file.hpp"
#include "files/hdf5_file.hpp"
#include "files/sealed_file.hpp"
#include "info_partition.hpp"
#include "kind.hpp"
#include "model/box.hpp"
#include "outside_text.hpp"
#include "phyxel/phyxel.hpp"
#include "setup.hpp"

namespace phyxel::app {
namespace {

namespace fs = std::filesystem;
using Facts = nlohmann::ordered_json;

Facts box_of(const std::vector<Vec3d>& points) {
  if (points.empty()) return "empty";
  const auto [low, high] = box_around(points);
  return {{"low", {low.x, low.y, low.z}}, {"high", {high.x, high.y, high.z}}};
}

Facts body_facts(const fs::path& file) {
  const Cloud cloud = read_body(file);
  double volume = 0;
  for (const double v : cloud.volume) volume += v;
  Facts regions = Facts::object();
  for (const auto& [name, phyxels] : cloud.regions) regions[name] = phyxels.size();
  Facts facts = {{"phyxels", cloud.position.size()},
                 {"surfels", cloud.surface.position.size()},
                 {"triangles", cloud.surface.triangle.size()},
                 {"bounds [m]", box_of(cloud.position)}};
  if (cloud.volume.empty()) {
    facts["volume"] = "not given: the kernel rule applies";
  } else {
    facts["volume [m^3]"] = volume;
  }
  if (!regions.empty()) facts["regions"] = regions;
  return facts;
}

Facts checkpoint_facts(const fs::path& file) {
  const Checkpoint checkpoint = read_checkpoint(file);
  const State& state = checkpoint.state;
  double displacement = 0, speed = 0;
  for (std::size_t i = 0; i < state.displacement.size(); ++i) {
    displacement = std::max(displacement, norm(state.displacement[i]));
    speed = std::max(speed, norm(state.velocity[i]));
  }
  return {{"program", checkpoint.info.program},
          {"precision", precision_name(checkpoint.info.precision)},
          {"phyxels", state.displacement.size()},
          {"time [s]", state.time},
          {"step", state.step},
          {"time step [s]", state.dt},
          {"largest displacement [m]", displacement},
          {"largest speed [m/s]", speed},
          {"total energy [J]", checkpoint.info.total_energy},
          {"frames written before", checkpoint.info.frames_written},
          {"model digest", fmt::format("{:016x}", checkpoint.info.model_digest)},
          {"continue with", fmt::format("phyxel run SCENE --resume {}", file.string())},
          {"scene", checkpoint.info.scene_text}};
}

Facts frame_facts(const fs::path& file) {
  const FrameData frame = read_frame(file);
  const Hdf5Reader in(file);
  return {{"title", in.text_attribute("/phyxel", "title")},
          {"program", in.text_attribute("/phyxel", "program")},
          {"time [s]", frame.time},
          {"step", in.integer_attribute("/phyxel", "step")},
          {"points", frame.point.size()},
          {"triangles", frame.triangle.size()},
          {"bounds [m]", box_of(frame.point)},
          {"fields", in.names("/VTKHDF/PointData")},
          {"kinetic energy [J]", in.number_attribute("/phyxel", "kinetic_energy")},
          {"total energy [J]", in.number_attribute("/phyxel", "total_energy")}};
}

Facts trajectory_facts(const fs::path& file) {
  const Hdf5Reader in(file);
  const auto times = in.array<double>("/VTKHDF/Steps/Values");
  return {{"title", in.text_attribute("/phyxel", "title")},
          {"frames", times.size()},
          {"first time [s]", times.empty() ? 0 : times.front()},
          {"last time [s]", times.empty() ? 0 : times.back()},
          {"points in all", in.shape("/VTKHDF/Points").rows},
          {"fields", in.names("/VTKHDF/PointData")}};
}

Facts sealed_facts(const fs::path& file) {
  const std::string kind = check_seal(file);
  Facts facts = {{"file", file.string()},
                 {"kind", "phyxel " + kind},
                 {"bytes", fs::file_size(file)},
                 {"digest", "fits"}};
  if (kind == "body") facts.update(body_facts(file));
  if (kind == "checkpoint") facts.update(checkpoint_facts(file));
  if (kind == phyxel_frame_kind || kind == surface_frame_kind) facts.update(frame_facts(file));
  if (kind == "trajectory") facts.update(trajectory_facts(file));
  return facts;
}

Facts series_facts(const fs::path& file) {
  const auto entries = read_series(file);
  Facts missing = Facts::array();
  for (const SeriesEntry& entry : entries) {
    if (!fs::exists(entry.file)) missing.push_back(entry.file.filename().string());
  }
  Facts facts = {{"file", file.string()}, {"kind", "series of frames"}, {"frames", entries.size()}};
  if (!entries.empty()) {
    facts["first time [s]"] = entries.front().time;
    facts["last time [s]"] = entries.back().time;
  }
  if (!missing.empty()) facts["missing frames"] = missing;
  return facts;
}

Facts scene_facts(const fs::path& file) {
  const Scene scene = read_scene(file);
  Facts bodies = Facts::array();
  for (const BodyRequest& body : scene.bodies) {
    const BodySource& source = body.source;
    Facts facts{{"name", body.name},
                {"from", !source.shape.name.empty() ? source.shape.name
                         : !source.mesh.empty()     ? source.mesh.string()
                         : !source.file.empty()     ? source.file.string()
                                                    : source.cloud},
                {"law", body.material.law}};
    if (has_parameter(body.material.law, "young")) facts["E [Pa]"] = body.material.young;
    if (has_parameter(body.material.law, "poisson")) facts["nu"] = body.material.poisson;
    for (const auto& [name, value] : body.material.parameters) {
      if (value.is_vector() || value.is_curve()) {
        facts[name] = value.text();
      } else {
        facts[name] = value.number();
      }
    }
    facts["rho [kg/m^3]"] = body.material.density;
    bodies.push_back(facts);
  }
  return {{"file", file.string()},
          {"kind", "scene"},
          {"title", scene.title},
          {"end [s]", scene.time.end},
          {"precision", precision_name(scene.solver.precision)},
          {"output", scene.output.directory.string()},
          {"bodies", bodies},
          {"more", fmt::format("phyxel run {} --dry-run", file.string())}};
}

Facts mesh_facts(const fs::path& file) {
  const Surface surface = read_mesh(file);
  return {{"file", file.string()},
          {"kind", "triangle mesh"},
          {"vertices", surface.position.size()},
          {"triangles", surface.triangle.size()},
          {"enclosed volume [m^3]", enclosed_volume(surface)},
          {"bounds [m]", box_of(surface.position)},
          {"state", inspect_surface(surface).describe()}};
}

Facts folder_facts(const fs::path& folder) {
  Facts facts = {{"folder", folder.string()}, {"kind", "output of a run"}};
  for (const char* family : {"phyxels", "surface"}) {
    const fs::path series = folder / fmt::format("{}.hdf.series", family);
    if (fs::exists(series)) facts[family] = series_facts(series);
  }
  std::string warning;
  if (const auto checkpoint = latest_checkpoint(folder, &warning)) {
    const Checkpoint read = read_checkpoint(*checkpoint);
    facts["newest checkpoint"] = {
        {"file", checkpoint->string()}, {"time [s]", read.state.time}, {"step", read.state.step}};
  }
  if (!warning.empty()) facts["warning"] = warning;
  if (facts.size() == 2)
    throw InputError(fmt::format("{}: does not contain a run of phyxel", folder.string()));
  return facts;
}

Facts facts_of(const fs::path& file) {
  switch (expect_kind(file, {Kind::folder, Kind::scene, Kind::mesh, Kind::series, Kind::hdf5})) {
    case Kind::missing:
      throw InputError(fmt::format("{}: no such file", file.string()));
    case Kind::folder:
      return folder_facts(file);
    case Kind::scene:
      return scene_facts(file);
    case Kind::mesh:
      return mesh_facts(file);
    case Kind::series:
      return series_facts(file);
    default:
      return sealed_facts(file);
  }
}

/// A value as text: numbers with nine digits, short lists on one line.
std::string shown(const Facts& value) {
  if (value.is_string()) return value.get<std::string>();
  if (value.is_number_float()) return fmt::format("{:.9g}", value.get<double>());
  if (!value.is_array()) return json_text(value, -1);
  std::string list;
  for (const Facts& item : value) list += (list.empty() ? "" : ", ") + shown(item);
  return list;
}

void print_facts(const Facts& facts, int indent) {
  for (const auto& [key, value] : facts.items()) {
    const bool nested =
        value.is_object() || (value.is_array() && !value.empty() && value.front().is_object());
    if (!nested) {
      const std::string text = shown(value);
      const bool block = text.find('\n') != std::string::npos;
      fmt::print("{:{}}{:<{}}{}{}\n", "", indent, key, std::max(4, 28 - indent), block ? "\n" : "",
                 text);
      continue;
    }
    fmt::print("{:{}}{}\n", "", indent, key);
    if (value.is_object()) {
      print_facts(value, indent + 2);
    } else {
      for (const Facts& item : value) print_facts(item, indent + 2);
    }
  }
}

}  // namespace

void add_info(CLI::App& program) {
  CLI::App* command = program.add_subcommand("info",
                                             "Explain a file: body, checkpoint, frame, series, "
                                             "trajectory, scene, mesh, or a run's folder");
  struct Options {
    fs::path file;
    bool json = false;
    std::optional<int> parts;
    std::string partitioner = "auto";
  };
  auto options = std::make_shared<Options>();
  command->add_option("file", options->file, "File or folder")->required();
  command->add_flag("--json", options->json, "Print the content as JSON");
  CLI::Option* partition =
      command
          ->add_option("--partition", options->parts,
                       "Cut a scene into this number of parts by each method, and show their "
                       "exchanges")
          ->check(CLI::Range(1, 100'000));
  command
      ->add_option("--partitioner", options->partitioner,
                   "Partitioner whose parts are listed: metis, curve, bisection, or auto (the "
                   "best)")
      ->needs(partition)
      ->capture_default_str();
  command->footer(
      "Examples:\n"
      "  phyxel info out/dino\n"
      "  phyxel info scene.toml --partition 8\n"
      "  phyxel info out/dino/phyxels_000010.hdf --json");
  command->callback([options] {
    if (options->parts) {
      const Facts facts = partition_facts(options->file, *options->parts, options->partitioner,
                                          options->json ? nullptr : stderr);
      fmt::print("{}", options->json ? json_text(facts) + "\n" : partition_tables(facts));
      return;
    }
    const Facts facts = facts_of(options->file);
    if (options->json) {
      fmt::print("{}\n", json_text(facts));
    } else {
      print_facts(facts, 0);
    }
  });
}

}  // namespace phyxel::app
