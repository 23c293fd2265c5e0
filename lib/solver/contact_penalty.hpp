/// Contact with obstacles in searches by Newton's method.
#pragma once

#include <span>
#include <vector>

#include "model/owned_vectors.hpp"
#include "phyxel/model.hpp"
#include "phyxel/physics/contact_penalty.hpp"
#include "solver/step_sums.hpp"

namespace phyxel {

/// The obstacles of a model at an instant.
using PlacedObstacles = std::vector<ObstacleStep>;

/// Returns the obstacles at a fraction of their paths. Oscillations and steady motions have no end,
/// and are left out.
PlacedObstacles obstacles_after(const Model& model, double share);

/// Returns the obstacles at a time [s], with their velocities over the last `span` [s].
PlacedObstacles obstacles_over(const Model& model, double time, double span);

/// The contact layer of a model by penalties: forces, their stiffness, and their energy.
class ContactPenalty {
 public:
  using Vector = OwnedVectors::Vector;

  /// @param model must outlive this
  explicit ContactPenalty(const Model& model);

  bool empty() const { return model_.obstacles.empty(); }
  /// Finds the stiffness at displacements u.
  void linearise(const PlacedObstacles& at, const Vector& u);
  /// Adds the forces at displacements u [N].
  void add(const PlacedObstacles& at, const Vector& u, Vector& force) const;
  /// The energy at displacements u [J]. Collective on a share.
  double energy(const PlacedObstacles& at, const Vector& u) const;
  /// The sum of the squared normal forces of the last `linearise` [N²]. Collective on a share.
  double squared_size() const;
  /// Adds the stiffness of the last `linearise` times v [N].
  void add_stiffness_times(const Vector& v, Vector& out) const;
  /// Replaces a / s by the solution x of (s + stiffness) x = a for the phyxels in contact.
  /// @param s stiffness of each phyxel [N/m]. @param free 1 along free axes, 0 along others
  void precondition(std::span<const double> s, const Vector& free, const Vector& a,
                    Vector& x) const;
  /// The depth of the deepest phyxel at displacements u, as a share of its support. Collective on a
  /// share.
  double largest_depth(const PlacedObstacles& at, const Vector& u) const;
  /// Adds to the sums of each obstacle what its forces at u do over a time [s] (`ContactTerms`).
  /// @param sums of the obstacles, one after the other
  void add_to(const PlacedObstacles& at, const Vector& u, double time,
              std::span<ExactSum> sums) const;

 private:
  /// Calls each(k, o, force, x) for the phyxels of the layer that are inside an obstacle at u; k
  /// counts phyxels of the layer and o obstacles, and x is the phyxel's place [m].
  template <class Each>
  void for_each_force(const PlacedObstacles& at, const Vector& u, Each&& each) const;

  const Model& model_;
  std::vector<double> stiffness_;  // [N/m], shape [layer]
  std::vector<Mat3d> blocks_;      // [N/m], shape [layer]
  double normal_forces_ = 0;       // squared [N²], of this rank
};

}  // namespace phyxel
