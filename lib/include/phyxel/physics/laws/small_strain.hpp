/// Hooke's law in Cauchy's strain: linear elasticity.
#pragma once

#include "phyxel/physics/hooke.hpp"
#include "phyxel/physics/law.hpp"
#include "phyxel/physics/strain.hpp"

namespace phyxel {

/// λ and μ [Pa] of laws whose parameters are `young_modulus` and `poisson_ratio`.
inline std::array<double, 2> lame_constants(std::span<const double> parameters) {
  return {lame_lambda(parameters[0], parameters[1]), lame_mu(parameters[0], parameters[1])};
}

/// Linear elasticity: P = λ tr(ε) I + 2 μ ε with Cauchy's strain ε, equations (3), (4) and (5) of
/// Farias et al. 2008. Valid for small rotations only: a rotated body has strain, and forces then
/// have a torque.
template <class Real>
struct SmallStrain {
  static constexpr const char* name = "small-strain";
  static constexpr const char* meaning =
      "Hooke's law in Cauchy's strain: linear, cheapest, and right for small rotations only";
  static constexpr LawParameter parameters[] = {young_modulus, poisson_ratio};
  static constexpr auto constants = lame_constants;
  /// A linear law is as stiff in every state as at rest.
  static constexpr bool is_linear = true;

  Hooke<Real> hooke;

  /// ½ ε : P [J/m³].
  PHYXEL_HD Real energy(const Mat3<Real>& grad_u) const {
    return hooke.energy(cauchy_strain(grad_u));
  }
  /// P [Pa].
  PHYXEL_HD Mat3<Real> first_piola_stress(const Mat3<Real>& grad_u) const {
    return full(hooke.stress(cauchy_strain(grad_u)));
  }
  /// λ + 2μ [Pa], the stiffness of pressure waves.
  PHYXEL_HD Real wave_stiffness(const PrincipalStretches<Real>&) const {
    return hooke.lambda + Real(2) * hooke.mu;
  }
  /// The same law, with the stiffness of volume conservation [Pa] added to λ.
  PHYXEL_HD SmallStrain at_rest(Real volume_stiffness) const {
    return {{hooke.lambda + volume_stiffness, hooke.mu}};
  }
};

}  // namespace phyxel
