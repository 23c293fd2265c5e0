/// Scenes of bodies that touch something, and what tests ask of them on their way.
#pragma once

#include <fmt/format.h>

#include <memory>
#include <string>
#include <vector>

#include "phyxel/contacts.hpp"
#include "phyxel/diagnostics.hpp"
#include "phyxel/solver.hpp"
#include "support/backend.hpp"
#include "support/scene_text.hpp"

namespace phyxel {

/// A scene on its way.
struct Way {
  Way(const std::string& text, double dt, Precision precision = Precision::double_, int threads = 0)
      : scene(parse_scene(text, "scene.toml")),
        model(build_model(scene)),
        backend(testing::make_test_backend(model, precision, threads)),
        solver(model, *backend, initial_state(model, scene, dt), scene.solver.method) {}
  std::vector<ContactReading> contacts() { return find_contacts(model, *backend, solver); }
  double energy() { return diagnose(model, *backend, solver).total_energy(); }
  /// The sum of weights times values of the phyxels.
  template <class Value>
  Vec3d sum(Value&& value) {
    const State state = solver.state();
    Vec3d all;
    for (Index i = 0; i < model.size(); ++i) all += model.mass[i] * value(i, state);
    return all;
  }
  double mass() const {
    double all = 0;
    for (const double m : model.mass) all += m;
    return all;
  }
  Vec3d momentum() {
    return sum([](Index i, const State& s) { return s.velocity[i]; });
  }
  Vec3d angular_momentum(Vec3d about) {
    return sum([&](Index i, const State& s) {
      return cross(model.position[i] + s.displacement[i] - about, s.velocity[i]);
    });
  }
  Vec3d centre() {
    return sum([&](Index i, const State& s) { return model.position[i] + s.displacement[i]; }) /
           mass();
  }

  Scene scene;
  Model model;
  std::unique_ptr<Backend> backend;
  Solver solver;
};

/// A body of a shape, with more keys.
inline std::string body(const std::string& name, const std::string& shape, const std::string& more,
                        double young = 1e5, double poisson = 0.3) {
  return fmt::format(
      "[[body]]\nname = '{}'\n{}{}[body.material]\nyoung = {}\npoisson = {}\ndensity = 1000\n",
      name, shape, more, young, poisson);
}

/// A block of 5 x 5 x 5 phyxels on its faces, 0.2 m wide, 8 kg.
inline std::string block(const std::string& more = "") {
  return "[[body]]\nname = 'block'\nshape = 'block'\nsize = [0.2, 0.2, 0.2]\nspacing = 0.05\n"
         "lattice = 'nodes'\n" +
         more + "[body.material]\nyoung = 1e5\npoisson = 0.3\ndensity = 1000\nviscosity = 0.004\n";
}
inline constexpr double dt = 5e-4;  // a tenth of the largest stable step without viscosity
inline const std::string end = "[time]\nend = 1\n";
inline std::string obstacle(const std::string& keys) { return "[[obstacle]]\n" + keys; }

/// The energy that bodies have lost to friction and impacts [J].
inline double energy_lost(const std::vector<ContactReading>& contacts) {
  double lost = 0;
  for (const ContactReading& c : contacts) lost += c.friction_heat + c.impact_loss;
  return lost;
}

/// The momentum of a body over its mass [m/s].
inline Vec3d velocity_of(Way& way, std::size_t part) {
  const State state = way.solver.state();
  Vec3d sum;
  double mass = 0;
  for (Index i = way.model.parts[part].begin; i < way.model.parts[part].end; ++i) {
    sum += way.model.mass[i] * state.velocity[i];
    mass += way.model.mass[i];
  }
  return sum / mass;
}

}  // namespace phyxel
