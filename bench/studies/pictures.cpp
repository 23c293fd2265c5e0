#include "pictures.hpp"

#include <memory>

#include "accuracy/bar.hpp"
#include "compose.hpp"
#include "phyxel/model.hpp"
#include "phyxel/physics/laws.hpp"
#include "phyxel/solver.hpp"
#include "png_file.hpp"
#include "studies.hpp"

namespace phyxel::studies {
namespace {

using app::Discretisation;
using app::Filling;

constexpr double seconds = 0.8;  // one swing and half of the swing back

/// The phyxels of a soft bar that hangs from one end, after its first swing.
FrameData swung(const Discretisation& d) {
  Scene scene = app::clamped(app::bar(d, 1, 0.2));
  Material& material = scene.bodies[0].material;
  material.young = 2.5e5;
  material.law = NeoHookean<double>::name;
  scene.gravity = {0, 0, -9.81};
  const Cloud cloud = app::cloud_of(scene, d);
  const Model model = build_model(scene, std::span(&cloud, 1));
  const double dt = 0.5 * step_limit(model).largest_step;
  const auto backend = make_cpu_backend(model, Precision::double_);
  Solver solver(*backend, initial_state(model, scene, dt));
  while (solver.time() < seconds) solver.step();
  FrameData frame;
  const State state = solver.state();
  for (std::size_t i = 0; i < state.displacement.size(); ++i) {
    frame.point.push_back(model.position[i] + state.displacement[i]);
  }
  return frame;
}

/// Lets the bar swing and draws it. @throws OutputError
void draw_pictures(const std::filesystem::path& folder) {
  const Discretisation ways[] = {{.across = 5},
                                 {.hourglass = 0.1, .across = 5},
                                 {.filling = Filling::mesh, .hourglass = 0.1, .across = 5}};
  std::vector<FrameData> frames;
  app::CameraFit fit(480, 480, {0, 1, 0}, {0, 0, 1});
  for (const Discretisation& d : ways) {
    frames.push_back(swung(d));
    fit.include(frames.back().point);
  }
  const app::Setting setting{.camera = fit.camera(),
                             .spacing = 0.2 / ways[0].across,
                             .extent = fit.extent(),
                             .time_decimals = -1};
  for (std::size_t k = 0; k < frames.size(); ++k) {
    app::write_png(folder / accuracy_pictures()[k].file,
                   app::draw_picture(nullptr, &frames[k], setting));
  }
}

}  // namespace

const std::vector<AccuracyPicture>& accuracy_pictures() {
  static const std::vector<AccuracyPicture> pictures = {
      {"accuracy_swing_plain.png", "nodes, plain"},
      {"accuracy_swing_held.png", "nodes, α = 0.1"},
      {"accuracy_swing_mesh.png", "mesh, α = 0.1"}};
  return pictures;
}

void add_pictures(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "pictures", "Draw pictures of a bar with and without hourglass control");
  auto results = std::make_shared<std::string>("docs/results");
  command->add_option("--results", *results, "Folder of the tables")->capture_default_str();
  command->footer(
      "Example:\n"
      "  phyxel_studies pictures");
  command->callback([results] { draw_pictures(*results); });
}

}  // namespace phyxel::studies
