/// Recovered gradients: displacement gradients of second order for output, on the surface as well.
#pragma once

#include <vector>

#include "phyxel/model.hpp"
#include "phyxel/neighbourhood.hpp"

namespace phyxel {

/// A recovery of gradients. The linear fit of a phyxel's neighbourhood is of second order inside,
/// where neighbours lie on all sides, but of first order on the surface: a quadratic term ½ xᵀ H x
/// of the displacement leaves A⁻¹ Σ w x ½ xᵀ H x there. Recovery subtracts it, with H from the
/// linear fit of the neighbours' gradients, in four sweeps. Each sweep leaves about half of the
/// error, so that the last change once more (Aitken's extrapolation) is most of what is left. For
/// quadratic displacements the limit is exact. Neighbours of another part do not count, so that
/// gradients may jump where the material does.
///
/// Forces and energies do not change. Costs neighbour lists of its own where a device has those of
/// the model.
class Recovery {
 public:
  /// @param model or a rank's share; must outlive this
  explicit Recovery(const Model& model);
  /// Finds the gradients of displacements, without unit, shape [n]; those of ghosts are undefined.
  /// A phyxel without neighbours has none. Collective on a share.
  /// @param displacement [m], shape [n]; ghosts receive their owners' values
  std::vector<Mat3d> gradients(std::vector<Vec3d> displacement) const;

 private:
  const Model& model_;
  Csr rows_;  // of phyxels that are no ghosts: neighbours of the same part, by their global index
  std::vector<Sym3d> inverse_moment_;  // of these [1/m²], shape [n]
};

}  // namespace phyxel
