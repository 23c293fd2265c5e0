/// Stress and strain tensors as output has them.
#pragma once

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>

#include "phyxel/physics/strain.hpp"
#include "phyxel/types.hpp"

namespace phyxel {

/// Cauchy stress σ = P Fᵀ / det F [Pa].
inline Mat3d cauchy_stress(const Mat3d& piola, const Mat3d& grad_u) {
  const Mat3d f = identity<double>() + grad_u;
  return (1 / determinant(f)) * (piola * transpose(f));
}

/// Von Mises stress sqrt(3/2 s:s) [Pa], s the deviator of σ.
inline double von_mises_stress(Mat3d sigma) {
  const double mean = (sigma(0, 0) + sigma(1, 1) + sigma(2, 2)) / 3;
  for (int k = 0; k < 3; ++k) sigma(k, k) -= mean;
  double largest = 0;  // scales the entries, so that squares neither overflow nor vanish
  for (int e = 0; e < 9; ++e) {
    const double size = std::abs(sigma(e / 3, e % 3));
    if (std::isnan(size)) return size;
    largest = std::max(largest, size);
  }
  if (!(largest > 0) || !std::isfinite(largest)) return largest;
  double squares = 0;
  for (int e = 0; e < 9; ++e) {
    const double share = sigma(e / 3, e % 3) / largest;
    squares += share * share;
  }
  return largest * std::sqrt(1.5 * squares);
}

/// Principal values of a symmetric matrix, the largest first.
inline std::array<double, 3> principal_values(const Mat3d& m) {
  Eigen::Matrix3d matrix;
  for (int e = 0; e < 9; ++e) matrix(e / 3, e % 3) = 0.5 * (m(e / 3, e % 3) + m(e % 3, e / 3));
  const Eigen::Vector3d found =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(matrix, Eigen::EigenvaluesOnly).eigenvalues();
  return {found[2], found[1], found[0]};
}

/// The components of a symmetric matrix in the order of fields.
inline std::array<double, 6> components(const Mat3d& m) {
  return {m(0, 0),
          m(1, 1),
          m(2, 2),
          0.5 * (m(0, 1) + m(1, 0)),
          0.5 * (m(1, 2) + m(2, 1)),
          0.5 * (m(0, 2) + m(2, 0))};
}
/// The symmetric matrix of these components.
inline Mat3d matrix_of(const std::array<double, 6>& c) {
  return full(Sym3d{c[0], c[3], c[5], c[1], c[4], c[2]});
}

}  // namespace phyxel
