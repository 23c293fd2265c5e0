/// phyxel render: pictures and videos of a trajectory.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <nlohmann/json.hpp>

#include "command.hpp"
#include "outside_text.hpp"
#include "phyxel/error.hpp"
#include "picture.hpp"
#include "trajectory_options.hpp"

namespace phyxel::app {
namespace {

struct RenderOptions {
  std::filesystem::path input, out;
  VideoRequest video;
  PictureRequest request;
  std::vector<double> view, up, position, target;
  ColourOptions colours;
  bool no_phyxels = false, no_surface = false, no_floor = false, force = false, json = false;
};

std::optional<Vec3d> vector_of(const std::vector<double>& values, const char* option) {
  if (values.empty()) return std::nullopt;
  if (values.size() != 3) {
    throw InputError(fmt::format("{}: {} numbers; allowed: three, as in {} -1,2,-0.6", option,
                                 values.size(), option));
  }
  return Vec3d{values[0], values[1], values[2]};
}

void video_command(const RenderOptions& options, const PictureRequest& request) {
  const std::size_t pictures = render_video(options.input, options.video, request, options.force);
  const std::string file = options.video.file.string();
  const double seconds =
      static_cast<double>(pictures) / static_cast<double>(options.video.pictures_per_second);
  if (options.json) {
    fmt::print("{}\n", json_text({{"video", file}, {"pictures", pictures}, {"seconds", seconds}}));
    return;
  }
  fmt::print("{}: {} picture{}, {:.3g} s\n", file, pictures, pictures == 1 ? "" : "s", seconds);
}

void render_command(const RenderOptions& options) {
  PictureRequest request = options.request;
  request.camera.view = vector_of(options.view, "--view");
  const CameraOptions& camera = options.request.camera;  // ranges of options let NaN pass
  for (const auto& [name, angle] :
       {std::pair{"--orbit", camera.orbit}, std::pair{"--field-of-view", camera.field_of_view}}) {
    if (angle && !std::isfinite(*angle)) {
      throw InputError(fmt::format("{} {}: allowed: a finite angle in degrees", name, *angle));
    }
  }
  request.camera.up = vector_of(options.up, "--up");
  request.camera.position = vector_of(options.position, "--position");
  request.camera.target = vector_of(options.target, "--target");
  const ColourRequest colours = options.colours.request();
  request.colour = colours.field;
  request.range = colours.range;
  request.scale = colours.scale;
  request.phyxels = !options.no_phyxels;
  request.surface = !options.no_surface;
  request.floor = !options.no_floor;
  if (!request.phyxels && !request.surface) {
    throw InputError("--no-phyxels --no-surface: nothing is left to draw; allowed: one of the two");
  }
  if (!options.video.file.empty()) return video_command(options, request);
  std::filesystem::path folder = options.out;
  if (folder.empty()) {
    const bool directory = std::filesystem::is_directory(options.input);
    folder = (directory ? options.input : options.input.parent_path()) / "pictures";
  }
  const auto files = render(options.input, folder, request, options.force);
  if (options.json) {
    nlohmann::ordered_json pictures = nlohmann::ordered_json::array();
    for (const auto& file : files) pictures.push_back(file.string());
    fmt::print("{}\n", json_text({{"pictures", pictures}}));
    return;
  }
  fmt::print("{} picture{}: {}", files.size(), files.size() == 1 ? "" : "s",
             files.front().string());
  fmt::print("{}{}\n", files.size() > 1 ? " ... " : "",
             files.size() > 1 ? files.back().string() : std::string());
}

/// @param out the option of the folder of pictures, which a video excludes
void add_video_options(CLI::App& command, RenderOptions& options, CLI::Option* out) {
  auto* video = command
                    .add_option("--video", options.video.file,
                                "Write a video instead, by ffmpeg: .mp4, .mov, .mkv, .webm or .gif")
                    ->excludes(out);
  command
      .add_option("--fps", options.video.pictures_per_second,
                  "Pictures per second of the video, whatever the interval of the frames")
      ->check(CLI::Range(1, 240))
      ->capture_default_str()
      ->needs(video);
}

/// Adds the options that replace the camera of the scene.
void add_camera_options(CLI::App& command, RenderOptions& options) {
  const auto vector = [&](const char* name, std::vector<double>& value, const char* meaning) {
    command.add_option(name, value, meaning)->delimiter(',')->allow_extra_args(false);
  };
  CameraOptions& camera = options.request.camera;
  vector("--view", options.view,
         "Direction of the camera: x,y,z (default: the scene's). It sees the whole motion, unless "
         "--position or --target is given");
  vector("--up", options.up, "Vertical direction of the picture: x,y,z (default: the scene's)");
  vector("--position", options.position, "Place of the camera [m]: x,y,z (default: the scene's)");
  vector("--target", options.target,
         "Point in the middle of the picture [m]: x,y,z (default: the scene's)");
  command
      .add_option("--field-of-view", camera.field_of_view,
                  "Angle of view along the shorter side of the picture [degrees] (default: the "
                  "scene's, else 30)")
      ->check(CLI::Range(1.0, 150.0));
  command
      .add_option(
          "--orbit", camera.orbit,
          "Angle by which the camera turns about the vertical, around the target, from the "
          "first picture to the last [degrees] (default: the scene's); a video of one frame "
          "then takes four seconds")
      ->check(CLI::Range(-36000.0, 36000.0));
  command.add_option("--follow", camera.follow,
                     "Name of a body, or of a free rigid one, that the camera moves with (default: "
                     "the scene's; '' "
                     "for none)");
}

}  // namespace

void add_render(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "render",
      "Draw PNG pictures or a video of a trajectory: the shaded surface, phyxels as dots");
  auto options = std::make_shared<RenderOptions>();
  PictureRequest& request = options->request;
  command
      ->add_option("input", options->input, "Folder of a run, a .series file, or one frame (.hdf)")
      ->required();
  auto* out = command->add_option("--out", options->out,
                                  "Folder for the pictures (default: pictures/ beside the frames)");
  add_frame_options(*command, request.choice);
  command->add_option("--width", request.width, "Width [px]")->capture_default_str();
  command->add_option("--height", request.height, "Height [px]")->capture_default_str();
  add_camera_options(*command, *options);
  add_colour_options(*command, options->colours);
  add_video_options(*command, *options, out);
  command->add_option("--scene-folder", request.scene_folder,
                      "Folder of the scene, with the meshes of its obstacles (default: the current "
                      "one)");
  command->add_flag(
      "--no-phyxels", options->no_phyxels,
      "Draw the surface only, without dots of phyxels, which are drawn where they are 8 px "
      "apart at least");
  command->add_flag("--no-surface", options->no_surface, "Draw the phyxels only, as spheres");
  command->add_option(
      "--cut", request.cut,
      "Plane that opens the bodies: x, y or z=position [m], which cuts away the side of the camera "
      "of the first picture, or a point and a normal, x,y,z,nx,ny,nz, which cuts away the side of "
      "the normal; with --follow the plane moves with the body");
  command->add_flag(
      "--no-floor", options->no_floor,
      "Draw no floor, as is drawn below the bodies of a scene without obstacles if the "
      "camera looks down");
  command->add_flag("--force", options->force, "Replace existing pictures");
  command->add_flag("--json", options->json, "The pictures' names as JSON, nothing else on stdout");
  command->footer(
      "Examples:\n"
      "  phyxel render out/dino --count 6\n"
      "  phyxel render out/dino --frames 0,10,-1 --view 0,1,0 --out pictures\n"
      "  phyxel render out/dino --colour speed --range 0,2\n"
      "  phyxel render out/dino --count 6 --colour von_mises --scale log\n"
      "  phyxel render out/dino --colour von_mises --cut y=0.1\n"
      "  phyxel render out/dino --position 0,-3,1 --target 0,0,0.5 --field-of-view 40\n"
      "  phyxel render out/dino --video dino.mp4 --view 0,1,0 --follow dino\n"
      "  phyxel render out/dino --video dino.mp4 --orbit 90\n"
      "  phyxel render out/dino/surface_000010.hdf");
  command->callback([options] { render_command(*options); });
}

}  // namespace phyxel::app
