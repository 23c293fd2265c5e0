#include "solver/next_step.hpp"

#include <algorithm>
#include <map>
#include <utility>

#include "model/parts.hpp"
#include "phyxel/physics/verlet.hpp"
#include "solver/body_contacts.hpp"
#include "solver/boundary_conditions.hpp"
#include "solver/contact_stiffness.hpp"
#include "solver/host_threads.hpp"
#include "solver/step_contacts.hpp"

namespace phyxel {
namespace {

/// The state of some phyxels after a step in which nothing touches them.
State next_state(const Model& model, const SupportInstant& now, const State& state,
                 std::span<const Index> phyxels) {
  const std::vector<Vec3d> free = free_axes(model);
  State next{.displacement = state.displacement, .velocity = state.velocity};
  for (const Index i : phyxels) {
    const DampedFlow flow = damped_flow(part_of(model, i).material.damping, now.dt);
    Vec3d& v = next.velocity[i];
    v = flow.keep * v + (flow.gain / model.mass[i]) * now.other_force[i];
    if (!free.empty()) v = by_components(free[i], v);
    next.displacement[i] += now.dt * v;
  }
  if (free.empty()) return next;
  std::vector<Vec3d> prescribed = next.displacement;
  prescribe_displacements(model, now.time + now.dt, prescribed);
  for (const Index i : phyxels) {
    const Vec3d way = prescribed[i] - state.displacement[i];
    next.velocity[i] += (1 / now.dt) * (way - by_components(free[i], way));
    next.displacement[i] = prescribed[i];
  }
  return next;
}

/// Begins the step of obstacles from an instant.
void begin_step(StepContacts& contacts, const SupportInstant& now, const State& state) {
  contacts.put_rigid(state.rigid, now.dt);
  contacts.begin_step(now.time, now.dt, [&](Index i) { return now.velocity[i]; });
  contacts.push(
      [&](Index i) {
        return Touched{state.displacement[i], state.velocity[i]};
      },
      [](Index, const Touched&) {});  // known in other forces
}

/// Keeps the phyxels of a state out of obstacles. @param note as of `StepContacts::keep_out`
template <class Note>
void keep_out(StepContacts& contacts, State& next, Note&& note) {
  contacts.keep_out([](Index) { return true; },
                    [&](Index i) {
                      return Touched{next.displacement[i], next.velocity[i]};
                    },
                    [&](Index i, const Touched& to) {
                      next.displacement[i] = to.displacement;
                      next.velocity[i] = to.velocity;
                    },
                    note);
}

/// True if a phyxel of this rank that touches obstacles is held or moved along an axis.
bool has_held_in_layer(const Model& model) {
  const std::vector<char> axes = prescribed_axes(model);
  const std::vector<Index>& layer = model.contact.phyxels;
  return std::any_of(layer.begin(), layer.end(), [&](Index i) { return axes[i] != 0; });
}

}  // namespace

std::optional<NextStep> next_step_of_device(Backend& backend, double time, double dt) {
  std::optional<NextContacts> tried = backend.next_contacts(time, dt);
  if (!tried) return std::nullopt;
  NextStep next{{}, std::move(tried->depths), std::move(tried->of_bodies)};
  add_words(next.sums, tried->sums);
  return next;
}

NextStep next_step(const Model& model, Backend& backend, const SupportInstant& now,
                   const State& state) {
  if (auto of_device = next_step_of_device(backend, now.time, now.dt)) {
    return std::move(*of_device);
  }
  StepContacts contacts(model, host_threads(backend));
  BodyContacts bodies(model, host_threads(backend));
  const std::vector<Index>& layer =
      bodies.acts() ? model.body_contact.layer.phyxels : model.contact.phyxels;
  State next = next_state(model, now, state, layer);
  NextStep made;
  begin_step(contacts, now, state);
  if (bodies.acts()) {
    const auto of = [](const State& s) {
      return [&s](Index i) { return SurfaceState{s.displacement[i], s.velocity[i]}; };
    };
    bodies.begin_step(now.dt, of(state));
    std::vector<Mat3d> gradient;
    if (bodies.any()) backend.displacement_gradients(gradient);
    for (std::size_t p = 0; p < bodies.count(); ++p) {
      bodies.set_gradient(p, gradient[bodies.phyxel(p)]);
    }
    made.depths = bodies.depths(of(state));
    bodies.push_apart(of(state), [](Index, const SurfaceState&) {});  // known in other forces
    bodies.keep_apart(of(next), [&](Index i, const SurfaceState& to) {
      next.displacement[i] = to.displacement;
      next.velocity[i] = to.velocity;
    });
    made.of_bodies.resize(static_cast<std::size_t>(model.size()));
    bodies.for_each_force([&](Index i, Vec3d force) { made.of_bodies[i] += force; });
    // Penalties are among the forces of the instant.
    if (has_body_penalties(model)) {
      bodies.for_each_push([&](Index i, Vec3d force) { made.of_bodies[i] -= force; });
    }
  }
  keep_out(contacts, next, [](Index, const ContactTerms&) {});
  made.sums = contacts.sums();
  made.sums.insert(made.sums.end(), bodies.sums().begin(), bodies.sums().end());
  return made;
}

std::vector<Vec3d> obstacles_on_supports(const Model& model, Backend& backend,
                                         const SupportInstant& now, const State& state) {
  const bool some = has_held_in_layer(model);
  const bool of_all = model.share ? model.share->communicator->largest(some ? 1 : 0) > 0 : some;
  if (!of_all && model.held_points.empty()) return {};
  std::vector<Vec3d> force(static_cast<std::size_t>(model.size()));
  StepContacts contacts(model, host_threads(backend));
  State next = next_state(model, now, state, model.contact.phyxels);
  begin_step(contacts, now, state);
  keep_out(contacts, next, [&](Index i, const ContactTerms& terms) {
    force[i] += (1 / now.dt) * terms.whole_impulse();
  });
  std::map<Index, Vec3d> on_held;  // by ids [N s]
  for (const HeldImpulse& on : contacts.on_held_points()) {
    on_held[on.id] += on.terms.whole_impulse();
  }
  for (Index i = 0; i < model.size() && !on_held.empty(); ++i) {
    const auto found = on_held.find(model.global_id(i));
    if (found != on_held.end()) force[i] += (1 / now.dt) * found->second;
  }
  return force;
}

}  // namespace phyxel
