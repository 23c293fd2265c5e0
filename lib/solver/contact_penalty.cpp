#include "solver/contact_penalty.hpp"

#include <algorithm>

#include "model/contact.hpp"
#include "model/parts.hpp"
#include "phyxel/diagnostics.hpp"
#include "rank_sums.hpp"
#include "solver/boundary_conditions.hpp"
#include "solver/contact_stiffness.hpp"

namespace phyxel {
PlacedObstacles obstacles_after(const Model& model, double share, double since) {
  PlacedObstacles placed;
  for (const Obstacle& obstacle : model.obstacles) {
    const Motion& motion = obstacle.motion;
    placed.push_back(obstacle.step_between(motion.path_after(since), motion.path_after(share), 1));
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

PlacedObstacles obstacles_now(const Model& model, double time, double dt,
                              std::span<const RigidState> rigid) {
  PlacedObstacles placed;
  std::size_t free = 0;
  for (const Obstacle& obstacle : model.obstacles) {
    placed.push_back(obstacle.free ? obstacle.placed(rigid[free++]) : obstacle.step_from(time, dt));
  }
  return placed;
}

ContactPenalty::ContactPenalty(const Model& model)
    : model_(model),
      groups_(groups_of(model, model.contact)),
      stiffness_(stiffness_of_layer(model, share_of_stiffness)),
      blocks_(model.contact.phyxels.size()),
      bodies_(model) {
  for (const LayerGroup& group : groups_) {
    largest_support_ = std::max(largest_support_, group.support);
  }
  for (const Obstacle& obstacle : model.obstacles) {
    obstacles_rub_ = obstacles_rub_ || obstacle.law.static_friction > 0;
    have_two_frictions_ = have_two_frictions_ || has_two_frictions(obstacle.law);
  }
}

void ContactPenalty::forget() {
  record_.forget();
  bodies_.forget();
}

template <class Each>
void ContactPenalty::for_each_force(const PlacedObstacles& at, const Vector& u, Each&& each) const {
  const PlacedLayer layer(model_, groups_, [&](Index i) { return u[i]; });
  for (std::size_t o = 0; o < model_.obstacles.size(); ++o) {
    layer.for_each_inside(model_.obstacles[o], at[o], [&](std::size_t k, Vec3d x, const Gap& gap) {
      each(k, o, penalty_force(gap, stiffness_[k]), x);
    });
  }
}

void ContactPenalty::find_rubbing(const PlacedObstacles& at, const Vector& u,
                                  const SlipMeasure& slip) {
  rubbing_.clear();
  if (slip.from.empty()) return;  // before a search, slips are not known
  record_.begin_linearise();
  slip_share_ = slip.share;
  const PlacedLayer layer(model_, groups_, [&](Index i) { return u[i]; });
  const double reach = record_.reach(slip);
  for (std::size_t o = 0; o < model_.obstacles.size(); ++o) {
    const Obstacle& obstacle = model_.obstacles[o];
    if (!(obstacle.law.static_friction > 0)) continue;
    const auto add = [&](std::size_t k, Vec3d x, const Gap& gap) {
      const Index i = model_.contact.phyxels[k];
      if (reach > 0 && !(gap.distance < reach * model_.neighbourhood.support[i])) return;
      Rubbing found;
      found.phyxel = k;
      found.obstacle = o;
      const double push = std::max(0.0, -stiffness_[k] * gap.distance);
      if (!record_.rubs(found.key(), true, push)) return;
      found.normal = gap.normal;
      found.surface = slip.from[i] + at[o].dt * surface_velocity(at[o], x);
      found.slip = along(gap.normal, u[i] - found.surface);
      const Vec3d ahead =
          slip.starts_moving() ? along(gap.normal, slip.ahead[i] - found.surface) : Vec3d{};
      record_.set_friction(found.key(), obstacle.law, push, stiffness_[k], slip, ahead, found);
      rubbing_.push_back(found);
    };
    layer.for_each_inside(obstacle, at[o], add, reach * largest_support_);
  }
  record_.end_linearise();
}

PenaltyForce ContactPenalty::friction_of(const Rubbing& rubbing, const Vector& u) const {
  const Vec3d way = u[model_.contact.phyxels[rubbing.phyxel]] - rubbing.surface;
  return friction_penalty(rubbing.limit, rubbing.normal, along(rubbing.normal, way), rubbing.way);
}

bool ContactPenalty::may_keep(const Vector& u) const {
  const double way = bodies_.empty() ? 0 : bodies_.way_to(u);
  return (model_.share ? model_.share->communicator->largest(way) : way) <= 1;
}

void ContactPenalty::renew_normals(double share) {
  record_.renew(share);
  for (Rubbing& rubbing : rubbing_) {
    const ContactLaw& law = model_.obstacles[rubbing.obstacle].law;
    rubbing.set_limit(record_.friction(rubbing.key(), law), record_.held(rubbing.key()),
                      stiffness_[rubbing.phyxel], slip_share_);
  }
  bodies_.renew_normals(share);
}

double ContactPenalty::unrest() const {
  const auto [change, most] = record_.unrest();
  const auto [change_of_bodies, most_of_bodies] = bodies_.unrest();
  double all_change = std::max(change, change_of_bodies), all_most = std::max(most, most_of_bodies);
  if (model_.share) {
    all_change = model_.share->communicator->largest(all_change);
    all_most = model_.share->communicator->largest(all_most);
  }
  return all_change > 0 ? all_change / all_most : 0;
}

bool ContactPenalty::begin_sliding() {
  bool begins = bodies_.begin_sliding();
  if (!have_two_frictions_) return begins;
  for (const Rubbing& rubbing : rubbing_) {
    const ContactLaw& law = model_.obstacles[rubbing.obstacle].law;
    if (!has_two_frictions(law) || !rubbing.has_slid()) continue;
    begins = record_.note_sliding(rubbing.key()) || begins;
  }
  return model_.share ? model_.share->communicator->largest(begins ? 1.0 : 0.0) > 0 : begins;
}

void ContactPenalty::linearise(const PlacedObstacles& at, const Vector& u, const SlipMeasure& slip,
                               Renewal renewal,
                               const std::function<std::vector<Mat3d>()>& gradient_of_u) {
  std::fill(blocks_.begin(), blocks_.end(), Mat3d{});
  normal_forces_ = 0;
  for_each_force(at, u, [&](std::size_t k, std::size_t, const PenaltyForce& f, Vec3d) {
    blocks_[k] += f.stiffness;
    normal_forces_ += dot(f.force, f.force);
  });
  if (obstacles_rub_) find_rubbing(at, u, slip);
  for (const Rubbing& rubbing : rubbing_) blocks_[rubbing.phyxel] += rubbing.stiffness;
  if (renewal == Renewal::motion) {
    bodies_.move_to(u, slip);
  } else if (!bodies_.empty()) {
    bodies_.linearise(u, slip, gradient_of_u());
  }
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
  for (const Rubbing& rubbing : rubbing_) {
    force[model_.contact.phyxels[rubbing.phyxel]] += friction_of(rubbing, u).force;
  }
  bodies_.add(u, force);
}

double ContactPenalty::energy(const PlacedObstacles& at, const Vector& u) const {
  if (empty()) return 0;
  ExactSum sum;
  for_each_force(
      at, u, [&](std::size_t, std::size_t, const PenaltyForce& f, Vec3d) { sum.add(f.energy); });
  for (const Rubbing& rubbing : rubbing_) sum.add(friction_of(rubbing, u).energy);
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
  const auto add_terms = [&](std::size_t o, const ContactTerms& terms) {
    for (int t = 0; t < ContactTerms::count; ++t) {
      sums[o * ContactTerms::count + t].add(terms.value[t]);
    }
  };
  for_each_force(at, u, [&](std::size_t, std::size_t o, const PenaltyForce& f, Vec3d x) {
    const ObstacleStep& step = at[o];
    ContactTerms terms;  // an energy loses nothing
    terms.set(time * f.force, {}, x - step.place_at_rest, rigid_velocity(step, x), {});
    add_terms(o, terms);
  });
  for (const Rubbing& rubbing : rubbing_) {
    const Index i = model_.contact.phyxels[rubbing.phyxel];
    const ObstacleStep& step = at[rubbing.obstacle];
    const Vec3d x = model_.position[i] + u[i];
    // What sticks moves with the surface over the stage, and so is without heat.
    const Vec3d surface = surface_velocity(step, x);
    ContactTerms terms;
    terms.set({}, time * friction_of(rubbing, u).force, x - step.place_at_rest, surface,
              velocity[i] - surface);
    add_terms(rubbing.obstacle, terms);
  }
  bodies_.add_to(u, velocity, time, sums.subspan(model_.obstacles.size() * ContactTerms::count));
}

}  // namespace phyxel
