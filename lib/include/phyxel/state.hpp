/// The variables of a simulation that change from step to step, which checkpoints hold.
#pragma once

#include <array>
#include <compare>
#include <string>
#include <vector>

#include "phyxel/rigid.hpp"
#include "phyxel/types.hpp"

namespace phyxel {

/// Record of the looks that `StepControl` takes at bodies that stiffen. A state carries the
/// record, so that a resumed run looks at the same steps as the unbroken one, and finds the same.
struct Looks {
  std::int64_t next = 0;       ///< Step of the next look.
  std::int64_t last = -1;      ///< Step of the last look; -1: none was taken.
  double ratio = 1;            ///< Stiffening found by the last look.
  double change = 0;           ///< Recent peak of the stiffening's rate of change [1/step].
  std::int64_t measured = -1;  ///< Step at which the stability limit was last found; -1: never.
  double measured_ratio = 1;   ///< Stiffening at that step.
  double measured_share = 0;   ///< (dt / limit)² at that step.
  std::int64_t apart = 0;      ///< Number of steps after which the limit is found again.
  /// Last step at which a step of twice the size was found too long; -1: never.
  std::int64_t too_long = -1;
  std::int64_t doublings = 0;  ///< Number of times that the step was doubled since t = 0.

  /// Rewrites all step counts for a step of half the size: the same times have twice the numbers.
  void halve_step();
  /// Rewrites all step counts for a step of twice the size, and counts it.
  void double_step();
  bool operator==(const Looks&) const = default;
};

/// Reference values by which `StabilityWatch` judges a run. Checkpoints carry them, so that a
/// resumed run is judged as the unbroken one.
struct Watched {
  double start_energy = 0;  ///< Total energy at t = 0 [J].
  double start_speed = 0;   ///< Largest speed at t = 0 [m/s]; NaN: unknown.
  /// Largest kinetic + elastic energy so far [J]. A checkpoint counts the start and the frames
  /// only, because a resumed run looks at other steps between frames than the unbroken run did.
  double peak_energy = 0;
  bool operator==(const Watched&) const = default;
};

/// One number of every phyxel's history, by its name (`HistoryNumber`).
struct HistoryColumn {
  std::string name;
  std::vector<double> values;  ///< Shape [n]; 0 where a phyxel's law has no such number.
  bool operator==(const HistoryColumn&) const = default;
};

/// Global ids of two phyxels.
using PhyxelPair = std::array<Index, 2>;

/// A phyxel that has broken pairs and carries stress with a part of its volume.
struct WornPhyxel {
  Index phyxel = 0;    ///< Global id.
  double carried = 1;  ///< That share of its volume.
  auto operator<=>(const WornPhyxel&) const = default;
};

/// The state of all phyxels. A `float` run's values are exactly representable as float.
struct State {
  std::vector<Vec3d> displacement;  ///< u(t) [m], shape [n, 3]; never the absolute position.
  /// v(t - dt/2) [m/s], shape [n, 3]: (u(t) - u(t - dt)) / dt; of implicit steps v(t).
  std::vector<Vec3d> velocity;
  /// What the laws remember, column by column (phyxel/history.hpp). Empty for the virgin material,
  /// and for laws that remember nothing.
  std::vector<HistoryColumn> history;
  /// Time from the history to the displacements [s]: that of the last step; 0: they belong
  /// together, so that nothing has a rate; `endless_time` of a search for rest.
  double history_interval = 0;
  double time = 0;  ///< t [s] = step * dt.
  std::int64_t step = 0;
  double dt = 0;  ///< [s]
  Looks looks;
  /// What supports and obstacles have done in earlier steps, by the rule of `Solver::step_sums`:
  /// words of exact sums over all ranks. Empty if no support moves and there is no obstacle.
  std::vector<std::int64_t> step_sums;
  /// The states of the free rigid bodies, in the order of the model's obstacles. Empty: they start.
  std::vector<RigidState> rigid;
  /// The broken pairs of phyxels, by global ids, ascending, the smaller id first. Of a share: those
  /// of which this rank steps a phyxel, and perhaps others (`Solver::state`: all).
  std::vector<PhyxelPair> broken;
  /// The phyxels of broken pairs that carry stress with less than their volume, by ascending ids,
  /// likewise.
  std::vector<WornPhyxel> worn;
};

/// Time level of a backend's state. Velocities are stored at `time - lag` (lag is dt/2 for
/// leapfrog).
struct Instant {
  std::int64_t step = 0;
  double time = 0;  ///< [s]
  double lag = 0;   ///< [s]
};

/// Deformed surfels.
struct SurfelState {
  std::vector<Vec3d> position;  ///< [m], shape [n_surfels, 3].
  std::vector<Vec3d> normal;    ///< Unit, shape [n_surfels, 3].
};

/// The phyxel that is stiffest against its own state at rest.
struct Stiffening {
  /// Upper bound of the stiffness of plane waves over that at rest (physics/laws.hpp), or of their
  /// viscosity if that has grown more; infinite if a displacement is not finite.
  double ratio = 1;
  double stretch = 1;  ///< Its largest principal stretch.
  Index phyxel = -1;   ///< Its global id; -1: there is no phyxel.
};

/// The reaction of the support of one set of phyxels, an entry of `fixed` or `motion` of a body, at
/// one instant.
struct Reaction {
  std::string body;  ///< Name of the body.
  std::string set;   ///< Entry of the body, e.g. "fixed 1", "motion 2".
  Vec3d centre;      ///< Centre of mass of the set at rest [m], about which the torque is taken.
  Vec3d force;       ///< Force of the support on the body [N].
  Vec3d torque;      ///< Torque of these forces about `centre`, on present positions [N m].
  /// Work that the support has done on the body since t = 0 [J]; NaN for a set that a search for
  /// equilibrium has moved, which follows no path.
  double work = 0;
};

/// Energies and conserved quantities at one instant, all bodies together.
struct Diagnostics {
  std::int64_t step = 0;
  double time = 0;              ///< [s]
  double kinetic_energy = 0;    ///< [J], at t (velocity centred with the force).
  double strain_energy = 0;     ///< [J]
  double volume_energy = 0;     ///< [J], of the volume-conservation term.
  double hourglass_energy = 0;  ///< [J], of hourglass control.
  double plastic_work = 0;      ///< [J], turned into heat since the virgin state.
  double viscous_work = 0;      ///< [J], turned into heat by viscosity since the start.
  double contact_loss = 0;      ///< [J], lost in impacts and by friction on obstacles since t = 0.
  double contact_energy = 0;    ///< [J], stored in the springs of contact by penalties.
  double fracture_energy = 0;   ///< [J], taken from the elastic energy where pairs broke.
  double gravity_energy = 0;    ///< [J], zero at rest.
  double load_energy = 0;       ///< [J], potential of the point and body loads.
  /// Energy of the deformation [J].
  double elastic_energy() const { return strain_energy + volume_energy + hourglass_energy; }
  /// Kinetic and elastic energy [J], without the potentials of gravity and loads.
  double kinetic_and_elastic_energy() const { return kinetic_energy + elastic_energy(); }
  /// Total energy [J], with what has become heat: constant in a scene without mass-proportional
  /// damping, motions and changing loads (`is_conservative`).
  double total_energy() const {
    return kinetic_and_elastic_energy() + plastic_work + viscous_work + contact_loss +
           contact_energy + fracture_energy + gravity_energy + load_energy;
  }
  Vec3d momentum;          ///< [kg m/s]
  Vec3d angular_momentum;  ///< [kg m^2/s] about the origin.
  Vec3d internal_force;    ///< Sum of internal forces [N]: zero but for rounding.
  Vec3d internal_torque;   ///< Sum of their torques [N m]: zero but for rounding with Green strain.
  double force_scale = 0;  ///< Sum of the internal forces' magnitudes [N].
  double torque_scale = 0;          ///< Sum of |x| |f| [N m].
  double largest_displacement = 0;  ///< [m]
  double largest_speed = 0;         ///< [m/s]
  Index fastest_phyxel = -1;
  Index inverted = 0;     ///< Phyxels whose deformation gradient has det F <= 0.
  Index bad_phyxel = -1;  ///< First phyxel whose state is not finite, or -1.
};

}  // namespace phyxel
