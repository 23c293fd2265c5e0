/// Metals that tear: Johnson and Cook's flow stress (laws/johnson_cook.hpp) with their damage
/// (Johnson and Cook 1985, Fracture characteristics of three metals subjected to various strains,
/// strain rates, temperatures and pressures).
///
/// A plastic strain Δε̄ uses up the share Δε̄/ε_f of the material, with the strain at failure
///   ε_f = (D₁ + D₂ exp(D₃ σ*)) (1 + D₄ ln max(1, ε̄˙/ε̄˙₀)) (1 + D₅ T*),
/// the triaxiality σ* = p/q of the mean stress p, positive in tension, and the von Mises stress q,
/// and T* as in the flow stress. Damage d begins where the shares add up to 1, and grows with the
/// plastic work of the undamaged material,
///   Δd = ℓ σ_y Δε̄/(2 G_c),
/// to 1. With the stresses of the damaged material, 1 - d times those of the undamaged one,
/// ℓ ∫ (1 - d) σ_y dε̄ = G_c until then: a band as wide as ℓ takes the energy release rate G_c in
/// tearing, whatever the flow stress does meanwhile (Hillerborg, Modéer and Petersson 1976, by the
/// work of flow; the width takes the part of an element's length). ℓ is `band_width` times the
/// spacing of the phyxels, so that the energy does not depend on the spacing.
///
/// Damage takes shear stress and tension, and no pressure: a phyxel that is spent (d = 1) bears
/// pressure like a fluid. The stored energy is
///   ψ = (1 - d) (μ |dev ε|² + ½ K ⟨θ⟩₊²) + ½ K ⟨θ⟩₋²
/// with Hencky's strain ε of the elastic part and θ = tr ε. Damage turns -∂ψ/∂d Δd of it into heat
/// that does not warm; plastic work is that of the damaged stresses.
#pragma once

#include <algorithm>
#include <array>
#include <span>

#include "phyxel/physics/laws/johnson_cook.hpp"

namespace phyxel {

/// Finite-strain J2 plasticity with Johnson and Cook's flow stress and damage.
template <class Real>
struct JohnsonCookDamage : JohnsonCookFlow<JohnsonCookDamage<Real>, Real> {
  using Flow = JohnsonCookFlow<JohnsonCookDamage<Real>, Real>;

  static constexpr const char* name = "johnson-cook-damage";
  static constexpr const char* meaning =
      "metals that tear: as \"johnson-cook\", with their damage by triaxiality, rate and "
      "temperature, and an energy release rate";

  static constexpr bool work_is_potential = false;  // of the rate, and of the temperature before

  /// The width of the band in which a body tears, in spacings of phyxels: two layers are spent, and
  /// those beside them damaged in part (docs/physics.md).
  static constexpr double band_width = 3;
  /// The largest triaxiality, of either sign, that counts.
  static constexpr double most_triaxiality = 3;

 private:
  static constexpr LawParameter own_parameters[] = {
      {.name = "d1",
       .unit = "",
       .low = 0,
       .high = 100,
       .open = false,
       .meaning = "D1 of Johnson and Cook's strain at failure, (D1 + D2 exp(D3 p/q)) (1 + D4 ln "
                  "max(1, rate/reference_rate)) (1 + D5 T*), with the mean stress p, positive in "
                  "tension, and the von Mises stress q.",
       .typical = 0.1},
      {.name = "d2",
       .unit = "",
       .low = 0,
       .high = 100,
       .open = false,
       .meaning = "D2 of that strain.",
       .fallback = 0},
      {.name = "d3",
       .unit = "",
       .low = -10,
       .high = 10,
       .open = false,
       .meaning = "D3 of that strain; below 0: tension from all sides makes brittle.",
       .fallback = 0},
      {.name = "d4",
       .unit = "",
       .low = -1,
       .high = 1,
       .open = false,
       .meaning = "D4 of that strain.",
       .fallback = 0},
      {.name = "d5",
       .unit = "",
       .low = -1,
       .high = 100,
       .open = false,
       .meaning = "D5 of that strain; T* is 0 if melting_temperature is.",
       .fallback = 0},
      {.name = "energy_release_rate",
       .unit = "J/m^2",
       .low = 1e-12,
       .high = 1e18,
       .open = false,
       .meaning = "G_c, the energy that tearing takes by area, once the strain at failure is "
                  "reached.",
       .typical = 1e3},
      material_spacing};

 public:
  static constexpr auto parameters = joined_parameters(johnson_cook_parameters, own_parameters);
  static constexpr int flow_parameters = std::size(johnson_cook_parameters);

  /// Rejects what the flow stress rejects, a strain at failure of zero, and a spacing of phyxels at
  /// which a phyxel at the yield stress stores more elastic energy than tearing takes.
  static const char* unmet(std::span<const double> p) {
    const char* const flow = unmet_of_johnson_cook(p);
    if (*flow) return flow;
    const double* const own = p.data() + flow_parameters;
    if (!(own[0] + own[1] > 0)) return "d1 + d2 > 0";
    return band_width * own[6] * p[3] * p[3] <= 2 * p[0] * own[5]
               ? ""
               : "an energy_release_rate of at least 1.5 yield_stress^2/young times the spacing of "
                 "the "
                 "phyxels";
  }
  /// The members below, in their order, after those of the flow stress.
  static std::array<double, 18> constants(std::span<const double> p) {
    std::array<double, 18> all{};
    const auto flow = constants_of_johnson_cook(p);
    std::copy(flow.begin(), flow.end(), all.begin());
    const double* const own = p.data() + flow_parameters;
    std::copy_n(own, 5, all.begin() + 12);
    all[17] = band_width * own[6] / (2 * own[5]);
    return all;
  }
  /// The smaller of E and 10 A [Pa].
  static double hourglass_modulus(std::span<const double> values) {
    return flowing_modulus(values[0], values[3]);
  }

  static constexpr HistoryNumber history[] = {
      plastic_history[0], plastic_history[1],        plastic_history[2],
      plastic_history[3], plastic_history[4],        plastic_history[5],
      plastic_history[6], {"temperature_rise", "K"}, {"damage_initiation", ""},
      {"damage", ""},     {"damage_work", "J/m^3"}};
  /// The history of a phyxel; all zero: never yielded.
  struct State : JohnsonCookState<Real> {
    Real initiation{};   ///< Σ Δε̄/ε_f
    Real damage{};       ///< d
    Real damage_work{};  ///< Elastic energy that damage has taken [J/m³].
  };

  Real d1, d2, d3, d4, d5;  ///< D₁ to D₅
  Real growth;              ///< ℓ/(2 G_c) [m³/J]

  /// Work of flow and of damage since the virgin state [J/m³].
  PHYXEL_HD Real plastic_work(const State& state) const {
    return Flow::plastic_work(state) + state.damage_work;
  }
  /// Hencky's law of a damaged material. @param trace θ of the elastic strain
  /// @param first, second Lamé's parameters if it were not damaged, or their secant values during
  /// flow [Pa]
  PHYXEL_HD Hencky<Real> worn(const State& state, Real trace, Real first, Real second) const {
    const Real keep = Real(1) - state.damage, bulk = fused(Real(2.0 / 3), second, first);
    const Real shear = keep * second;
    const Real kept_bulk = where_larger(trace, Real(0), keep * bulk, bulk);
    return {fused(Real(-2.0 / 3), shear, kept_bulk), shear};
  }
  /// Adds Δε̄, its heat and its damage to a history where the excess is positive.
  /// @param trace θ of the trial. @param von_mises q of the trial [Pa], undamaged
  PHYXEL_HD void wear(State& state, Real trace, Real von_mises, Real excess, Real increment,
                      Real dt) const {
    const Real none = Real(0), one = Real(1);
    const Real shear_stress = larger(fused(Real(-3) * this->mu, increment, von_mises), none);
    const Real bulk = fused(Real(2.0 / 3), this->mu, this->lambda);
    const Real tension = where_larger(trace, none, trace, none);
    const Real stress = this->mean_flow_stress(state, increment, dt);

    const Real used = increment / failure_strain(state, bulk * trace, shear_stress, increment, dt);
    const Real before = state.initiation, after = before + used;
    const Real beyond = larger(after - larger(before, one), none);
    const Real share = beyond / where_larger(used, none, used, one);
    const Real wanted = growth * stress * (increment * share);
    const Real more = smaller(wanted, one - state.damage);
    const Real keep = fused(Real(-0.5), more, one - state.damage);
    // μ |dev ε|² = q²/(6 μ).
    const Real released = fused(Real(0.5) * bulk * tension, tension,
                                shear_stress * shear_stress / (Real(6) * this->mu));

    const Real work = fused(released, more, state.damage_work);
    this->add_flow(state, excess, increment, keep * stress, dt);
    state.initiation = where_larger(excess, none, after, before);
    state.damage_work = where_larger(excess, none, work, state.damage_work);
    state.damage = where_larger(excess, none, state.damage + more, state.damage);
  }

 private:
  /// ε_f. @param mean p [Pa]. @param von_mises q [Pa]
  PHYXEL_HD Real failure_strain(const State& state, Real mean, Real von_mises, Real increment,
                                Real dt) const {
    const Real none = Real(0), one = Real(1), most = Real(most_triaxiality);
    const Real ratio = mean / where_larger(von_mises, none, von_mises, one);
    const Real power = d3 * larger(-most, smaller(most, ratio));
    const Real decay = one + exp_minus_one(where_larger(power, none, power, -power));
    const Real grown = where_larger(power, none, one / decay, decay);
    const Real warm = larger(none, smaller(one, this->relative_temperature(state)));
    const Real strain = fused(d2, grown, d1) *
                        fused(d4, this->logarithm_of_rate(increment, dt), one) *
                        fused(d5, warm, one);
    return larger(strain, Real(1e-6));
  }
};

}  // namespace phyxel
