#include "solver/contact_penalty.hpp"

#include <Eigen/Dense>
#include <algorithm>

#include "model/contact.hpp"
#include "model/parts.hpp"
#include "phyxel/diagnostics.hpp"
#include "rank_sums.hpp"
#include "solver/boundary_conditions.hpp"
#include "solver/contact_stiffness.hpp"

namespace phyxel {
PlacedObstacles obstacles_after(const Model& model, double share) {
  PlacedObstacles placed;
  for (const Obstacle& obstacle : model.obstacles) {
    placed.push_back(obstacle.step_between({}, obstacle.motion.path_after(share), 0));
  }
  return placed;
}

PlacedObstacles obstacles_over(const Model& model, double time, double span) {
  PlacedObstacles placed;
  for (const Obstacle& obstacle : model.obstacles) {
    placed.push_back(obstacle.stage_to(time, span));
  }
  return placed;
}

PlacedObstacles obstacles_now(const Model& model, double time, std::span<const RigidState> rigid) {
  PlacedObstacles placed;
  std::size_t free = 0;
  for (const Obstacle& obstacle : model.obstacles) {
    placed.push_back(obstacle.free ? obstacle.placed(rigid[free++]) : obstacle.step_from(time, 0));
  }
  return placed;
}

ContactPenalty::ContactPenalty(const Model& model)
    : model_(model),
      groups_(groups_of(model, model.contact)),
      stiffness_(stiffness_of_layer(model, share_of_stiffness)),
      blocks_(model.contact.phyxels.size()),
      bodies_(model) {}

template <class Each>
void ContactPenalty::for_each_force(const PlacedObstacles& at, const Vector& u, Each&& each) const {
  const PlacedLayer layer(model_, groups_, [&](Index i) { return u[i]; });
  for (std::size_t o = 0; o < model_.obstacles.size(); ++o) {
    layer.for_each_inside(model_.obstacles[o], at[o], [&](std::size_t k, Vec3d x, const Gap& gap) {
      each(k, o, penalty_force(gap, stiffness_[k]), x);
    });
  }
}

void ContactPenalty::linearise(const PlacedObstacles& at, const Vector& u,
                               const std::function<std::vector<Mat3d>()>& gradient_of_u) {
  std::fill(blocks_.begin(), blocks_.end(), Mat3d{});
  normal_forces_ = 0;
  for_each_force(at, u, [&](std::size_t k, std::size_t, const PenaltyForce& f, Vec3d) {
    blocks_[k] += f.stiffness;
    normal_forces_ += dot(f.force, f.force);
  });
  if (!bodies_.empty()) bodies_.linearise(u, gradient_of_u());
  held_.clear();
  for (std::size_t k = 0; k < blocks_.size(); ++k) {
    const Mat3d& block = blocks_[k];
    if (block(0, 0) + block(1, 1) + block(2, 2) > 0) held_[model_.contact.phyxels[k]] = block;
  }
  bodies_.for_each_block([&](Index i, const Mat3d& block) { held_[i] += block; });
}

void ContactPenalty::add(const PlacedObstacles& at, const Vector& u, Vector& force) const {
  for_each_force(at, u, [&](std::size_t k, std::size_t, const PenaltyForce& f, Vec3d) {
    force[model_.contact.phyxels[k]] += f.force;
  });
  bodies_.add(u, force);
}

double ContactPenalty::energy(const PlacedObstacles& at, const Vector& u) const {
  if (empty()) return 0;
  ExactSum sum;
  for_each_force(
      at, u, [&](std::size_t, std::size_t, const PenaltyForce& f, Vec3d) { sum.add(f.energy); });
  bodies_.add_energy(u, sum);
  if (model_.share) add_over_ranks(*model_.share->communicator, {&sum});
  return sum.value();
}

double ContactPenalty::squared_size() const {
  if (empty()) return 0;
  ExactSum sum;
  sum.add(normal_forces_);
  bodies_.add_squares(sum);
  if (model_.share) add_over_ranks(*model_.share->communicator, {&sum});
  return sum.value();
}

void ContactPenalty::add_stiffness_times(const Vector& v, Vector& out) const {
  for (std::size_t k = 0; k < blocks_.size(); ++k) {
    const Index i = model_.contact.phyxels[k];
    out[i] += blocks_[k] * v[i];
  }
  bodies_.add_stiffness_times(v, out);
}

void ContactPenalty::precondition(std::span<const double> s, const Vector& free, const Vector& a,
                                  Vector& x) const {
  for (const auto& [i, block] : held_) {
    const double of_axis[] = {free[i].x, free[i].y, free[i].z};
    Eigen::Matrix3d all = s[i] * Eigen::Matrix3d::Identity();
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) all(r, c) += of_axis[r] * of_axis[c] * block(r, c);
    }
    const Eigen::Vector3d solved = all.llt().solve(Eigen::Vector3d(a[i].x, a[i].y, a[i].z));
    x[i] = {solved[0], solved[1], solved[2]};
  }
}

double ContactPenalty::largest_depth(const PlacedObstacles& at, const Vector& u) const {
  double deepest = 0;
  for_each_force(at, u, [&](std::size_t k, std::size_t, const PenaltyForce& f, Vec3d) {
    const double support = model_.neighbourhood.support[model_.contact.phyxels[k]];
    deepest = std::max(deepest, norm(f.force) / (stiffness_[k] * support));
  });
  deepest = std::max(deepest, bodies_.depths().share);
  return model_.share ? model_.share->communicator->largest(deepest) : deepest;
}

void ContactPenalty::add_to(const PlacedObstacles& at, const Vector& u, const Vector& velocity,
                            double time, std::span<ExactSum> sums) const {
  for_each_force(at, u, [&](std::size_t, std::size_t o, const PenaltyForce& f, Vec3d x) {
    const ObstacleStep& step = at[o];
    ContactTerms terms;  // an energy loses nothing
    terms.set(time * f.force, {}, x - step.place_at_rest, rigid_velocity(step, x), {});
    for (int t = 0; t < ContactTerms::count; ++t) {
      sums[o * ContactTerms::count + t].add(terms.value[t]);
    }
  });
  bodies_.add_to(velocity, time, sums.subspan(model_.obstacles.size() * ContactTerms::count));
}

}  // namespace phyxel
