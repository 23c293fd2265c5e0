#include "solver/implicit_step.hpp"

#include <fmt/format.h>

#include <cmath>

#include "phyxel/error.hpp"
#include "solver/boundary_conditions.hpp"

namespace phyxel {
namespace {

// Tolerance of residual forces, whose effect on velocities is far below the error of the step.
constexpr double tolerance = 1e-8;
constexpr int most_newton_steps = 400;
const double share_of_step = 1 - std::sqrt(0.5);  // γ
constexpr double share_of_depth = 1e-3;           // of `SlipMeasure`

}  // namespace

double stage_of_step(double dt) { return share_of_step * dt; }

SlipMeasure slip_of_stage(double span, const std::vector<Vec3d>& u, const std::vector<Vec3d>& v) {
  SlipMeasure slip{.from = u, .share = share_of_depth, .ahead = u};
  for (std::size_t i = 0; i < u.size(); ++i) slip.from[i] -= span * v[i];
  return slip;
}

ImplicitStep::ImplicitStep(const Model& model, Backend& backend)
    : model_(model),
      backend_(backend),
      newton_(model, backend, most_newton_steps),
      support_work_(no_step_sums(model)) {
  const OwnedVectors& vectors = newton_.vectors();
  balance_.target = vectors.make();
  balance_.centre = vectors.make();
  balance_.weight.resize(balance_.target.size());
  balance_.free = free_axes(model);
  balance_.free.resize(balance_.target.size(), {1, 1, 1});
  for (const Part& part : model.parts) {
    if (part.material.damping > 0) damping_.resize(balance_.target.size(), 0);
  }
  for (const Part& part : model.parts) {
    if (damping_.empty()) break;
    for (Index i = part.begin; i < part.end; ++i) damping_[i] = part.material.damping;
  }
}

/// The stage u' = U + s v', v' = V + s (f(u')/m - c v'): substituting v' in the first equation
/// leaves a balance with inertia m (1 + c s) / s² about U + s V / (1 + c s).
ImplicitStep::Vector ImplicitStep::take_stage(double time, double s, const Vector& from,
                                              const Vector& moving, Vector& u, Vector& v) {
  const OwnedVectors& vectors = newton_.vectors();
  newton_.set_applied(time, balance_);
  prescribe_displacements(model_, time, balance_.target);
  const auto slowed = [&](Index i) { return damping_.empty() ? 1.0 : 1 + damping_[i] * s; };
  vectors.for_each([&](Index i) {
    balance_.weight[i] = model_.mass[i] * slowed(i) / (s * s);
    balance_.centre[i] = from[i] + (s / slowed(i)) * v[i];
  });
  balance_.obstacles = obstacles_over(model_, time, s);
  if (newton_.contact().rubs()) {
    vectors.for_each([&](Index i) { u[i] = from[i] + s * moving[i]; });
    balance_.slip = {.from = from, .share = share_of_depth, .ahead = u};
  }
  const Vector inner = newton_.inner_forces(u);
  balance_.scale = std::sqrt(vectors.product(inner, inner)) + std::sqrt(vectors.sum([&](Index i) {
                     const Vec3d force =
                         (model_.mass[i] / s) * by_components(balance_.free[i], v[i]);
                     return dot(force, force);
                   }));
  const NewtonReport report = newton_.solve(balance_, tolerance, u);
  work_.steps += report.steps;
  work_.evaluations += report.evaluations + 2;
  work_.residual = std::max(work_.residual, report.residual);
  if (report.interrupted) {
    throw InterruptedError(
        fmt::format("the implicit step to t = {:g} s was stopped after {} steps of Newton's method",
                    time, report.steps));
  }
  if (!report.found) {
    const std::string why = fmt::format(
        "the implicit step to t = {:g} s failed: after {} steps of Newton's method ({}) the "
        "residual force is {:.2g} of what acts, {:.2g} is needed; allowed is a smaller time.step",
        time, report.steps, report.why, report.residual, tolerance);
    if (model_.share) throw AgreedError(ExitCode::diverged, why);
    throw DivergedError(why);
  }
  // Velocities are updated from forces rather than displacements: internal forces sum to zero, so
  // momentum is conserved.
  Vector force = newton_.acting_forces(balance_, u);
  vectors.for_each([&](Index i) {
    const Vec3d acceleration = (1 / model_.mass[i]) * force[i];
    v[i] = by_components(balance_.free[i], (1 / slowed(i)) * (v[i] + s * acceleration));
  });
  return force;
}

void ImplicitStep::add_support_work(const SupportInstant& now) {
  for (std::size_t m = 0; m < sums_of_motions(model_); ++m) {
    const Motion& motion = model_.motions[m];
    if (motion.stands_still()) continue;
    const Path mean_step = motion.mean_step(now.time, now.dt);
    for_each_support_force(model_, motion, now, [&](Index i, Vec3d support) {
      support_work_[m].add(dot(support, mean_step.at(model_.position[i])));
    });
  }
}

void ImplicitStep::add_contact(const Vector& u, const Vector& v, double time,
                               StepSums& sums) const {
  newton_.contact().add_to(balance_.obstacles, u, v, time,
                           std::span(sums).subspan(sums_of_motions(model_)));
}

ImplicitStep::Vector ImplicitStep::path_velocities(std::int64_t step, double dt) const {
  const OwnedVectors& vectors = newton_.vectors();
  Vector before = vectors.make(), after = vectors.make();
  prescribe_displacements(model_, static_cast<double>(step) * dt, before);
  prescribe_displacements(model_, static_cast<double>(step + 1) * dt, after);
  vectors.for_each([&](Index i) { after[i] = (1 / dt) * (after[i] - before[i]); });
  return after;
}

void ImplicitStep::take(State& state) {
  const State before = state;
  const StepSums sums = support_work_;
  try {
    take_both_stages(state);
  } catch (...) {
    state = before;
    support_work_ = sums;
    throw;
  }
}

void ImplicitStep::take_both_stages(State& state) {
  const OwnedVectors& vectors = newton_.vectors();
  const double dt = state.dt, s = stage_of_step(dt), rest = dt - s;
  const double begin = static_cast<double>(state.step) * dt;
  const double end = static_cast<double>(state.step + 1) * dt;
  const Vector u = state.displacement, v = state.velocity;
  Vector& u2 = state.displacement;
  Vector& v2 = state.velocity;
  Vector first_force;
  if (state.step == 0 && sums_of_motions(model_) > 0) {
    newton_.set_applied(begin, balance_);
    const bool rubs = newton_.contact().rubs();
    balance_.obstacles = obstacles_over(model_, begin, rubs ? s : 0);
    if (rubs) balance_.slip = slip_of_stage(s, u, v);
    first_force = newton_.acting_forces(balance_, u);
  }
  backend_.set_history_interval(s);
  take_stage(begin + s, s, u, v, u2, v2);
  const Vector path = path_velocities(state.step, dt);
  // Stages leave velocities along prescribed axes out.
  const auto with_path = [&](Vector of_stage) {
    vectors.for_each(
        [&](Index i) { of_stage[i] = by_components(balance_.free[i], of_stage[i]) + path[i]; });
    return of_stage;
  };
  if (!newton_.contact().empty()) add_contact(u2, with_path(v2), rest, support_work_);
  // The start extrapolates the velocity and acceleration of the first stage over the rest of the
  // step.
  Vector from = vectors.make();
  const Vector moving = newton_.contact().rubs() ? v2 : Vector{};
  vectors.for_each([&](Index i) {
    const Vec3d acceleration = (1 / s) * (v2[i] - v[i]);
    from[i] = u[i] + rest * v2[i];
    v2[i] = v[i] + rest * acceleration;
  });
  backend_.set_history_interval(dt);
  Vector force = take_stage(end, s, from, moving, u2, v2);
  v2 = with_path(std::move(v2));
  add_contact(u2, v2, s, support_work_);
  end_contact_ = no_step_sums(model_);
  add_contact(u2, v2, 1, end_contact_);
  vectors.refresh_ghosts(u2);
  backend_.put_displacements(u2);
  backend_.commit_history();
  State history;
  backend_.download(history);
  state.history = std::move(history.history);
  state.history_interval = history.history_interval;
  state.broken = std::move(history.broken);
  state.worn = std::move(history.worn);
  ++state.step;
  state.time = end;
  if (model_.motions.empty()) return;
  if (!first_force.empty()) add_support_work({begin, dt, false, v, first_force});
  add_support_work({end, dt, false, v2, force});
  end_force_ = std::move(force);
}

}  // namespace phyxel
