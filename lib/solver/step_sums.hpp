/// Sums over steps and phyxels, without rounding: the work of supports that move, and what
/// obstacles and bodies have done to bodies.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "exact_sum.hpp"
#include "phyxel/model.hpp"
#include "phyxel/physics/verlet.hpp"
#include "phyxel/share.hpp"

namespace phyxel {

/// True if a support of the model moves: fixed supports do no work.
inline bool has_moving_supports(const Model& model) {
  return std::any_of(model.motions.begin(), model.motions.end(),
                     [](const Motion& motion) { return !motion.stands_still(); });
}

/// Exact sums of the work of each motion [J], none if no support moves; then those of each
/// obstacle, and those of each body of the scene if bodies touch each other (`ContactTerms`); last
/// the energy that broken pairs have taken [J], if pairs may break.
using StepSums = std::vector<ExactSum>;

/// Returns the number of sums of motions, after which those of obstacles begin.
inline std::size_t sums_of_motions(const Model& model) {
  return has_moving_supports(model) ? model.motions.size() : 0;
}

/// Returns the number of what touches: obstacles, and bodies that touch each other.
inline std::size_t touching_count(const Model& model) {
  return model.obstacles.size() + model.body_contact.distances.size();
}

/// Returns the number of sums before that of fracture.
inline std::size_t sums_before_fracture(const Model& model) {
  return sums_of_motions(model) + ContactTerms::count * touching_count(model);
}

/// Returns sums of zero.
inline StepSums no_step_sums(const Model& model) {
  return StepSums(sums_before_fracture(model) + (model.fracture.breaks ? 1 : 0));
}

/// Returns the words of exact sums, as backends and checkpoints hold them.
inline std::vector<std::int64_t> words_of(StepSums work) {
  std::vector<std::int64_t> words;
  for (ExactSum& sum : work) {
    const std::span<const std::int64_t> ready = sum.ready();
    words.insert(words.end(), ready.begin(), ready.end());
  }
  return words;
}

/// Adds words of exact sums, `sign` (1 or -1) times. No words are sums of zero.
inline void add_words(StepSums& work, std::span<const std::int64_t> words, int sign = 1) {
  work.resize(std::max(work.size(), words.size() / ExactSum::words));
  for (std::size_t k = 0; k < words.size(); ++k) {
    work[k / ExactSum::words].ready()[k % ExactSum::words] += sign * words[k];
  }
  for (ExactSum& sum : work) sum.ready();  // propagates carries
}

/// Calls each(i, part) for the phyxels i of a motion that this rank owns.
template <class Each>
void for_each_owned(const Model& model, const Motion& motion, Each&& each) {
  for (const Index i : motion.phyxels) {
    if (!model.owns(i)) continue;
    const auto part = std::partition_point(model.parts.begin(), model.parts.end(),
                                           [&](const Part& p) { return p.end <= i; });
    each(i, *part);
  }
}

/// Returns the inertia of a step of each phyxel of a motion that this rank owns [kg/s], for
/// `support_force`.
inline std::vector<double> support_inertia(const Model& model, const Motion& motion, double dt) {
  std::vector<double> inertia;
  for_each_owned(model, motion, [&](Index i, const Part& part) {
    inertia.push_back(model.mass[i] / damped_flow(part.material.damping, dt).gain);
  });
  return inertia;
}

/// An instant at which forces of supports are found.
struct SupportInstant {
  double time = 0;                     ///< t [s]
  double dt = 0;                       ///< Size of the step from t [s]; 0: at rest.
  bool single = false;                 ///< True if the state is in float.
  std::span<const Vec3d> velocity;     ///< Velocities that the step starts with [m/s], shape [n].
  std::span<const Vec3d> other_force;  ///< All other forces [N], shape [n].
};

/// Calls each(i, force) with the force of the support [N], along the axes of a motion, on each
/// phyxel of the motion that this rank owns: the force that the step from t needs to follow the
/// path, or at rest the one that balances all others.
template <class Each>
void for_each_support_force(const Model& model, const Motion& motion, const SupportInstant& now,
                            Each&& each) {
  const Path before = motion.path_at(now.time), after = motion.path_at(now.time + now.dt);
  for_each_owned(model, motion, [&](Index i, const Part& part) {
    const Vec3d other = now.other_force[i], x = model.position[i];
    if (now.dt == 0) return each(i, motion.along_axes(-other, {}));
    const DampedFlow flow = damped_flow(part.material.damping, now.dt);
    Vec3d prescribed = (after.at(x) - before.at(x)) / now.dt;
    if (now.single) {  // as the step stores it
      const auto stored = [](double value) { return double{static_cast<float>(value)}; };
      prescribed = {stored(prescribed.x), stored(prescribed.y), stored(prescribed.z)};
    }
    const double inertia = model.mass[i] / flow.gain;
    const Vec3d free = flow.keep * now.velocity[i] + (1 / inertia) * other;
    each(i, motion.along_axes(support_force(inertia, prescribed, free), {}));
  });
}

/// The work of supports in the steps of a backend on the CPU.
class StepWork {
 public:
  /// @param model must outlive this
  explicit StepWork(const Model& model)
      : model_(model), sums_(sums_of_motions(model)), inertia_(sums_.size()) {}

  /// Prepares for a step of `dt` [s].
  void begin_step(double dt) {
    if (sums_.empty() || dt == dt_) return;
    dt_ = dt;
    for (std::size_t m = 0; m < sums_.size(); ++m) {
      if (!model_.motions[m].stands_still()) {
        inertia_[m] = support_inertia(model_, model_.motions[m], dt);
      }
    }
  }
  /// Adds the work on the k-th phyxel of motion m that this rank owns.
  /// @param prescribed,free velocities as for `support_force` [m/s]. @param mean_step displacement
  /// as of `Motion::mean_step` [m]
  void add(std::size_t m, std::size_t k, Vec3d prescribed, Vec3d free, Vec3d mean_step) {
    sums_[m].add(dot(support_force(inertia_[m][k], prescribed, free), mean_step));
  }
  /// The sums so far.
  const StepSums& sums() const { return sums_; }
  /// Bytes of its arrays.
  std::size_t bytes() const {
    std::size_t count = 0;
    for (const auto& of_motion : inertia_) count += of_motion.size() * sizeof(double);
    return count + sums_.size() * sizeof(ExactSum);
  }

 private:
  const Model& model_;
  StepSums sums_;
  std::vector<std::vector<double>> inertia_;  // [kg/s], by motion and owned phyxel
  double dt_ = 0;                             // step of `inertia_` [s]
};

}  // namespace phyxel
