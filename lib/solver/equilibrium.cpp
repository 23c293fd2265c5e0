#include "phyxel/equilibrium.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "phyxel/error.hpp"
#include "solver/newton.hpp"

namespace phyxel {
namespace {

constexpr double on_the_way = 1e-2;  // residual, at which the next stage may begin

/// Gravity and loads at their full size; targets are still to be set.
Balance whole_balance(const Model& model, const Newton& newton) {
  const OwnedVectors& vectors = newton.vectors();
  Balance balance;
  balance.target = vectors.make();
  balance.free.assign(balance.target.size(), {1, 1, 1});
  for (const Motion& motion : model.motions) {
    if (motion.velocity != Vec3d{} || motion.amplitude != Vec3d{}) {
      throw InputError(
          "a motion with a velocity or an amplitude never ends: allowed in a search for "
          "equilibrium are fixed phyxels and motions by a displacement");
    }
    for (const Index i : motion.phyxels) {
      balance.free[i] = motion.along_axes({}, balance.free[i]);
    }
  }
  balance.applied = vectors.make();
  vectors.for_each([&](Index i) { balance.applied[i] = model.mass[i] * model.gravity; });
  for (const Load& load : model.loads) {
    for (std::size_t k = 0; k < load.phyxels.size(); ++k) {
      balance.applied[load.phyxels[k]] += load.force[k];
    }
  }
  newton.add_external_forces(balance.applied);
  return balance;
}

/// Motions so much of their way.
void set_targets(const Model& model, double share, Balance& balance) {
  for (const Motion& motion : model.motions) {
    const Path path = motion.path_after(share);
    for (const Index i : motion.phyxels) {
      balance.target[i] = motion.along_axes(path.at(model.position[i]), balance.target[i]);
    }
  }
}

/// What turns is followed by an eighth of a turn at a time: straight ways there would flatten it.
int stages_of(const Model& model) {
  double angle = 0;
  for (const Motion& motion : model.motions) angle = std::max(angle, norm(motion.rotation));
  return std::max(1, static_cast<int>(std::ceil(angle / (std::numbers::pi / 4) - 1e-9)));
}

/// Along an axis that nothing is held along, what is applied must cancel.
void refuse_free_fall(const Balance& balance, const OwnedVectors& vectors) {
  const double scale = vectors.sum([&](Index i) { return norm(balance.applied[i]); });
  const auto refuse_along = [&](double Vec3d::*axis) {
    if (vectors.largest([&](Index i) { return 1 - balance.free[i].*axis; }) > 0) return;
    const double all = vectors.sum([&](Index i) { return balance.applied[i].*axis; });
    if (std::abs(all) <= 1e-9 * scale) return;
    throw InputError(fmt::format(
        "nothing is held against a force of {:g} N, so that nothing comes to rest: allowed is a "
        "scene with fixed phyxels, or with loads that cancel",
        std::abs(all)));
  };
  refuse_along(&Vec3d::x);
  refuse_along(&Vec3d::y);
  refuse_along(&Vec3d::z);
}

}  // namespace

Equilibrium find_equilibrium(const Model& model, Backend& backend,
                             const EquilibriumOptions& options) {
  Newton newton(model, backend, options.most_steps);
  Balance balance = whole_balance(model, newton);
  refuse_free_fall(balance, newton.vectors());
  Equilibrium found;
  found.state.displacement = newton.vectors().make();
  found.state.velocity = newton.vectors().make();
  NewtonReport report;
  const int stages = stages_of(model);
  for (int stage = 1; stage <= stages; ++stage) {
    set_targets(model, static_cast<double>(stage) / stages, balance);
    const bool last = stage == stages;
    report =
        newton.solve(balance, last ? options.tolerance : std::max(options.tolerance, on_the_way),
                     found.state.displacement);
    found.steps += report.steps;
    found.evaluations += report.evaluations;
    if (!report.found) break;
  }
  if (!report.found) {
    const std::string why = fmt::format(
        "no equilibrium was found in {} steps of Newton's method: the residual force is {:.2g} of "
        "what is applied, {:.2g} is asked; nothing may hold a part of the body, or it buckles: "
        "allowed are more support, smaller loads, or a run in time with damping",
        report.steps, report.residual, options.tolerance);
    if (model.share) throw AgreedError(ExitCode::diverged, why);
    throw DivergedError(why);
  }
  found.residual = report.residual;
  backend.upload(found.state);
  return found;
}

}  // namespace phyxel
