/// Hencky's law: Hooke's law in logarithmic strain.
///
/// ψ = μ Σ εₐ² + ½ λ (Σ εₐ)²,  εₐ = L(sₐ) = ln sₐ, with the principal stretches sₐ (Hencky 1928;
/// Anand 1979, On H. Hencky's approximate strain-energy function for moderate deformations).
/// Principal Kirchhoff stresses are 2 μ εₐ + λ Σ ε: a bar under uniaxial stress carries E ln s. The
/// logarithm is not defined for stretches <= 0, so L continues it below s₀ = 0.1 by its tangent,
/// L(s) = ln s₀ + (s - s₀)/s₀ (Stomakhin et al. 2012, Energetically consistent invertible
/// elasticity, section 4): a body that is flattened or inverted (det F <= 0: the smallest stretch
/// is negative) has a finite energy and stress, and is pushed back.
///
/// Stretches are the eigenvalues of S in F = R S (nearest_rotation) rather than the roots of those
/// of FᵀF: the sign of the smallest one is known, and its error grows with the ratio of stretches,
/// not with its square.
#pragma once

#include <cmath>

#include "phyxel/physics/laws/small_strain.hpp"
#include "phyxel/physics/rotation.hpp"
#include "phyxel/physics/stretches.hpp"
#include "phyxel/physics/symmetric_functions.hpp"
#include "phyxel/types.hpp"

namespace phyxel {

/// L of one principal stretch s = 1 + x, and its derivative.
template <class Real>
struct LogarithmicStrain {
  static constexpr double least_stretch = 0.1;  ///< s₀: L is the tangent below it.

  Real biot;      ///< x = s - 1
  Real clipped;   ///< max(x, s₀ - 1)
  Real log;       ///< ln(1 + clipped)
  Real value;     ///< L(s)
  Real gradient;  ///< L'(s) = 1/(1 + clipped)

  /// @param x s - 1
  PHYXEL_HD explicit LogarithmicStrain(Real x)
      : biot(x),
        clipped(where_larger(Real(least_stretch - 1), x, Real(least_stretch - 1), x)),
        log(log_one_plus(clipped)),
        value(fused(Real(1 / least_stretch), biot - clipped, log)),
        gradient(Real(1) / (Real(1) + clipped)) {}
};

/// Divided differences of L and of L' between two stretches, to rounding however close they are.
template <class Real>
struct LogarithmicSlope {
  Real of_value;     ///< (L(s) - L(r))/(s - r)
  Real of_gradient;  ///< (L'(s) - L'(r))/(s - r)

  /// @param a L at s
  /// @param b L at r
  PHYXEL_HD LogarithmicSlope(const LogarithmicStrain<Real>& a, const LogarithmicStrain<Real>& b) {
    const Real gap = a.biot - b.biot;
    const Real inverse = detail::safe_inverse(gap);
    // The part of the gap that lies above s₀: all of it except in crushed bodies.
    const Real below = (a.biot - a.clipped) - (b.biot - b.clipped);
    const Real share = Real(1) - below * inverse;
    const Real by_sum = Real(1) / (Real(2) + a.clipped + b.clipped);
    const Real z = (a.clipped - b.clipped) * by_sum, w = z * z;
    const Real close = Real(2) * share * by_sum * artanh_ratio(w);
    const Real apart = (a.log - b.log) * inverse;
    of_value = fused(Real(1 / LogarithmicStrain<Real>::least_stretch), Real(1) - share,
                     where_larger(w, Real(0.02), apart, close));
    of_gradient = -(share * a.gradient * b.gradient);
  }
};

/// The logarithmic strain of an elastic deformation in its principal frame, and the tensors of
/// functions of it (stress, strain).
template <class Real>
struct HenckyStrain {
  Mat3<Real> turn;                              ///< R - I
  Sym3<Real> deviator, square;                  ///< d = dev(S - I) and d²
  TracelessEigenvalues<Real> eigenvalues;       ///< of d
  LogarithmicStrain<Real> isolated, near, far;  ///< of the eigenvalues of S - I

  /// @param grad_u F - I of the elastic deformation
  PHYXEL_HD static HenckyStrain of(const Mat3<Real>& grad_u) {
    const Mat3<Real> turn = nearest_rotation(grad_u).change;
    const Mat3<Real> biot = fused(transpose(turn), grad_u, transpose(turn) + grad_u);
    const Real mean = Real(1.0 / 3) * (biot(0, 0) + biot(1, 1) + biot(2, 2));
    const Sym3<Real> d{biot(0, 0) - mean,
                       Real(0.5) * (biot(0, 1) + biot(1, 0)),
                       Real(0.5) * (biot(0, 2) + biot(2, 0)),
                       biot(1, 1) - mean,
                       Real(0.5) * (biot(1, 2) + biot(2, 1)),
                       biot(2, 2) - mean};
    const TracelessEigenvalues<Real> y = traceless_eigenvalues(d);
    return {turn,
            d,
            phyxel::square(d),
            y,
            LogarithmicStrain<Real>(mean + y.isolated),
            LogarithmicStrain<Real>(mean + y.near),
            LogarithmicStrain<Real>(mean + y.far)};
  }

  /// θ, the trace of the logarithmic strain: ln det F.
  PHYXEL_HD Real trace() const { return isolated.value + near.value + far.value; }
  /// Σ (εₐ - θ/3)², the squared length of the deviator.
  PHYXEL_HD Real deviator_squared() const {
    const Real mean = Real(1.0 / 3) * trace();
    const Real a = isolated.value - mean, b = near.value - mean, c = far.value - mean;
    return fused(c, c, fused(b, b, a * a));
  }
  /// Π (εₐ - θ/3), the determinant of the deviator.
  PHYXEL_HD Real deviator_determinant() const {
    const Real mean = Real(1.0 / 3) * trace();
    return (isolated.value - mean) * (near.value - mean) * (far.value - mean);
  }
  /// The logarithmic strain in the frame at rest, L(S).
  PHYXEL_HD Sym3<Real> strain() const {
    const LogarithmicSlope<Real> close(near, far), apart(isolated, near);
    return interpolate(near.value, close.of_value, apart.of_value);
  }
  /// First Piola stress R Σ tₐ nₐ nₐᵀ, tₐ = (2 μ εₐ + λ θ) L'(sₐ).
  /// @param lambda, mu Lamé's parameters [Pa], or their secant values during plastic flow
  PHYXEL_HD Mat3<Real> first_piola_stress(Real lambda, Real mu) const {
    const LogarithmicSlope<Real> close(near, far), apart(isolated, near);
    const Real two_mu = Real(2) * mu, mean = lambda * trace();
    const auto kirchhoff = [&](const LogarithmicStrain<Real>& a) {
      return fused(two_mu, a.value, mean);
    };
    // Divided differences of a product: [τ L'](s, r) = τ(s) [L'](s, r) + [τ](s, r) L'(r).
    const Real first =
        fused(kirchhoff(near), close.of_gradient, two_mu * close.of_value * far.gradient);
    const Real second =
        fused(kirchhoff(isolated), apart.of_gradient, two_mu * apart.of_value * near.gradient);
    const Mat3<Real> t = full(interpolate(kirchhoff(near) * near.gradient, first, second));
    return fused(turn, t, t);
  }

 private:
  /// The tensor of a function f of the principal stretches.
  /// @param at_near f(near)
  /// @param close, apart divided differences of f over (near, far) and over (isolated, near)
  PHYXEL_HD Sym3<Real> interpolate(Real at_near, Real close, Real apart) const {
    const TracelessEigenvalues<Real>& y = eigenvalues;
    // The gap is 3 p at least; where it is zero, so is d.
    const Real bend = (apart - close) * detail::safe_inverse(y.isolated - y.far);
    // f(near) + close (d - near) + bend (d - near) (d - far)
    return QuadraticOf<Real>{fused(y.near, fused(bend, y.far, -close), at_near),
                             fused(-bend, y.near + y.far, close), bend}
        .at(deviator, square);
  }
};

/// An upper bound of the stiffness of plane waves [Pa] of an isotropic law whose principal
/// Kirchhoff stresses are 2 μ εₐ + λ Σ ε. With x = Rᵀa, in the principal frame (Ogden 1984,
/// Non-linear elastic deformations, 6.1.4), the stiffness of a bᵀ is
///   Σₐ dₐ wₐ² + 2 Σₐ﹤ᵦ nₐᵦ wₐ wᵦ + Σₐ﹤ᵦ kₐᵦ (xₐ² bᵦ² + xᵦ² bₐ²),   wₐ = xₐ bₐ,  Σ |w| <= 1,
/// at most the largest of all k, all d, and the largest k plus the largest |n|: λ + 2μ at rest. The
/// bound of NaN stretches is NaN.
template <class Real>
struct WaveBound {
  Real diagonal{}, mixed{}, shear{};  ///< The largest d, |n| and k so far [Pa]; k >= 0.

  /// Adds d of one principal direction.
  PHYXEL_HD void add_diagonal(Real d) { diagonal = larger(diagonal, d); }
  /// Adds n and k of a pair of principal directions.
  PHYXEL_HD void add_pair(Real n, Real k) {
    mixed = larger(mixed, larger(-n, n));
    shear = larger(shear, k);
  }
  /// The bound [Pa].
  PHYXEL_HD Real value() const { return larger(diagonal, shear + mixed); }
};

/// Hencky's law. The law softens in tension: Kirchhoff stress grows with the logarithm of stretch,
/// and the force of a bar falls beyond a stretch of e.
template <class Real>
struct Hencky {
  static constexpr const char* name = "hencky";
  static constexpr const char* meaning =
      "Hooke's law in logarithmic strain, the one that metals have; resists compression to "
      "nothing, and "
      "inversion";
  static constexpr LawParameter parameters[] = {young_modulus, poisson_ratio};
  static constexpr auto constants = lame_constants;
  static constexpr bool many_registers = true;

  Real lambda, mu;  ///< Lamé's parameters [Pa].

  /// ψ [J/m³].
  PHYXEL_HD Real energy(const Mat3<Real>& grad_u) const {
    return energy(HenckyStrain<Real>::of(grad_u));
  }
  /// ψ [J/m³] of a given logarithmic strain.
  PHYXEL_HD Real energy(const HenckyStrain<Real>& strain) const {
    const Real a = strain.isolated.value, b = strain.near.value, c = strain.far.value;
    const Real trace = strain.trace();
    return fused(mu, fused(c, c, fused(b, b, a * a)), Real(0.5) * lambda * trace * trace);
  }
  /// R (2 μ ε + λ θ I) L'(S) [Pa]: τ F⁻ᵀ where no stretch is below s₀.
  PHYXEL_HD Mat3<Real> first_piola_stress(const Mat3<Real>& grad_u) const {
    return HenckyStrain<Real>::of(grad_u).first_piola_stress(lambda, mu);
  }
  /// The linearisation at rest, Hooke's law in Cauchy's strain.
  PHYXEL_HD SmallStrain<Real> at_rest(Real volume_stiffness) const {
    return SmallStrain<Real>{{lambda, mu}}.at_rest(volume_stiffness);
  }
  /// An upper bound of the stiffness of plane waves [Pa] (physics/law.hpp).
  PHYXEL_HD Real wave_stiffness(const PrincipalStretches<Real>& s) const {
    const LogarithmicStrain<Real> strains[3] = {LogarithmicStrain<Real>(s.largest - Real(1)),
                                                LogarithmicStrain<Real>(s.middle - Real(1)),
                                                LogarithmicStrain<Real>(s.smallest - Real(1))};
    const Real two_mu = Real(2) * mu;
    const Real mean = lambda * (strains[0].value + strains[1].value + strains[2].value);
    WaveBound<Real> bound;
    for (int i = 0; i < 3; ++i) {
      const LogarithmicStrain<Real>& a = strains[i];
      const Real stress = fused(two_mu, a.value, mean);
      const Real bend = where_larger(a.clipped, a.biot, Real(0), stress);
      bound.add_diagonal((lambda + two_mu - bend) * a.gradient * a.gradient);
      for (int j = i + 1; j < 3; ++j) {
        const LogarithmicStrain<Real>& b = strains[j];
        const LogarithmicSlope<Real> slope(a, b);
        const Real sides = fused(stress, slope.of_gradient, two_mu * slope.of_value * b.gradient);
        // The rotational part ½ (x_a b_b - x_b b_a)² has the stiffness (t_a + t_b)/(s_a + s_b),
        // left out where negative (inverted bodies). Where two stretches cancel, the rotation
        // jumps, which no step resolves.
        const Real stresses = fused(fused(two_mu, b.value, mean), b.gradient, stress * a.gradient);
        const Real turning =
            larger(Real(0), stresses) / larger(Real(0.01), Real(2) + a.biot + b.biot);
        bound.add_pair(fused(lambda * a.gradient, b.gradient, Real(0.5) * (sides - turning)),
                       Real(0.5) * (sides + turning));
      }
    }
    return bound.value();
  }
};

}  // namespace phyxel
