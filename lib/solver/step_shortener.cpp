/// `StepShortener` decides when steps of Verlet's method are halved.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "phyxel/diagnostics.hpp"
#include "phyxel/error.hpp"
#include "phyxel/solver.hpp"

namespace phyxel {
namespace {

/// Phyxels at a surface have neighbours on one side, so that their gradients are not quite those of
/// plane waves: modes of a stretched block are up to 11% stiffer than the bound.
constexpr double at_surfaces = 1.12;

/// Steps after which the limit is found again, as a multiple of the fewest steps between two looks.
/// It is found even if no phyxel has stiffened, because the stiffest place may have moved.
constexpr std::int64_t least_apart = 16;
/// The number of steps doubles up to this one each time that the limit has stayed the same.
constexpr std::int64_t most_apart = 2048;
/// Half-life of the peak rate of stiffening, as a multiple of the same.
constexpr std::int64_t memory = 64;
constexpr double same_share = 0.02;  // the accuracy of a limit that was found

/// The bound of (dt / limit)² that follows from a plane wave in the stiffest phyxel.
double bound_of_share(double dt, double limit_at_rest, double ratio) {
  const double share = dt / limit_at_rest;
  return share * share * at_surfaces * ratio;
}

/// (dt / limit)² that follows from the last limit found, if all phyxels have stiffened as much as
/// the stiffest one.
double expected_share(const Looks& looks, double ratio) {
  return looks.measured_share * std::max(1.0, ratio / looks.measured_ratio);
}

}  // namespace

StepShortener::StepShortener(const Model& model, Backend& backend, const StepPlan& plan)
    : model_(model), backend_(backend), limit_(plan.limit.largest_step) {
  if (!plan.shortens) return;
  for (const Part& part : model.parts) active_ = active_ || stiffens(part.material);
  // Ranks look together; one of them may have nothing that stiffens.
  if (model.share) active_ = model.share->communicator->largest(active_) > 0;
  if (!active_) return;
  // A wave travels about one spacing in a step, and so crosses a body in as many steps as the body
  // has phyxels across: a small one deforms fully within a few steps.
  std::map<Index, Index> size;  // of each body
  for (const Part& part : model.parts) size[part.body] += part.size;
  for (const auto& [body, phyxels] : size) {
    const auto across = static_cast<std::int64_t>(std::cbrt(phyxels));
    fewest_ = std::clamp(across / 2, std::int64_t{1}, fewest_);
  }
}

int StepShortener::look(Solver& solver, int halvings) {
  if (!active_ || solver.steps() < solver.looks().next) return 0;
  const Stiffening now = find_stiffening(model_, backend_);
  if (std::isfinite(now.ratio)) seen_ = {now, solver.time()};
  Looks& looks = solver.looks();
  const auto diverged = [&](const std::string& how) {
    return DivergedError(
        fmt::format("the simulation diverged: {} at t = {:g} s (step {}); {}; a stiffer material, "
                    "damping, smaller loads or a smaller time.step may help",
                    how, solver.time(), solver.steps(), where_it_began()));
  };
  if (!std::isfinite(now.ratio)) throw diverged("the state is not finite");  // on all ranks
  int made = 0;
  if (bound_of_share(solver.dt(), limit_, now.ratio) > 1 &&
      (looks.measured < 0 || expected_share(looks, now.ratio) > allowed_share(solver.dt()) ||
       solver.steps() - looks.measured >= looks.apart)) {
    const double share = share_of_limit(solver);
    const bool stayed = looks.measured >= 0 &&
                        std::abs(share - looks.measured_share) <= same_share * looks.measured_share;
    looks.apart = stayed ? std::min(2 * looks.apart, most_apart) : least_apart * fewest_;
    looks.measured = solver.steps();
    looks.measured_ratio = now.ratio;
    looks.measured_share = share;
    const double allowed = allowed_share(solver.dt());
    if (!(looks.measured_share <= allowed) && !first_) first_ = seen_;
    for (; !(looks.measured_share <= allowed); ++made) {
      if (halvings + made == most_halvings) {
        throw diverged(
            fmt::format("a body is {:.3g} times as stiff as at rest, for which steps "
                        "would have to be shorter than {:g} s, 1/{} of those planned,",
                        now.ratio, solver.dt(), std::int64_t{1} << most_halvings));
      }
      solver.halve_step();
    }
  }
  look_again(solver, looks, now.ratio);
  return made;
}

double StepShortener::share_of_limit(const Solver& solver) const {
  const StepLimit limit = present_step_limit(model_, backend_);
  const double share = solver.dt() / limit.largest_step;
  // Where forces nearby are not finite, only the bound is known.
  return std::isfinite(share) ? share * share
                              : bound_of_share(solver.dt(), limit_, seen_->what.ratio);
}

double StepShortener::allowed_share(double dt) const {
  const double at_rest = dt / limit_;
  return std::max(largest_share, std::min(1.1 * at_rest * at_rest, 0.95));
}

void StepShortener::look_again(const Solver& solver, Looks& looks, double ratio) const {
  const std::int64_t step = solver.steps();
  // The stiffening of one phyxel up to which nothing has to be done.
  const double bounded = 1 / bound_of_share(solver.dt(), limit_, 1);
  const double most_ratio =
      ratio <= bounded ? bounded
                       : looks.measured_ratio * allowed_share(solver.dt()) / looks.measured_share;
  std::int64_t wait = fewest_;
  if (looks.last >= 0 && step > looks.last) {
    const double since = static_cast<double>(step - looks.last);
    // Half the way there, and as fast back as forth; at most twice as long as before. The peak rate
    // fades slowly, because a body that swings stiffens fast again and again.
    const double faded = looks.change * std::exp2(-since / static_cast<double>(memory * fewest_));
    looks.change = std::max(std::abs(ratio - looks.ratio) / since, faded);
    const double until = looks.change > 0 ? (most_ratio - ratio) / looks.change / 2 : 2 * since;
    wait = static_cast<std::int64_t>(std::min(until, 2 * since));
  }
  looks.next = step + std::clamp(wait / fewest_ * fewest_, fewest_, most());
  looks.last = step;
  looks.ratio = ratio;
}

void StepShortener::see(const Solver& solver) {
  const Stiffening now = find_stiffening(model_, backend_);
  if (std::isfinite(now.ratio)) seen_ = {now, solver.time()};
}

std::string StepShortener::where_it_began() const {
  const std::optional<Seen>& began = first_ ? first_ : seen_;
  if (!began || began->what.phyxel < 0) return "nobody has looked at it before";
  if (!(began->what.stretch > 1 + 1e-6)) {
    return fmt::format("at t = {:g} s, the last look, nothing was stretched", began->time);
  }
  return fmt::format("it began at {}, stretched to {:.3g} times its length at t = {:g} s",
                     describe_phyxel(model_, began->what.phyxel), began->what.stretch, began->time);
}

}  // namespace phyxel
