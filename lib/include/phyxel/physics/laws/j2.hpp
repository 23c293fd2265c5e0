/// Metals: J2 plasticity at finite strain, with isotropic hardening, on Hencky's law.
///
/// F = F_e F_p; the stress is Hencky's of F_e (laws/hencky.hpp). Where its von Mises stress q
/// exceeds the flow stress σ_y, the material flows along the deviator of the stress, by an
/// exponential map that keeps the volume (Simo 1992, Algorithms for static and dynamic
/// multiplicative plasticity; de Souza Neto, Perić and Owen 2008, Computational methods for
/// plasticity, box 14.3):
///   q - 3 μ Δε̄ = σ_y(ε̄ + Δε̄),   σ_y = σ₀ + H ε̄ + (σ_∞ - σ₀)(1 - exp(-δ ε̄))      (Voce 1955)
/// with the equivalent plastic strain ε̄. The return mapping is implicit: a step of any size ends
/// on the yield surface, and a rotation of the body between two steps has no effect.
///
/// The history holds L, the lower triangular factor of C_p⁻¹ = L Lᵀ, rather than C_p⁻¹ itself: F_e
/// is F L up to a rotation of the body at rest, which an isotropic law does not see, and rounding
/// grows with the plastic stretch instead of with its square. With S the stretch of the trial F L,
/// flow replaces L by the triangular factor of L exp(-Δε_p), without an inverse of F.
#pragma once

#include <array>
#include <cmath>
#include <span>
#include <type_traits>

#include "phyxel/physics/laws/hencky.hpp"

namespace phyxel {

/// Finite-strain J2 plasticity with linear and Voce hardening.
template <class Real>
struct J2 {
  static constexpr const char* name = "j2";
  static constexpr const char* meaning =
      "metals: Hencky's law until the von Mises stress reaches yield_stress, then plastic flow "
      "with "
      "linear hardening, Voce's, or none";
  static constexpr LawParameter parameters[] = {
      young_modulus,
      poisson_ratio,
      {.name = "yield_stress",
       .unit = "Pa",
       .low = 1e-12,
       .high = 1e18,
       .open = false,
       .meaning = "Flow stress of the virgin material.",
       .typical = 1e5},
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
  static constexpr bool many_registers = true;

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
  /// The smaller of E and 10 σ₀ [Pa]: hourglass residuals keep growing while the material flows,
  /// and with E alone their forces would exceed the flow stress.
  static double hourglass_modulus(std::span<const double> values) {
    return values[0] < 10 * values[2] ? values[0] : 10 * values[2];
  }

  static constexpr HistoryNumber history[] = {
      {"inverse_plastic_factor_xx", ""}, {"inverse_plastic_factor_yx", ""},
      {"inverse_plastic_factor_yy", ""}, {"inverse_plastic_factor_zx", ""},
      {"inverse_plastic_factor_zy", ""}, {"inverse_plastic_factor_zz", ""},
      {"equivalent_plastic_strain", ""}};
  /// The history of a phyxel; all zero: never yielded.
  struct State {
    /// L - I by rows: xx; yx yy; zx zy zz.
    Real xx{}, yx{}, yy{}, zx{}, zy{}, zz{};
    Real equivalent_plastic_strain{};  ///< ε̄
  };

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
  /// The stored elastic energy [J/m³]: Hencky's of F L.
  PHYXEL_HD Real energy(const Mat3<Real>& grad_u, const State& state) const {
    return Hencky<Real>{lambda, mu}.energy(elastic_gradient(grad_u, state));
  }
  /// Plastic work ∫ σ_y dε̄ since the virgin state [J/m³].
  PHYXEL_HD Real plastic_work(const State& state) const {
    const Real e = state.equivalent_plastic_strain;
    const Real rate = where_larger(saturation_rate, Real(0), saturation_rate, Real(1));
    const Real linear = e * fused(Real(0.5) * hardening, e, yield_stress);
    const Real late = e + exp_minus_one(rate * e) / rate;
    return linear + where_larger(saturation_rate, Real(0), saturates() * late, Real(0));
  }
  /// The elastic stress ∂ψ/∂∇u [Pa] at a fixed history: Hencky's of F L, pulled back to F.
  PHYXEL_HD Mat3<Real> elastic_stress(const Mat3<Real>& grad_u, const State& state) const {
    const Hencky<Real> elastic{lambda, mu};
    return times_transpose(elastic.first_piola_stress(elastic_gradient(grad_u, state)), state);
  }
  /// The linearisation at rest, that of Hencky's law.
  PHYXEL_HD SmallStrain<Real> at_rest(Real volume_stiffness) const {
    return Hencky<Real>{lambda, mu}.at_rest(volume_stiffness);
  }
  /// First Piola stress [Pa] at the end of a step, whose length does not matter.
  /// @param grad_u F - I at the end of the step
  /// @param state history at the start of the step; advanced to its end
  PHYXEL_HD Mat3<Real> first_piola_stress(const Mat3<Real>& grad_u, State& state,
                                          Real /*dt*/) const {
    using std::sqrt;
    const HenckyStrain<Real> trial = HenckyStrain<Real>::of(elastic_gradient(grad_u, state));
    const Real before = state.equivalent_plastic_strain;
    const Real von_mises = mu * sqrt(Real(6) * trial.deviator_squared());
    // Crushed or inverted material (a stretch below s₀ of Hencky's law) does not flow, since flow
    // would enlarge a negative stretch; it recovers elastically.
    const Real least = smaller(smaller(trial.isolated.biot, trial.near.biot), trial.far.biot);
    const Real excess = where_larger(least, Real(LogarithmicStrain<Real>::least_stretch - 1),
                                     von_mises - flow_stress(before), Real(0));
    Real secant = mu, lambda_secant = lambda;
    State after = state;
    if (may_be_positive(excess)) {
      const Real increment = plastic_increment(excess, before);
      const Real lost = Real(3) * mu * increment / von_mises;  // fraction of the trial deviator
      // Flow keeps the bulk modulus λ + ⅔ μ, and so the mean stress.
      const Real softer = mu * lost;
      secant = where_larger(excess, Real(0), mu - softer, mu);
      lambda_secant = where_larger(excess, Real(0), fused(Real(2.0 / 3), softer, lambda), lambda);
      flow(trial, where_larger(excess, Real(0), lost, Real(0)), after);
      after.equivalent_plastic_strain = before + increment;
    }
    const Mat3<Real> p = times_transpose(trial.first_piola_stress(lambda_secant, secant), state);
    const auto commit = [&](Real& old, Real next) {
      old = where_larger(excess, Real(0), next, old);
    };
    commit(state.xx, after.xx), commit(state.yx, after.yx), commit(state.yy, after.yy);
    commit(state.zx, after.zx), commit(state.zy, after.zy), commit(state.zz, after.zz);
    commit(state.equivalent_plastic_strain, after.equivalent_plastic_strain);
    return p;
  }
  /// An upper bound of the stiffness of plane waves [Pa] (physics/law.hpp), whatever the history,
  /// for flow stresses up to that at ε̄ = 10. It is the stiffness of elastic unloading, at elastic
  /// stretches whose ratios the flow stress limits, times 1/s² of the smallest total stretch (at
  /// least 0.01).
  PHYXEL_HD Real wave_stiffness(const PrincipalStretches<Real>& s) const {
    const Real q = flow_stress(Real(10));
    // (ln s_a - ln s_b) between elastic principal stretches is at most q/(√3 μ).
    const Real gap = q / (Real(1.7320508075688772) * mu), square = gap * gap;
    const Real volume = larger(Real(0.1), s.largest * s.middle * s.smallest);
    const Real mean = fused(Real(2.0 / 3), mu, lambda) * log_one_plus(volume - Real(1));
    const Real third = Real(1.0 / 3) * q;
    WaveBound<Real> bound;
    bound.add_diagonal(lambda + Real(2) * mu - mean + Real(2) * third);
    const Real mixed = lambda + mu - mean, bend = Real(1.0 / 3) * square;
    bound.add_pair(larger(-mixed, mixed) + mu * bend + third, mu * (Real(1) + gap + bend));
    const Real smallest = larger(Real(0.01), s.smallest);
    return bound.value() / (smallest * smallest);
  }

 private:
  /// σ_∞ - σ₀ [Pa].
  PHYXEL_HD Real saturates() const { return saturation_stress - yield_stress; }

  /// False if a branch can be skipped: of a scalar, whether it is positive; of a pack, always true.
  PHYXEL_HD static bool may_be_positive([[maybe_unused]] Real value) {
    if constexpr (std::is_floating_point_v<Real>) {
      return value > Real(0);
    } else {
      return true;
    }
  }

  /// F L - I.
  PHYXEL_HD static Mat3<Real> elastic_gradient(const Mat3<Real>& g, const State& l) {
    Mat3<Real> e;
    for (int a = 0; a < 3; ++a) {
      e(a, 0) = fused(g(a, 2), l.zx, fused(g(a, 1), l.yx, fused(g(a, 0), l.xx, g(a, 0))));
      e(a, 1) = fused(g(a, 2), l.zy, fused(g(a, 1), l.yy, g(a, 1)));
      e(a, 2) = fused(g(a, 2), l.zz, g(a, 2));
    }
    e(0, 0) = e(0, 0) + l.xx;
    e(1, 0) = e(1, 0) + l.yx, e(1, 1) = e(1, 1) + l.yy;
    e(2, 0) = e(2, 0) + l.zx, e(2, 1) = e(2, 1) + l.zy, e(2, 2) = e(2, 2) + l.zz;
    return e;
  }
  /// p Lᵀ.
  PHYXEL_HD static Mat3<Real> times_transpose(const Mat3<Real>& p, const State& l) {
    Mat3<Real> m;
    for (int a = 0; a < 3; ++a) {
      m(a, 0) = fused(p(a, 0), l.xx, p(a, 0));
      m(a, 1) = fused(p(a, 1), l.yy, fused(p(a, 0), l.yx, p(a, 1)));
      m(a, 2) = fused(p(a, 2), l.zz, fused(p(a, 1), l.zy, fused(p(a, 0), l.zx, p(a, 2))));
    }
    return m;
  }

  /// Solves for Δε̄ >= 0 in excess = 3 μ Δε̄ + σ_y(ε̄ + Δε̄) - σ_y(ε̄). The flow stress is concave,
  /// so Newton's method approaches the root from below and never passes it: six steps are exact to
  /// rounding where δ (σ_∞ - σ₀) <= 3 μ, as in metals, or where δ Δε̄ <= 1.
  PHYXEL_HD Real plastic_increment(Real excess, Real before) const {
    const Real slope = fused(Real(3), mu, hardening), rise = saturates();
    const Real linear = excess / slope;
    if (!may_be_positive(rise)) return linear;
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

  /// L ← the triangular factor of L exp(-lost e), e the deviator of the trial's logarithmic strain.
  PHYXEL_HD static void flow(const HenckyStrain<Real>& trial, Real lost, State& l) {
    using std::sqrt;
    const Sym3<Real> strain = trial.strain();
    const Real mean = Real(1.0 / 3) * phyxel::trace(strain);
    const Sym3<Real> e{-(lost * (strain.xx - mean)), -(lost * strain.xy),
                       -(lost * strain.xz),          -(lost * (strain.yy - mean)),
                       -(lost * strain.yz),          -(lost * (strain.zz - mean))};
    const Real squared = lost * lost;
    const Sym3<Real> d = exp_minus_identity(e, Real(0.5) * squared * trial.deviator_squared(),
                                            -(squared * lost * trial.deviator_determinant()));
    // The rows of L + L d - I.
    Vec3<Real> x{fused(l.xx, d.xx, d.xx) + l.xx, fused(l.xx, d.xy, d.xy), fused(l.xx, d.xz, d.xz)};
    Vec3<Real> y{fused(l.yy, d.xy, fused(l.yx, d.xx, d.xy)) + l.yx,
                 fused(l.yy, d.yy, fused(l.yx, d.xy, d.yy)) + l.yy,
                 fused(l.yy, d.yz, fused(l.yx, d.xz, d.yz))};
    Vec3<Real> z{fused(l.zz, d.xz, fused(l.zy, d.xy, fused(l.zx, d.xx, d.xz))) + l.zx,
                 fused(l.zz, d.yz, fused(l.zy, d.yy, fused(l.zx, d.xy, d.yz))) + l.zy,
                 fused(l.zz, d.zz, fused(l.zy, d.yz, fused(l.zx, d.xz, d.zz))) + l.zz};
    // Givens rotations from the right eliminate the entries above the diagonal. The rotation of (1
    // + a, b) to (r, 0) adds r - 1 - a = b²/(r + 1 + a) to the diagonal.
    struct Turn {
      Real sine, cosine_less;  ///< sin, 1 - cos
      PHYXEL_HD Turn(Real& a, Real& b) {
        const Real side = Real(1) + a, r = sqrt(fused(side, side, b * b)),
                   more = b * b / (r + side);
        const Real inverse = Real(1) / r;
        sine = b * inverse, cosine_less = more * inverse;
        a = a + more, b = Real(0);
      }
      /// Rotates (p, q); if `diagonal` is 1, q - 1 is stored in place of q.
      PHYXEL_HD void apply(Real& p, Real& q, Real diagonal) const {
        const Real first = p, second = q + diagonal;
        p = p + fused(sine, second, -(cosine_less * first));
        q = q - fused(sine, first, cosine_less * second);
      }
    };
    const Turn xy(x.x, x.y);
    xy.apply(y.x, y.y, Real(1)), xy.apply(z.x, z.y, Real(0));
    const Turn xz(x.x, x.z);
    xz.apply(y.x, y.z, Real(0)), xz.apply(z.x, z.z, Real(1));
    const Turn yz(y.y, y.z);
    yz.apply(z.y, z.z, Real(1));
    // Removes det L - 1, so that rounding does not add up to a change of volume.
    const Real area = fused(x.x, y.y, x.x + y.y);
    const Real third = Real(-1.0 / 3) * fused(area, z.z, area + z.z);
    l.xx = fused(third, x.x, third) + x.x;
    l.yy = fused(third, y.y, third) + y.y;
    l.zz = fused(third, z.z, third) + z.z;
    l.yx = fused(third, y.x, y.x), l.zx = fused(third, z.x, z.x), l.zy = fused(third, z.y, z.y);
  }
};

}  // namespace phyxel
