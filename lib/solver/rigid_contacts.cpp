#include "solver/rigid_contacts.hpp"

#include <algorithm>
#include <cmath>

#include "phyxel/physics/body_contact.hpp"

namespace phyxel {
namespace {

constexpr int most_sweeps = 1000;
constexpr double tolerance = 1e-9;  // of velocities

/// The law of two rigid bodies.
ContactLaw law_of(const ContactLaw& a, const ContactLaw& b) {
  return {std::sqrt(a.static_friction * b.static_friction),
          std::sqrt(a.kinetic_friction * b.kinetic_friction),
          std::max(a.restitution, b.restitution)};
}

}  // namespace

RigidState drifted(const RigidMass& mass, const RigidState& state, double dt) {
  const Mat3d turn = rotation_of(state.turn);
  RigidState next = state;
  next.place += dt * state.velocity;
  next.turn = after(state.turn,
                    turn_of_step(mass.inertia, dt * (transpose(turn) * state.angular_momentum)));
  return next;
}

double kinetic_energy(const RigidMass& mass, const RigidState& state) {
  return 0.5 * mass.mass * dot(state.velocity, state.velocity) +
         0.5 * dot(state.angular_momentum, angular_velocity(mass.inertia, state));
}

RigidContacts::RigidContacts(const Model& model)
    : model_(model), free_(free_bodies(model)), tips_(model) {}

void RigidContacts::add_touch(const Placed& of_tips, const Placed& other, Vec3d end, const Gap& gap,
                              double dt, std::span<const RigidState> start,
                              std::span<const RigidState> states) {
  const Obstacle &first = model_.obstacles[of_tips.obstacle],
                 &second = model_.obstacles[other.obstacle];
  const int anchor = of_tips.free >= 0 ? of_tips.free : other.free;
  const ContactLaw law = law_of(first.law, second.law);
  const auto velocity_of = [&](int free, std::span<const RigidState> of, Vec3d arm) {
    const RigidMass& mass = *model_.obstacles[free_[free]].free;
    return of[free].velocity + cross(angular_velocity(mass.inertia, of[free]), arm);
  };
  // Where bodies touch, before the free one moves.
  const Vec3d at = end - dt * states[anchor].velocity;
  Touch touch{.first = of_tips.free, .second = other.free, .normal = gap.normal, .law = law};
  Vec3d now, before;
  const auto add = [&](const Placed& body, double sign, Vec3d& arm) {
    if (body.free < 0) {
      touch.given += sign * surface_velocity(body.step, end);
      now += sign * surface_velocity(body.step, end);
      before += sign * rigid_velocity(body.step, end);
      return;
    }
    arm = at - states[body.free].place;
    now += sign * velocity_of(body.free, states, arm);
    before += sign * velocity_of(body.free, start, arm);
  };
  add(of_tips, 1, touch.arm);
  add(other, -1, touch.other_arm);
  const SurfaceTouch as_surface{.is_inside = true, .gap = gap.distance, .normal = gap.normal};
  touch.target = target_velocity(as_surface, now, before, law, {.rate = recovery_in_step / dt}, dt);
  touches_.push_back(touch);
}

void RigidContacts::find_touches(double time, double dt, std::span<const RigidState> start,
                                 std::span<const RigidState> states) {
  touches_.clear();
  std::size_t free = 0;
  tips_.place([&](std::size_t o) {
    const Obstacle& obstacle = model_.obstacles[o];
    return obstacle.free ? obstacle.placed(drifted(*obstacle.free, states[free++], dt))
                         : obstacle.step_from(time, dt);
  });
  tips_.for_each_inside([&](const Placed& of_tips, const Placed& other, Vec3d end, const Gap& gap) {
    add_touch(of_tips, other, end, gap, dt, start, states);
  });
}

void RigidContacts::sweep_all(double speed, std::vector<Moving>& moving) {
  const auto change = [&](const Touch& t, Vec3d impulse) {
    const auto add = [&](int body, Vec3d arm, Vec3d j) {
      if (body < 0) return;
      Moving& m = moving[body];
      m.velocity += m.inverse_mass * j;
      m.spin += m.inverse_inertia * cross(arm, j);
    };
    add(t.first, t.arm, impulse);
    add(t.second, t.other_arm, -impulse);
  };
  const auto velocity_at = [&](int body, Vec3d arm) {
    return body < 0 ? Vec3d{} : moving[body].velocity + cross(moving[body].spin, arm);
  };
  for (int sweep = 0; sweep < most_sweeps; ++sweep) {
    double largest = 0;  // change of a velocity
    for (std::size_t k = 0; k < touches_.size(); ++k) {
      // There and back, so that what a sweep finds out runs through a stack both ways.
      Touch& t = touches_[sweep % 2 == 0 ? k : touches_.size() - 1 - k];
      const auto relative = [&] {
        return t.given + velocity_at(t.first, t.arm) - velocity_at(t.second, t.other_arm);
      };
      const double rate = t.target - dot(t.normal, relative());
      const double push = std::max(0.0, t.push + rate / t.mobility), more = push - t.push;
      t.push = push;
      change(t, more * t.normal);
      largest = std::max(largest, std::abs(more) * t.mobility);
      if (!(t.law.static_friction > 0)) continue;
      const Vec3d v = relative();
      // By one number in all directions, so that friction ends up against the slip.
      double a = t.hold_a - dot(t.a, v) / t.mobility_across;
      double b = t.hold_b - dot(t.b, v) / t.mobility_across;
      const double size = std::hypot(a, b);
      if (size > t.law.static_friction * t.push) {
        const double part = t.law.kinetic_friction * t.push / size;
        a *= part;
        b *= part;
      }
      const double more_a = a - t.hold_a, more_b = b - t.hold_b;
      t.hold_a = a;
      t.hold_b = b;
      change(t, more_a * t.a + more_b * t.b);
      largest = std::max(largest, std::hypot(more_a, more_b) * t.mobility_across);
    }
    if (largest <= tolerance * speed) return;
  }
}

void RigidContacts::resolve(double time, double dt, std::span<const RigidState> start,
                            std::vector<RigidState>& states) {
  if (free_.empty()) return;
  find_touches(time, dt, start, states);
  if (touches_.empty()) return;
  std::vector<Moving> moving;
  for (std::size_t k = 0; k < free_.size(); ++k) {
    const RigidMass& mass = *model_.obstacles[free_[k]].free;
    moving.push_back({states[k].velocity, angular_velocity(mass.inertia, states[k]), 1 / mass.mass,
                      turned(rotation_of(states[k].turn), inverse(mass.inertia))});
  }
  double speed = 0;  // by which changes count as small [m/s]
  for (Touch& t : touches_) {
    const auto response = [&](Vec3d way, Vec3d along) {  // of the velocity along to an impulse
      double sum = 0;
      for (const auto& [body, arm] : {std::pair{t.first, t.arm}, {t.second, t.other_arm}}) {
        if (body < 0) continue;
        const Moving& m = moving[body];
        sum += m.inverse_mass * dot(way, along) +
               dot(along, cross(m.inverse_inertia * cross(arm, way), arm));
      }
      return sum;
    };
    const Vec3d n = t.normal;
    t.a = normalised(cross(n, std::abs(n.x) < 0.6 ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0}));
    t.b = cross(n, t.a);
    t.mobility = response(n, n);
    const double aa = response(t.a, t.a), ab = response(t.a, t.b), bb = response(t.b, t.b);
    t.mobility_across = 0.5 * (aa + bb) + std::hypot(0.5 * (aa - bb), ab);
    speed = std::max(speed, std::abs(t.target));
    for (const int body : {t.first, t.second}) {
      if (body >= 0) speed = std::max(speed, norm(moving[body].velocity));
    }
  }
  sweep_all(speed, moving);
  for (const Touch& t : touches_) {
    const Vec3d impulse = t.push * t.normal + t.hold_a * t.a + t.hold_b * t.b;
    const auto add = [&](int body, Vec3d arm, Vec3d j) {
      if (body < 0) return;
      RigidState& state = states[body];
      const RigidMass& mass = *model_.obstacles[free_[body]].free;
      state.loss += kinetic_energy(mass, state);
      state.velocity += (1 / mass.mass) * j;
      state.angular_momentum += cross(arm, j);
      state.loss -= kinetic_energy(mass, state);
    };
    add(t.first, t.arm, impulse);
    add(t.second, t.other_arm, -impulse);
    // What paths do is no loss.
    const double work = -dot(impulse, t.given);
    states[t.first >= 0 ? t.first : t.second].loss -= work;
  }
}

}  // namespace phyxel
