/// Thermal expansion by a given temperature, for any law.
///
/// A body that is warmer by ΔT than where it has no stress expands by the thermal strain
///   θ = α ΔT
/// in all directions, and its law acts on the rest of the deformation (Stojanović, Djurić and
/// Vujošević 1964; Lubarda 2004, Constitutive theories based on the multiplicative decomposition of
/// deformation gradient, section 2):
///   F = (1 + θ) F_e,   ψ = (1 + θ)³ ψ_e(F_e),   P = ∂ψ/∂F = (1 + θ)² P_e(F_e)
/// with ψ_e per volume of the warm body. The expansion is the same in all directions, and so has no
/// order with elastic, plastic and viscous deformation. ΔT follows a curve in time, the same for
/// all phyxels of a material, linear between its points and constant before the first and after the
/// last. The method "equilibrium" takes the last.
///
/// A change of temperature at a fixed deformation changes the stored energy by
///   dψ/dθ = (1 + θ)² (3 ψ_e - P_e : F_e),
/// whose sum over steps, by the trapezoidal rule, is the work that heat has done on the body. Work
/// that flow and viscosity have turned into heat counts per volume of the warm body, too, and
/// changes with it as ψ does.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>

#include "phyxel/physics/law.hpp"
#include "phyxel/physics/symmetric_functions.hpp"
#include "phyxel/types.hpp"

namespace phyxel {

/// The thermal strain θ as a function of time.
template <class Real>
struct ThermalStrain {
  static constexpr int points = 8;                ///< The most points of a curve.
  static constexpr int numbers = 3 * points - 1;  ///< The number of its constants.

  Real first;               ///< θ at the first point.
  Real times[points];       ///< Of the points [s]; the last one is repeated.
  Real slopes[points - 1];  ///< dθ/dt between the points [1/s].
  Real steps[points - 1];   ///< Changes of θ between the points.

  /// The constants of a curve with a coefficient of expansion, in the order of the members.
  /// @param coefficient α [1/K]. @param curve points [t [s], ΔT [K]] whose times ascend
  static std::array<double, numbers> constants(double coefficient,
                                               std::span<const std::array<double, 2>> curve) {
    std::array<double, numbers> all{};
    const auto point = [&](int k) {
      return curve[std::min(static_cast<std::size_t>(k), curve.size() - 1)];
    };
    all[0] = coefficient * point(0)[1];
    for (int k = 0; k < points; ++k) all[1 + k] = point(k)[0];
    for (int k = 0; k + 1 < points; ++k) {
      const double time = point(k + 1)[0] - point(k)[0];
      const double step = coefficient * (point(k + 1)[1] - point(k)[1]);
      all[1 + points + k] = time > 0 ? step / time : 0;
      all[2 * points + k] = step;
    }
    return all;
  }

  /// θ at a time [s]. Behind the end of a piece its whole step counts, so that θ there is that of
  /// the curve to rounding.
  PHYXEL_HD Real at(Real time) const {
    Real strain = first;
    for (int k = 0; k + 1 < points; ++k) {
      const Real in = larger(time - times[k], Real(0));
      strain = strain + where_larger(times[k + 1], time, slopes[k] * in, steps[k]);
    }
    return strain;
  }
};

/// The history of expansion; all zero: cold, at the start.
template <class Real>
struct ThermalState {
  Real time{}, time_rest{};  ///< t [s], and what rounding has left out of it.
  Real thermal_strain{};     ///< θ
  Real thermal_stress{};     ///< dψ/dθ [Pa], work turned into heat included.
  Real thermal_work{};       ///< Of heat on the body since the start [J/m³].

  /// The names of its numbers.
  static constexpr HistoryNumber history[] = {{"thermal_time", "s"},
                                              {"thermal_time_rest", "s"},
                                              {"thermal_strain", ""},
                                              {"thermal_stress", "Pa"},
                                              {"thermal_work", "J/m^3"}};

  /// F_e - I = (∇u - θ I)/(1 + θ).
  PHYXEL_HD Mat3<Real> elastic_gradient(const Mat3<Real>& grad_u) const {
    const Real inverse = Real(1) / (Real(1) + thermal_strain);
    Mat3<Real> elastic = grad_u;
    for (int a = 0; a < 3; ++a) elastic(a, a) = elastic(a, a) - thermal_strain;
    return inverse * elastic;
  }
  /// (1 + θ)², by which P exceeds that of the law.
  PHYXEL_HD Real area() const { return (Real(1) + thermal_strain) * (Real(1) + thermal_strain); }
  /// (1 + θ)³, by which energies per volume at rest exceed those of the law.
  PHYXEL_HD Real volume() const { return (Real(1) + thermal_strain) * area(); }

  /// Returns the first Piola stress [Pa] at the end of a step of `dt` [s], and advances the history
  /// to it; after `endless_time` the temperature is the last one.
  /// @param stress_of stress_of(F_e - I), P_e [Pa] of the law at the end of the step
  /// @param energy_of energy_of(F_e - I), called after it: stored energy and work turned into heat
  /// [J/m³]
  template <class StressOf, class EnergyOf>
  PHYXEL_HD Mat3<Real> stress_after_step(const ThermalStrain<Real>& strain,
                                         const Mat3<Real>& grad_u, Real dt, StressOf&& stress_of,
                                         EnergyOf&& energy_of) {
    const Real endless = Real(endless_time);
    // Kahan's sum: a float alone would lose most of a short step after many.
    const Real step = dt - time_rest, after = time + step, lost = (after - time) - step;
    time = where_larger(endless, dt, after, strain.times[ThermalStrain<Real>::points - 1]);
    time_rest = where_larger(endless, dt, lost, Real(0));
    const Real before = thermal_strain;
    thermal_strain = strain.at(time);
    const Mat3<Real> elastic = elastic_gradient(grad_u), stress = stress_of(elastic);
    Real power = stress(0, 0) + stress(1, 1) + stress(2, 2);  // P_e : F_e
    for (int k = 0; k < 9; ++k) power = fused(stress(k / 3, k % 3), elastic(k / 3, k % 3), power);
    const Real slope = area() * fused(Real(3), energy_of(elastic), -power);
    thermal_work =
        fused(Real(0.5) * (thermal_strain - before), slope + thermal_stress, thermal_work);
    thermal_stress = slope;
    return area() * stress;
  }
};

/// A law of a material that expands. The wrapped law may have a history or none.
template <class Law, class Real>
struct WithExpansion {
  static constexpr bool many_registers = true;

  /// The history of a phyxel; all zero: cold, at the start.
  struct State {
    [[no_unique_address]] HistoryOf<Law> law;  ///< History of the wrapped law.
    ThermalState<Real> heat;
  };

  Law law;
  ThermalStrain<Real> strain;  ///< θ(t)

  /// The stored energy [J/m³].
  PHYXEL_HD Real energy(const Mat3<Real>& grad_u, const State& state) const {
    return state.heat.volume() * stored_energy(law, state.heat.elastic_gradient(grad_u), state.law);
  }
  /// The elastic stress ∂ψ/∂∇u [Pa] at a fixed history and temperature.
  PHYXEL_HD Mat3<Real> elastic_stress(const Mat3<Real>& grad_u, const State& state) const {
    return state.heat.area() *
           phyxel::elastic_stress(law, state.heat.elastic_gradient(grad_u), state.law);
  }
  /// First Piola stress [Pa] at the end of a step.
  /// @param grad_u F - I at the end of the step
  /// @param state history at the start of the step; advanced to its end
  /// @param dt length of the step [s]
  PHYXEL_HD Mat3<Real> first_piola_stress(const Mat3<Real>& grad_u, State& state, Real dt) const {
    return state.heat.stress_after_step(
        strain, grad_u, dt,
        [&](const Mat3<Real>& elastic) {
          return phyxel::stress_after_step(law, elastic, state.law, dt);
        },
        [&](const Mat3<Real>& elastic) {
          return stored_energy(law, elastic, state.law) +
                 (phyxel::plastic_work<Real>(law, state.law) +
                  phyxel::viscous_work<Real>(law, state.law));
        });
  }
  /// Work of heat on the body since the start [J/m³].
  PHYXEL_HD Real thermal_work(const State& state) const { return state.heat.thermal_work; }
  /// Work of viscosity of the wrapped law [J/m³].
  PHYXEL_HD Real viscous_work(const State& state) const {
    return state.heat.volume() * phyxel::viscous_work<Real>(law, state.law);
  }
  /// Plastic work of the wrapped law [J/m³].
  PHYXEL_HD Real plastic_work(const State& state) const {
    return state.heat.volume() * phyxel::plastic_work<Real>(law, state.law);
  }
  /// An upper bound of the stiffness of plane waves [Pa] (physics/law.hpp), that of the wrapped
  /// law.
  PHYXEL_HD Real wave_stiffness(const PrincipalStretches<Real>& s) const {
    return law.wave_stiffness(s);
  }
  /// The linearisation at rest, that of the wrapped law.
  PHYXEL_HD auto at_rest(Real volume_stiffness) const { return law.at_rest(volume_stiffness); }
};

}  // namespace phyxel
