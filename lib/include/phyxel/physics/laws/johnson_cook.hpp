/// Metals at high rates: J2 plasticity at finite strain (laws/plastic_flow.hpp) with the flow
/// stress of Johnson and Cook (1983, A constitutive model and data for metals subjected to large
/// strains, high strain rates and high temperatures):
///   σ_y = (A + B ε̄ⁿ) (1 + C ln max(1, ε̄˙/ε̄˙₀)) (1 - T*ᵐ),   T* = (T - T_r)/(T_m - T_r) in [0, 1]
/// with the plastic rate ε̄˙ = Δε̄/Δt of the step itself. Plastic work heats the material where it
/// is, without conduction:
///   ρ c_p ΔT = χ σ_y Δε̄
/// Within a step σ_y is that of the temperature at its start. ε̄ⁿ has an infinite slope at 0; below
/// ε₀ = 10⁻⁶ it is continued by the line to 0.
///
/// In the endless time of a search for equilibrium the rate is as slow as ε̄˙₀, and its factor is 1;
/// heat is gone, so the temperature stays. In no time (Δt = 0) nothing flows if C > 0.
#pragma once

#include <array>
#include <cmath>
#include <span>

#include "phyxel/physics/laws/plastic_flow.hpp"
#include "phyxel/physics/powers.hpp"

namespace phyxel {

/// Finite-strain J2 plasticity with Johnson and Cook's flow stress and adiabatic heating.
template <class Real>
struct JohnsonCook : PlasticFlow<JohnsonCook<Real>, Real> {
  static constexpr const char* name = "johnson-cook";
  static constexpr const char* meaning =
      "metals at high rates: Johnson and Cook's flow stress, which grows with plastic strain and "
      "its rate, falls with temperature, and heats the material";

  static constexpr bool work_is_potential = false;  // of the rate, and of the temperature before

 private:
  static constexpr double first_strain = 1e-6;  ///< ε₀
  /// ln of the largest rate [1/s] for which the step limit is safe.
  static constexpr double fastest = 18.420680743952367;

 public:
  static constexpr LawParameter parameters[] = {
      young_modulus,
      poisson_ratio,
      material_density,
      virgin_flow_stress,
      {.name = "hardening_modulus",
       .unit = "Pa",
       .low = 0,
       .high = 1e18,
       .open = false,
       .meaning = "B: growth of the flow stress at a plastic strain of 1; 0: none.",
       .fallback = 0},
      {.name = "hardening_exponent",
       .unit = "",
       .low = 0.01,
       .high = 10,
       .open = false,
       .meaning = "n, the power of the plastic strain in that growth.",
       .fallback = 1},
      {.name = "rate_factor",
       .unit = "",
       .low = 0,
       .high = 10,
       .open = false,
       .meaning = "C: growth of the flow stress with the logarithm of the plastic rate; 0: none. "
                  "The method \"equilibrium\" knows no rate, and leaves it out.",
       .fallback = 0},
      {.name = "reference_rate",
       .unit = "1/s",
       .low = 1e-9,
       .high = 1e12,
       .open = false,
       .meaning = "Plastic rate up to which the flow stress is that of slow tests.",
       .fallback = 1},
      {.name = "specific_heat",
       .unit = "J/(kg K)",
       .low = 1e-6,
       .high = 1e12,
       .open = false,
       .meaning = "Specific heat c_p, which says how much plastic work heats.",
       .typical = 400},
      {.name = "heat_fraction",
       .unit = "",
       .low = 1e-6,
       .high = 1,
       .open = false,
       .meaning = "Share of plastic work that becomes heat (Taylor and Quinney); the rest stays in "
                  "the material.",
       .fallback = 0.9},
      {.name = "temperature",
       .unit = "K",
       .low = 0,
       .high = 1e9,
       .open = false,
       .meaning = "Temperature at the start. Output has the rise above it, `temperature_rise`.",
       .fallback = 293},
      {.name = "reference_temperature",
       .unit = "K",
       .low = 0,
       .high = 1e9,
       .open = false,
       .meaning = "Temperature T_r up to which the flow stress does not soften.",
       .fallback = 293},
      {.name = "melting_temperature",
       .unit = "K",
       .low = 0,
       .high = 1e9,
       .open = false,
       .meaning = "Temperature T_m at which the flow stress is zero; 0: it does not soften.",
       .fallback = 0},
      {.name = "softening_exponent",
       .unit = "",
       .low = 0.01,
       .high = 10,
       .open = false,
       .meaning = "m, the power of the relative temperature in the softening.",
       .fallback = 1}};

  /// Rejects a melting temperature that is not above the others.
  static const char* unmet(std::span<const double> p) {
    return p[12] == 0 || (p[12] > p[11] && p[12] > p[10])
               ? ""
               : "melting_temperature = 0, or melting_temperature > reference_temperature and > "
                 "temperature";
  }
  /// The members below, in their order.
  static std::array<double, 12> constants(std::span<const double> p) {
    const std::array<double, 2> lame = lame_constants(p);
    const double per_heat = p[9] / (p[2] * p[8]), range = p[12] - p[11];
    const bool softens = p[12] > 0;
    return {lame[0],
            lame[1],
            p[3],
            p[4],
            p[5],
            p[6],
            p[7],
            per_heat,
            p[13],
            softens ? (p[10] - p[11]) / range : 0,
            softens ? 1 / range : 0,
            1 / per_heat};
  }
  /// The smaller of E and 10 A [Pa].
  static double hourglass_modulus(std::span<const double> values) {
    return flowing_modulus(values[0], values[3]);
  }

  static constexpr HistoryNumber history[] = {
      plastic_history[0], plastic_history[1], plastic_history[2], plastic_history[3],
      plastic_history[4], plastic_history[5], plastic_history[6], {"temperature_rise", "K"}};
  /// The history of a phyxel; all zero: never yielded.
  struct State : PlasticState<Real> {
    Real temperature_rise{};  ///< Above the temperature at the start [K].
  };

  Real lambda, mu;          ///< Lamé's parameters [Pa].
  Real yield_stress;        ///< A [Pa]
  Real hardening;           ///< B [Pa]
  Real exponent;            ///< n
  Real rate_factor;         ///< C
  Real reference_rate;      ///< ε̄˙₀ [1/s]
  Real heating;             ///< χ/(ρ c_p) [K m³/J]
  Real softening_exponent;  ///< m
  Real start;               ///< T* at the start, below 0 if colder than T_r.
  Real per_kelvin;          ///< 1/(T_m - T_r) [1/K]; 0: no softening.
  Real work_per_kelvin;     ///< ρ c_p/χ [J/(m³ K)]

  /// The flow stress of a history at slow rates [Pa].
  PHYXEL_HD Real flow_stress(const State& state) const {
    return hardened(state.equivalent_plastic_strain).stress * softened(state);
  }
  /// The flow stress at ε̄ = 10 and a rate of 10⁸/s [Pa].
  PHYXEL_HD Real largest_flow_stress() const {
    const Real rates = larger(Real(fastest) - log_of(reference_rate), Real(0));
    return hardened(Real(10)).stress * fused(rate_factor, rates, Real(1));
  }
  /// Plastic work ∫ σ_y dε̄ since the virgin state [J/m³], of which the temperature tells.
  PHYXEL_HD Real plastic_work(const State& state) const {
    return work_per_kelvin * state.temperature_rise;
  }
  /// Solves for Δε̄ >= 0 in excess = 3 μ Δε̄ + σ_y(ε̄ + Δε̄, Δε̄/Δt) - σ_y(ε̄, 0), whose right side
  /// ascends, by Newton's method within a bracket. It is concave but for n > 1 and where the rate
  /// factor begins, so Newton's method approaches from below; where it falls out of the bracket
  /// from above, a sixteenth of the estimate is tried, or the middle. Nine steps are exact to
  /// rounding (tests/lib/physics/johnson_cook_test.cpp), and their fixed number gives all devices
  /// the same bits.
  PHYXEL_HD Real plastic_increment(Real excess, const State& state, Real dt) const {
    const Real before = state.equivalent_plastic_strain, softening = softened(state);
    const Real slow = softening * hardened(before).stress, elastic = Real(3) * mu;
    const Real slowest = reference_rate * dt;  // Δε̄ up to which the rate factor is 1
    Real low{}, high = larger(excess, Real(0)) / elastic;
    Real x = smaller(high, by_rate_alone(high * elastic, slow, slowest));
#if defined(__CUDA_ARCH__)
#pragma unroll 1
#endif
    for (int k = 0; k < 9; ++k) {
      const Hardening now = hardened(before + x);
      const Rate rate = rate_of(x, slowest);
      const Real stress = softening * now.stress;
      const Real residual = fused(stress, rate.factor, fused(elastic, x, -(slow + excess)));
      const Real slope = elastic + fused(softening * now.slope, rate.factor, stress * rate.slope);
      high = where_larger(residual, Real(0), x, high);
      low = where_larger(residual, Real(0), low, x);
      const Real next = x - residual / slope, part = Real(1.0 / 16) * x;
      const Real middle = Real(0.5) * (low + high);
      const Real instead = where_larger(low, next, where_larger(part, low, part, middle), next);
      x = where_larger(next, high, middle, instead);
    }
    const Real in_time = where_larger(dt, Real(0), x, Real(0));
    return where_larger(rate_factor, Real(0), in_time, x);
  }
  /// Adds Δε̄ and the heat of its work to a history where the excess is positive; no heat in an
  /// endless time. The work is that
  /// of the mean of the flow stresses at the begin and the end, at the rate of the step.
  PHYXEL_HD void remember(State& state, Real excess, Real increment, Real dt) const {
    Real& e = state.equivalent_plastic_strain;
    const Real after = e + increment;
    const Real mean = Real(0.5) * (hardened(e).stress + hardened(after).stress);
    const Real stress = mean * softened(state) * rate_of(increment, reference_rate * dt).factor;
    const Real heat = where_larger(Real(endless_time), dt, heating * stress, Real(0));
    const Real warmer = fused(heat, increment, state.temperature_rise);
    e = where_larger(excess, Real(0), after, e);
    state.temperature_rise = where_larger(excess, Real(0), warmer, state.temperature_rise);
  }

 private:
  /// A + B ε̄ⁿ [Pa] and its derivative.
  struct Hardening {
    Real stress, slope;
  };
  /// The rate factor and its derivative by Δε̄.
  struct Rate {
    Real factor, slope;
  };

  PHYXEL_HD Hardening hardened(Real strain) const {
    const Real least = Real(first_strain), clipped = larger(strain, least);
    const Real power = hardening * power_of(clipped, exponent), per = power / clipped;
    return {where_larger(strain, least, yield_stress + power, fused(per, strain, yield_stress)),
            where_larger(strain, least, exponent * per, per)};
  }
  /// 1 + C ln max(1, ε̄˙/ε̄˙₀). @param slowest ε̄˙₀ Δt; 0: no rate
  PHYXEL_HD Rate rate_of(Real increment, Real slowest) const {
    const Real one = Real(1), none = Real(0);
    const Real ratio = increment / where_larger(slowest, none, slowest, one);
    const Real fast = where_larger(slowest, none, where_larger(ratio, one, one, none), none);
    const Real factor = fused(rate_factor, log_of(where_larger(fast, none, ratio, one)), one);
    return {factor, where_larger(fast, none, rate_factor / increment, none)};
  }
  /// Δε̄ by which the rate factor alone takes up an excess [Pa]: an upper bound of the answer.
  PHYXEL_HD Real by_rate_alone(Real excess, Real slow, Real slowest) const {
    const Real growth = rate_factor * slow;
    const Real logarithm = excess / where_larger(growth, Real(0), growth, Real(1));
    const Real large = slowest / (Real(1) + exp_minus_one(logarithm));
    const Real none = Real(1e30);
    return where_larger(growth, Real(0), where_larger(slowest, Real(0), large, none), none);
  }
  /// 1 - T*ᵐ.
  PHYXEL_HD Real softened(const State& state) const {
    const Real relative = fused(per_kelvin, state.temperature_rise, start);
    const Real heat = smaller(relative, Real(1));
    const Real least = Real(1e-9);
    const Real lost = power_of(larger(heat, least), softening_exponent);
    return where_larger(heat, least, Real(1) - lost, Real(1));
  }
};

}  // namespace phyxel
