/// The preconditioner of the linear equations of Newton's method.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "model/owned_vectors.hpp"
#include "phyxel/model.hpp"
#include "solver/body_lattices.hpp"

namespace phyxel {

/// An approximate inverse of the stiffness of a model. It consists of the stiffness of single
/// phyxels, for rough displacements, and of lattices behind each body, for smooth ones,
///
///   z = Q (B⁻¹ + P V Pᵀ) Qᵀ r + E T⁺ Eᵀ r,
///
/// where P takes the displacements of nodes to phyxels, and V is a V-cycle. E moves whole bodies
/// along axes along which nothing holds them; Q = 1 - E (EᵀDE)⁻¹ EᵀD leaves such motions out, with
/// D the inertia of phyxels, or 1 without; and T is the stiffness against them, by inertia and
/// contact. Where inertia is no less than a tenth of the stiffness of phyxels, B is enough.
/// Conjugate gradients then need about as many iterations for many phyxels as for few. The first
/// part is that of small strains at rest, with inertia and contact; lattices turn with the body.
class Preconditioner {
 public:
  using Vector = OwnedVectors::Vector;
  /// Stiffness that contact adds to phyxels of this rank [N/m].
  using Blocks = std::map<Index, Mat3d>;

  /// Collective on a share. All arguments must outlive this.
  Preconditioner(const Model& model, const OwnedVectors& vectors);

  /// Sets the terms beside elasticity. Collective on a share.
  /// @param free 1 along free axes, 0 along others, shape [n]
  /// @param weight inertia of phyxels [kg/s²], shape [n] or empty
  /// @param contact blocks of phyxels in contact
  /// @param gradient of displacement, shape [n]; empty: small
  void set(const Vector& free, std::span<const double> weight, const Blocks& contact,
           std::vector<Mat3d> gradient);

  /// z = M⁻¹ r. Collective on a share.
  void apply(const Vector& r, Vector& z);

 private:
  /// The motion of a body as a whole.
  struct Whole {
    Vec3d loose;                ///< 1 along axes along which nothing holds it, 0 along others.
    double shares = 1;          ///< EᵀDE, of each axis.
    Mat3d compliance;           ///< T⁺ [m/N].
    bool uses_lattices = true;  ///< False if inertia outweighs stiffness.
  };
  void find_wholes(std::span<const Mat3d> more);
  void project(Vector& z, const std::vector<Vec3d>& totals) const;
  double share_of(Index i) const { return weight_.empty() ? 1 : weight_[i]; }
  std::vector<std::span<std::int64_t>> gathered(const Vector& r, double largest, double& by);

  const Model& model_;
  const OwnedVectors& vectors_;
  Vector free_;
  std::vector<double> weight_;
  Blocks contact_;
  std::vector<Mat3d> gradient_;         // of displacement; empty: at rest
  std::vector<Mat3d> block_, inverse_;  // of each phyxel
  std::vector<BodyLattices> lattices_;  // of each body
  std::vector<Whole> wholes_;           // of each body
  bool any_loose_ = false;
  std::vector<std::int64_t> sums_;
};

}  // namespace phyxel
