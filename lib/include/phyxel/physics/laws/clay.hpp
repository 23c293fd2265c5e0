/// Clay: the plastic strain of Müller et al. (2004, Point based animation of elastic, plastic and
/// melting objects, section 3.4), in the form of O'Brien, Bargteil and Hodgins (2002, Graphical
/// modeling and animation of ductile fracture).
///
/// The elastic strain is ε = E - ε_p with Green's strain E, the stress Hooke's of it. The part of ε
/// that may flow is ê = dev ε + s ⅓ tr(ε) I with the share s of volume (s = 1: Müller's, all of ε).
/// Where its length |ê| = √(ê : ê) exceeds the yield strain, a step of Δt takes the excess away at
/// the rate of creep, then keeps ε_p within its limit:
///   ε_p ← ε_p + (1 - exp(-Δt/τ)) (|ê| - yield)/|ê| ê,   |ε_p| <= limit
/// Müller's creep is a share per step; as a time τ it does not depend on the step, since the
/// excess decays as exp(-t/τ) at a fixed E. τ = 0 takes it away at once, and so does the endless
/// time of a search for equilibrium. The work S : Δε_p of a step becomes heat. At the limit the law
/// is that of the papers, and no longer one of mechanics: with s > 0 that work may be negative
/// there, and in long steps it is too large.
///
/// ε_p belongs to the body at rest, so a rotation has no effect. Unlike the flow of metals
/// (laws/plastic_flow.hpp) that of large ε_p changes the volume, if by less with s = 0.
#pragma once

#include <array>
#include <cmath>
#include <span>

#include "phyxel/physics/laws/plastic_flow.hpp"
#include "phyxel/physics/laws/st_venant_kirchhoff.hpp"

namespace phyxel {

/// Hooke's law in Green's strain with a plastic strain that creeps.
template <class Real>
struct Clay {
  static constexpr const char* name = "clay";
  static constexpr const char* meaning =
      "clay, dough, lead in films: Hooke's law in Green's strain, and strain beyond yield_strain "
      "stays, as in Müller et al. 2004";
  static constexpr LawParameter parameters[] = {
      young_modulus,
      poisson_ratio,
      {.name = "yield_strain",
       .unit = "",
       .low = 1e-9,
       .high = 10,
       .open = false,
       .meaning = "Length of the elastic strain up to which it is stored.",
       .typical = 0.02},
      {.name = "creep_time",
       .unit = "s",
       .low = 0,
       .high = 1e12,
       .open = false,
       .meaning =
           "Time in which the strain beyond yield_strain falls to 1/e of itself, as it becomes "
           "plastic strain; 0: at once. The method \"equilibrium\" waits for ever.",
       .fallback = 0},
      {.name = "plastic_limit",
       .unit = "",
       .low = 0,
       .high = 10,
       .open = false,
       .meaning = "Largest length of the plastic strain.",
       .fallback = 1},
      {.name = "plastic_volume",
       .unit = "",
       .low = 0,
       .high = 1,
       .open = false,
       .meaning =
           "Share of the change of volume that flows as the change of shape does: 0 in most "
           "materials, 1 in Müller et al. 2004. Even with 0, bodies lose volume where the "
           "plastic strain is large, since it is one of Green's: 6% if it is that of a stretch "
           "of 1.2, and 44% at 1.5.",
       .fallback = 0}};
  static constexpr bool many_registers = true;
  static constexpr bool work_is_potential = false;  // with creep, and at the limit

  /// The members below, in their order.
  static std::array<double, 6> constants(std::span<const double> p) {
    const std::array<double, 2> lame = lame_constants(p);
    return {lame[0], lame[1], p[2], p[3], p[4], p[5]};
  }
  /// The time of creep [s].
  static double longest_time(std::span<const double> p) { return p[3]; }
  /// The smaller of E and ten times the stress at yield [Pa].
  static double hourglass_modulus(std::span<const double> p) {
    return flowing_modulus(p[0], p[0] * p[2]);
  }

  static constexpr HistoryNumber history[] = {{"plastic_strain_xx", ""}, {"plastic_strain_xy", ""},
                                              {"plastic_strain_xz", ""}, {"plastic_strain_yy", ""},
                                              {"plastic_strain_yz", ""}, {"plastic_strain_zz", ""},
                                              {"plastic_work", "J/m^3"}};
  /// The history of a phyxel; all zero: never yielded.
  struct State {
    Sym3<Real> plastic_strain;  ///< ε_p, Green's measure in the body at rest.
    Real plastic_work{};        ///< Turned into heat so far [J/m³].
  };

  Hooke<Real> hooke;
  Real yield_strain;    ///< |ê| up to which strain is stored.
  Real creep_time;      ///< τ [s]
  Real plastic_limit;   ///< Largest |ε_p|.
  Real plastic_volume;  ///< s

  /// The stored energy ½ ε : C : ε [J/m³].
  PHYXEL_HD Real energy(const Mat3<Real>& grad_u, const State& state) const {
    return hooke.energy(elastic_strain(grad_u, state));
  }
  /// Work that flow has turned into heat [J/m³].
  PHYXEL_HD Real plastic_work(const State& state) const { return state.plastic_work; }
  /// The elastic stress F C : ε [Pa] at a fixed history.
  PHYXEL_HD Mat3<Real> elastic_stress(const Mat3<Real>& grad_u, const State& state) const {
    return pushed(grad_u, hooke.stress(elastic_strain(grad_u, state)));
  }
  /// First Piola stress [Pa] at the end of a step of `dt` [s].
  /// @param grad_u F - I at the end of the step
  /// @param state history at the start of the step; advanced to its end
  PHYXEL_HD Mat3<Real> first_piola_stress(const Mat3<Real>& grad_u, State& state, Real dt) const {
    using std::sqrt;
    const Sym3<Real> trial = elastic_strain(grad_u, state);
    const Real mean = Real(1.0 / 3) * phyxel::trace(trial), kept = mean - plastic_volume * mean;
    const Sym3<Real> flowing{trial.xx - kept, trial.xy, trial.xz,
                             trial.yy - kept, trial.yz, trial.zz - kept};
    const Real length = sqrt(contract(flowing, flowing)), excess = length - yield_strain;
    if (!detail::has_positive(excess)) return pushed(grad_u, hooke.stress(trial));
    const Real none(0), one(1);
    const Real share = creep(dt) * excess / where_larger(length, none, length, one);
    const Sym3<Real> next =
        limited(state.plastic_strain + where_larger(excess, none, share, none) * flowing);
    const Sym3<Real> change = next + Real(-1) * state.plastic_strain;
    const Sym3<Real> strain = trial + Real(-1) * change;
    // At the stress of the step's end, as in an implicit step: without creep, what flow dissipates
    // along the way to second order in the step.
    const Real work = contract(hooke.stress(strain), change);
    state.plastic_work = where_larger(excess, none, state.plastic_work + work, state.plastic_work);
    const auto commit = [&](Real& old, Real by) { old = where_larger(excess, none, by, old); };
    Sym3<Real>& p = state.plastic_strain;
    commit(p.xx, next.xx), commit(p.xy, next.xy), commit(p.xz, next.xz);
    commit(p.yy, next.yy), commit(p.yz, next.yz), commit(p.zz, next.zz);
    Sym3<Real> after = trial;
    commit(after.xx, strain.xx), commit(after.xy, strain.xy), commit(after.xz, strain.xz);
    commit(after.yy, strain.yy), commit(after.yz, strain.yz), commit(after.zz, strain.zz);
    return pushed(grad_u, hooke.stress(after));
  }
  /// The linearisation at rest, Hooke's law in Cauchy's strain.
  PHYXEL_HD SmallStrain<Real> at_rest(Real volume_stiffness) const {
    return SmallStrain<Real>{hooke}.at_rest(volume_stiffness);
  }
  /// An upper bound of the stiffness of plane waves [Pa] (physics/law.hpp): that of the virgin
  /// material, which `StVenantKirchhoff` has, plus the largest principal stress of -ε_p. At rest it
  /// is the virgin material's.
  PHYXEL_HD Real wave_stiffness(const PrincipalStretches<Real>& s) const {
    const Real virgin = StVenantKirchhoff<Real>{hooke}.wave_stiffness(s);
    const Real shape(0.81649658092772603), none(0);  // √(2/3), of a deviator of length 1
    const Real pressure = larger(hooke.lambda, -hooke.lambda) * Real(1.7320508075688772);
    const Real two_mu = Real(2) * hooke.mu;
    const Real stress =
        plastic_limit * where_larger(plastic_volume, none, two_mu + pressure, two_mu * shape);
    const Real stretch = larger(s.largest - Real(1), Real(1) - s.smallest);
    return where_larger(stretch, none, virgin + stress, virgin);
  }

 private:
  /// E - ε_p.
  PHYXEL_HD static Sym3<Real> elastic_strain(const Mat3<Real>& grad_u, const State& state) {
    return green_strain(grad_u) + Real(-1) * state.plastic_strain;
  }
  /// F S.
  PHYXEL_HD static Mat3<Real> pushed(const Mat3<Real>& grad_u, const Sym3<Real>& s) {
    return fused(grad_u, full(s), full(s));
  }
  /// 1 - exp(-Δt/τ); 1 without τ.
  PHYXEL_HD Real creep(Real dt) const {
    const Real none(0), one(1), times = dt / where_larger(creep_time, none, creep_time, one);
    return where_larger(creep_time, none, -exp_minus_one(times), one);
  }
  /// A plastic strain within the limit, rounding included.
  PHYXEL_HD Sym3<Real> limited(const Sym3<Real>& plastic) const {
    using std::sqrt;
    const Real length = sqrt(contract(plastic, plastic)), none(0), one(1);
    const Real less = Real(detail::single_precision<Real> ? 1 - 4.8e-7 : 1 - 9e-16);
    const Real scale = plastic_limit / where_larger(length, none, length, one) * less;
    return where_larger(length, less * plastic_limit, scale, one) * plastic;
  }
};

}  // namespace phyxel
