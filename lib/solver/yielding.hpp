/// How much softer or stiffer than elasticity phyxels are at present, for preconditioners.
#pragma once

#include <span>
#include <vector>

#include "phyxel/model.hpp"
#include "phyxel/state.hpp"

namespace phyxel {

/// The stiffness of a phyxel whose stress depends on history: of isotropic elasticity times `bulk`
/// and `shear`, less way ⊗ way along the direction in which it flows.
struct Yielding {
  double bulk = 1, shear = 1;
  Mat3d way;  ///< [√Pa], of deformation gradients.

  /// Lamé's first parameter, from both of elasticity [Pa].
  double lambda(double lambda, double mu) const {
    constexpr double of_mu = 2.0 / 3;
    return bulk * (lambda + of_mu * mu) - shear * of_mu * mu;
  }
};

/// Lamé's parameters of a part at small strains [Pa]; of laws that are not isotropic, those of an
/// isotropic one of like stiffness.
struct LameParameters {
  double lambda = 0, mu = 0;
};
LameParameters small_strain_parameters(const Part& part);

/// True if the stress of a part depends on history. Laws of the caller count as elastic.
bool may_yield(const Model& model, const Part& part);

/// How this rank's phyxels of parts that may yield do so, shape [n]; empty if there is no such
/// part. Found from the change of the stress along itself, but for pressure.
/// @param gradient of displacement, shape [n]. @param state whose history and interval count
std::vector<Yielding> present_yielding(const Model& model, std::span<const Mat3d> gradient,
                                       const State& state, int threads);

}  // namespace phyxel
