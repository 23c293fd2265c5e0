/// From displacements to strain. Notation: x_ij = X_j - X_i at rest, u displacement, A moment
/// matrix, F = I + ∇u deformation gradient (called J in the 2004 paper).
#pragma once

#include "phyxel/types.hpp"

namespace phyxel {

/// Adds one neighbour's term to Σ_j (u_j - u_i) (w_ij x_ij)ᵀ [m²]. `wx` is w_ij x_ij.
template <class Real>
PHYXEL_HD void add_gradient_term(Mat3<Real>& sum, Vec3<Real> u_ij, Vec3<Real> wx) {
  sum = fused_outer(u_ij, wx, sum);
}

/// ∇u_i = (Σ_j (u_j - u_i) (w_ij x_ij)ᵀ) A_i⁻¹; row a, column b is ∂u_a/∂X_b. Exact for linear
/// displacement fields on any neighbourhood of rank 3. Source: Mueller et al. 2004, equation (11).
template <class Real>
PHYXEL_HD Mat3<Real> displacement_gradient(const Mat3<Real>& sum,
                                           const Sym3<Real>& inverse_moment) {
  return sum * inverse_moment;
}

/// Green's strain ½(∇u + ∇uᵀ + ∇uᵀ∇u) = ½(FᵀF - I): equation (2) of Farias et al. 2008, whose ∇u
/// is the transpose of ours. Written in ∇u, so that small strains keep their digits.
template <class Real>
PHYXEL_HD Sym3<Real> green_strain(const Mat3<Real>& g) {
  const Real half = Real(0.5);
  // Σ_k g(k, a) g(k, b) + sum
  const auto products = [&](int a, int b, Real sum) {
    return fused(g(2, a), g(2, b), fused(g(1, a), g(1, b), fused(g(0, a), g(0, b), sum)));
  };
  const auto diagonal = [&](int a) { return fused(half, products(a, a, Real(0)), g(a, a)); };
  const auto off_diagonal = [&](int a, int b) { return half * products(a, b, g(a, b) + g(b, a)); };
  return {diagonal(0), off_diagonal(0, 1), off_diagonal(0, 2),
          diagonal(1), off_diagonal(1, 2), diagonal(2)};
}

/// Cauchy's strain ½(∇u + ∇uᵀ): equation (3) of Farias et al. 2008.
template <class Real>
PHYXEL_HD Sym3<Real> cauchy_strain(const Mat3<Real>& g) {
  const Real half = Real(0.5);
  return {g(0, 0), half * (g(0, 1) + g(1, 0)), half * (g(0, 2) + g(2, 0)),
          g(1, 1), half * (g(1, 2) + g(2, 1)), g(2, 2)};
}

namespace detail {
/// The sum of the principal minors: the second invariant of a tensor.
template <class Real>
PHYXEL_HD Real minors(const Mat3<Real>& g) {
  return minor(g(0, 0), g(1, 1), g(0, 1), g(1, 0)) + minor(g(0, 0), g(2, 2), g(0, 2), g(2, 0)) +
         minor(g(1, 1), g(2, 2), g(1, 2), g(2, 1));
}
/// The squared Frobenius norm, Σ g(a, b)².
template <class Real>
PHYXEL_HD Real squares(const Mat3<Real>& g) {
  Real sum = g(0, 0) * g(0, 0);
  for (int e = 1; e < 9; ++e) sum = fused(g(e / 3, e % 3), g(e / 3, e % 3), sum);
  return sum;
}
}  // namespace detail

/// det F - 1 from ∇u, without cancellation: tr G + ½(tr² G - tr G²) + det G.
template <class Real>
PHYXEL_HD Real volume_change(const Mat3<Real>& g) {
  return g(0, 0) + g(1, 1) + g(2, 2) + detail::minors(g) + determinant(g);
}

}  // namespace phyxel
