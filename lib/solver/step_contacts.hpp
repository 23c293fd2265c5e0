/// Contact with obstacles in the steps of a backend on the CPU.
#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "mesh/distance_field.hpp"
#include "model/parts.hpp"
#include "phyxel/model.hpp"
#include "phyxel/physics/obstacles.hpp"
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
        before_(model.contact.phyxels.size()) {}

  /// Prepares for a step, which has not changed velocities yet.
  /// @param velocity_of returns the velocity of a phyxel [m/s]
  template <class VelocityOf>
  void begin_step(double time, double dt, VelocityOf&& velocity_of) {
    if (model_.obstacles.empty()) return;
    if (dt != dt_) {
      dt_ = dt;
      inertia_ = inertia_of_layer(model_, dt);
    }
    steps_.clear();
    for (const Obstacle& obstacle : model_.obstacles) {
      steps_.push_back(obstacle.step_from(time, dt));
    }
#pragma omp parallel for schedule(static) num_threads(threads_here())
    for (std::size_t k = 0; k < before_.size(); ++k) {
      before_[k] = velocity_of(model_.contact.phyxels[k]);
    }
  }
  /// Moves phyxels that the step has led into obstacles out of them, one obstacle after the other.
  /// @param is_meant tells which phyxels this call is for
  /// @param get,set return and replace the state of a phyxel
  template <class IsMeant, class Get, class Set>
  void keep_out(IsMeant&& is_meant, Get&& get, Set&& set) {
    for (std::size_t o = 0; o < model_.obstacles.size(); ++o) {
      const Obstacle& obstacle = model_.obstacles[o];
      const std::span<ExactSum> all =
          std::span(sums_).subspan(o * ContactTerms::count, ContactTerms::count);
      ObstacleShapes::with(obstacle.form, [&](const auto& shape) {
#pragma omp parallel num_threads(threads_here())
        {
          StepSums own(ContactTerms::count);
          bool touches = false;
#pragma omp for schedule(static) nowait
          for (std::size_t k = 0; k < before_.size(); ++k) {
            const Index i = model_.contact.phyxels[k];
            if (is_meant(i) && keep_out_of(shape, steps_[o], k, i, get, set, own)) touches = true;
          }
          if (touches) {
#pragma omp critical(phyxel_contact_sums)
            for (int s = 0; s < ContactTerms::count; ++s) all[s].add(own[s]);
          }
        }
      });
    }
  }
  /// The sums so far, obstacle by obstacle (`ContactTerms`).
  const StepSums& sums() const { return sums_; }
  /// Bytes of its arrays.
  std::size_t bytes() const {
    std::size_t distances = 0;
    for (const Obstacle& obstacle : model_.obstacles) {
      if (obstacle.distances) distances += obstacle.distances->bytes();
    }
    return distances + sums_.size() * sizeof(ExactSum) +
           (free_.size() + before_.size()) * sizeof(Vec3d) + inertia_.size() * sizeof(double);
  }

 private:
  int threads_here() const {
    return std::clamp(static_cast<int>(before_.size() / 1000), 1, threads_);
  }
  template <class Shape, class Get, class Set>
  bool keep_out_of(const Shape& shape, const ObstacleStep& step, std::size_t k, Index i, Get&& get,
                   Set&& set, StepSums& sums) const {
    const Touched now = get(i);
    TouchingPoint point{model_.position[i] + now.displacement,
                        now.velocity,
                        before_[k],
                        free_[k],
                        model_.contact.offset[k],
                        inertia_[k]};
    ContactTerms terms;
    if (!touch(shape, step, point, terms)) return false;
    set(i, {now.displacement + step.dt * (point.velocity - now.velocity), point.velocity});
    for (int s = 0; s < ContactTerms::count; ++s) sums[s].add(terms.value[s]);
    return true;
  }

  const Model& model_;
  int threads_;
  StepSums sums_;
  std::vector<Vec3d> free_;          // as of `TouchingPoint`, shape [layer]
  std::vector<Vec3d> before_;        // velocities at the start of the step [m/s], shape [layer]
  std::vector<double> inertia_;      // [kg/s], shape [layer]
  std::vector<ObstacleStep> steps_;  // of the present step
  double dt_ = 0;                    // of `inertia_` [s]
};

}  // namespace phyxel
