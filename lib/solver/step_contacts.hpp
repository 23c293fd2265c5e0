/// Contact with obstacles in the steps of a backend on the CPU.
#pragma once

#include <algorithm>
#include <map>
#include <set>
#include <span>
#include <vector>

#include "mesh/distance_field.hpp"
#include "model/box_overlaps.hpp"
#include "model/contact_groups.hpp"
#include "model/parts.hpp"
#include "phyxel/model.hpp"
#include "phyxel/physics/contact_penalty.hpp"
#include "phyxel/physics/obstacles.hpp"
#include "solver/contact_stiffness.hpp"
#include "solver/rigid_bodies.hpp"
#include "solver/step_sums.hpp"

namespace phyxel {

/// Returns 1 for the axes along which each phyxel of the contact layer is free, 0 for the others.
inline std::vector<Vec3d> free_axes_of_layer(const Model& model) {
  const std::vector<char> prescribed = prescribed_axes(model);
  std::vector<Vec3d> free;
  for (const Index i : model.contact.phyxels) {
    const auto of_axis = [&](int axis) { return prescribed[i] >> axis & 1 ? 0.0 : 1.0; };
    free.push_back({of_axis(0), of_axis(1), of_axis(2)});
  }
  return free;
}

/// Returns the inertia of a step of each phyxel of the contact layer [kg/s] (`TouchingPoint`).
inline std::vector<double> inertia_of_layer(const Model& model, double dt) {
  std::vector<double> inertia;
  for (const Index i : model.contact.phyxels) {
    inertia.push_back(model.mass[i] / damped_flow(part_of(model, i).material.damping, dt).gain);
  }
  return inertia;
}

/// Returns the inertia of each phyxel of the contact layer against what changes its velocity as a
/// step starts [kg/s] (`PushedPoint`).
inline std::vector<double> start_inertia_of_layer(const Model& model, double dt) {
  std::vector<double> inertia = inertia_of_layer(model, dt);
  for (std::size_t k = 0; k < inertia.size(); ++k) {
    const Part& part = part_of(model, model.contact.phyxels[k]);
    inertia[k] *= damped_flow(part.material.damping, dt).keep;
  }
  return inertia;
}

/// The state of a phyxel at the end of a step.
struct Touched {
  Vec3d displacement;  ///< [m]
  Vec3d velocity;      ///< [m/s]
};

/// Keeps the contact layer out of the obstacles of a model, step by step, and adds up what they do.
class StepContacts {
 public:
  /// @param model must outlive this. @param threads most threads that share the work
  StepContacts(const Model& model, int threads)
      : model_(model),
        threads_(threads),
        sums_(ContactTerms::count * model.obstacles.size()),
        free_(free_axes_of_layer(model)),
        before_(model.contact.phyxels.size()),
        groups_(groups_of(model, model.contact)),
        near_(groups_.size()),
        rigid_(model) {
    for (std::size_t o = 0; o < model.obstacles.size(); ++o) {
      if (!model.obstacles[o].stands_still()) moving_.push_back(o);
      pushes_ = pushes_ || model.obstacles[o].penalty > 0;
    }
    if (pushes_) stiffness_ = stiffness_of_layer(model, share_of_layer);
  }

  /// Sets the states of free bodies, as of `RigidBodies::put`.
  void put_rigid(std::span<const RigidState> states, double dt) { rigid_.put(states, dt); }
  const std::vector<RigidState>& rigid_states() const { return rigid_.states(); }

  /// Prepares for a step, which has not changed velocities yet.
  /// @param velocity_of returns the velocity of a phyxel [m/s]
  template <class VelocityOf>
  void begin_step(double time, double dt, VelocityOf&& velocity_of) {
    if (model_.obstacles.empty()) return;
    if (dt != dt_) {
      dt_ = dt;
      inertia_ = inertia_of_layer(model_, dt);
      steps_.clear();
      for (const Obstacle& obstacle : model_.obstacles) {
        steps_.push_back(obstacle.step_from(time, dt));
      }
      if (pushes_) {
        start_inertia_ = start_inertia_of_layer(model_, dt);
        starts_ = steps_;
      }
    }
    for (const std::size_t o : moving_) {
      const Obstacle& obstacle = model_.obstacles[o];
      if (!obstacle.free) steps_[o] = obstacle.step_from(time, dt);
      if (!pushes_) continue;
      starts_[o] = obstacle.free ? rigid_.start_of(o, dt) : obstacle.stage_to(time, dt);
    }
    time_ = time;
#pragma omp parallel for schedule(static) num_threads(threads_here())
    for (std::size_t k = 0; k < before_.size(); ++k) {
      before_[k] = velocity_of(model_.contact.phyxels[k]);
    }
  }
  /// Changes the velocities with which the step starts by the penalties of obstacles, and moves
  /// free bodies. Of a share: collective.
  /// @param get,set return and replace the state of a phyxel
  template <class Get, class Set>
  void push(Get&& get, Set&& set) {
    if (pushes_) push_by_penalties(get, set);
    if (rigid_.empty()) return;
    rigid_.begin_step(time_, dt_);
    for (const std::size_t o : moving_) {
      if (model_.obstacles[o].free) steps_[o] = rigid_.step_of(o);
    }
  }
  /// Moves phyxels that the step has led into obstacles out of them, one obstacle after the other,
  /// and lets those rub on obstacles that penalties push.
  /// @param is_meant tells which phyxels this call is for
  /// @param get,set return and replace the state of a phyxel
  template <class IsMeant, class Get, class Set>
  void keep_out(IsMeant&& is_meant, Get&& get, Set&& set) {
    keep_out(is_meant, get, set, [](Index, const ContactTerms&) {});
  }
  /// The same, with the terms of each touch. @param note called as note(i, terms) for phyxel i
  template <class IsMeant, class Get, class Set, class Note>
  void keep_out(IsMeant&& is_meant, Get&& get, Set&& set, Note&& note) {
    if (model_.obstacles.empty()) return;
    each_touch(
        steps_, is_meant, get,
        [&](std::size_t o) {
          const Obstacle& obstacle = model_.obstacles[o];
          return !(obstacle.penalty > 0) || obstacle.law.static_friction > 0;
        },
        [&](const auto& shape, std::size_t o, std::size_t k, ContactTerms& terms) {
          if (!keep_out_of(shape, o, k, get, set, terms)) return false;
          note(model_.contact.phyxels[k], terms);
          return true;
        });
  }
  /// Ends a step, after all phyxels have been kept out. Of a share: collective.
  void end_step() { rigid_.act_back(sums_); }
  /// The sums so far, obstacle by obstacle (`ContactTerms`).
  StepSums sums() const { return rigid_.with_held_points(sums_); }
  /// The impulses of free bodies on held points in the present step.
  const std::vector<HeldImpulse>& on_held_points() const { return rigid_.on_held_points(); }
  /// Bytes of its arrays.
  std::size_t bytes() const {
    std::size_t distances = 0;
    std::set<const DistanceArrays*> counted;
    for (const Obstacle& obstacle : model_.obstacles) {
      const bool is_new = obstacle.distances && counted.insert(obstacle.distances.get()).second;
      if (is_new) distances += obstacle.distances->bytes();
    }
    return distances + sums_.size() * sizeof(ExactSum) +
           (free_.size() + before_.size()) * sizeof(Vec3d) +
           (inertia_.size() + start_inertia_.size() + stiffness_.size()) * sizeof(double);
  }

 private:
  template <class Get, class Set>
  void push_by_penalties(Get&& get, Set&& set) {
    const auto by = [&](const auto& shape, std::size_t o, std::size_t k, ContactTerms& terms) {
      const Index i = model_.contact.phyxels[k];
      const Touched now = get(i);
      Vec3d change;
      if (!penalty_change(shape, starts_[o], pushed(o, k, now), change, terms)) return false;
      set(i, {now.displacement, now.velocity + change});
      return true;
    };
    each_touch(
        starts_, [](Index) { return true; }, get,
        [&](std::size_t o) { return model_.obstacles[o].penalty > 0; }, by);
    rigid_.act_back(sums_);
  }
  int threads_here() const {
    return std::clamp(static_cast<int>(before_.size() / 1000), 1, threads_);
  }
  /// The obstacles that a group may touch while it stays in a box: those that stand still beside
  /// that box, and all that move.
  struct NearObstacles {
    Box box = no_box;
    std::vector<std::size_t> obstacles;  // ascending
  };
  /// Finds the obstacles that a group may touch anew, with a margin for the next steps.
  void find_near(std::size_t g, const Box& box) {
    const LayerGroup& group = groups_[g];
    NearObstacles& near = near_[g];
    near.box = grown(box, 0.5 * (box.extent() + group.support));
    near.obstacles = moving_;
    for (std::size_t o = 0; o < model_.obstacles.size(); ++o) {
      const Obstacle& obstacle = model_.obstacles[o];
      if (!obstacle.stands_still()) continue;
      if (!is_clear_of(obstacle, steps_[o], near.box, group.offset)) near.obstacles.push_back(o);
    }
    std::sort(near.obstacles.begin(), near.obstacles.end());
  }
  /// Calls act(shape, o, k, terms) for phyxels k of the layer that may touch obstacles o, one
  /// obstacle after the other, and adds the terms to the sums of the obstacle where that is true.
  /// @param at where obstacles are. @param is_meant tells which phyxels are meant
  /// @param get returns the state of a phyxel. @param acts tells which obstacles are meant
  template <class IsMeant, class Get, class Acts, class Act>
  void each_touch(const std::vector<ObstacleStep>& at, IsMeant&& is_meant, Get&& get, Acts&& acts,
                  Act&& act) {
#pragma omp parallel num_threads(threads_here())
    {
      std::map<std::size_t, StepSums> own;  // of the obstacles that this thread's phyxels touch
#pragma omp for schedule(static) nowait
      for (std::size_t g = 0; g < groups_.size(); ++g) {
        each_of_group(g, at, is_meant, get, acts, act, own);
      }
      if (!own.empty()) {
#pragma omp critical(phyxel_contact_sums)
        for (const auto& [o, sums] : own) {
          for (int s = 0; s < ContactTerms::count; ++s) {
            sums_[o * ContactTerms::count + s].add(sums[s]);
          }
        }
      }
    }
  }
  /// The same for the phyxels of a group. @param sums those of this thread
  template <class IsMeant, class Get, class Acts, class Act>
  void each_of_group(std::size_t g, const std::vector<ObstacleStep>& at, IsMeant&& is_meant,
                     Get&& get, Acts&& acts, Act&& act, std::map<std::size_t, StepSums>& sums) {
    const LayerGroup& group = groups_[g];
    const std::vector<Index>& layer = model_.contact.phyxels;
    NearObstacles& near = near_[g];
    Box box;
    const auto find_box = [&] {
      box = no_box;
      for (std::size_t k = group.begin; k < group.end; ++k) {
        const Index i = layer[k];
        if (is_meant(i)) extend(box, model_.position[i] + get(i).displacement);
      }
      if (!is_within(box, near.box)) find_near(g, box);
    };
    find_box();
    for (std::size_t n = 0; n < near.obstacles.size(); ++n) {
      const std::size_t o = near.obstacles[n];
      const Obstacle& obstacle = model_.obstacles[o];
      if (!acts(o) || is_clear_of(obstacle, at[o], box, group.offset)) continue;
      StepSums* own = nullptr;
      ObstacleShapes::with(obstacle.form, [&](const auto& shape) {
        for (std::size_t k = group.begin; k < group.end; ++k) {
          ContactTerms terms;
          if (!is_meant(layer[k]) || !act(shape, o, k, terms)) continue;
          if (!own) own = &sums.try_emplace(o, ContactTerms::count).first->second;
          for (int s = 0; s < ContactTerms::count; ++s) (*own)[s].add(terms.value[s]);
        }
      });
      if (!own) continue;
      // What has been pushed out of this obstacle may have been led into another one.
      find_box();
      n = static_cast<std::size_t>(
          std::upper_bound(near.obstacles.begin(), near.obstacles.end(), o) -
          near.obstacles.begin() - 1);
    }
  }
  template <class Shape, class Get, class Set>
  bool keep_out_of(const Shape& shape, std::size_t o, std::size_t k, Get&& get, Set&& set,
                   ContactTerms& terms) const {
    const Index i = model_.contact.phyxels[k];
    const ObstacleStep& step = steps_[o];
    const Touched now = get(i);
    TouchingPoint point{model_.position[i] + now.displacement,
                        now.velocity,
                        before_[k],
                        free_[k],
                        model_.contact.offset[k],
                        inertia_[k]};
    const double penalty = model_.obstacles[o].penalty;
    const bool touches = penalty > 0 ? rub(shape, step, penalty * stiffness_[k], point, terms)
                                     : touch(shape, step, point, terms);
    if (!touches) return false;
    set(i, {now.displacement + step.dt * (point.velocity - now.velocity), point.velocity});
    return true;
  }
  /// A phyxel of the layer that the penalty of an obstacle may push as the step starts.
  PushedPoint pushed(std::size_t o, std::size_t k, const Touched& now) const {
    return {model_.position[model_.contact.phyxels[k]] + now.displacement, free_[k],
            model_.contact.offset[k], model_.obstacles[o].penalty * stiffness_[k],
            start_inertia_[k]};
  }

  const Model& model_;
  int threads_;
  StepSums sums_;
  std::vector<Vec3d> free_;            // as of `TouchingPoint`, shape [layer]
  std::vector<Vec3d> before_;          // velocities at the start of the step [m/s], shape [layer]
  std::vector<double> inertia_;        // [kg/s], shape [layer]
  bool pushes_ = false;                // true if an obstacle acts by penalties; else all empty:
  std::vector<double> start_inertia_;  // of `PushedPoint` [kg/s], shape [layer]
  std::vector<double> stiffness_;      // of penalties of 1 [N/m], shape [layer]
  std::vector<ObstacleStep> starts_;   // where obstacles are as the present step starts
  std::vector<ObstacleStep> steps_;    // of the present step
  std::vector<LayerGroup> groups_;
  std::vector<NearObstacles> near_;  // of each group
  std::vector<std::size_t> moving_;  // obstacles that do not stand still
  RigidBodies rigid_;
  double time_ = 0;  // at which the present step starts [s]
  double dt_ = 0;    // of `inertia_` [s]
};

}  // namespace phyxel
