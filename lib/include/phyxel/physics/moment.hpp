/// The moment matrix of a neighbourhood and its pseudo-inverse.
#pragma once

#include "phyxel/types.hpp"

namespace phyxel {

/// Eigenvalues of a moment matrix below this fraction of the largest count as zero: a neighbourhood
/// thinner in some direction than a thousandth of its largest extent is treated as a sheet (rank 2)
/// or a thread (rank 1). In a cloud with volume the fraction is above 0.05.
inline constexpr double moment_cutoff = 1e-6;

/// One neighbour's term of A_i = Σ_j w_ij x_ij x_ijᵀ.
template <class Real>
PHYXEL_HD Sym3<Real> moment_term(Vec3<Real> x, Real w) {
  const Vec3<Real> wx = w * x;
  return {wx.x * x.x, wx.x * x.y, wx.x * x.z, wx.y * x.y, wx.y * x.z, wx.z * x.z};
}

/// A pseudo-inverse and the number of eigenvalues above the cut-off.
template <class Real>
struct PseudoInverse {
  Sym3<Real> matrix;
  int rank = 0;
};

namespace detail {

/// One Jacobi rotation in the (p, q) plane: zeroes m(p, q) and applies the rotation to `vectors`.
template <class Real>
PHYXEL_HD void jacobi_rotate(Mat3<Real>& m, Mat3<Real>& vectors, int p, int q) {
  using std::abs;
  using std::sqrt;
  const Real off = m(p, q);
  if (off == Real(0)) return;
  const Real theta = (m(q, q) - m(p, p)) / (Real(2) * off);
  const Real t =
      (theta >= Real(0) ? Real(1) : Real(-1)) / (abs(theta) + sqrt(theta * theta + Real(1)));
  const Real c = Real(1) / sqrt(t * t + Real(1));
  const Real s = t * c;
  m(p, p) -= t * off;
  m(q, q) += t * off;
  m(p, q) = m(q, p) = Real(0);
  const int r = 3 - p - q;
  const Real rp = m(r, p), rq = m(r, q);
  m(r, p) = m(p, r) = c * rp - s * rq;
  m(r, q) = m(q, r) = s * rp + c * rq;
  for (int k = 0; k < 3; ++k) {
    const Real kp = vectors(k, p), kq = vectors(k, q);
    vectors(k, p) = c * kp - s * kq;
    vectors(k, q) = s * kp + c * kq;
  }
}

}  // namespace detail

/// Moore–Penrose pseudo-inverse of a symmetric positive semi-definite matrix, by cyclic Jacobi
/// rotations (which keep small eigenvalues accurate). Eigenvalues at or below
/// `cutoff` × the largest are treated as zero. Rank 0 gives the zero matrix.
template <class Real>
PHYXEL_HD PseudoInverse<Real> pseudo_inverse(const Sym3<Real>& a,
                                             Real cutoff = Real(moment_cutoff)) {
  using std::abs;
  PseudoInverse<Real> result;
  // Scaled to a largest entry of one, so that no product leaves the range of Real.
  Real scale = abs(a.xx);
  const Real entries[] = {abs(a.xy), abs(a.xz), abs(a.yy), abs(a.yz), abs(a.zz)};
  for (const Real entry : entries) scale = entry > scale ? entry : scale;
  if (!(scale > Real(0))) return result;

  Mat3<Real> m = full((Real(1) / scale) * a);
  Mat3<Real> vectors = identity<Real>();
  for (int sweep = 0; sweep < 8; ++sweep) {  // converges quadratically; 5 sweeps reach rounding
    detail::jacobi_rotate(m, vectors, 0, 1);
    detail::jacobi_rotate(m, vectors, 0, 2);
    detail::jacobi_rotate(m, vectors, 1, 2);
  }
  Real largest = m(0, 0);
  for (int k = 1; k < 3; ++k) largest = m(k, k) > largest ? m(k, k) : largest;
  for (int k = 0; k < 3; ++k) {
    if (!(m(k, k) > cutoff * largest)) continue;
    const Vec3<Real> v{vectors(0, k), vectors(1, k), vectors(2, k)};
    result.matrix += moment_term(v, Real(1) / (m(k, k) * scale));
    ++result.rank;
  }
  return result;
}

}  // namespace phyxel
