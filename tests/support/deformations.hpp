/// Random deformations for tests of laws at a point, and the references of these tests: differences
/// of the energy, the acoustic tensor by differences, and lanes of a pack.
#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <random>
#include <type_traits>

#include "phyxel/types.hpp"

namespace phyxel::testing {

using M3 = Eigen::Matrix3d;
using V3 = Eigen::Vector3d;

/// Reproducible random deformations.
class Deformations {
 public:
  explicit Deformations(unsigned seed) : engine_(seed) {}

  double uniform(double low, double high) {
    // std::uniform_real_distribution differs between standard libraries.
    return low + (high - low) * std::ldexp(static_cast<double>(engine_() >> 11), -53);
  }
  V3 direction() {
    V3 v;
    do v = V3(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
    while (v.norm() > 1 || v.norm() < 0.1);
    return v.normalized();
  }
  /// A rotation by up to half a turn.
  M3 rotation() { return Eigen::AngleAxisd(uniform(-M_PI, M_PI), direction()).toRotationMatrix(); }
  /// F with principal stretches between two bounds.
  M3 gradient(double low, double high) {
    return stretched(V3(uniform(low, high), uniform(low, high), uniform(low, high)));
  }
  /// F with given principal stretches.
  M3 stretched(const V3& stretches) { return rotation() * stretches.asDiagonal() * rotation(); }
  /// A matrix with entries in (-size, size).
  M3 noise(double size) {
    M3 m;
    for (int e = 0; e < 9; ++e) m(e / 3, e % 3) = uniform(-size, size);
    return m;
  }

 private:
  std::mt19937_64 engine_;
};

template <class Real = double>
Mat3<Real> mat3(const M3& m) {
  Mat3<Real> out;
  for (int e = 0; e < 9; ++e) out(e / 3, e % 3) = static_cast<Real>(m(e / 3, e % 3));
  return out;
}
template <class Real>
M3 eigen(const Mat3<Real>& m) {
  M3 out;
  for (int e = 0; e < 9; ++e) out(e / 3, e % 3) = static_cast<double>(m(e / 3, e % 3));
  return out;
}
/// ∇u of F.
template <class Real = double>
Mat3<Real> grad_u(const M3& f) {
  return mat3<Real>(f - M3::Identity());
}
/// Largest entry of a difference.
inline double distance(const M3& a, const M3& b) { return (a - b).cwiseAbs().maxCoeff(); }

/// ∂ψ/∂F by central differences of fourth order.
template <class Energy>
M3 gradient_of(const Energy& energy, const M3& f, double step) {
  M3 out;
  for (int e = 0; e < 9; ++e) {
    const auto at = [&](double shift) {
      M3 moved = f;
      moved(e / 3, e % 3) += shift;
      return energy(moved);
    };
    out(e / 3, e % 3) = (8 * (at(step) - at(-step)) - (at(2 * step) - at(-2 * step))) / (12 * step);
  }
  return out;
}

/// Largest a bᵀ : ∂P/∂F : a bᵀ over unit vectors a and b, with ∂P/∂F by central differences. The
/// maximum is found by optimising a and b in turn, from many starts.
template <class Stress>
double largest_wave_stiffness(const Stress& stress, const M3& f, Deformations& any) {
  const double step = 1e-5;
  Eigen::Matrix<double, 9, 9> tangent;
  for (int e = 0; e < 9; ++e) {
    M3 ahead = f, behind = f;
    ahead(e / 3, e % 3) += step, behind(e / 3, e % 3) -= step;
    const M3 change = (stress(ahead) - stress(behind)) / (2 * step);
    for (int k = 0; k < 9; ++k) tangent(k, e) = change(k / 3, k % 3);
  }
  double largest = -1e300;
  for (int start = 0; start < 12; ++start) {
    V3 a, b = any.direction();
    double value = 0;
    for (int k = 0; k < 60; ++k) {
      M3 by_a = M3::Zero(), by_b = M3::Zero();
      for (int r = 0; r < 9; ++r) {
        for (int c = 0; c < 9; ++c) by_a(r / 3, c / 3) += b[r % 3] * tangent(r, c) * b[c % 3];
      }
      a = Eigen::SelfAdjointEigenSolver<M3>(0.5 * (by_a + by_a.transpose())).eigenvectors().col(2);
      for (int r = 0; r < 9; ++r) {
        for (int c = 0; c < 9; ++c) by_b(r % 3, c % 3) += a[r / 3] * tangent(r, c) * a[c / 3];
      }
      const Eigen::SelfAdjointEigenSolver<M3> best(0.5 * (by_b + by_b.transpose()));
      b = best.eigenvectors().col(2), value = best.eigenvalues()[2];
    }
    largest = std::max(largest, value);
  }
  return largest;
}

/// Broadcasts each number of a plain struct to all lanes of a pack.
template <class Packed, class P, class Plain>
Packed packed(const Plain& plain) {
  using T = std::decay_t<decltype(P{}[0])>;
  constexpr int numbers = sizeof(Plain) / sizeof(T);
  static_assert(sizeof(Packed) == numbers * sizeof(P));
  T values[numbers];
  std::memcpy(values, &plain, sizeof(plain));
  P lanes[numbers];
  for (int k = 0; k < numbers; ++k) lanes[k] = P(static_cast<double>(values[k]));
  Packed out;
  std::memcpy(static_cast<void*>(&out), lanes, sizeof(lanes));
  return out;
}
/// Returns number k of one lane of a packed struct.
template <class T, class P, class Packed>
T lane_of(const Packed& packed, int k, int lane) {
  P number;
  std::memcpy(static_cast<void*>(&number), reinterpret_cast<const char*>(&packed) + k * sizeof(P),
              sizeof(P));
  return number[lane];
}
/// Packs matrices: lane l of the result is matrix l.
template <class P, class T, int W>
Mat3<P> packed_matrices(const Mat3<T> (&of)[W]) {
  Mat3<P> out;
  for (int e = 0; e < 9; ++e) {
    T values[W];
    for (int l = 0; l < W; ++l) values[l] = of[l](e / 3, e % 3);
    std::memcpy(static_cast<void*>(&out(e / 3, e % 3)), values, sizeof(values));
  }
  return out;
}

}  // namespace phyxel::testing
