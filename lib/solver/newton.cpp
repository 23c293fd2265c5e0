#include "solver/newton.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "phyxel/diagnostics.hpp"
#include "phyxel/error.hpp"
#include "phyxel/law_table.hpp"
#include "solver/boundary_conditions.hpp"
#include "solver/host_threads.hpp"

namespace phyxel {
namespace {

constexpr double largest_strain = 0.3;  // largest change of strain in one step
constexpr int most_cuts = 8;
// Linear equations are solved to this share of the residual, within limits: more would be lost
// where forces are far from linear.
constexpr double inner_tolerance_of_contact = 1e-3;
constexpr double inner_share = 0.3, least_inner = 0.01, most_inner_tolerance = 0.1;
constexpr double large_gradient = 0.05;  // of u, which the preconditioner has to know
constexpr int most_inner = 50'000;
// Limit of conjugate gradient iterations per unknown; in exact arithmetic one per unknown suffices.
constexpr int most_inner_share = 10;
constexpr int most_exhausted = 3;        // steps in a row whose linear equations stay unsolved
constexpr int most_without_gain = 50;    // steps that hardly reduce the smallest residual
constexpr double rounding_share = 1e-6;  // times the tolerance: a few units of rounding

// Limits of the linear form of gaps (`Renewal`), and of held normal forces.
constexpr double kept_below = 1e-2;       // residual
constexpr int most_kept = 5;              // steps
constexpr double share_of_goal = 0.1;     // of the last residual, from which on contact is renewed
constexpr double held_below = 1e-3;       // residual, for the normal forces of friction
constexpr int most_unheld = 15;           // steps until they are held, with inertia
constexpr int most_unsettled = 8;         // renewals without a gain until contact changes by less
constexpr double unrest_at_rest = 1e-9;   // change of normal forces in a balance, over the largest
constexpr double unrest_in_steps = 1e-3;  // likewise: below the error of a step

Vec3d held_part(const Balance& balance, Index i, Vec3d v) {
  return v - by_components(balance.free[i], v);
}

}  // namespace

void check_precision(const Backend& backend, Method method) {
  if (backend.precision() == Precision::double_) return;
  throw InputError(fmt::format(
      "solver.precision = \"{}\" found; allowed with solver.method = \"{}\": \"double\"",
      precision_name(backend.precision()), method_name(method)));
}

Newton::Newton(const Model& model, Backend& backend, int most_steps)
    : model_(model),
      backend_(backend),
      most_steps_(most_steps),
      vectors_(model, host_threads(backend)),
      following_(model),
      contact_(model),
      preconditioner_(model, vectors_),
      difference_(1e-7 * vectors_.smallest_support()) {
  is_nearly_potential_ = !following_.empty();
  for (const Part& part : model.parts) {  // of the same materials on all ranks
    if (part.material.custom_law) continue;
    const LawEntry& law = law_table()[chosen_law(part.material).index];
    is_nearly_potential_ = is_nearly_potential_ || !law.work_is_potential;
  }
}

/// The reason to give a search up, or nothing. @param exhausted number of steps in a row whose
/// linear equations stayed unsolved
std::string Newton::why_to_end(const NewtonReport& report, int without_gain, int exhausted) const {
  if (!std::isfinite(report.residual)) return "forces are not finite";
  if (report.steps >= most_steps_) {
    return fmt::format("{} steps are all that is allowed", most_steps_);
  }
  if (without_gain >= most_without_gain) {
    return fmt::format("{} steps in a row have gained nothing", without_gain);
  }
  if (exhausted < most_exhausted) return {};
  return fmt::format(
      "the linear equations of {} steps in a row have no solution that conjugate gradients "
      "find in {} iterations",
      exhausted, most_inner_here());
}

/// Holds the normal forces of friction once they are known well, or where they do not settle: with
/// them friction has an energy, and the search finds a balance. Without inertia nothing but
/// friction may hold a body, so that they have to be known well first.
void Newton::hold_normals(const Balance& balance, Rounds& rounds, const NewtonReport& report) {
  if (!contact_.rubs() || contact_.holds_normals()) return;
  const bool is_near = report.residual <= held_below;
  const bool holds = balance.weight.empty() ? is_near && rounds.without_gain >= most_unsettled
                                            : is_near || report.steps >= most_unheld;
  if (!holds) return;
  contact_.renew_normals(1);
  rounds.forget_gain();
}

/// Renews the normal forces of friction where a balance with held ones is found.
/// @returns false if the present normal forces are the held ones, within a tolerance
bool Newton::renew_normals(const Balance& balance, Rounds& rounds) {
  const double most = balance.weight.empty() ? unrest_at_rest : unrest_in_steps;
  if (!contact_.holds_normals() || contact_.unrest() <= most) return false;
  // Where they swing, smaller changes settle.
  ++rounds.of_normals;
  contact_.renew_normals(rounds.of_normals < 4 ? 1 : rounds.of_normals < 10 ? 0.5 : 0.25);
  return true;
}

/// Checks for convergence after a renewal of all of contact. @returns true if the search has ended
bool Newton::takes_stock(const Balance& balance, const Vector& u, const Vector& force,
                         double tolerance, bool is_placed, Vector& all, Rounds& rounds,
                         NewtonReport& report) {
  report.residual = residual(balance, u, all);
  report.evaluations = evaluations_;
  report.found = report.residual <= tolerance && is_placed;
  rounds.renewed = report.residual;
  if (report.found) {
    const bool begins = contact_.begin_sliding();
    if (!begins && !renew_normals(balance, rounds)) return true;
    if (!begins) {
      all = with_contact(balance, u, force);
      rounds.renewed = residual(balance, u, all);
    }
    rounds.smallest = std::numeric_limits<double>::infinity();
  }
  const bool gained = !is_placed || rounds.renewed < 0.9 * rounds.smallest;
  rounds.smallest = std::min(rounds.smallest, rounds.renewed);
  rounds.without_gain = gained ? 0 : rounds.without_gain + 1;
  report.why = why_to_end(report, rounds.without_gain, rounds.exhausted);
  if (!report.why.empty()) return true;
  hold_normals(balance, rounds, report);
  rounds.kept = 0;
  return false;
}

/// True if gaps of bodies have to be renewed after steps that have kept their linear form.
bool Newton::must_renew(const Rounds& rounds, const Balance& balance, const Vector& u,
                        const Vector& all, double tolerance) const {
  const double goal = std::max(0.5 * tolerance, share_of_goal * rounds.renewed);
  return rounds.renewed > kept_below || rounds.kept >= most_kept || !contact_.may_keep(u) ||
         residual(balance, u, all) <= goal;
}

NewtonReport Newton::solve(const Balance& balance, double tolerance, Vector& u) {
  NewtonReport report;
  evaluations_ = 0;
  progress_ = {.tolerance = tolerance};
  Rounds rounds;
  find_stiffness(balance);
  contact_.forget();
  // Forces and energies without contact, whose stiffness is known and needs no differences.
  Vector force = forces_without_contact(balance, u), step = vectors_.make(), next = vectors_.make();
  double plain_energy = potential(balance, u);
  for (;;) {
    linearise_contact(balance, u, rounds.renewal);
    Vector all = with_contact(balance, u, force);
    const double to_move = vectors_.largest(
        [&](Index i) { return norm(held_part(balance, i, balance.target[i] - u[i])); });
    if (rounds.renewal == Renewal::motion) {
      if (to_move > 0 || must_renew(rounds, balance, u, all, tolerance)) {
        rounds.renewal = Renewal::all;
        continue;
      }
    } else {
      const bool is_placed = to_move == 0;
      if (takes_stock(balance, u, force, tolerance, is_placed, all, rounds, report)) return report;
      const double share = rounds.without_gain < most_unsettled ? 1 : 0.3;
      if (contact_.mix(u, share)) all = with_contact(balance, u, force);
    }
    const double energy = plain_energy + contact_.energy(balance.obstacles, u);
    progress_.step = report.steps;
    progress_.residual = report.residual;
    progress_.energy = energy;
    if (asked_to_stop(0, 1)) {
      report.interrupted = true;
      return report;
    }
    ++report.steps;
    ++rounds.kept;

    const Inner inner = find_step(balance, u, force, all, step);
    rounds.exhausted = inner == Inner::exhausted ? rounds.exhausted + 1 : 0;
    if (inner == Inner::interrupted) {
      report.interrupted = true;
      return report;
    }
    const LineSearch searched = search_line({balance, energy, report.residual, to_move > 0}, u,
                                            step, force, plain_energy, next);
    if (searched != LineSearch::found) {
      report.interrupted = searched == LineSearch::interrupted;
      if (!report.interrupted) {
        report.why = "no part of a step leads to a state whose energy is finite";
      }
      return report;
    }
    u.swap(next);
    rounds.renewal = contact_.can_keep() ? Renewal::motion : Renewal::all;
  }
}

/// Shortens a step until the energy falls, or to where it hardly matters.
/// @param force,energy receive forces and energy without contact after it. @param next receives the
/// displacements there
Newton::LineSearch Newton::search_line(const Start& start, const Vector& u, const Vector& step,
                                       Vector& force, double& plain_energy, Vector& next) {
  const Balance& balance = start.balance;
  double length = std::min(1.0, largest_strain / steepest(step));
  for (int attempt = 0;; ++attempt, length *= 0.5) {
    vectors_.for_each([&](Index i) {
      next[i] = u[i] + length * step[i];
      // A whole step ends exactly on the target.
      if (length == 1) {
        next[i] =
            by_components(balance.free[i], next[i]) + held_part(balance, i, balance.target[i]);
      }
    });
    force = forces_without_contact(balance, next);
    const double plain = potential(balance, next);
    const double now = plain + contact_.energy(balance.obstacles, next);
    // Energy may rise while prescribed phyxels move; a rise by rounding does not count. Pressure
    // that follows the surface has an energy only nearly, and so do laws whose flow depends on its
    // rate: there, smaller residuals do as well.
    const double rise = now - start.energy, rounding = 1e-10 * std::abs(start.energy);
    const bool falls =
        rise <= rounding ||
        (is_nearly_potential_ &&
         residual(balance, next, with_contact(balance, next, force)) < start.residual);
    if (std::isfinite(now) && (start.moves || falls || attempt == most_cuts)) {
      plain_energy = plain;
      return LineSearch::found;
    }
    if (attempt > 2 * most_cuts) return LineSearch::endless;
    if (asked_to_stop(progress_.iteration, progress_.inner_residual)) {
      return LineSearch::interrupted;
    }
  }
}

Newton::Vector Newton::inner_forces(const Vector& u) {
  put(u);
  Vector force;
  backend_.internal_forces(force);
  ++evaluations_;
  return force;
}

void Newton::set_applied(double time, Balance& balance) const {
  Vector& applied = balance.applied;
  applied = vectors_.make();
  vectors_.for_each([&](Index i) { applied[i] = model_.mass[i] * model_.gravity; });
  add_constant_loads(model_, time, applied);
  const std::span<const Vec3d> external = backend_.external_forces();
  if (!external.empty()) vectors_.for_each([&](Index i) { applied[i] += external[i]; });
  balance.time = time;
  if (following_.empty()) return;
  Vector rest = vectors_.make();
  for_each_load(model_, true, time, [&](Index i, Vec3d load) { rest[i] += load; });
  balance.scale = std::sqrt(vectors_.product(rest, rest));
}

Newton::Vector Newton::acting_without_contact(const Balance& balance, const Vector& u) {
  Vector force = inner_forces(u);
  vectors_.for_each([&](Index i) { force[i] += balance.applied[i]; });
  following_.add(
      balance.time, [&](Index i) { return placed_[i]; }, force);
  return force;
}

Newton::Vector Newton::with_contact(const Balance& balance, const Vector& u, Vector force) const {
  if (!contact_.empty()) contact_.add(balance.obstacles, u, force);
  return force;
}

Newton::Vector Newton::acting_forces(const Balance& balance, const Vector& u) {
  Vector force = acting_without_contact(balance, u);
  linearise_contact(balance, u, Renewal::all);
  return with_contact(balance, u, std::move(force));
}

/// Call it where the backend has the displacements u.
void Newton::linearise_contact(const Balance& balance, const Vector& u, Renewal renewal) {
  if (contact_.empty()) return;
  contact_.linearise(balance.obstacles, u, balance.slip, renewal, [&] {
    std::vector<Mat3d> gradient;
    backend_.displacement_gradients(gradient);
    ++evaluations_;
    return gradient;
  });
}

/// The sum of all forces at u but those of contact, those of inertia included [N].
Newton::Vector Newton::forces_without_contact(const Balance& balance, const Vector& u) {
  Vector force = acting_without_contact(balance, u);
  if (!balance.weight.empty()) {
    vectors_.for_each([&](Index i) {
      force[i] -= balance.weight[i] * by_components(balance.free[i], u[i] - balance.centre[i]);
    });
  }
  return force;
}

void Newton::put(const Vector& u) {
  placed_ = u;
  vectors_.refresh_ghosts(placed_);
  backend_.put_displacements(placed_);
}

/// The potential energy [J] at u without that of contact, but for closed cracks. Call right after
/// `forces_without_contact` at the same u.
double Newton::potential(const Balance& balance, const Vector& u) {
  // Includes the incremental potentials of plastic and viscous stresses over one step.
  const Diagnostics now = diagnose(model_, backend_, 0, 1);
  const double elastic =
      now.elastic_energy() + now.contact_energy + now.plastic_work + 0.5 * now.viscous_work;
  ++evaluations_;
  double inert = 0;
  if (!balance.weight.empty()) {
    inert = vectors_.sum([&](Index i) {
      const Vec3d way = by_components(balance.free[i], u[i] - balance.centre[i]);
      return 0.5 * balance.weight[i] * dot(way, way);
    });
  }
  const double following = following_.energy(balance.time, [&](Index i) { return placed_[i]; });
  return elastic - vectors_.product(balance.applied, u) + following + inert;
}

/// The residual force relative to applied, reaction and inertial forces, plus a fraction of the
/// forces that moving single phyxels as far would take: without loads, the rounding of these
/// remains.
double Newton::residual(const Balance& balance, const Vector& u, const Vector& force) const {
  const double free = vectors_.sum(
      [&](Index i) { return dot(by_components(balance.free[i], force[i]), force[i]); });
  const double reactions =
      vectors_.sum([&](Index i) { return dot(held_part(balance, i, force[i]), force[i]); });
  const double scale = std::sqrt(vectors_.product(balance.applied, balance.applied)) +
                       std::sqrt(reactions) + std::sqrt(contact_.squared_size()) + balance.scale +
                       rounding_share * std::sqrt(vectors_.sum([&](Index i) {
                         return stiffness_[i] * stiffness_[i] * dot(u[i], u[i]);
                       }));
  return scale > 0 ? std::sqrt(free) / scale : std::sqrt(free) > 0 ? 1 : 0;
}

double Newton::largest_entry(std::span<const Mat3d> gradient) const {
  return vectors_.largest([&](Index i) {
    double entry = 0;
    for (int e = 0; e < 9; ++e) entry = std::max(entry, std::abs(gradient[i](e / 3, e % 3)));
    return entry;
  });
}

/// The largest entry of ∇u of a displacement.
double Newton::steepest(const Vector& step) {
  put(step);
  std::vector<Mat3d> gradient;
  backend_.displacement_gradients(gradient);
  ++evaluations_;
  return std::max(largest_entry(gradient), 1e-300);
}

/// Computes out = (K + weight) v on free axes, with K v by a difference of forces, and the
/// stiffness of contact added. @param force at u without contact [N]
void Newton::stiffness_times(const Balance& balance, const Vector& u, const Vector& force,
                             const Vector& v, Vector& out) {
  const double size = vectors_.largest([&](Index i) { return norm(v[i]); });
  const double scale = size > 0 ? difference_ / size : 1;
  Vector there(u.size());
  vectors_.for_each([&](Index i) { there[i] = u[i] + scale * v[i]; });
  const Vector changed = forces_without_contact(balance, there);
  vectors_.for_each([&](Index i) { out[i] = (1 / scale) * (force[i] - changed[i]); });
  contact_.add_stiffness_times(v, out);
  vectors_.for_each([&](Index i) { out[i] = by_components(balance.free[i], out[i]); });
}

/// Estimates the stiffness of each phyxel against its neighbours [N/m]. Without inertia only ratios
/// matter, and a constant factor may remain.
void Newton::find_stiffness(const Balance& balance) {
  stiffness_.resize(static_cast<std::size_t>(model_.size()));
  for (const Part& part : model_.parts) {
    const double c = pressure_wave_speed(part.material);
    for (Index i = part.begin; i < part.owned_end(); ++i) {
      const double h = model_.neighbourhood.support[i], crossings = h > 0 ? c / h : 1;
      stiffness_[i] = model_.mass[i] * crossings * crossings;
      if (!balance.weight.empty()) stiffness_[i] += balance.weight[i];
    }
  }
}

int Newton::most_inner_here() const {
  const auto unknowns = 3 * static_cast<std::int64_t>(model_.global_count());
  return static_cast<int>(std::min<std::int64_t>(most_inner, most_inner_share * unknowns + 100));
}

bool Newton::asked_to_stop(int iteration, double inner_residual) {
  if (!observer_) return false;
  progress_.iteration = iteration;
  progress_.inner_residual = inner_residual;
  const double stop = observer_(progress_) ? 0 : 1;
  return (model_.share ? model_.share->communicator->largest(stop) : stop) > 0;
}

/// Sets the preconditioner for a step from u, on which alone it depends, so that a search that was
/// stopped goes on to the bit. Gradients count if they are large.
void Newton::begin_preconditioner(const Balance& balance, const Vector& u) {
  put(u);
  std::vector<Mat3d> gradient;
  backend_.displacement_gradients(gradient);
  ++evaluations_;
  if (!(largest_entry(gradient) > large_gradient)) gradient.clear();
  preconditioner_.set(balance.free, balance.weight, contact_.held_blocks(), std::move(gradient));
}

/// Finds the step of Newton's method, in which prescribed phyxels reach their targets, by
/// preconditioned conjugate gradients. They stop at the first direction of negative stiffness.
/// @param force,all forces at u without and with contact [N]
Newton::Inner Newton::find_step(const Balance& balance, const Vector& u, const Vector& force,
                                const Vector& all, Vector& step) {
  Vector rest = vectors_.make(), image = vectors_.make();
  vectors_.for_each([&](Index i) { step[i] = held_part(balance, i, balance.target[i] - u[i]); });
  const bool moves = vectors_.largest([&](Index i) { return norm(step[i]); }) > 0;
  if (moves) stiffness_times(balance, u, force, step, image);
  vectors_.for_each([&](Index i) {
    rest[i] = by_components(balance.free[i], all[i]);
    if (moves) rest[i] -= image[i];
  });

  Vector way(u.size()), preconditioned(u.size());
  begin_preconditioner(balance, u);
  preconditioner_.apply(rest, preconditioned);
  vectors_.for_each([&](Index i) { way[i] = preconditioned[i]; });
  double product = vectors_.product(rest, preconditioned);
  const double start = product;
  const int most = most_inner_here();
  const double enough = contact_.empty() ? std::clamp(inner_share * progress_.residual, least_inner,
                                                      most_inner_tolerance)
                                         : inner_tolerance_of_contact;
  for (int k = 0; product > enough * enough * start; ++k) {
    if (k == most) return Inner::exhausted;
    stiffness_times(balance, u, force, way, image);
    if (asked_to_stop(k + 1, std::sqrt(product / start))) return Inner::interrupted;
    const double curvature = vectors_.product(way, image);
    if (!(curvature > 0)) {
      if (k == 0) vectors_.for_each([&](Index i) { step[i] += way[i]; });
      return Inner::indefinite;
    }
    const double length = product / curvature;
    vectors_.for_each([&](Index i) {
      step[i] += length * way[i];
      rest[i] -= length * image[i];
    });
    const double before = product;
    preconditioner_.apply(rest, preconditioned);
    product = vectors_.product(rest, preconditioned);
    const double share = product / before;
    vectors_.for_each([&](Index i) { way[i] = preconditioned[i] + share * way[i]; });
  }
  return Inner::converged;
}

}  // namespace phyxel
