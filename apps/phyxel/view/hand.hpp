/// The hand of a user: a spring that pulls a part of a body.
#pragma once

#include <span>
#include <vector>

#include "phyxel/backend.hpp"
#include "phyxel/model.hpp"

namespace phyxel::app {

/// A damped spring between a place that a user moves and a patch of phyxels of one body, around the
/// phyxel that was grabbed. The force is shared over the patch by mass, and less towards its edge,
/// so that no phyxel is torn out. Weighted means of displacements and velocities are its ends. The
/// force is limited, and too soft a spring to shorten the stable step. Functions are collective;
/// the bits are the same on any number of ranks.
class Hand {
 public:
  /// Steps between two changes of the force.
  static constexpr int interval = 4;

  /// @param phyxel global id of the grabbed phyxel @param dt step [s]
  /// @param others external forces that act beside the hand's [N]: one for each phyxel of this
  ///   rank's model, or none; must outlive the hand
  /// @throws InputError for a phyxel that does not exist
  Hand(const Model& model, Index phyxel, double dt, std::span<const Vec3d> others = {});

  /// Moves the spring's end that the user holds. @param by [m] from where the patch was grabbed
  void move(Vec3d by) { by_ = by; }
  /// Number of steps after which the force is due to change; 0: now.
  int until_due() const { return pulls_ ? interval - since_ : 0; }
  /// Sets the forces of the spring for the next `interval` steps, by the present state.
  /// @param lag time by which velocities are older than displacements [s], as of `Instant`
  void pull(Backend& backend, double lag);
  /// Counts steps of `dt` [s] that have been taken, no more than were left until the next change.
  void stepped(int steps, double dt);
  /// Removes the hand's forces. @returns the work done on the body since the patch was grabbed [J]
  double let_go(Backend& backend, double lag);

  /// Work of the forces up to the present state [J].
  double work_until(const Backend& backend, double lag) const;
  /// Their impulse so far [N s].
  Vec3d impulse() const { return impulse_; }

 private:
  /// Means over the patch.
  struct Patch {
    Vec3d displacement;  ///< [m]
    Vec3d velocity;      ///< [m/s]
    Vec3d before;        ///< Displacement when it had this velocity [m].
  };
  Patch mean(const Backend& backend, double lag) const;
  /// The work of the present force since it was set [J]. Verlet's steps change kinetic energies by
  /// forces times the mean displacement of the steps before and after.
  double work_since_pull(const Patch& now) const;

  const Model& model_;
  std::span<const Vec3d> others_;
  std::vector<Index> phyxels_;  // of this rank's
  std::vector<double> share_;   // of the force that acts on each
  double stiffness_ = 0;        // [N/m]
  double damping_ = 0;          // [N s/m]
  double largest_force_ = 0;    // [N]
  Vec3d grabbed_;               // the patch's displacement at the start [m]
  Vec3d by_;                    // [m]
  bool pulls_ = false;
  int since_ = 0;            // steps since the force was set
  Vec3d force_, pulled_at_;  // present force [N], and `Patch::before` when it was set [m]
  double work_ = 0;
  Vec3d impulse_;
};

}  // namespace phyxel::app
