/// Contact with obstacles and of bodies in searches by Newton's method.
#pragma once

#include <functional>
#include <map>
#include <span>
#include <vector>

#include "model/contact_groups.hpp"
#include "model/owned_vectors.hpp"
#include "phyxel/model.hpp"
#include "phyxel/physics/contact_penalty.hpp"
#include "solver/body_penalty.hpp"
#include "solver/slip.hpp"
#include "solver/step_sums.hpp"

namespace phyxel {

/// The obstacles of a model at an instant.
using PlacedObstacles = std::vector<ObstacleStep>;

/// Returns the obstacles at a fraction of their paths, with their ways since a smaller one as their
/// velocities over a step of 1. Oscillations and steady motions have no end, and are left out.
PlacedObstacles obstacles_after(const Model& model, double share, double since);

/// Returns the obstacles at a time [s], with their velocities over the last `span` [s].
PlacedObstacles obstacles_over(const Model& model, double time, double span);

/// Returns the obstacles at the end of the step of `dt` [s] from a time [s], free bodies in their
/// states.
PlacedObstacles obstacles_now(const Model& model, double time, double dt,
                              std::span<const RigidState> rigid);

/// Stiffness of penalties, times that of a phyxel against its neighbours. A layer of phyxels on a
/// face, s apart, then is as stiff as a fifth of s of the body.
inline constexpr double share_of_stiffness = 40;

/// The contact layers of a model by penalties: forces, their stiffness, and their energy.
class ContactPenalty {
 public:
  using Vector = OwnedVectors::Vector;

  /// @param model must outlive this
  explicit ContactPenalty(const Model& model);

  bool empty() const { return model_.obstacles.empty() && bodies_.empty(); }
  /// True if something has friction.
  bool rubs() const { return obstacles_rub_ || bodies_.rubs(); }
  /// True if there are gaps whose linear form a search may keep over some steps (`Renewal`).
  bool can_keep() const { return !bodies_.empty(); }
  /// True if points have moved so little to displacements u since the last renewal of all that the
  /// linear form of gaps may be kept. Collective on a share.
  bool may_keep(const Vector& u) const;
  /// True if friction is that of normal forces that are held.
  bool holds_normals() const { return record_.holds(); }
  /// As of `RubbingRecord`, and sets friction anew.
  void renew_normals(double share);
  /// The largest change of normal forces since they are held, as a share of the largest one [1].
  /// Collective on a share.
  double unrest() const;
  /// Finds the stiffness at displacements u, and how bodies touch there; it stays so until the next
  /// call. Collective on a share.
  /// @param slip what slip is; not used without friction. @param gradient_of_u returns the
  /// gradients of displacement, for bodies that touch each other, where all is renewed
  void linearise(const PlacedObstacles& at, const Vector& u, const SlipMeasure& slip,
                 Renewal renewal, const std::function<std::vector<Mat3d>()>& gradient_of_u);
  /// Begins a search anew, on which earlier searches have no influence.
  void forget();
  /// Gives the points that slide at the displacements of the last `linearise` the kinetic friction,
  /// which counts from the next one on. Collective on a share. @returns true if that changes forces
  bool begin_sliding();
  /// Replaces the gaps between bodies at u, the displacements of the last `linearise`, by better
  /// ones to start a step of Newton's method from. @returns true if that changes forces
  bool mix(const Vector& u, double share) { return bodies_.mix(u, share); }
  /// Adds the forces at displacements u [N]. Collective on a share, as all that follow.
  void add(const PlacedObstacles& at, const Vector& u, Vector& force) const;
  /// The energy at displacements u [J].
  double energy(const PlacedObstacles& at, const Vector& u) const;
  /// The sum of the squared normal forces of the last `linearise` [N²].
  double squared_size() const;
  /// Adds the stiffness of the last `linearise` times v [N].
  void add_stiffness_times(const Vector& v, Vector& out) const;
  /// The stiffness of the last `linearise` of phyxels in contact against themselves [N/m].
  const std::map<Index, Mat3d>& held_blocks() const { return held_; }
  /// The depth of the deepest phyxel at displacements u, those of the last `linearise`, as a share
  /// of its support.
  double largest_depth(const PlacedObstacles& at, const Vector& u) const;
  /// Adds to the sums of each obstacle and body what the forces at u, the displacements of the last
  /// `linearise`, do over a time [s] (`ContactTerms`).
  /// @param velocity of each phyxel in that time [m/s]
  /// @param sums of the obstacles, one after the other, and of the bodies
  void add_to(const PlacedObstacles& at, const Vector& u, const Vector& velocity, double time,
              std::span<ExactSum> sums) const;
  const BodyPenalty& bodies() const { return bodies_; }

 private:
  /// Calls each(k, o, force, x) for the phyxels of the layer that are inside an obstacle at u; k
  /// counts phyxels of the layer and o obstacles, and x is the phyxel's place [m].
  template <class Each>
  void for_each_force(const PlacedObstacles& at, const Vector& u, Each&& each) const;
  /// A phyxel of the layer that rubs on an obstacle.
  struct Rubbing : RubbingContact {
    std::size_t phyxel = 0;    ///< Its number in the layer.
    std::size_t obstacle = 0;  ///< Number of the obstacle.
    Vec3d surface;  ///< Displacement of a phyxel that sticks to the obstacle's surface [m].
    RubbingRecord::Key key() const {
      return {static_cast<Index>(phyxel), static_cast<Index>(obstacle)};
    }
  };
  void find_rubbing(const PlacedObstacles& at, const Vector& u, const SlipMeasure& slip);
  /// Friction at displacements u.
  PenaltyForce friction_of(const Rubbing& rubbing, const Vector& u) const;

  const Model& model_;
  std::vector<LayerGroup> groups_;
  double largest_support_ = 0;     // of phyxels of the layer [m]
  std::vector<double> stiffness_;  // [N/m], shape [layer]
  std::vector<Mat3d> blocks_;      // [N/m], shape [layer]
  double normal_forces_ = 0;       // squared [N²], of this rank
  bool obstacles_rub_ = false, have_two_frictions_ = false;
  std::vector<Rubbing> rubbing_;  // by obstacle, then by phyxel
  RubbingRecord record_;
  double slip_share_ = 0;  // as of `SlipMeasure`
  BodyPenalty bodies_;
  std::map<Index, Mat3d> held_;  // stiffness of phyxels in contact against themselves [N/m]
};

}  // namespace phyxel
