#include "phyxel/reactions.hpp"

#include <limits>

#include "rank_sums.hpp"
#include "solver/present_forces.hpp"
#include "solver/support_work.hpp"

namespace phyxel {
namespace {

/// Adds the sums of all ranks.
void add_over_ranks(const Model& model, std::vector<ExactSum>& sums) {
  if (model.share) add_over_ranks(*model.share->communicator, sums);
}

/// Returns the vector whose components are the sums from `first` on.
Vec3d vector_at(const std::vector<ExactSum>& sums, std::size_t first) {
  return {sums[first].value(), sums[first + 1].value(), sums[first + 2].value()};
}

void add(std::vector<ExactSum>& sums, std::size_t first, Vec3d term) {
  sums[first].add(term.x);
  sums[first + 1].add(term.y);
  sums[first + 2].add(term.z);
}

/// Returns the centre of mass of each motion's phyxels at rest [m].
std::vector<Vec3d> centres_of(const Model& model) {
  std::vector<ExactSum> sums(4 * model.motions.size());  // mass [kg] and mass times position
  for (std::size_t m = 0; m < model.motions.size(); ++m) {
    for_each_owned(model, model.motions[m], [&](Index i, const Part&) {
      sums[4 * m].add(model.mass[i]);
      add(sums, 4 * m + 1, model.mass[i] * model.position[i]);
    });
  }
  add_over_ranks(model, sums);
  std::vector<Vec3d> centres;
  for (std::size_t m = 0; m < model.motions.size(); ++m) {
    const double mass = sums[4 * m].value();
    centres.push_back(mass > 0 ? vector_at(sums, 4 * m + 1) / mass : Vec3d{});
  }
  return centres;
}

/// Returns the displacement that the reactions of an instant have to be multiplied by to complete
/// the work of earlier steps (`Solver::support_work`).
Path rest_of_work(const Motion& motion, const Solver& solver) {
  const double time = solver.time(), dt = solver.dt();
  Path rest = motion.last_step(time, dt);
  rest.displacement = 0.5 * rest.displacement;
  rest.turn = 0.5 * rest.turn;
  if (solver.method() == Method::implicit && solver.steps() > 0) {  // the whole is counted
    const Path whole = motion.mean_step(time, dt);
    rest.displacement -= whole.displacement;
    rest.turn = rest.turn - whole.turn;
  }
  return rest;
}

}  // namespace

std::vector<Reaction> find_reactions(const Model& model, Backend& backend, const Solver& solver) {
  check_fits(model, backend);
  if (model.motions.empty()) return {};
  const PresentForces present(model, backend, solver);
  const std::vector<Vec3d> centres = centres_of(model);
  constexpr std::size_t width = 7;  // force, torque, and the rest of the work
  std::vector<ExactSum> sums(width * model.motions.size());
  for (std::size_t m = 0; m < model.motions.size(); ++m) {
    const Motion& motion = model.motions[m];
    const Path rest = rest_of_work(motion, solver);
    for_each_support_force(model, motion, present.instant(), [&](Index i, Vec3d force) {
      const Vec3d x = model.position[i], arm = x + present.state().displacement[i] - centres[m];
      add(sums, width * m, force);
      add(sums, width * m + 3, cross(arm, force));
      if (!motion.stands_still()) sums[width * m + 6].add(dot(force, rest.at(x)));
    });
  }
  add_over_ranks(model, sums);
  SupportWork work = no_support_work(model);
  add_words(work, solver.support_work());
  std::vector<Reaction> reactions;
  for (std::size_t m = 0; m < model.motions.size(); ++m) {
    const Motion& motion = model.motions[m];
    Reaction& reaction = reactions.emplace_back();
    reaction.body = motion.body;
    reaction.set = motion.set;
    reaction.centre = centres[m];
    reaction.force = vector_at(sums, width * m);
    reaction.torque = vector_at(sums, width * m + 3);
    if (motion.stands_still()) continue;
    ExactSum whole = work[m];
    whole.add(sums[width * m + 6]);
    reaction.work = solver.method() == Method::equilibrium
                        ? std::numeric_limits<double>::quiet_NaN()
                        : whole.value();
  }
  return reactions;
}

std::span<const ReactionColumn> reaction_columns() {
  using R = const Reaction&;
  static const ReactionColumn columns[] = {
      {"force_x", "N", [](R r) { return r.force.x; }},
      {"force_y", "N", [](R r) { return r.force.y; }},
      {"force_z", "N", [](R r) { return r.force.z; }},
      {"torque_x", "N m", [](R r) { return r.torque.x; }},
      {"torque_y", "N m", [](R r) { return r.torque.y; }},
      {"torque_z", "N m", [](R r) { return r.torque.z; }},
      {"work", "J", [](R r) { return r.work; }},
      {"centre_x", "m", [](R r) { return r.centre.x; }},
      {"centre_y", "m", [](R r) { return r.centre.y; }},
      {"centre_z", "m", [](R r) { return r.centre.z; }},
  };
  return columns;
}

}  // namespace phyxel
