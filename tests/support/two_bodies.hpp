/// A small trajectory with known values: two bodies that move along x.
#pragma once

#include "phyxel/model.hpp"
#include "phyxel/recorder.hpp"
#include "phyxel/scene.hpp"

namespace phyxel::test {

/// Two bodies of two and three phyxels; the surface is one tetrahedron, of the second body.
inline Model two_bodies() {
  Model model;
  model.position = {{0, 0, 0}, {1, 0, 0}, {5, 0, 0}, {5, 1, 0}, {5, 0, 1}};
  model.mass = {1, 2, 3, 4, 5};
  model.volume = {0.1, 0.2, 0.3, 0.4, 0.5};
  model.parts.resize(2);
  model.parts[0].end = 2;
  model.parts[1] = {
      .name = "second", .body = 1, .begin = 2, .end = 5, .surfel_begin = 0, .surfel_end = 4};
  model.surfels.position = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  model.surfels.normal = {{-1, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  model.surfels.triangle = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}};
  return model;
}

/// A scene that writes every field to `directory`.
inline Scene two_bodies_scene(const std::filesystem::path& directory) {
  Scene scene;
  scene.title = "two bodies";
  scene.text = "title = \"two bodies\"\n";
  scene.time.end = 1;
  scene.output.directory = directory;
  scene.output.fields = {"displacement", "velocity", "von_mises", "volume_ratio", "mass", "volume"};
  return scene;
}

/// Frame number `k`, with everything moved by k/2 along x.
struct TwoBodiesFrame {
  TwoBodiesFrame(const Model& model, int k)
      : number(k), surfels{model.surfels.position, model.surfels.normal} {
    state.displacement.assign(5, Vec3d{0.5 * k, 0, 0});
    state.velocity.assign(5, Vec3d{0, 0.25 * k, 0});
    state.step = 10 * k;
    state.time = 0.1 * k;
    state.dt = 0.01;
    for (Vec3d& p : surfels.position) p.x += 0.5 * k;
  }
  /// Returns the frame, which refers to the data of this object.
  Frame frame() const {
    Frame frame;
    frame.state = &state;
    frame.surfels = &surfels;
    frame.fields[Quantity::von_mises].assign(5, 100.0 * number);
    frame.fields[Quantity::volume_ratio].assign(5, 1.0);
    frame.diagnostics.step = state.step;
    frame.diagnostics.time = state.time;
    frame.diagnostics.kinetic_energy = number;
    return frame;
  }

  int number;
  State state;
  SurfelState surfels;
};

}  // namespace phyxel::test
