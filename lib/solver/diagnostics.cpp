#include "phyxel/diagnostics.hpp"

#include <fmt/format.h>
#include <omp.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "model/parts.hpp"
#include "phyxel/contacts.hpp"
#include "phyxel/error.hpp"
#include "phyxel/history.hpp"
#include "phyxel/physics/hourglass.hpp"
#include "phyxel/physics/verlet.hpp"
#include "phyxel/solver.hpp"
#include "rank_sums.hpp"
#include "solver/boundary_conditions.hpp"
#include "solver/contact_stiffness.hpp"
#include "solver/first_error.hpp"
#include "solver/following_loads.hpp"
#include "solver/host_threads.hpp"
#include "solver/hourglass.hpp"
#include "solver/part_law.hpp"
#include "solver/present_forces.hpp"
#include "solver/rigid_bodies.hpp"
#include "solver/step_sums.hpp"
#include "solver/totals.hpp"

namespace phyxel {
double pressure_wave_speed(const Material& m) {
  return std::sqrt(wave_stiffness_at_rest(m) / m.density);
}

namespace {

/// The energy of the loads that follow the surface [J]. Collective if there are any.
double energy_of_following(const Model& model, Backend& backend, double time) {
  if (model.following.empty()) return 0;
  State state;
  backend.download(state);
  refresh_for_following(model, state.displacement);
  return FollowingLoads(model).energy(time, [&](Index i) { return state.displacement[i]; });
}

/// Sums over the phyxels of this rank, as of `Backend::diagnostics`, on the host.
Totals totals_on_host(const Model& model, Backend& backend, const Instant& now,
                      const std::optional<Breakage>& breakage) {
  State state;
  backend.download(state);
  std::vector<Vec3d> force;
  backend.internal_forces(force);
  std::vector<Mat3d> gradient;
  backend.displacement_gradients(gradient);
  std::vector<double> residual;
  if (has_hourglass_control(model)) backend.fit_residuals(residual);

  Totals all;
  refresh_for_following(model, state.displacement);
  const std::span<const Vec3d> external = backend.external_forces();
  std::vector<Vec3d> loads(model.loads.empty() ? 0 : force.size());
  std::vector<Vec3d> following(model.following.empty() ? 0 : force.size());
  add_constant_loads(model, now.time, loads);
  FollowingLoads(model).add(
      now.time, [&](Index i) { return state.displacement[i]; }, following);
  const auto value_of = [](std::span<const Vec3d> forces, Index i) {
    return forces.empty() ? Vec3d{} : forces[i];
  };
  const std::vector<Vec3d> free = free_axes(model);
  const std::vector<std::string> columns = history_columns(model);

  std::vector<PartLaw> laws;
  std::vector<PartHistory> histories;
  std::size_t most_numbers = 0;
  for (const Part& part : model.parts) {
    laws.emplace_back(part.material);
    histories.emplace_back(state, part.material, columns);
    most_numbers = std::max(most_numbers, histories.back().size());
  }
  const int threads = host_threads(backend);
  std::vector<std::vector<double>> rooms(static_cast<std::size_t>(threads),
                                         std::vector<double>(most_numbers));
  FirstError error;  // of a caller's law
#pragma omp parallel num_threads(threads)
  {
    Totals own;
    std::vector<double>& numbers = rooms[static_cast<std::size_t>(omp_get_thread_num())];
    for (std::size_t p = 0; p < model.parts.size(); ++p) {
      const Part& part = model.parts[p];
      const Material& m = part.material;
      const PartLaw& law = laws[p];
      const PartHistory& history = histories[p];
      const double kappa = hourglass_stiffness(model, part);
      const DampedFlow half = damped_flow(m.damping, now.lag);
#pragma omp for schedule(static) nowait
      for (Index i = part.begin; i < part.owned_end(); ++i) {
        const Vec3d u = state.displacement[i];
        const PointResponse<double> response = error.caught([&] {
          return law.after_step(gradient[i], history.of(i, numbers), state.history_interval);
        });
        own.add(totals_of(
                    {.mass = model.mass[i],
                     .volume = breakage ? breakage->carried[i] * model.volume[i] : model.volume[i],
                     .position = model.position[i] + u,
                     .displacement = u,
                     .velocity = state.velocity[i],
                     .flow = half,
                     .free = free.empty() ? Vec3d{1, 1, 1} : free[i],
                     .internal = force[i],
                     .load = value_of(loads, i),
                     .following = value_of(following, i),
                     .external = value_of(external, i),
                     .gravity = model.gravity,
                     .grad_u = gradient[i],
                     .hourglass = kappa,
                     .residual = kappa > 0 ? residual[i] : 0},
                    response),
                model.global_id(i));
      }
    }
#pragma omp critical
    all.add(own);
  }
  error.rethrow();
  return all;
}

/// The energy of closed cracks [J]. Of a share: collective.
double energy_of_closed_cracks(const Model& model, const std::optional<Breakage>& breakage) {
  if (!breakage) return 0;  // the same on all ranks
  std::vector<ExactSum> sum(1);
  for (const Part& part : model.parts) {
    for (Index i = part.begin; i < part.owned_end(); ++i) sum[0].add(breakage->closed[i]);
  }
  add_over_ranks(model, sum);
  return sum[0].value();
}

}  // namespace

Diagnostics diagnose(const Model& model, Backend& backend, const Instant& now) {
  check_fits(model, backend);
  const std::optional<Breakage> breakage = backend.breakage();
  std::optional<Diagnostics> d = backend.diagnostics(now);
  if (!d) {
    Totals all = totals_on_host(model, backend, now, breakage);
    if (model.share) all.add_ranks(*model.share->communicator);
    d = all.values();
  }
  d->load_energy += energy_of_following(model, backend, now.time);
  d->contact_energy += energy_of_closed_cracks(model, breakage);
  add_rigid(model, backend.rigid_states(), now.lag, *d);
  d->step = now.step;
  d->time = now.time;
  return *d;
}

namespace {

/// Adds to diagnostics what penalties do: their energy, and the changes of velocities by their
/// forces in the half step that leads from velocities to the present. What bodies have taken from
/// each other's motion is stored, but for what has been lost as normals turned. Of a
/// share: collective.
void add_penalties(const Model& model, Backend& backend, const Solver& solver, Diagnostics& d) {
  const PresentForces present(model, backend, solver);
  const State& state = present.state();
  const std::vector<Vec3d> free = free_axes(model);
  const PresentContact& contact = present.contact();
  // Energies, those of bodies, momentum, angular momentum.
  std::vector<ExactSum> sums(10);
  sums[0] = contact.energy;
  sums[2] = contact.energy_of_bodies;
  for (const Part& part : model.parts) {
    const DampedFlow half = damped_flow(part.material.damping, solver.now().lag);
    for (Index i = part.begin; i < part.owned_end(); ++i) {
      const Vec3d push = contact.force[i];
      if (push == Vec3d{}) continue;
      Vec3d change = (half.gain / model.mass[i]) * push;
      if (!free.empty()) change = by_components(free[i], change);
      const Vec3d after = half.keep * state.velocity[i] +
                          (half.gain / model.mass[i]) * present.instant().other_force[i];
      const Vec3d momentum = model.mass[i] * change;
      const Vec3d turning = cross(model.position[i] + state.displacement[i], momentum);
      // Changes are zero along prescribed axes, on which the velocity is another one.
      const Vec3d mean = after - 0.5 * change;
      sums[1].add(dot(momentum, mean));
      const Vec3d of_bodies = half.gain * contact.of_bodies[i];
      sums[3].add(dot(free.empty() ? of_bodies : by_components(free[i], of_bodies), mean));
      const double all[] = {momentum.x, momentum.y, momentum.z, turning.x, turning.y, turning.z};
      for (int k = 0; k < 6; ++k) sums[4 + k].add(all[k]);
    }
  }
  add_over_ranks(model, sums);
  d.contact_energy += sums[0].value();
  d.kinetic_energy += sums[1].value();
  d.contact_loss -= sums[2].value() + sums[3].value();
  d.momentum += Vec3d{sums[4].value(), sums[5].value(), sums[6].value()};
  d.angular_momentum += Vec3d{sums[7].value(), sums[8].value(), sums[9].value()};
}

/// The largest speed of the phyxels of each body of the scene [m/s]. Of a share: collective.
std::vector<double> speeds_of_bodies(const Model& model, Backend& backend) {
  State state;
  backend.download(state);
  std::vector<double> speeds(count_of_bodies(model));
  for (const Part& part : model.parts) {
    for (Index i = part.begin; i < part.owned_end(); ++i) {
      speeds[part.body] = std::max(speeds[part.body], norm(state.velocity[i]));
    }
  }
  for (double& speed : speeds) {
    if (model.share) speed = model.share->communicator->largest(speed);
  }
  return speeds;
}

}  // namespace

Diagnostics diagnose(const Model& model, Backend& backend, const Solver& solver) {
  Diagnostics d = diagnose(model, backend, solver.now());
  if (touching_count(model) == 0 && !model.fracture.breaks) return d;
  StepSums all = no_step_sums(model);
  add_words(all, solver.step_sums());
  if (model.fracture.breaks) d.fracture_energy = all.back().value();
  if (touching_count(model) == 0) return d;
  ExactSum loss;
  for (std::size_t o = 0; o < touching_count(model); ++o) {
    const std::size_t first = sums_of_motions(model) + o * ContactTerms::count;
    loss.add(all[first + ContactTerms::friction_heat].value());
    loss.add(all[first + ContactTerms::impact_loss].value());
  }
  d.contact_loss += loss.value();
  if (solver.method() == Method::verlet && has_penalties(model)) {
    add_penalties(model, backend, solver, d);
  }
  check_contact_speeds(
      model, solver, d.largest_speed, [&] { return speeds_of_bodies(model, backend); },
      backend.rigid_states());
  return d;
}

std::string describe_phyxel(const Model& model, Index global_id) {
  constexpr double nowhere = -std::numeric_limits<double>::infinity();
  Vec3d at{nowhere, nowhere, nowhere};
  for (const Part& part : model.parts) {
    for (Index i = part.begin; i < part.owned_end(); ++i) {
      if (model.global_id(i) == global_id) at = model.position[i];
    }
  }
  if (model.share) {
    const Communicator& ranks = *model.share->communicator;
    at = {ranks.largest(at.x), ranks.largest(at.y), ranks.largest(at.z)};
  }
  Index begin = 0;
  for (const Part& part : model.parts) {
    if (global_id >= begin && global_id < begin + part.size) {
      return fmt::format("phyxel {} of body \"{}\", at rest at ({:.6g}, {:.6g}, {:.6g}) m",
                         global_id, part.name, at.x, at.y, at.z);
    }
    begin += part.size;
  }
  return "no phyxel";
}

}  // namespace phyxel
