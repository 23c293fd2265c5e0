#include "solver/field_point.hpp"

#include <Eigen/LU>
#include <cmath>
#include <vector>

#include "phyxel/physics/strain.hpp"

namespace phyxel {
namespace {

double frobenius_norm(const Mat3d& m) {
  double squares = 0;
  for (int e = 0; e < 9; ++e) squares += m(e / 3, e % 3) * m(e / 3, e % 3);
  return std::sqrt(squares);
}

/// A gradient that differs from `grad_u` by a nᵀ and has a traction P n, found by Newton's method.
/// @param stress_at stress_at(gradient): first Piola stress [Pa]
/// @returns `fallback` if it is not found
template <class StressAt>
Mat3d with_traction(StressAt&& stress_at, const Mat3d& grad_u, Vec3d traction, Vec3d normal,
                    const Mat3d& fallback) {
  constexpr int most_steps = 5;
  constexpr double difference = 1e-7, tolerance = 1e-6;  // of the stress
  const auto traction_at = [&](const Mat3d& g) { return stress_at(g) * normal; };
  Mat3d g = grad_u;
  const Mat3d first = stress_at(g);
  Vec3d here = first * normal;
  const double size = frobenius_norm(first) + norm(traction);
  for (int step = 0; step < most_steps; ++step) {
    const Vec3d left = traction - here;
    if (norm(left) <= tolerance * size) return g;
    Eigen::Matrix3d slope;
    for (int k = 0; k < 3; ++k) {
      const Vec3d along{k == 0 ? difference : 0, k == 1 ? difference : 0, k == 2 ? difference : 0};
      const Vec3d change = (traction_at(g + outer(along, normal)) - here) / difference;
      slope.col(k) = Eigen::Vector3d(change.x, change.y, change.z);
    }
    const Eigen::Vector3d a = slope.fullPivLu().solve(Eigen::Vector3d(left.x, left.y, left.z));
    g += outer(Vec3d{a[0], a[1], a[2]}, normal);
    here = traction_at(g);
  }
  return norm(traction - here) <= tolerance * size ? g : fallback;
}

/// The response of a material at another gradient, reached without viscous stress, as a step of no
/// duration has none.
PointResponse<double> response_at(const PartLaw& law, const Mat3d& grad_u,
                                  std::span<const double> history) {
  thread_local std::vector<double> numbers;
  numbers.assign(history.begin(), history.end());
  return law.after_step(grad_u, numbers, 0);
}

}  // namespace

FieldPoint own_point(const PartLaw& law, const Mat3d& own, std::span<const double> history,
                     double dt) {
  thread_local std::vector<double> numbers;
  numbers.assign(history.begin(), history.end());
  return {own, law.after_step(own, numbers, dt).first_piola_stress};
}

FieldPoint recovered_point(const PartLaw& law, const FieldPoint& own,
                           std::span<const double> history, const Mat3d& recovered, Vec3d normal,
                           double share) {
  constexpr double most_change = 3;  // of what recovery asks for
  if (law.custom() && !history.empty()) return own;
  const PointResponse<double> here = response_at(law, own.grad_u, history);
  if (here.plastic_work > 0) return own;
  const Mat3d &g0 = own.grad_u, &p0 = here.first_piola_stress;
  const auto stress_at = [&](const Mat3d& g) {
    return response_at(law, g, history).first_piola_stress;
  };
  const Mat3d kept = with_traction(stress_at, recovered, p0 * normal, normal, g0);
  if (frobenius_norm(kept - g0) > most_change * frobenius_norm(recovered - g0)) return own;
  const Mat3d g = g0 + share * (kept - g0);
  const double ratio = (1 + volume_change(g)) / (1 + volume_change(g0));
  if (!(ratio > 0.5 && ratio < 2)) return own;
  const Mat3d viscous = own.first_piola_stress - p0;
  return {g, stress_at(g) + viscous};
}

}  // namespace phyxel
