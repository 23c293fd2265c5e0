#include "solver/rigid_support.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <array>
#include <cmath>

#include "exact_sum.hpp"
#include "phyxel/error.hpp"
#include "solver/boundary_conditions.hpp"

namespace phyxel {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

constexpr double rounding = 1e-9;      // rounding error of a sum, relative to all forces
constexpr double least_torque = 1e-2;  // relative to all forces times the body's size
constexpr double singular = 1e-9;      // smallest eigenvalue, relative to the largest

/// Sums over one body. A rigid motion has three translations and three rotations about the body's
/// centre, the latter in units of 1/size.
struct BodySums {
  ExactSum square_distance, phyxels, force_size;
  std::array<ExactSum, 6> force;  ///< Applied force along each motion [N].
  std::array<ExactSum, 21> held;  ///< Products of motions along held axes, lower triangle.

  template <class Each>
  void for_each_sum(Each&& each) {
    each(square_distance), each(phyxels), each(force_size);
    for (ExactSum& sum : force) each(sum);
    for (ExactSum& sum : held) each(sum);
  }
};

/// Calls each(body) for every body, a run of consecutive parts.
template <class Each>
void for_each_body(const Model& model, Each&& each) {
  for (std::size_t p = 0; p < model.parts.size();) {
    std::size_t end = p;
    while (end < model.parts.size() && model.parts[end].body == model.parts[p].body) ++end;
    each(std::span(model.parts).subspan(p, end - p));
    p = end;
  }
}

template <class Each>
void for_each_phyxel(std::span<const Part> body, Each&& each) {
  for (const Part& part : body) {
    for (Index i = part.begin; i < part.owned_end(); ++i) each(i);
  }
}

void add_ranks(const Model& model, std::vector<BodySums>& bodies) {
  if (!model.share) return;
  std::vector<std::int64_t> words;
  for (BodySums& body : bodies) {
    body.for_each_sum([&](ExactSum& sum) {
      const auto ready = sum.ready();
      words.insert(words.end(), ready.begin(), ready.end());
    });
  }
  model.share->communicator->add(words);
  auto from = words.begin();
  for (BodySums& body : bodies) {
    body.for_each_sum([&](ExactSum& sum) {
      for (std::int64_t& word : sum.ready()) word = *from++;
    });
  }
}

/// Size of each body: the root of the mean square distance from its centre [m].
std::vector<double> sizes_of(const Model& model) {
  std::vector<BodySums> bodies;
  for_each_body(model, [&](std::span<const Part> body) {
    BodySums& sums = bodies.emplace_back();
    for_each_phyxel(body, [&](Index i) {
      const Vec3d x = model.position[i] - body[0].centre;
      sums.square_distance.add(dot(x, x));
      sums.phyxels.add(1);
    });
  });
  add_ranks(model, bodies);
  std::vector<double> sizes;
  for (BodySums& body : bodies) {
    const double square = body.square_distance.value() / std::max(1.0, body.phyxels.value());
    sizes.push_back(square > 0 ? std::sqrt(square) : 1);
  }
  return sizes;
}

/// @param applied all forces but those of supports, on the body at rest [N]
BodySums sums_of(const Model& model, const Balance& balance, const Balance::Vector& applied,
                 std::span<const Part> body, double size) {
  BodySums sums;
  for_each_phyxel(body, [&](Index i) {
    const Vec3d x = (1 / size) * (model.position[i] - body[0].centre);
    const Vec3d force = applied[i], torque = cross(x, force);
    const double along[] = {force.x, force.y, force.z, torque.x, torque.y, torque.z};
    for (int k = 0; k < 6; ++k) sums.force[k].add(along[k]);
    sums.force_size.add(norm(force));
    // Row a: displacement along axis a of each of the six motions.
    const double motion[3][6] = {
        {1, 0, 0, 0, x.z, -x.y}, {0, 1, 0, -x.z, 0, x.x}, {0, 0, 1, x.y, -x.x, 0}};
    const double free[] = {balance.free[i].x, balance.free[i].y, balance.free[i].z};
    for (int a = 0; a < 3; ++a) {
      if (free[a] != 0) continue;
      for (int r = 0, k = 0; r < 6; ++r) {
        for (int c = 0; c <= r; ++c, ++k) sums.held[k].add(motion[a][r] * motion[a][c]);
      }
    }
  });
  return sums;
}

[[noreturn]] void refuse(const Model& model, const std::string& why) {
  if (model.share) throw AgreedError(ExitCode::bad_input, why);
  throw InputError(why);
}

void check(const Model& model, const Part& body, double size, BodySums& sums) {
  const double scale = sums.force_size.value();
  if (!(scale > 0)) return;
  Vector6 force;
  for (int k = 0; k < 6; ++k) force[k] = sums.force[k].value();
  Matrix6 held;
  for (int r = 0, k = 0; r < 6; ++r) {
    for (int c = 0; c <= r; ++c, ++k) held(r, c) = held(c, r) = sums.held[k].value();
  }
  for (int a = 0; a < 3; ++a) {
    if (held(a, a) > 0 || std::abs(force[a]) <= rounding * scale) continue;
    refuse(model, fmt::format("body \"{}\": nothing is held against a force of {:g} N along {}, so "
                              "that it never comes to rest: needed are fixed phyxels, or loads "
                              "that cancel",
                              body.name, std::abs(force[a]), "xyz"[a]));
  }
  const Eigen::SelfAdjointEigenSolver<Matrix6> motions(held);
  Vector6 loose = Vector6::Zero();  // applied force along the unsupported motions
  for (int k = 0; k < 6; ++k) {
    if (motions.eigenvalues()[k] > singular * std::max(1.0, motions.eigenvalues()[5])) continue;
    const Vector6 motion = motions.eigenvectors().col(k);
    loose += motion.dot(force) * motion;
  }
  if (loose.norm() <= least_torque * scale) return;
  const Eigen::Vector3d turn = loose.tail<3>();
  if (!(turn.norm() > rounding * loose.norm())) {
    refuse(model, fmt::format("body \"{}\": nothing is held against a force of {:g} N along "
                              "({:.3g}, {:.3g}, {:.3g}), so that it never comes to rest: needed "
                              "are more fixed phyxels, or loads that cancel",
                              body.name, loose.norm(), loose[0] / loose.norm(),
                              loose[1] / loose.norm(), loose[2] / loose.norm()));
  }
  const Eigen::Vector3d axis = turn.normalized();
  refuse(model,
         fmt::format("body \"{}\": nothing is held against a torque of {:g} N m about an axis "
                     "along ({:.3g}, {:.3g}, {:.3g}): what is fixed lets it turn; needed are "
                     "fixed phyxels away from one point or line, loads that cancel, or a run in "
                     "time with damping",
                     body.name, size * loose.norm(), axis[0], axis[1], axis[2]));
}

}  // namespace

void refuse_unsupported_bodies(const Model& model, const Balance& balance) {
  const std::vector<double> sizes = sizes_of(model);
  Balance::Vector applied = balance.applied;
  for_each_load(model, true, full_loads, [&](Index i, Vec3d load) { applied[i] += load; });
  std::vector<BodySums> bodies;
  for_each_body(model, [&](std::span<const Part> body) {
    bodies.push_back(sums_of(model, balance, applied, body, sizes[bodies.size()]));
  });
  add_ranks(model, bodies);
  std::size_t b = 0;
  for_each_body(model, [&](std::span<const Part> body) {
    check(model, body[0], sizes[b], bodies[b]);
    ++b;
  });
}

}  // namespace phyxel
