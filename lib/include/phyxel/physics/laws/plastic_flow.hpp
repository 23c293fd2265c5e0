/// Plastic flow at finite strain, for all laws of metals: J2 plasticity on Hencky's law.
///
/// F = F_e F_p; the stress is Hencky's of F_e (laws/hencky.hpp). Where its von Mises stress q
/// exceeds the flow stress σ_y, the material flows along the deviator of the stress, by an
/// exponential map that keeps the volume (Simo 1992, Algorithms for static and dynamic
/// multiplicative plasticity; de Souza Neto, Perić and Owen 2008, Computational methods for
/// plasticity, box 14.3):
///   q - 3 μ Δε̄ = σ_y(ε̄ + Δε̄)
/// with the equivalent plastic strain ε̄. The return mapping is implicit: a step of any size ends
/// on the yield surface, and a rotation of the body between two steps has no effect. Laws differ in
/// σ_y alone, which may depend on the rate Δε̄/Δt and on the history, too.
///
/// The history holds L, the lower triangular factor of C_p⁻¹ = L Lᵀ, rather than C_p⁻¹ itself: F_e
/// is F L up to a rotation of the body at rest, which an isotropic law does not see, and rounding
/// grows with the plastic stretch instead of with its square. With S the stretch of the trial F L,
/// flow replaces L by the triangular factor of L exp(-Δε_p), without an inverse of F.
#pragma once

#include <cmath>
#include <span>
#include <type_traits>

#include "phyxel/physics/laws/hencky.hpp"

namespace phyxel {

/// The flow stress σ₀ of the virgin material, a parameter of laws of metals.
inline constexpr LawParameter virgin_flow_stress{.name = "yield_stress",
                                                 .unit = "Pa",
                                                 .low = 1e-12,
                                                 .high = 1e18,
                                                 .open = false,
                                                 .meaning = "Flow stress of the virgin material.",
                                                 .typical = 1e5};

/// The modulus that scales hourglass control of metals [Pa]: the smaller of E and 10 σ₀. Hourglass
/// residuals keep growing while the material flows, and with E alone their forces would exceed the
/// flow stress.
inline double flowing_modulus(double young, double yield_stress) {
  return young < 10 * yield_stress ? young : 10 * yield_stress;
}

namespace detail {

/// True if a scalar or a lane of a pack is positive: if not, a branch can be skipped.
template <class Real>
PHYXEL_HD bool has_positive(Real value) {
  if constexpr (std::is_floating_point_v<Real>) {
    return value > Real(0);
  } else {
    return any_positive(value);
  }
}

}  // namespace detail

/// The names of the history of plastic flow.
inline constexpr HistoryNumber plastic_history[] = {
    {"inverse_plastic_factor_xx", ""}, {"inverse_plastic_factor_yx", ""},
    {"inverse_plastic_factor_yy", ""}, {"inverse_plastic_factor_zx", ""},
    {"inverse_plastic_factor_zy", ""}, {"inverse_plastic_factor_zz", ""},
    {"equivalent_plastic_strain", ""}};

/// L - I of a phyxel by rows: xx; yx yy; zx zy zz. All zero: no plastic deformation.
template <class Real>
struct PlasticFactor {
  Real xx{}, yx{}, yy{}, zx{}, zy{}, zz{};

  /// F L - I. @param g F - I
  PHYXEL_HD Mat3<Real> elastic_gradient(const Mat3<Real>& g) const {
    Mat3<Real> e;
    for (int a = 0; a < 3; ++a) {
      e(a, 0) = fused(g(a, 2), zx, fused(g(a, 1), yx, fused(g(a, 0), xx, g(a, 0))));
      e(a, 1) = fused(g(a, 2), zy, fused(g(a, 1), yy, g(a, 1)));
      e(a, 2) = fused(g(a, 2), zz, g(a, 2));
    }
    e(0, 0) = e(0, 0) + xx;
    e(1, 0) = e(1, 0) + yx, e(1, 1) = e(1, 1) + yy;
    e(2, 0) = e(2, 0) + zx, e(2, 1) = e(2, 1) + zy, e(2, 2) = e(2, 2) + zz;
    return e;
  }
  /// p Lᵀ.
  PHYXEL_HD Mat3<Real> times_transpose(const Mat3<Real>& p) const {
    Mat3<Real> m;
    for (int a = 0; a < 3; ++a) {
      m(a, 0) = fused(p(a, 0), xx, p(a, 0));
      m(a, 1) = fused(p(a, 1), yy, fused(p(a, 0), yx, p(a, 1)));
      m(a, 2) = fused(p(a, 2), zz, fused(p(a, 1), zy, fused(p(a, 0), zx, p(a, 2))));
    }
    return m;
  }

  /// L ← the triangular factor of L exp(-lost e), e the deviator of the trial's logarithmic strain.
  PHYXEL_HD void flow(const HenckyStrain<Real>& trial, Real lost) {
    using std::sqrt;
    PlasticFactor& l = *this;
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

  /// Replaces L by `next` where `excess` > 0.
  PHYXEL_HD void replace(Real excess, const PlasticFactor& next) {
    const auto replace_one = [&](Real& old, Real by) {
      old = where_larger(excess, Real(0), by, old);
    };
    replace_one(xx, next.xx), replace_one(yx, next.yx), replace_one(yy, next.yy);
    replace_one(zx, next.zx), replace_one(zy, next.zy), replace_one(zz, next.zz);
  }
};

/// The history of a phyxel of a metal; all zero: never yielded.
template <class Real>
struct PlasticState : PlasticFactor<Real> {
  Real equivalent_plastic_strain{};  ///< ε̄
};

/// An upper bound of the stiffness of plane waves [Pa] (physics/law.hpp) of a spring of Hencky's
/// law that follows F but for a flow that keeps the volume, whatever the flow: the stiffness of
/// elastic unloading, times 1/s² of the smallest total stretch (at least 0.01).
/// @param von_mises an upper bound of the spring's von Mises stress [Pa]
/// @param s total stretches
template <class Real>
PHYXEL_HD Real wave_stiffness_of_flow(Real lambda, Real mu, Real von_mises,
                                      const PrincipalStretches<Real>& s) {
  // (ln s_a - ln s_b) between elastic principal stretches is at most q/(√3 μ).
  const Real gap = von_mises / (Real(1.7320508075688772) * mu), square = gap * gap;
  const Real volume = larger(Real(0.1), s.largest * s.middle * s.smallest);
  const Real mean = fused(Real(2.0 / 3), mu, lambda) * log_one_plus(volume - Real(1));
  const Real third = Real(1.0 / 3) * von_mises;
  WaveBound<Real> bound;
  bound.add_diagonal(lambda + Real(2) * mu - mean + Real(2) * third);
  const Real mixed = lambda + mu - mean, bend = Real(1.0 / 3) * square;
  bound.add_pair(larger(-mixed, mixed) + mu * bend + third, mu * (Real(1) + gap + bend));
  const Real smallest = larger(Real(0.01), s.smallest);
  return bound.value() / (smallest * smallest);
}

/// J2 plasticity, the base of laws of metals. `Law` derives from it and has the members `lambda`
/// and `mu` [Pa], `State`, which derives from `PlasticState`, and the functions
///   flow_stress(state)                      σ_y [Pa] of a history, at slow rates
///   plastic_increment(excess, state, dt)    Δε̄ >= 0 of a step of `dt` [s] with q - σ_y = excess
///   remember(state, excess, increment, dt)  adds Δε̄ to a history where excess > 0
///   largest_flow_stress()                   σ_y [Pa] that a body may reach, for the step limit
///   plastic_work(state)                     ∫ σ_y dε̄ since the virgin state [J/m³]
/// With packs, `plastic_increment` also gets an excess <= 0, and its result is not used.
template <class Law, class Real>
struct PlasticFlow {
  static constexpr bool many_registers = true;

  /// The stored elastic energy [J/m³]: Hencky's of F L.
  PHYXEL_HD Real energy(const Mat3<Real>& grad_u, const PlasticFactor<Real>& state) const {
    return elastic().energy(state.elastic_gradient(grad_u));
  }
  /// The elastic stress ∂ψ/∂∇u [Pa] at a fixed history: Hencky's of F L, pulled back to F.
  PHYXEL_HD Mat3<Real> elastic_stress(const Mat3<Real>& grad_u,
                                      const PlasticFactor<Real>& state) const {
    return state.times_transpose(elastic().first_piola_stress(state.elastic_gradient(grad_u)));
  }
  /// The linearisation at rest, that of Hencky's law.
  PHYXEL_HD SmallStrain<Real> at_rest(Real volume_stiffness) const {
    return elastic().at_rest(volume_stiffness);
  }
  /// First Piola stress [Pa] at the end of a step of `dt` [s].
  /// @param grad_u F - I at the end of the step
  /// @param state history at the start of the step; advanced to its end
  template <class State>
  PHYXEL_HD Mat3<Real> first_piola_stress(const Mat3<Real>& grad_u, State& state, Real dt) const {
    using std::sqrt;
    const Real lambda = law().lambda, mu = law().mu;
    const HenckyStrain<Real> trial = HenckyStrain<Real>::of(state.elastic_gradient(grad_u));
    const Real von_mises = mu * sqrt(Real(6) * trial.deviator_squared());
    // Crushed or inverted material (a stretch below s₀ of Hencky's law) does not flow, since flow
    // would enlarge a negative stretch; it recovers elastically.
    const Real least = smaller(smaller(trial.isolated.biot, trial.near.biot), trial.far.biot);
    const Real excess = where_larger(least, Real(LogarithmicStrain<Real>::least_stretch - 1),
                                     von_mises - law().flow_stress(state), Real(0));
    Real secant = mu, lambda_secant = lambda;
    const PlasticFactor<Real> before = state;
    if (detail::has_positive(excess)) {
      const Real increment = law().plastic_increment(excess, state, dt);
      const Real lost = Real(3) * mu * increment / von_mises;  // fraction of the trial deviator
      // Flow keeps the bulk modulus λ + ⅔ μ, and so the mean stress.
      const Real softer = mu * lost;
      secant = where_larger(excess, Real(0), mu - softer, mu);
      lambda_secant = where_larger(excess, Real(0), fused(Real(2.0 / 3), softer, lambda), lambda);
      PlasticFactor<Real> after = before;
      after.flow(trial, where_larger(excess, Real(0), lost, Real(0)));
      state.replace(excess, after);
      law().remember(state, excess, increment, dt);
    }
    return before.times_transpose(trial.first_piola_stress(lambda_secant, secant));
  }
  /// An upper bound of the stiffness of plane waves [Pa] (physics/law.hpp), whatever the history,
  /// at elastic stretches that the flow stress limits.
  PHYXEL_HD Real wave_stiffness(const PrincipalStretches<Real>& s) const {
    return wave_stiffness_of_flow(law().lambda, law().mu, law().largest_flow_stress(), s);
  }

 private:
  PHYXEL_HD const Law& law() const { return static_cast<const Law&>(*this); }
  PHYXEL_HD Hencky<Real> elastic() const { return {law().lambda, law().mu}; }
};

}  // namespace phyxel
