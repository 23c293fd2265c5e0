#include "solver/present_contact.hpp"

#include "model/contact.hpp"
#include "phyxel/physics/contact_penalty.hpp"
#include "solver/body_contacts.hpp"
#include "solver/contact_penalty.hpp"
#include "solver/contact_stiffness.hpp"
#include "solver/host_threads.hpp"

namespace phyxel {
namespace {

void add_obstacles(const Model& model, const State& state, double time, PresentContact& found) {
  const std::vector<double> stiffness = stiffness_of_layer(model, share_of_layer);
  const std::vector<LayerGroup> groups = groups_of(model, model.contact);
  const PlacedLayer layer(model, groups, [&](Index i) { return state.displacement[i]; });
  const PlacedObstacles now = obstacles_now(model, time, 0, state.rigid);
  for (std::size_t o = 0; o < now.size(); ++o) {
    const Obstacle& obstacle = model.obstacles[o];
    if (!(obstacle.penalty > 0)) continue;
    layer.for_each_inside(obstacle, now[o], [&](std::size_t k, Vec3d, const Gap& gap) {
      const PenaltyForce f = penalty_force(gap, obstacle.penalty * stiffness[k]);
      found.force[model.contact.phyxels[k]] += f.force;
      found.energy.add(f.energy);
    });
  }
}

void add_bodies(const Model& model, Backend& backend, const State& state, double dt,
                PresentContact& found) {
  BodyContacts bodies(model, host_threads(backend));
  const auto get = [&](Index i) { return SurfaceState{state.displacement[i], state.velocity[i]}; };
  bodies.begin_step(dt, get);
  if (!bodies.any()) return;
  std::vector<Mat3d> gradient;
  backend.displacement_gradients(gradient);
  for (std::size_t p = 0; p < bodies.count(); ++p) {
    bodies.set_gradient(p, gradient[bodies.phyxel(p)]);
  }
  bodies.push_apart(get, [](Index, const SurfaceState&) {});
  bodies.for_each_push([&](Index i, Vec3d force) {
    found.force[i] += force;
    found.of_bodies[i] += force;
  });
  bodies.add_push_energy(found.energy_of_bodies);
  found.energy.add(found.energy_of_bodies);
}

}  // namespace

PresentContact present_contact(const Model& model, Backend& backend, const State& state,
                               double time, double dt) {
  PresentContact found;
  if (!has_penalties(model)) return found;
  found.force.resize(static_cast<std::size_t>(model.size()));
  found.of_bodies.resize(found.force.size());
  add_obstacles(model, state, time, found);
  if (has_body_penalties(model)) add_bodies(model, backend, state, dt, found);
  return found;
}

}  // namespace phyxel
