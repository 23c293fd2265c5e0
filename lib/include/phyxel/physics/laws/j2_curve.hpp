/// Metals: J2 plasticity at finite strain (laws/plastic_flow.hpp) whose flow stress follows a
/// measured curve, linear between its points (ε_k, σ_k) and constant beyond the last.
#pragma once

#include <array>
#include <span>

#include "phyxel/physics/laws/plastic_flow.hpp"

namespace phyxel {

/// Finite-strain J2 plasticity with a tabulated flow stress.
template <class Real>
struct J2Curve : PlasticFlow<J2Curve<Real>, Real> {
  static constexpr int points = 16;  ///< The most points of a curve.

  static constexpr const char* name = "j2-curve";
  static constexpr const char* meaning =
      "metals as \"j2\", with the flow stress of a table of plastic strains and stresses";
  static constexpr LawParameter parameters[] = {
      young_modulus,
      poisson_ratio,
      {.name = "flow_curve",
       .unit = "Pa",
       .low = 1e-12,
       .high = 1e18,
       .open = false,
       .meaning =
           "Flow stress (Kirchhoff, von Mises) by equivalent plastic strain, linear between "
           "points and constant beyond the last. It may fall, by less than the shear modulus "
           "times the strain; where it falls, deformation gathers in a band as wide as the "
           "spacing of phyxels.",
       .points = points,
       .argument = "plastic strain",
       .typical_curve = {{0, 1e5}, {0.2, 2e5}}}};

  /// Rejects curves that fall so fast that a step has no single answer, or rise beyond all numbers.
  static const char* unmet(std::span<const double> p) {
    const double mu = lame_constants(p)[1];
    for (int k = 1; k < points; ++k) {
      const double strain = p[2 * k + 2] - p[2 * k], stress = p[2 * k + 3] - p[2 * k + 1];
      if (strain > 0 && !(stress > -mu * strain && stress <= 1e18 * strain)) {
        return "a flow_curve that nowhere falls by the shear modulus times the strain or more, nor "
               "rises by more than 1e18 Pa times the strain";
      }
    }
    return "";
  }
  /// λ, μ, σ₀ [Pa], then the strains at which pieces of the curve end, then their slopes [Pa].
  /// Pieces left over end at the last point and have no slope.
  static std::array<double, 2 * points + 1> constants(std::span<const double> p) {
    std::array<double, 2 * points + 1> all{};
    const auto lame = lame_constants(p);
    all[0] = lame[0], all[1] = lame[1], all[2] = p[3];
    for (int k = 1; k < points; ++k) {
      const double strain = p[2 * k + 2] - p[2 * k], stress = p[2 * k + 3] - p[2 * k + 1];
      all[2 + k] = p[2 * k + 2];
      all[1 + points + k] = strain > 0 ? stress / strain : 0;
    }
    return all;
  }
  /// The smaller of E and 10 σ₀ [Pa].
  static double hourglass_modulus(std::span<const double> values) {
    return flowing_modulus(values[0], values[3]);
  }

  static constexpr auto& history = plastic_history;
  /// The history of a phyxel; all zero: never yielded.
  using State = PlasticState<Real>;

  Real lambda, mu;          ///< Lamé's parameters [Pa].
  Real yield_stress;        ///< σ₀ [Pa]
  Real ends[points - 1];    ///< ε̄ at the ends of the pieces, ascending.
  Real slopes[points - 1];  ///< dσ_y/dε̄ of the pieces [Pa].

  /// The flow stress of a history [Pa].
  PHYXEL_HD Real flow_stress(const State& state) const {
    Real stress = yield_stress;
    for (int k = 0; k < points - 1; ++k) {
      stress = fused(slopes[k], part_below(state.equivalent_plastic_strain, k), stress);
    }
    return stress;
  }
  /// The largest flow stress of the curve [Pa].
  PHYXEL_HD Real largest_flow_stress() const {
    Real stress = yield_stress, most = yield_stress;
    for (int k = 0; k < points - 1; ++k) {
      stress = fused(slopes[k], ends[k] - begin_of(k), stress);
      most = larger(most, stress);
    }
    return most;
  }
  /// Plastic work ∫ σ_y dε̄ since the virgin state [J/m³].
  PHYXEL_HD Real plastic_work(const State& state) const {
    const Real e = state.equivalent_plastic_strain;
    Real work = yield_stress * e;
    for (int k = 0; k < points - 1; ++k) {
      // A piece raises the flow stress along its length, and from its end on.
      const Real part = part_below(e, k), rest = larger(e - ends[k], Real(0));
      work = fused(slopes[k] * part, fused(Real(0.5), part, rest), work);
    }
    return work;
  }
  /// Solves for Δε̄ >= 0 in excess = 3 μ Δε̄ + σ_y(ε̄ + Δε̄) - σ_y(ε̄), piece by piece: exactly, with
  /// no iteration.
  PHYXEL_HD Real plastic_increment(Real excess, const State& state, Real /*dt*/) const {
    const Real before = state.equivalent_plastic_strain, elastic = Real(3) * mu;
    Real left = excess, increment{};
#if defined(__CUDA_ARCH__)
#pragma unroll 1
#endif
    for (int k = 0; k < points - 1; ++k) {
      const Real length = larger(ends[k] - larger(begin_of(k), before), Real(0));
      const Real modulus = elastic + slopes[k];
      const Real step = smaller(length, larger(left, Real(0)) / modulus);
      increment = increment + step;
      left = fused(-modulus, step, left);
    }
    return increment + larger(left, Real(0)) / elastic;
  }
  /// Adds Δε̄ to a history where the excess is positive.
  PHYXEL_HD void remember(State& state, Real excess, Real increment, Real /*dt*/) const {
    Real& e = state.equivalent_plastic_strain;
    e = where_larger(excess, Real(0), e + increment, e);
  }

 private:
  /// ε̄ at the begin of a piece.
  PHYXEL_HD Real begin_of(int k) const { return k == 0 ? Real(0) : ends[k - 1]; }
  /// The part of a piece that lies below a plastic strain.
  PHYXEL_HD Real part_below(Real e, int k) const {
    return smaller(larger(e - begin_of(k), Real(0)), ends[k] - begin_of(k));
  }
};

}  // namespace phyxel
