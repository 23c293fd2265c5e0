/// Damping by the rate of strain (Kelvin and Voigt), beside any law.
///
/// A viscous second Piola stress of the rate of Green's strain:
///   S_v = 2 η dev Ė + ζ tr(Ė) I,   Ė = (E - E_last)/Δt,   P += F S_v
/// E does not see a rotation, however large in one step: rigid motion costs nothing, and momenta
/// are kept (F S_v Fᵀ is symmetric). A difference of ∇u in place of E would make a stress of (1 -
/// cos φ)/Δt of a rotation by φ. With η = τ μ and ζ = τ (λ + ⅔ μ) a mode of angular frequency ω is
/// damped by the share τ ω/2 of critical damping.
#pragma once

#include <cmath>
#include <sstream>
#include <string>

#include "phyxel/physics/strain.hpp"
#include "phyxel/physics/stretches.hpp"
#include "phyxel/types.hpp"

namespace phyxel {

/// Why a relaxation time [s] cannot be; empty if it can.
inline std::string refusal_of_viscosity(double time) {
  if (time >= 0 && std::isfinite(time)) return {};
  std::ostringstream text;
  text << "viscosity is " << time << "; it must be 0 or positive, and finite [s]";
  return text.str();
}

namespace detail {

/// The history of a law that has none.
struct NoHistory {};
template <class Law>
struct HistoryOf {
  using type = NoHistory;
};
template <class Law>
requires requires { typename Law::State; }
struct HistoryOf<Law> {
  using type = typename Law::State;
};

}  // namespace detail

/// A law and a viscous stress beside it. The wrapped law may have a history or none.
template <class Law, class Real>
struct WithViscosity {
  /// History of a phyxel; all zero: at rest.
  struct State {
    [[no_unique_address]] typename detail::HistoryOf<Law>::type law;  ///< Of the wrapped law.
    Sym3<Real> strain;                                                ///< E at the last evaluation
    Real viscous_dissipation{};                                       ///< [J/m³] since the start
  };

  Law law;
  Real shear_viscosity;  ///< η [Pa s]
  Real bulk_viscosity;   ///< ζ [Pa s]

  /// Damping in proportion to stiffness.
  /// @param law the wrapped law
  /// @param time τ [s]
  /// @param lambda, mu Lamé's parameters at rest [Pa]
  static WithViscosity of(const Law& law, double time, double lambda, double mu) {
    return {law, Real(time * mu), Real(time * (lambda + 2 * mu / 3))};
  }

  /// Energy that is stored [J/m³]: of the wrapped law.
  PHYXEL_HD Real energy(const Mat3<Real>& grad_u, [[maybe_unused]] const State& state) const {
    if constexpr (has_history) {
      return law.energy(grad_u, state.law);
    } else {
      return law.energy(grad_u);
    }
  }
  /// Work that viscosity, and the wrapped law, have turned into heat [J/m³].
  PHYXEL_HD Real dissipated(const State& state) const {
    if constexpr (requires { law.dissipated(state.law); }) {
      return law.dissipated(state.law) + state.viscous_dissipation;
    } else {
      return state.viscous_dissipation;
    }
  }
  /// First Piola stress [Pa] at the end of a step.
  /// @param grad_u F - I at the end of the step
  /// @param state history at its start; becomes that at its end
  /// @param dt length of the step [s]. 0: no rate, no viscous stress; the strain is then
  ///   taken as that from which the next step starts
  PHYXEL_HD Mat3<Real> first_piola_stress(const Mat3<Real>& grad_u, State& state, Real dt) const {
    const Sym3<Real> strain = green_strain(grad_u);
    const Sym3<Real> change = strain + Real(-1) * state.strain;
    const Sym3<Real> s = viscous_stress(rate_of(dt) * change);
    state.strain = strain;
    state.viscous_dissipation = state.viscous_dissipation + contract(s, change);
    return fused(grad_u, full(s), full(s)) + elastic(grad_u, state, dt);
  }
  /// An upper bound of the stiffness of plane waves [Pa] (stiffening.hpp): of the wrapped law.
  PHYXEL_HD Real wave_stiffness(const PrincipalStretches<Real>& s) const {
    return law.wave_stiffness(s);
  }
  /// An upper bound of the viscosity of plane waves [Pa s], as the stiffness is one:
  /// (ζ + 4/3 η) |Fᵀa|². With κ the bound of stiffness, a step obeys
  /// ω Δt <= 2 (√(1 + ξ²) - ξ), ξ = ω times this over 2 κ.
  PHYXEL_HD Real wave_viscosity(const PrincipalStretches<Real>& s) const {
    return fused(Real(4.0 / 3), shear_viscosity, bulk_viscosity) * s.largest * s.largest;
  }
  /// S_v [Pa] of a rate of Green's strain [1/s].
  PHYXEL_HD Sym3<Real> viscous_stress(const Sym3<Real>& rate) const {
    const Real two_eta = Real(2) * shear_viscosity;
    const Real mean = fused(Real(-2.0 / 3), shear_viscosity, bulk_viscosity) * trace(rate);
    return {fused(two_eta, rate.xx, mean), two_eta * rate.xy, two_eta * rate.xz,
            fused(two_eta, rate.yy, mean), two_eta * rate.yz, fused(two_eta, rate.zz, mean)};
  }

 private:
  static constexpr bool has_history = requires { typename Law::State; };

  /// 1/Δt; 0 without a step.
  PHYXEL_HD static Real rate_of(Real dt) {
    return where_larger(dt, Real(0), Real(1) / where_larger(dt, Real(0), dt, Real(1)), Real(0));
  }
  PHYXEL_HD Mat3<Real> elastic(const Mat3<Real>& grad_u, [[maybe_unused]] State& state,
                               [[maybe_unused]] Real dt) const {
    if constexpr (has_history) {
      return law.first_piola_stress(grad_u, state.law, dt);
    } else {
      return law.first_piola_stress(grad_u);
    }
  }
};

}  // namespace phyxel
