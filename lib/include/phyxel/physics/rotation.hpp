/// The rotation nearest to a deformation gradient: the rotation R with the largest R : F. For det F
/// > 0 it is the factor R of the polar decomposition F = R S. For det F < 0 (inversion) it is still
/// a rotation, and the smallest stretch of S is negative.
///
/// R : F = qᵀ K q for the unit quaternion q of R and Davenport's matrix K, linear in F, so q is the
/// eigenvector of K's largest eigenvalue (B. K. P. Horn 1987, Closed-form solution of absolute
/// orientation using unit quaternions). That eigenvalue, the trace of S, is found by Laguerre's
/// method on K's characteristic polynomial, whose roots are all real; q qᵀ is the adjugate of K
/// minus it, up to its length. All formulas are written in ∇u, so that small strains keep their
/// digits.
#pragma once

#include <cmath>

#include "phyxel/types.hpp"

namespace phyxel {

/// F = R S with a rotation R and a symmetric S.
template <class Real>
struct NearestRotation {
  Mat3<Real> change;  ///< R - I.
  Real stretch;       ///< R : F - 3, the trace of S - I.
};

namespace detail {

/// A quaternion, not normalised.
template <class Real>
struct Quaternion {
  Real w;
  Vec3<Real> v;
};

template <class Real>
PHYXEL_HD Vec3<Real> row_of(const Sym3<Real>& s, int row) {
  if (row == 0) return {s.xx, s.xy, s.xz};
  if (row == 1) return {s.xy, s.yy, s.yz};
  return {s.xz, s.yz, s.zz};
}
template <class Real>
PHYXEL_HD Sym3<Real> adjugate(const Sym3<Real>& s) {
  return {s.yy * s.zz - s.yz * s.yz, s.xz * s.yz - s.xy * s.zz, s.xy * s.yz - s.xz * s.yy,
          s.xx * s.zz - s.xz * s.xz, s.xy * s.xz - s.xx * s.yz, s.xx * s.yy - s.xy * s.xy};
}

/// Davenport's matrix of F = I + ∇u, less that of I: [trace, zᵀ; z, sides].
template <class Real>
struct Davenport {
  Real trace;
  Vec3<Real> z;
  Sym3<Real> sides;  ///< ∇u + ∇uᵀ - trace I

  PHYXEL_HD explicit Davenport(const Mat3<Real>& g)
      : trace(g(0, 0) + g(1, 1) + g(2, 2)),
        z{g(2, 1) - g(1, 2), g(0, 2) - g(2, 0), g(1, 0) - g(0, 1)},
        sides{g(0, 0) - g(1, 1) - g(2, 2), g(0, 1) + g(1, 0), g(0, 2) + g(2, 0),
              g(1, 1) - g(0, 0) - g(2, 2), g(1, 2) + g(2, 1), g(2, 2) - g(0, 0) - g(1, 1)} {}

  /// The eigenvector of eigenvalue 3 + stretch: the largest column of the adjugate of
  /// (3 + stretch) I - K.
  PHYXEL_HD Quaternion<Real> eigenvector(Real stretch) const {
    const Real four = Real(4) + stretch, corner = stretch - trace;
    const Sym3<Real> b{four - sides.xx, -sides.xy, -sides.xz,
                       four - sides.yy, -sides.yz, four - sides.zz};
    const Sym3<Real> adj = adjugate(b);
    const Real ww = dot(row_of(b, 0), row_of(adj, 0));
    const Vec3<Real> w = adj * z;
    // corner adj(B) - [z]× B [z]×ᵀ
    const Vec3<Real> t0 = cross(z, row_of(b, 0)), t1 = cross(z, row_of(b, 1)),
                     t2 = cross(z, row_of(b, 2));
    const Vec3<Real> x = corner * row_of(adj, 0) - cross(z, Vec3<Real>{t0.x, t1.x, t2.x}),
                     y = corner * row_of(adj, 1) - cross(z, Vec3<Real>{t0.y, t1.y, t2.y}),
                     zz = corner * row_of(adj, 2) - cross(z, Vec3<Real>{t0.z, t1.z, t2.z});
    Quaternion<Real> q{ww, w};
    Real largest = ww;
    const auto look_at = [&](Real diagonal, Real first, Vec3<Real> rest) {
      q.w = where_larger(diagonal, largest, first, q.w);
      q.v.x = where_larger(diagonal, largest, rest.x, q.v.x);
      q.v.y = where_larger(diagonal, largest, rest.y, q.v.y);
      q.v.z = where_larger(diagonal, largest, rest.z, q.v.z);
      largest = where_larger(diagonal, largest, diagonal, largest);
    };
    look_at(x.x, w.x, x);
    look_at(y.y, w.y, y);
    look_at(zz.z, w.z, zz);
    return q;
  }
  /// qᵀ (K - 3 I) q: R : F - 3 times the length² of q.
  PHYXEL_HD Real stretch_of(const Quaternion<Real>& q) const {
    const Vec3<Real> turned = sides * q.v - Real(4) * q.v;
    return trace * q.w * q.w + Real(2) * q.w * dot(z, q.v) + dot(q.v, turned);
  }
};

}  // namespace detail

/// Computes the rotation nearest to F. Where two rotations are equally near (as for F = 0), the
/// result is finite but arbitrary. @param grad_u ∇u = F - I
template <class Real>
PHYXEL_HD NearestRotation<Real> nearest_rotation(const Mat3<Real>& grad_u) {
  using std::sqrt;
  const Mat3<Real> f = identity<Real>() + grad_u, cof = cofactor(f);
  Real a{}, b{};
  for (int e = 0; e < 9; ++e) {
    a = fused(f(e / 3, e % 3), f(e / 3, e % 3), a);
    b = fused(cof(e / 3, e % 3), cof(e / 3, e % 3), b);
  }
  const Real d = f(0, 0) * cof(0, 0) + f(0, 1) * cof(0, 1) + f(0, 2) * cof(0, 2);
  // λ⁴ - 2 a λ² - 8 d λ + a² - 4 b, from above its roots. Six steps: three suffice for small
  // strains; flattened or inverted bodies, where two roots lie close together, need the others.
  const Real least(1e-30F);
  const Real constant = a * a - Real(4) * b;
  Real root = sqrt(Real(3) * a);
  for (int k = 0; k < 6; ++k) {
    const Real square = root * root;
    const Real value = (square - Real(2) * a) * square - Real(8) * d * root + constant;
    const Real slope = Real(4) * root * (square - a) - Real(8) * d;
    const Real bend = Real(12) * square - Real(4) * a;
    // The exact value is not negative; rounding may make it so.
    const Real inside = Real(9) * slope * slope - Real(12) * value * bend;
    const Real bent = sqrt(where_larger(inside, Real(0), inside, Real(0)));
    root = root - Real(4) * value / (slope + bent + least);
  }
  const detail::Davenport<Real> k(grad_u);
  const detail::Quaternion<Real> q = k.eigenvector(root - Real(3));
  const Real scale = Real(1) / (q.w * q.w + dot(q.v, q.v) + least);
  const Vec3<Real> v = (Real(2) * scale) * q.v, wv = q.w * v;
  NearestRotation<Real> r;
  r.stretch = scale * k.stretch_of(q);
  Mat3<Real>& m = r.change;
  m(0, 0) = -(v.y * q.v.y + v.z * q.v.z);
  m(1, 1) = -(v.x * q.v.x + v.z * q.v.z);
  m(2, 2) = -(v.x * q.v.x + v.y * q.v.y);
  m(0, 1) = v.x * q.v.y - wv.z;
  m(1, 0) = v.x * q.v.y + wv.z;
  m(0, 2) = v.x * q.v.z + wv.y;
  m(2, 0) = v.x * q.v.z - wv.y;
  m(1, 2) = v.y * q.v.z - wv.x;
  m(2, 1) = v.y * q.v.z + wv.x;
  return r;
}

}  // namespace phyxel
