/// Verlet's steps, halved and doubled as laws stiffen and soften.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>

#include "phyxel/solver.hpp"

namespace phyxel {

/// Halves Verlet's steps where laws have become so stiff that they would soon be unstable, and
/// doubles them again, up to the planned step, where the limit allows it. It looks at a bound that
/// costs little, a wave in the stiffest phyxel; only beyond that bound it finds the limit itself,
/// as far fewer bodies outgrow their step than have a phyxel that would. When it looks follows from
/// what it has seen: often where a body stiffens, seldom where nothing changes. All of that is part
/// of the state, so that runs, restarts and any number of threads and ranks change their steps at
/// the same times. Laws that cannot stiffen cost nothing.
class StepControl {
 public:
  static constexpr int most_halvings = 10;  ///< Of the planned step.
  /// Of (dt / limit)²: bodies that stiffen fast come to half as much again between two looks.
  static constexpr double largest_share = 0.75;

  /// All must outlive this.
  StepControl(const Model& model, Backend& backend, const StepPlan& plan);

  /// Before a step: if a look is due, looks, and halves the solver's step as often as needed, or
  /// doubles it once. Collective.
  /// @param halvings of the planned step that made the present one
  /// @returns the number of halvings made now; -1: the step was doubled
  /// @throws DivergedError, saying which phyxel, its stretch and when, if `most_halvings` are not
  ///   enough or a displacement is not finite
  int look(Solver& solver, int halvings);
  /// The step before which `look` has to be called next.
  std::int64_t next_look(Solver& solver) const {
    return active_ ? solver.looks().next : std::numeric_limits<std::int64_t>::max();
  }
  /// Whether any law can stiffen.
  bool active() const { return active_; }
  /// The fewest steps between two looks, but at the start and in a shock: half the number of steps
  /// in which a wave crosses the smallest body, from 1 to 16.
  std::int64_t fewest() const { return fewest_; }
  /// The most steps between two looks.
  std::int64_t most() const { return std::min<std::int64_t>(32 * fewest_, 128); }
  /// Steps of twice the size have to be right for so many steps before they are taken.
  std::int64_t patience() const { return 64 * fewest_; }
  /// Looks without a change of the step, so that messages know of models that cannot stiffen, too.
  /// Collective.
  void see(const Solver& solver);
  /// The first phyxel for which the planned step was halved, or else the stiffest of the last look:
  /// which, its stretch, and when. Collective.
  std::string where_it_began() const;

 private:
  /// The bound of (dt / limit)² that follows from a plane wave in the stiffest phyxel.
  double bound_of_share(double dt, double ratio) const;
  /// (dt / limit)² that follows from the last limit found, if all phyxels have stiffened, or
  /// softened, as much as the stiffest one.
  double expected_share(const Looks& looks, double ratio) const;
  /// Finds (dt / limit)² at the present displacements, and records it.
  double measure(Solver& solver, double ratio) const;
  /// The largest share that is allowed: `largest_share`, or a tenth more than at rest where a scene
  /// asks for longer steps.
  double allowed_share(double dt) const;
  /// Halves the step as often as needed. @returns how often
  int shorten(Solver& solver, double ratio, int halvings);
  /// The largest share at which steps are doubled: less than is allowed, so that no small change
  /// halves them again.
  double calm_share_of(double dt) const;
  /// True if steps of twice the size have seemed right for as long as `patience`.
  bool is_calm(Solver& solver, double ratio) const;
  /// Doubles the step if the bound, or the limit, allows it. @returns whether it did
  bool lengthen(Solver& solver, double ratio) const;
  /// When to look again, after a look that found `ratio`.
  void look_again(const Solver& solver, Looks& looks, double ratio) const;
  [[noreturn]] void diverge(const Solver& solver, const std::string& how) const;

  static constexpr std::int64_t most_of_fewest = 16;
  struct Seen {
    Stiffening what;
    double time = 0;  ///< [s]
  };
  const Model& model_;
  Backend& backend_;
  StepLimit at_rest_;
  double viscosity_ = 0;  ///< The longest relaxation time of all bodies [s].
  bool active_ = false, lengthens_ = false;
  std::int64_t fewest_ = most_of_fewest;
  std::optional<Seen> seen_, first_;
};

}  // namespace phyxel
