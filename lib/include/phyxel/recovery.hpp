/// Recovered gradients: displacement gradients for output that are better on the surface.
#pragma once

#include <vector>

#include "phyxel/model.hpp"
#include "phyxel/neighbourhood.hpp"

namespace phyxel {

/// A recovery of gradients. The linear fit of a phyxel's neighbourhood is of second order inside,
/// where neighbours lie on all sides; on the surface it is the gradient at a place beside the
/// phyxel, its neighbourhood's `shift`. A quadratic term ½ xᵀ H x of the displacement leaves
/// A⁻¹ Σ w x ½ xᵀ H x there. `gradients` subtracts it, with H from the linear fit of the
/// neighbours' gradients, in four sweeps. Each sweep leaves about half of the error, so that the
/// last change once more (Aitken's extrapolation) is most of what is left. For quadratic
/// displacements the limit is exact. Neighbours of another part do not count, so that gradients may
/// jump where the material does.
///
/// The balance of forces determines the traction of a phyxel's own stress on the surface better
/// than recovery does: `find_fields` keeps that traction (`Recovery::normal`).
///
/// Forces and energies do not change. Costs neighbour lists of its own where a device has those of
/// the model.
class Recovery {
 public:
  /// @param model or a rank's share; must outlive this
  explicit Recovery(const Model& model);
  /// Finds the gradients of displacements, without unit, shape [n]; those of ghosts are undefined.
  /// Collective on a share.
  /// @param displacement [m], shape [n]; ghosts receive their owners' values
  std::vector<Mat3d> gradients(std::vector<Vec3d> displacement) const;
  /// The share of a recovered gradient in the field of a phyxel: 1 on the surface, 0 where all
  /// neighbours lie evenly on all sides, and where the neighbours of the same material span fewer
  /// directions than all neighbours, as in a layer of one phyxel.
  double share(Index phyxel) const { return share_[phyxel]; }
  /// The outward normal at a phyxel on the surface, as its neighbourhood tells it; elsewhere some
  /// unit vector, or zero.
  Vec3d normal(Index phyxel) const { return normal_[phyxel]; }

 private:
  void find_rows();

  const Model& model_;
  Csr rows_;  // of phyxels that are no ghosts: their neighbours, by their global index
  std::vector<Sym3d> inverse_moment_;  // of those of the same part [1/m²], shape [n]
  std::vector<double> share_;          // shape [n]
  std::vector<Vec3d> normal_;          // shape [n]
};

}  // namespace phyxel
