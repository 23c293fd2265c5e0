/// `StepControl` decides when the step of Verlet's method is halved or doubled.
#include "phyxel/step_control.hpp"

#include <fmt/format.h>

#include <cmath>
#include <map>

#include "phyxel/diagnostics.hpp"
#include "phyxel/error.hpp"

namespace phyxel {
namespace {

/// Factor of the stiffness bound for surfaces. Phyxels there have neighbours on one side only, so
/// their gradients differ from those of plane waves: modes of a stretched block are up to 11%
/// stiffer than the bound.
constexpr double at_surfaces = 1.12;

/// Steps after which the step limit is computed again, as a multiple of the fewest steps between
/// two looks. It is computed even if no phyxel has stiffened, because the stiffest place may have
/// moved.
constexpr std::int64_t least_apart = 16;
/// Upper limit of that number, which doubles each time that the step limit has not changed.
constexpr std::int64_t most_apart = 2048;
/// Half-life of the peak rate of stiffening, in the same unit.
constexpr std::int64_t memory = 64;
constexpr double same_share = 0.02;  // relative accuracy of a computed limit
/// A shock stiffens a phyxel by more than this fraction between two looks the fewest steps apart.
constexpr double shock = 0.5;
/// The step is doubled if the bound is below this value, so that no small change halves it again.
constexpr double calm_bound = 0.85;
/// The step is doubled if the computed limit is below this fraction of the largest share, likewise.
constexpr double calm_share = 0.9;

}  // namespace

StepControl::StepControl(const Model& model, Backend& backend, const StepPlan& plan)
    : model_(model), backend_(backend), at_rest_(plan.limit), lengthens_(plan.lengthens) {
  if (!plan.shortens) return;
  for (const Part& part : model.parts) active_ = active_ || stiffens(part.material);
  // Looks are collective, even if nothing on this rank stiffens.
  if (model.share) active_ = model.share->communicator->largest(active_) > 0;
  if (!active_) return;
  viscosity_ = largest_viscosity(model);
  // A wave travels about one spacing in a step, and so crosses a body in as many steps as the body
  // has phyxels across: a small one deforms fully within a few steps.
  std::map<Index, Index> size;  // number of phyxels of each body
  for (const Part& part : model.parts) size[part.body] += part.size;
  for (const auto& [body, phyxels] : size) {
    const auto across = static_cast<std::int64_t>(std::cbrt(phyxels));
    fewest_ = std::clamp(across / 2, std::int64_t{1}, fewest_);
  }
}

int StepControl::look(Solver& solver, int halvings) {
  if (!active_ || solver.steps() < solver.looks().next) return 0;
  const Stiffening now = find_stiffening(model_, backend_);
  if (std::isfinite(now.ratio)) seen_ = {now, solver.time()};
  if (!std::isfinite(now.ratio)) diverge(solver, "the state is not finite");  // on all ranks
  int made = shorten(solver, now.ratio, halvings);
  const bool calm = made == 0 && halvings > 0 && lengthens_ && is_calm(solver, now.ratio);
  const bool even = solver.steps() % 2 == 0;
  if (calm && even && lengthen(solver, now.ratio)) made = -1;
  if (halvings + made == 0) first_.reset();
  look_again(solver, solver.looks(), now.ratio);
  if (calm && !even) solver.looks().next = solver.steps() + 1;
  return made;
}

int StepControl::shorten(Solver& solver, double ratio, int halvings) {
  if (!(bound_of_share(solver.dt(), ratio) > 1)) return 0;
  const Looks& looks = solver.looks();
  // A share computed earlier is a lower bound.
  const double expected = std::max(looks.measured_share, expected_share(looks, ratio));
  if (looks.measured >= 0 && expected <= allowed_share(solver.dt()) &&
      solver.steps() - looks.measured < looks.apart) {
    return 0;
  }
  const bool known = looks.measured >= 0;
  const double before = looks.measured_share, share = measure(solver, ratio);
  const bool stayed = known && std::abs(share - before) <= same_share * before;
  solver.looks().apart = stayed ? std::min(2 * looks.apart, most_apart) : least_apart * fewest_;
  const double allowed = allowed_share(solver.dt());
  if (!(share <= allowed) && !first_) first_ = seen_;
  int made = 0;
  for (; !(looks.measured_share <= allowed); ++made) {
    if (halvings + made == most_halvings) {
      diverge(solver, fmt::format("a body is {:.3g} times as stiff as at rest, for which steps "
                                  "would have to be shorter than {:g} s, 1/{} of those planned,",
                                  ratio, solver.dt(), std::int64_t{1} << most_halvings));
    }
    solver.halve_step();
  }
  if (made > 0) solver.looks().too_long = solver.steps();
  return made;
}

double StepControl::calm_share_of(double dt) const {
  const double at_rest = dt / at_rest_.largest_step, allowed = allowed_share(dt);
  return std::max(calm_share * allowed, (at_rest * at_rest + allowed) / 2);
}

bool StepControl::is_calm(Solver& solver, double ratio) const {
  Looks& looks = solver.looks();
  const std::int64_t step = solver.steps();
  const double longer = 2 * solver.dt();
  const bool is_likely =
      bound_of_share(longer, ratio) <= calm_bound ||
      (looks.measured >= 0 && 4 * expected_share(looks, ratio) <= calm_share_of(longer)) ||
      step - looks.measured >= most_apart;
  if (!is_likely) looks.too_long = step;
  return looks.too_long < 0 || step - looks.too_long >= patience();
}

bool StepControl::lengthen(Solver& solver, double ratio) const {
  const double longer = 2 * solver.dt();
  if (bound_of_share(longer, ratio) > calm_bound &&
      !(4 * measure(solver, ratio) <= calm_share_of(longer))) {
    solver.looks().too_long = solver.steps();
    return false;
  }
  solver.double_step();
  return true;
}

double StepControl::measure(Solver& solver, double ratio) const {
  const double omega = present_step_limit(model_, backend_).omega_max;
  // The viscosity of any mode exceeds that at rest by at most the factor of the stiffest phyxel.
  const double slowed = at_rest_.omega_max / omega;
  const double viscosity = viscosity_ > 0 ? viscosity_ * ratio * slowed * slowed : 0;
  const double share = solver.dt() / stable_step(omega, viscosity);
  Looks& looks = solver.looks();
  looks.measured = solver.steps();
  looks.measured_ratio = ratio;
  // If forces nearby are not finite, only the bound is available.
  looks.measured_share = std::isfinite(share) ? share * share : bound_of_share(solver.dt(), ratio);
  return looks.measured_share;
}

double StepControl::bound_of_share(double dt, double ratio) const {
  const double share =
      dt / stable_step(at_rest_.omega_max * std::sqrt(at_surfaces * ratio), viscosity_);
  return share * share;
}

double StepControl::expected_share(const Looks& looks, double ratio) const {
  const double grown = ratio / looks.measured_ratio;
  // A limit set by viscosity falls as the square of the frequency.
  return looks.measured_share * (viscosity_ > 0 ? std::max(grown, grown * grown) : grown);
}

double StepControl::allowed_share(double dt) const {
  const double at_rest = dt / at_rest_.largest_step;
  return std::max(largest_share, std::min(1.1 * at_rest * at_rest, 0.95));
}

void StepControl::look_again(const Solver& solver, Looks& looks, double ratio) const {
  const std::int64_t step = solver.steps();
  // The stiffening of a phyxel up to which the step is safe.
  const double reserve = 1 / bound_of_share(solver.dt(), 1);
  const double bounded = viscosity_ > 0 ? std::min(reserve, std::sqrt(reserve)) : reserve;
  const double most_ratio =
      ratio <= bounded ? bounded
                       : looks.measured_ratio * allowed_share(solver.dt()) / looks.measured_share;
  std::int64_t wait = 1, least = 1;
  if (looks.last >= 0 && step > looks.last) {
    const double since = static_cast<double>(step - looks.last);
    // The next look is due after half the time in which the peak rate uses up the reserve, and
    // after at most twice the last interval. The peak rate fades slowly, because a swinging body
    // stiffens fast again and again.
    const double faded = looks.change * std::exp2(-since / static_cast<double>(memory * fewest_));
    const double rate = std::abs(ratio - looks.ratio) / since;
    looks.change = std::max(rate, faded);
    const double until = looks.change > 0 ? (most_ratio - ratio) / looks.change / 2 : 2 * since;
    wait = static_cast<std::int64_t>(std::min(until, 2 * since));
    // A shock stiffens only the phyxels that it has reached.
    const bool is_shock = rate * static_cast<double>(fewest_) > shock * ratio;
    least = is_shock ? 1 : std::min(fewest_, 2 * (step - looks.last));
  }
  looks.next = step + std::clamp(wait, least, most());
  looks.last = step;
  looks.ratio = ratio;
}

void StepControl::see(const Solver& solver) {
  const Stiffening now = find_stiffening(model_, backend_);
  if (std::isfinite(now.ratio)) seen_ = {now, solver.time()};
}

void StepControl::diverge(const Solver& solver, const std::string& how) const {
  throw DivergedError(
      fmt::format("the simulation diverged: {} at t = {:g} s (step {}); {}; a stiffer material, "
                  "damping, smaller loads or a smaller time.step may help",
                  how, solver.time(), solver.steps(), where_it_began()));
}

std::string StepControl::where_it_began() const {
  const std::optional<Seen>& began = first_ ? first_ : seen_;
  if (!began || began->what.phyxel < 0) return "nobody has looked at it before";
  if (!(began->what.stretch > 1 + 1e-6)) {
    return fmt::format("at t = {:g} s, the last look, nothing was stretched", began->time);
  }
  return fmt::format("it began at {}, stretched to {:.3g} times its length at t = {:g} s",
                     describe_phyxel(model_, began->what.phyxel), began->what.stretch, began->time);
}

}  // namespace phyxel
