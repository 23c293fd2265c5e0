/// Energies, momenta and the detection of unstable runs.
#pragma once

#include <optional>
#include <string>

#include "phyxel/backend.hpp"
#include "phyxel/model.hpp"
#include "phyxel/state.hpp"

namespace phyxel {

class Solver;

/// Energies, conserved quantities and a finiteness check of a backend's present state. Sums run in
/// double and exactly, so they do not depend on the number of threads or ranks; a device that sums
/// itself has its own. Of a share, those of the whole model: collective.
Diagnostics diagnose(const Model& model, Backend& backend, const Instant& now);
/// The same at the present instant of a solver, with what contact has lost since t = 0. Of a share:
/// for a solver that was made with the model.
/// @throws DivergedError as `check_contact_speeds`
Diagnostics diagnose(const Model& model, Backend& backend, const Solver& solver);
/// Diagnostics after `step` Verlet steps of size `dt` [s].
inline Diagnostics diagnose(const Model& model, Backend& backend, std::int64_t step, double dt) {
  return diagnose(model, backend, {step, static_cast<double>(step) * dt, dt / 2});
}

/// The phyxel that is stiffest at the backend's present displacements, over all ranks. Collective.
Stiffening find_stiffening(const Model& model, Backend& backend);

/// True if a material can become stiffer than it is at rest: all can but linear laws.
bool stiffens(const Material& material);

/// A description of a phyxel: global id, body and rest position [m]. Collective on a share.
std::string describe_phyxel(const Model& model, Index global_id);

/// Von Mises equivalent of the Cauchy stress [Pa] and det F of every phyxel, shape [n]; either
/// pointer may be null.
void stress_fields(const Model& model, Backend& backend, std::vector<double>* von_mises,
                   std::vector<double>* volume_ratio);

/// The speed of pressure waves at rest [m/s]: sqrt((λ + 2μ + k_v) / ρ) of Hooke's law.
double pressure_wave_speed(const Material& material);

class StepControl;

/// Detects unstable runs and stops them.
class StabilityWatch {
 public:
  /// The model must outlive this. Of a share: collective. @throws as `check`
  /// @param start diagnostics of the state from which the run steps
  /// @param before reference values of the run that `start` continues; none: the run begins here
  StabilityWatch(const Model& model, const Diagnostics& start,
                 const std::optional<Watched>& before = std::nullopt);

  /// @param control whose looks tell where it began; null: the fastest phyxel of the last good
  ///   state is named. Of a share: collective.
  /// @throws DivergedError, saying which phyxel and when, if the state is not finite, if a phyxel
  ///   moves faster by far than waves, gravity, loads and motions can make it, or if a conservative
  ///   scene has gained more energy than it has exchanged so far.
  void check(const Diagnostics& now, const StepControl* control = nullptr);

  /// The reference values; every state that `check` finds good updates the peak energy.
  const Watched& watched() const { return watched_; }
  /// The speed limit at a time [m/s]: three times the wave speed or, if larger, ten times the
  /// driving speed, plus the speed that gravity and loads can have added by then.
  double speed_limit(double time) const;

 private:
  const Model& model_;
  Watched watched_;
  double wave_speed_ = 0;     ///< Pressure wave speed of the fastest part [m/s].
  double driving_speed_ = 0;  ///< Largest speeds of the start and of all motions, summed [m/s].
  double acceleration_ = 0;   ///< Largest accelerations by gravity and all loads, summed [m/s²].
  double contact_noise_ = 0;  ///< Energy of overlaps that bodies may have at the start [J].
  bool conservative_;
  std::optional<Diagnostics> good_;  // the last one found good
};

/// True if the model conserves total energy: it has no damping, no motion and no changing load.
bool is_conservative(const Model& model);

}  // namespace phyxel
