/// Functions of symmetric 3x3 tensors without eigenvectors, in arithmetic and square roots only:
/// the same code runs on scalars and on SIMD packs, and a lane of a pack has the bits of the
/// scalar wherever the compiler contracts products and sums in both alike, or in neither.
///
/// An isotropic function f of a tensor is Newton's interpolation polynomial of f through the three
/// eigenvalues, evaluated at the tensor. A double eigenvalue is known only to the square root of
/// the rounding error, but the error of interpolation is the product of the errors of all three:
/// the polynomial keeps the digits that eigenvectors would lose. Against cyclic Jacobi rotations
/// (four sweeps) eigenvalues and polynomial take half the instructions and a quarter of the
/// divisions and roots, with the same errors; against square roots of the tensor by iteration and a
/// Padé approximant of the logarithm they take no inverses, and know the sign of each eigenvalue.
#pragma once

#include <cmath>
#include <type_traits>

#include "phyxel/types.hpp"

namespace phyxel {

namespace detail {

/// The scalar type of a pack's lane; of a scalar, its own type.
template <class Real>
struct LaneOf {
  using type = Real;
};
template <template <class, int> class Pack, class Lane, int width>
struct LaneOf<Pack<Lane, width>> {
  using type = Lane;
};
/// True for a mantissa of 24 bits, for which shorter series are exact to rounding.
template <class Real>
inline constexpr bool single_precision = std::is_same_v<typename LaneOf<Real>::type, float>;

/// 1/a, or 1 where a is zero (or its square is, in rounding).
template <class Real>
PHYXEL_HD Real safe_inverse(Real a) {
  return Real(1) / where_larger(a * a, Real(0), a, Real(1));
}

}  // namespace detail

/// The larger of two numbers; b if one is not a number.
template <class Real>
PHYXEL_HD Real larger(Real a, Real b) {
  return where_larger(a, b, a, b);
}

/// The smaller of two numbers; b if one is not a number.
template <class Real>
PHYXEL_HD Real smaller(Real a, Real b) {
  return where_larger(b, a, a, b);
}

/// artanh(z)/z of w = z², to rounding for w <= 0.0295 (z <= tan²(π/8), the end of the range that
/// log_one_plus needs): Taylor's series, Σ wᵏ/(2k + 1).
template <class Real>
PHYXEL_HD Real artanh_ratio(Real w) {
  if constexpr (detail::single_precision<Real>) {
    Real sum = Real(1.0 / 9);
    sum = fused(sum, w, Real(1.0 / 7));
    sum = fused(sum, w, Real(1.0 / 5));
    sum = fused(sum, w, Real(1.0 / 3));
    return fused(sum, w, Real(1));
  } else {
    Real sum = Real(1.0 / 21);
    sum = fused(sum, w, Real(1.0 / 19));
    sum = fused(sum, w, Real(1.0 / 17));
    sum = fused(sum, w, Real(1.0 / 15));
    sum = fused(sum, w, Real(1.0 / 13));
    sum = fused(sum, w, Real(1.0 / 11));
    sum = fused(sum, w, Real(1.0 / 9));
    sum = fused(sum, w, Real(1.0 / 7));
    sum = fused(sum, w, Real(1.0 / 5));
    sum = fused(sum, w, Real(1.0 / 3));
    return fused(sum, w, Real(1));
  }
}

/// ln(1 + x), relative error of a few roundings, for 2⁻³·⁵ <= 1 + x <= 2¹⁵·⁵ (less accurate
/// outside). Factors of two are taken out by comparisons, since packs have no access to exponents.
template <class Real>
PHYXEL_HD Real log_one_plus(Real x) {
  Real twos{};
  const auto divide = [&](double exponent, double threshold, double power) {
    const Real reduced = (x - Real(power - 1)) * Real(1 / power);
    const Real more = twos + Real(exponent);
    twos = where_larger(x, Real(threshold - 1), more, twos);
    x = where_larger(x, Real(threshold - 1), reduced, x);
  };
  const auto multiply = [&](double exponent, double threshold, double power) {
    const Real reduced = fused(x, Real(power), Real(power - 1));
    const Real less = twos - Real(exponent);
    twos = where_larger(Real(threshold - 1), x, less, twos);
    x = where_larger(Real(threshold - 1), x, reduced, x);
  };
  constexpr double root = 1.4142135623730951;
  divide(8, 128 * root, 256);
  divide(4, 8 * root, 16);
  divide(2, 2 * root, 4);
  divide(1, root, 2);
  multiply(2, 0.25 * root, 4);
  multiply(1, 0.5 * root, 2);
  const Real z = x / (Real(2) + x);
  return fused(twos, Real(0.69314718055994531), Real(2) * z * artanh_ratio(z * z));
}

/// exp(-y) - 1 for y >= 0, absolute error of a few roundings: Taylor's series of y/64, squared six
/// times. Above 60, its value at 60.
template <class Real>
PHYXEL_HD Real exp_minus_one(Real y) {
  constexpr int terms = detail::single_precision<Real> ? 5 : 9;
  const Real x = Real(-1.0 / 64) * smaller(y, Real(60));
  Real sum(1);
  for (int k = terms; k > 1; --k) sum = fused(Real(1.0 / k) * x, sum, Real(1));
  sum = sum * x;
  for (int k = 0; k < 6; ++k) sum = fused(sum, sum, Real(2) * sum);
  return sum;
}

/// Eigenvalues of a traceless symmetric tensor: `isolated` is farther from the other two than they
/// are from each other; of those two, `far` is the one farther from `isolated`.
template <class Real>
struct TracelessEigenvalues {
  Real isolated, near, far;
};

/// Computes the eigenvalues of d, a symmetric tensor of trace zero. The roots of its characteristic
/// polynomial are
///   2 p cos(φ + 2πk/3) with p² = tr(d²)/6 and cos 3φ = det(d/p)/2 (Smith 1961). z = cos φ is a
///   smooth function of |cos 3φ|, which a cubic and Newton's method evaluate without trigonometry.
template <class Real>
PHYXEL_HD TracelessEigenvalues<Real> traceless_eigenvalues(const Sym3<Real>& d) {
  using std::sqrt;
  const Real p = sqrt(contract(d, d) * Real(1.0 / 6));
  const Sym3<Real> n = detail::safe_inverse(p) * d;
  const Real half = Real(0.5) * (n.xx * detail::minor(n.yy, n.zz, n.yz, n.yz) -
                                 n.xy * detail::minor(n.xy, n.zz, n.yz, n.xz) +
                                 n.xz * detail::minor(n.xy, n.yz, n.yy, n.xz));
  const Real sign = where_larger(Real(0), half, Real(-1), Real(1));
  const Real cosine = smaller(sign * half, Real(1));
  // Chebyshev's interpolant, within 4.1e-5; each step of Newton's method squares that (times 1.7).
  Real z = fused(fused(fused(Real(0.0093197), cosine, Real(-0.0406912)), cosine, Real(0.1653304)),
                 cosine, Real(0.8660663));
  for (int k = 0; k < (detail::single_precision<Real> ? 1 : 2); ++k) {
    const Real square = z * z;
    const Real value = fused(fused(Real(4), square, Real(-3)), z, -cosine);
    z = z - value / fused(Real(12), square, Real(-3));
  }
  const Real sine = sqrt(larger(fused(-z, z, Real(1)), Real(0)));
  const Real scale = sign * p, across = Real(1.7320508075688772) * sine;
  return {Real(2) * scale * z, scale * (across - z), -(scale * (across + z))};
}

/// a + b d + c d² of a symmetric tensor d.
template <class Real>
struct QuadraticOf {
  Real a, b, c;

  /// @param d the tensor
  /// @param square d²
  PHYXEL_HD Sym3<Real> at(const Sym3<Real>& d, const Sym3<Real>& square) const {
    return {fused(c, square.xx, fused(b, d.xx, a)), fused(c, square.xy, b * d.xy),
            fused(c, square.xz, b * d.xz),          fused(c, square.yy, fused(b, d.yy, a)),
            fused(c, square.yz, b * d.yz),          fused(c, square.zz, fused(b, d.zz, a))};
  }
};

/// s².
template <class Real>
PHYXEL_HD Sym3<Real> square(const Sym3<Real>& s) {
  const auto sum = [](Real a, Real b, Real c, Real d, Real e, Real f) {
    return fused(e, f, fused(c, d, a * b));
  };
  return {sum(s.xx, s.xx, s.xy, s.xy, s.xz, s.xz), sum(s.xx, s.xy, s.xy, s.yy, s.xz, s.yz),
          sum(s.xx, s.xz, s.xy, s.yz, s.xz, s.zz), sum(s.xy, s.xy, s.yy, s.yy, s.yz, s.yz),
          sum(s.xy, s.xz, s.yy, s.yz, s.yz, s.zz), sum(s.xz, s.xz, s.yz, s.yz, s.zz, s.zz)};
}

/// exp(a) - I of a traceless symmetric tensor, with a relative error of a few roundings up to |a| =
/// 2: a³ = j2 a + j3 I (Cayley and Hamilton) makes Taylor's series of a/8 and its three squarings a
/// recurrence of three numbers.
/// @param a the tensor
/// @param j2 ½ tr a²
/// @param j3 det a
template <class Real>
PHYXEL_HD Sym3<Real> exp_minus_identity(const Sym3<Real>& a, Real j2, Real j3) {
  constexpr int terms = detail::single_precision<Real> ? 7 : 11;
  j2 = Real(1.0 / 64) * j2, j3 = Real(1.0 / 512) * j3;
  Real unit{}, first(1), second{};                 // coefficients of the sum
  Real term_unit{}, term_first(1), term_second{};  // coefficients of (a/8)ᵏ/k!
  for (int k = 2; k <= terms; ++k) {
    const Real share = Real(1.0 / k), old = term_second;
    term_second = share * term_first;
    term_first = share * fused(old, j2, term_unit);
    term_unit = share * (old * j3);
    unit = unit + term_unit, first = first + term_first, second = second + term_second;
  }
  for (int k = 0; k < 3; ++k) {  // x ← 2 x + x²
    const Real cross = Real(2) * first * second, squares = second * second;
    const Real u = fused(cross, j3, fused(unit, unit, Real(2) * unit));
    const Real f = fused(squares, j3, fused(cross, j2, Real(2) * fused(unit, first, first)));
    second = fused(squares, j2, fused(first, first, Real(2) * fused(unit, second, second)));
    unit = u, first = f;
  }
  return QuadraticOf<Real>{unit, Real(1.0 / 8) * first, Real(1.0 / 64) * second}.at(a, square(a));
}

}  // namespace phyxel
