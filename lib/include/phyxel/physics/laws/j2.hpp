/// Metals: J2 plasticity at finite strain (laws/plastic_flow.hpp) with isotropic hardening,
///   σ_y = σ₀ + H ε̄ + (σ_∞ - σ₀)(1 - exp(-δ ε̄))      (Voce 1955).
#pragma once

#include <array>
#include <span>

#include "phyxel/physics/laws/plastic_flow.hpp"

namespace phyxel {

/// Finite-strain J2 plasticity with linear and Voce hardening.
template <class Real>
struct J2 : PlasticFlow<J2<Real>, Real> {
  static constexpr const char* name = "j2";
  static constexpr const char* meaning =
      "metals: Hencky's law until the von Mises stress reaches yield_stress, then plastic flow "
      "with "
      "linear hardening, Voce's, or none";
  static constexpr LawParameter parameters[] = {
      young_modulus,
      poisson_ratio,
      virgin_flow_stress,
      {.name = "hardening",
       .unit = "Pa",
       .low = 0,
       .high = 1e18,
       .open = false,
       .meaning = "Growth of the flow stress with the equivalent plastic strain; 0: none. A body "
                  "that softens has no answer that does not depend on the spacing of phyxels.",
       .fallback = 0},
      {.name = "saturation_stress",
       .unit = "Pa",
       .low = 0,
       .high = 1e18,
       .open = false,
       .meaning = "Flow stress that Voce's hardening approaches, yield_stress at least; 0: none.",
       .fallback = 0},
      {.name = "saturation_rate",
       .unit = "",
       .low = 0,
       .high = 1e6,
       .open = false,
       .meaning = "Rate of that approach: exp(-rate * plastic strain).",
       .fallback = 0}};

  /// Rejects parameters for which Voce's law softens.
  static const char* unmet(std::span<const double> values) {
    return values[4] == 0 || values[4] >= values[2]
               ? ""
               : "saturation_stress = 0, or saturation_stress >= yield_stress";
  }
  /// λ, μ, σ₀, H, σ_∞ [Pa] and δ.
  static std::array<double, 6> constants(std::span<const double> values) {
    const std::array<double, 2> lame = lame_constants(values);
    const double yield = values[2], saturation = values[4];
    return {lame[0], lame[1], yield, values[3], saturation == 0 ? yield : saturation, values[5]};
  }
  /// The smaller of E and 10 σ₀ [Pa].
  static double hourglass_modulus(std::span<const double> values) {
    return flowing_modulus(values[0], values[2]);
  }

  static constexpr auto& history = plastic_history;
  /// The history of a phyxel; all zero: never yielded.
  using State = PlasticState<Real>;

  Real lambda, mu;         ///< Lamé's parameters [Pa].
  Real yield_stress;       ///< σ₀ [Pa]
  Real hardening;          ///< H [Pa]
  Real saturation_stress;  ///< σ_∞ [Pa]; equal to σ₀ without saturation
  Real saturation_rate;    ///< δ

  /// The flow stress σ_y(ε̄) [Pa].
  PHYXEL_HD Real flow_stress(Real equivalent_plastic_strain) const {
    return fused(hardening, equivalent_plastic_strain, yield_stress) -
           saturates() * exp_minus_one(saturation_rate * equivalent_plastic_strain);
  }
  /// The flow stress of a history [Pa].
  PHYXEL_HD Real flow_stress(const State& state) const {
    return flow_stress(state.equivalent_plastic_strain);
  }
  /// The flow stress at ε̄ = 10 [Pa].
  PHYXEL_HD Real largest_flow_stress() const { return flow_stress(Real(10)); }
  /// Plastic work ∫ σ_y dε̄ since the virgin state [J/m³].
  PHYXEL_HD Real plastic_work(const State& state) const {
    const Real e = state.equivalent_plastic_strain;
    const Real rate = where_larger(saturation_rate, Real(0), saturation_rate, Real(1));
    const Real linear = e * fused(Real(0.5) * hardening, e, yield_stress);
    const Real late = e + exp_minus_one(rate * e) / rate;
    return linear + where_larger(saturation_rate, Real(0), saturates() * late, Real(0));
  }
  /// Solves for Δε̄ >= 0 in excess = 3 μ Δε̄ + σ_y(ε̄ + Δε̄) - σ_y(ε̄). The flow stress is concave,
  /// so Newton's method approaches the root from below and never passes it: six steps are exact to
  /// rounding where δ (σ_∞ - σ₀) <= 3 μ, as in metals, or where δ Δε̄ <= 1.
  PHYXEL_HD Real plastic_increment(Real excess, const State& state, Real /*dt*/) const {
    const Real before = state.equivalent_plastic_strain;
    const Real slope = fused(Real(3), mu, hardening), rise = saturates();
    const Real linear = excess / slope;
    if (!detail::has_positive(rise)) return linear;
    const Real left = rise * (Real(1) + exp_minus_one(saturation_rate * before));
    Real increment{};
#if defined(__CUDA_ARCH__)
#pragma unroll 1
#endif
    for (int k = 0; k < 6; ++k) {
      const Real passed = exp_minus_one(saturation_rate * larger(increment, Real(0)));
      const Real residual = fused(left, passed, fused(-slope, increment, excess));
      increment = increment + residual / fused(left * saturation_rate, Real(1) + passed, slope);
    }
    return where_larger(rise, Real(0), increment, linear);
  }
  /// Adds Δε̄ to a history where the excess is positive.
  PHYXEL_HD void remember(State& state, Real excess, Real increment, Real /*dt*/) const {
    Real& e = state.equivalent_plastic_strain;
    e = where_larger(excess, Real(0), e + increment, e);
  }

 private:
  /// σ_∞ - σ₀ [Pa].
  PHYXEL_HD Real saturates() const { return saturation_stress - yield_stress; }
};

}  // namespace phyxel
