/// The stiffness of single phyxels.
#pragma once

#include <vector>

#include "model/owned_vectors.hpp"
#include "phyxel/model.hpp"

namespace phyxel {

/// Lamé's parameters of a part at small strains [Pa]; of laws that are not isotropic, those of an
/// isotropic one of like stiffness.
struct LameParameters {
  double lambda = 0, mu = 0;
};
LameParameters small_strain_parameters(const Part& part);

/// The stiffness of each phyxel of this rank against all others at rest [N/m], shape [n]: with
/// g_ki = ∂∇u_k/∂u_i,
///
///   Σ_k v_k [(λ + μ) g gᵀ + μ |g|² 1] + κ [2 Σ_j w_ij - Σ_k g · A_k g] 1,
///
/// k over the phyxel and those that have it as a neighbour; without closing. Where a device has the
/// lists, an estimate. Collective on a share.
std::vector<Mat3d> stiffness_blocks(const Model& model, const OwnedVectors& vectors);

}  // namespace phyxel
