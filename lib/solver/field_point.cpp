#include "solver/field_point.hpp"

#include <Eigen/LU>
#include <cmath>
#include <functional>

#include "phyxel/physics/strain.hpp"

namespace phyxel {
namespace {

/// The Frobenius norm.
double size_of(const Mat3d& m) {
  double squares = 0;
  for (int e = 0; e < 9; ++e) squares += m(e / 3, e % 3) * m(e / 3, e % 3);
  return std::sqrt(squares);
}

/// A gradient that differs from `grad_u` by a nᵀ and has a traction P n, found by Newton's method.
/// @param stress_at first Piola stress [Pa] at a gradient
/// @returns `fallback` if it is not found
Mat3d with_traction(const std::function<Mat3d(const Mat3d&)>& stress_at, const Mat3d& grad_u,
                    Vec3d traction, Vec3d normal, const Mat3d& fallback) {
  constexpr int most_steps = 5;
  constexpr double difference = 1e-7, tolerance = 1e-6;  // of the stress
  const auto traction_at = [&](const Mat3d& g) { return stress_at(g) * normal; };
  Mat3d g = grad_u;
  Vec3d here = traction_at(g);
  const double size = size_of(stress_at(grad_u)) + norm(traction);
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

/// A material at the end of a step without a duration, which causes no viscous stress.
struct SlowStep {
  PointResponse<double> response;
  std::vector<double> history;
};
SlowStep slow_step(const PartLaw& law, const Mat3d& grad_u, std::span<const double> before) {
  SlowStep step{.response = {}, .history = {before.begin(), before.end()}};
  step.response = law.after_step(grad_u, step.history, 0);
  return step;
}

}  // namespace

FieldPoint own_point(const PartLaw& law, const Mat3d& own, std::span<const double> history,
                     double dt) {
  FieldPoint point{.grad_u = own, .history = {history.begin(), history.end()}};
  std::vector<double> advanced = point.history;
  point.first_piola_stress = law.after_step(own, advanced, dt).first_piola_stress;
  return point;
}

FieldPoint recovered_point(const PartLaw& law, const FieldPoint& own, const Mat3d& recovered,
                           Vec3d normal, double share) {
  const SlowStep here = slow_step(law, own.grad_u, own.history);
  // Each way sets out from the own point, with the history there.
  const auto stress_at = [&](const Mat3d& g) {
    return slow_step(law, g, here.history).response.first_piola_stress;
  };
  const Mat3d &g0 = own.grad_u, &p0 = here.response.first_piola_stress;
  const auto yields = [&](const SlowStep& step) {
    return step.response.plastic_work > here.response.plastic_work;
  };
  const auto towards = [&](const Mat3d& g) {
    const Mat3d kept = with_traction(stress_at, g, p0 * normal, normal, g0);
    return g0 + share * (kept - g0);
  };
  /// The point at the end of a slow step.
  const auto at = [&](const Mat3d& g, const SlowStep& step) {
    FieldPoint point{.grad_u = g, .first_piola_stress = own.first_piola_stress - p0};  // viscous
    point.first_piola_stress += step.response.first_piola_stress;
    for (std::size_t k = 0; k < own.history.size(); ++k) {
      point.history.push_back(own.history[k] + (step.history[k] - here.history[k]));
    }
    const double ratio = (1 + volume_change(g)) / (1 + volume_change(g0));
    return ratio > 0.5 && ratio < 2 ? point : own;
  };
  const Mat3d ahead = towards(recovered);
  const SlowStep forward = slow_step(law, ahead, here.history);
  if (own.history.empty() || yields(forward)) return at(ahead, forward);
  const SlowStep backward = slow_step(law, towards(g0 + g0 - recovered), here.history);
  if (!yields(backward)) return at(ahead, forward);
  // The material has come less far: its history is that before a step back, taken in reverse, and
  // the stress, that of the recovered gradient with it.
  std::vector<double> less = here.history;
  for (std::size_t k = 0; k < less.size(); ++k) less[k] -= backward.history[k] - here.history[k];
  const SlowStep step = slow_step(law, ahead, less);
  return step.response.plastic_work >= 0 ? at(ahead, step) : own;
}

}  // namespace phyxel
