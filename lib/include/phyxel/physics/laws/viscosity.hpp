/// Kelvin–Voigt damping, by the rate of strain, for any law.
///
/// A viscous second Piola stress of the rate of Green's strain:
///   S_v = τ C : Ė,   Ė = (E - E_last)/Δt,   P += F S_v
/// with the stiffness C of the law at rest. A rotation does not change E, however large it is in
/// one step: rigid motion is not damped, and momenta are conserved (F S_v Fᵀ is symmetric). A
/// difference of ∇u in place of E would give a rotation by φ a strain rate of (1 - cos φ)/Δt. For
/// Hooke's law S_v is 2 η dev Ė + ζ tr(Ė) I with η = τ μ and ζ = τ (λ + ⅔ μ). Damping is
/// proportional to stiffness: a mode of angular frequency ω has the damping ratio τ ω/2.
#pragma once

#include "phyxel/physics/law.hpp"
#include "phyxel/physics/strain.hpp"
#include "phyxel/physics/stretches.hpp"
#include "phyxel/types.hpp"

namespace phyxel {

/// A law with a viscous stress added. The wrapped law may have a history or none.
template <class Law, class Real>
struct WithViscosity {
  static constexpr bool many_registers = true;

  /// History of a phyxel; all zero: at rest.
  struct State {
    [[no_unique_address]] HistoryOf<Law> law;  ///< History of the wrapped law.
    Sym3<Real> strain;                         ///< Green's strain E at the end of the last step.
    Real viscous_work{};                       ///< [J/m³] since the start.
  };
  /// The names of the last seven numbers, which follow those of the wrapped law.
  static constexpr HistoryNumber history[] = {{"last_strain_xx", ""},   {"last_strain_xy", ""},
                                              {"last_strain_xz", ""},   {"last_strain_yy", ""},
                                              {"last_strain_yz", ""},   {"last_strain_zz", ""},
                                              {"viscous_work", "J/m^3"}};

  Law law;
  Real relaxation_time;  ///< τ [s]

  /// The stored energy [J/m³], that of the wrapped law.
  PHYXEL_HD Real energy(const Mat3<Real>& grad_u, const State& state) const {
    return stored_energy(law, grad_u, state.law);
  }
  /// Work that viscosity and the wrapped law's relaxation have turned into heat [J/m³].
  PHYXEL_HD Real viscous_work(const State& state) const {
    return state.viscous_work + phyxel::viscous_work<Real>(law, state.law);
  }
  /// Plastic work of the wrapped law [J/m³].
  PHYXEL_HD Real plastic_work(const State& state) const {
    return phyxel::plastic_work<Real>(law, state.law);
  }
  /// The elastic stress ∂ψ/∂∇u [Pa] at a fixed history, that of the wrapped law.
  PHYXEL_HD Mat3<Real> elastic_stress(const Mat3<Real>& grad_u, const State& state) const {
    return phyxel::elastic_stress(law, grad_u, state.law);
  }
  /// First Piola stress [Pa] at the end of a step.
  /// @param grad_u F - I at the end of the step
  /// @param state history at the start of the step; advanced to its end
  /// @param dt length of the step [s]. If 0 or `endless_time`, there is no viscous stress, and the
  /// strain is stored as the start of the next step
  PHYXEL_HD Mat3<Real> first_piola_stress(const Mat3<Real>& grad_u, State& state, Real dt) const {
    const Sym3<Real> strain = green_strain(grad_u);
    const Sym3<Real> change = strain + Real(-1) * state.strain;
    const Mat3<Real> s = viscous_stress(rate_of(dt) * change);
    state.strain = strain;
    state.viscous_work = state.viscous_work + work_of(s, change);
    return fused(grad_u, s, s) + stress_after_step(law, grad_u, state.law, dt);
  }
  /// An upper bound of the stiffness of plane waves [Pa] (physics/law.hpp), that of the wrapped
  /// law.
  PHYXEL_HD Real wave_stiffness(const PrincipalStretches<Real>& s) const {
    return law.wave_stiffness(s);
  }
  /// An upper bound of the viscosity of plane waves [Pa s]: τ times the stiffness at rest of a wave
  /// along Fᵀa.
  PHYXEL_HD Real wave_viscosity(const PrincipalStretches<Real>& s) const {
    return relaxation_time * rest().wave_stiffness(s) * s.largest * s.largest;
  }
  /// The viscous stress S_v [Pa] of a rate of Green's strain [1/s].
  PHYXEL_HD Mat3<Real> viscous_stress(const Sym3<Real>& rate) const {
    return rest().first_piola_stress(full(relaxation_time * rate));
  }
  /// The linearisation at rest, that of the wrapped law.
  PHYXEL_HD auto at_rest(Real volume_stiffness) const { return law.at_rest(volume_stiffness); }

 private:
  /// The linear law with the stiffness C of the viscous stress.
  PHYXEL_HD auto rest() const {
    if constexpr (requires { law.at_rest(); }) {
      return law.at_rest();
    } else {
      return law.at_rest(Real(0));
    }
  }
  /// 1/Δt [1/s]; 0 if Δt is 0, or endless.
  PHYXEL_HD static Real rate_of(Real dt) {
    const Real rate = Real(1) / where_larger(dt, Real(0), dt, Real(1));
    return where_larger(dt, Real(0), where_larger(Real(endless_time), dt, rate, Real(0)), Real(0));
  }
  /// s : e.
  PHYXEL_HD static Real work_of(const Mat3<Real>& s, const Sym3<Real>& e) {
    return contract(Sym3<Real>{s(0, 0), s(0, 1), s(0, 2), s(1, 1), s(1, 2), s(2, 2)}, e);
  }
};

}  // namespace phyxel
