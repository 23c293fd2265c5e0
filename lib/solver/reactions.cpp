#include "phyxel/reactions.hpp"

#include <limits>

#include "rank_sums.hpp"
#include "solver/contact_penalty.hpp"
#include "solver/next_step.hpp"
#include "solver/present_forces.hpp"
#include "solver/step_sums.hpp"

namespace phyxel {
namespace {

/// Sums over the phyxels of a motion.
struct CentreSums {
  ExactSum mass;       ///< [kg]
  ExactVector moment;  ///< Mass times position [kg m].
  std::vector<ExactSum*> all() { return {&mass, &moment.x, &moment.y, &moment.z}; }
};
struct ReactionSums {
  ExactVector force, torque;  ///< [N], [N m]
  ExactSum rest_of_work;      ///< [J]
  std::vector<ExactSum*> all() {
    return {&force.x, &force.y, &force.z, &torque.x, &torque.y, &torque.z, &rest_of_work};
  }
};

/// Returns the centre of mass of each motion's phyxels at rest [m].
std::vector<Vec3d> centres_of(const Model& model) {
  std::vector<CentreSums> sums(model.motions.size());
  for (std::size_t m = 0; m < model.motions.size(); ++m) {
    for_each_owned(model, model.motions[m], [&](Index i, const Part&) {
      sums[m].mass.add(model.mass[i]);
      sums[m].moment.add(model.mass[i] * model.position[i]);
    });
  }
  add_each_over_ranks(model, sums);
  std::vector<Vec3d> centres;
  for (CentreSums& of : sums) {
    const double mass = of.mass.value();
    centres.push_back(mass > 0 ? of.moment.value() / mass : Vec3d{});
  }
  return centres;
}

/// Returns the displacement that the reactions of an instant have to be multiplied by to complete
/// the work of earlier steps (`Solver::step_sums`).
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

/// All forces but those of supports, with those of other bodies and of obstacles on phyxels that
/// are held [N]. Of a share: collective.
std::vector<Vec3d> forces_on_supports(const Model& model, Backend& backend, const Solver& solver,
                                      const PresentForces& present) {
  const std::span<const Vec3d> others = present.instant().other_force;
  std::vector<Vec3d> all(others.begin(), others.end());
  if (touching_count(model) == 0 || !solver.end_force().empty()) return all;
  const State& state = present.state();
  const auto add = [&](const std::vector<Vec3d>& more) {
    for (std::size_t i = 0; i < more.size(); ++i) all[i] += more[i];
  };
  if (solver.method() == Method::verlet) {
    if (model.body_contact.acts()) {
      add(next_step(model, backend, present.instant(), state).of_bodies);
    }
    SupportInstant now = present.instant();
    now.other_force = all;
    if (!model.obstacles.empty()) add(obstacles_on_supports(model, backend, now, state));
  } else if (solver.method() == Method::equilibrium) {
    const std::span<const Vec3d> known = solver.rest_contact_force();
    for (std::size_t i = 0; i < known.size(); ++i) all[i] += known[i];
    if (!known.empty()) return all;
    const double share = solver.steps() > 0 ? 1 : 0;
    const PlacedObstacles at = obstacles_after(model, share, share);
    ContactPenalty penalty(model);
    penalty.linearise(at, state.displacement, SlipMeasure{}, Renewal::all, [&] {
      std::vector<Mat3d> gradient;
      backend.displacement_gradients(gradient);
      return gradient;
    });
    penalty.add(at, state.displacement, all);
  }
  return all;
}

}  // namespace

std::vector<Reaction> find_reactions(const Model& model, Backend& backend, const Solver& solver) {
  check_fits(model, backend);
  if (model.motions.empty()) return {};
  const PresentForces present(model, backend, solver);
  const std::vector<Vec3d> others = forces_on_supports(model, backend, solver, present);
  SupportInstant now = present.instant();
  now.other_force = others;
  const std::vector<Vec3d> centres = centres_of(model);
  std::vector<ReactionSums> sums(model.motions.size());
  for (std::size_t m = 0; m < model.motions.size(); ++m) {
    const Motion& motion = model.motions[m];
    const Path rest = rest_of_work(motion, solver);
    for_each_support_force(model, motion, now, [&](Index i, Vec3d force) {
      const Vec3d x = model.position[i], arm = x + present.state().displacement[i] - centres[m];
      sums[m].force.add(force);
      sums[m].torque.add(cross(arm, force));
    });
    if (motion.stands_still()) continue;
    // Steps add the work of reactions to all but other bodies.
    for_each_support_force(model, motion, present.instant(), [&](Index i, Vec3d force) {
      sums[m].rest_of_work.add(dot(force, rest.at(model.position[i])));
    });
  }
  add_each_over_ranks(model, sums);
  StepSums work = no_step_sums(model);
  add_words(work, solver.step_sums());
  std::vector<Reaction> reactions;
  for (std::size_t m = 0; m < model.motions.size(); ++m) {
    const Motion& motion = model.motions[m];
    Reaction& reaction = reactions.emplace_back();
    reaction.body = motion.body;
    reaction.set = motion.set;
    reaction.centre = centres[m];
    reaction.force = sums[m].force.value();
    reaction.torque = sums[m].torque.value();
    if (motion.stands_still()) continue;
    ExactSum whole = work[m];
    whole.add(sums[m].rest_of_work);
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
