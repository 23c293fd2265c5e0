/// A scene that runs while a user acts on it.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "setup.hpp"
#include "view/built_scene.hpp"
#include "view/hand.hpp"
#include "view/request.hpp"

namespace phyxel::app {

/// A scene with changed values. Settings that it has nothing for leave it as it is.
Scene with_settings(Scene scene, const Settings& settings);

/// Builds a scene that has changed values. @throws Error if it cannot be built
using SceneBuilder = std::function<std::shared_ptr<BuiltScene>(const Scene&)>;

/// The model, backend and solver of a scene, and what acts have made of them. All functions but
/// const ones are collective, and the same acts at the same steps give the same bits on any number
/// of ranks.
class LiveScene {
 public:
  /// @throws InputError for a search for equilibrium, which has no time; DeviceError
  LiveScene(Scene scene, CutOptions cut, bool unsafe_step);
  /// Takes over a scene that steps: its present state, to which a reset goes back, and its external
  /// forces, which go on acting. @throws InputError likewise
  LiveScene(Scene scene, std::shared_ptr<BuiltScene> steps, SceneBuilder builder);

  /// Takes `count` steps. @throws DivergedError
  void advance(std::int64_t count);
  /// Takes an act, except `save`, into effect. An act that is refused changes nothing.
  /// @throws InputError for a phyxel or a setting that the scene cannot have
  void apply(const Request& act);
  /// Finds energies and momenta, and checks the state. @throws DivergedError
  const Diagnostics& look();
  /// Lets go of what the hand holds, so that the scene can go on without this. @throws
  /// DivergedError
  void finish();

  /// The scene with all settings.
  const Scene& scene() const { return scene_; }
  const SharedModel& shared() const { return *built_->shared; }
  const Model& model() const { return built_->model(); }
  Backend& backend() const { return *built_->backend; }
  const Solver& solver() const { return *built_->solver; }
  /// What steps now; acts that change values replace it.
  const std::shared_ptr<BuiltScene>& built() const { return built_; }
  /// True if the acts began at the start of the scene.
  bool began_with_scene() const { return !taken_over_; }
  /// The result of the last look.
  const Diagnostics& now() const { return now_; }
  /// Number of steps since the start, which resets and changes of the step's size do not change.
  std::int64_t taken() const { return taken_; }
  /// The values that acts have set.
  const Settings& settings() const { return settings_; }
  /// True while the hand holds a body.
  bool is_held() const { return hand_.has_value(); }
  /// Work of the hand since the last reset [J], up to the last look while it holds a body.
  double hand_work() const { return worked_ + held_work_; }
  /// Impulse of the hand since the last reset [N s].
  Vec3d hand_impulse() const { return pushed_ + (hand_ ? hand_->impulse() : Vec3d{}); }

 private:
  void begin(std::shared_ptr<BuiltScene> built, const State& state);
  void set(const Settings& settings);
  void reset();
  void let_go();
  /// The state of a model for the next model, whose planned step it changes to one that fits the
  /// time.
  State carried_over(BuiltScene& from, BuiltScene& next) const;
  /// Changes velocities by a share of what a model's next step of Verlet's method adds.
  void move_velocities(BuiltScene& by, State& state, double share) const;
  void refresh_ghosts(State& state) const;

  const Scene given_;  // without settings
  Scene scene_;
  Settings settings_;
  SceneBuilder builder_;
  std::shared_ptr<BuiltScene> built_;
  std::optional<State> taken_over_;  // the state at the start, if it is not the scene's
  std::vector<Vec3d> forces_;        // external ones beside the hand's [N], or none
  std::optional<Hand> hand_;
  std::int64_t taken_ = 0;
  double worked_ = 0;     // by the hand, before it grabbed what it holds [J]
  double held_work_ = 0;  // since then, at the last look [J]
  Vec3d pushed_;          // by the hand before [N s]
  bool acted_ = false;    // since the last look, so that energies may have changed
  Diagnostics now_;
};

}  // namespace phyxel::app
