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
    : model_(model), free_(free_bodies(model)), tips_(model), held_(model) {}

RigidContacts::Side RigidContacts::side_of(const Placed& body, Vec3d end) {
  if (body.free >= 0) return {.free = body.free};
  return {.velocity = surface_velocity(body.step, end), .start = rigid_velocity(body.step, end)};
}

RigidContacts::Touch& RigidContacts::add_touch(const Side& first, const Side& second,
                                               const ContactLaw& law, Vec3d end, const Gap& gap,
                                               double dt, std::span<const RigidState> start,
                                               std::span<const RigidState> states) {
  const int anchor = first.free >= 0 ? first.free : second.free;
  const auto velocity_of = [&](int free, std::span<const RigidState> of, Vec3d arm) {
    const RigidMass& mass = *model_.obstacles[free_[free]].free;
    return of[free].velocity + cross(angular_velocity(mass.inertia, of[free]), arm);
  };
  // Where bodies touch, before the free one moves.
  const Vec3d at = end - dt * states[anchor].velocity;
  Touch touch{.first = first.free, .second = second.free, .normal = gap.normal, .law = law};
  Vec3d now, before;
  const auto add = [&](const Side& side, double sign, Vec3d& arm) {
    if (side.free < 0) {
      touch.given += sign * side.velocity;
      now += sign * side.velocity;
      before += sign * side.start;
      return;
    }
    arm = at - states[side.free].place;
    now += sign * velocity_of(side.free, states, arm);
    before += sign * velocity_of(side.free, start, arm);
  };
  add(first, 1, touch.arm);
  add(second, -1, touch.other_arm);
  const SurfaceTouch as_surface{.is_inside = true, .gap = gap.distance, .normal = gap.normal};
  touch.target = target_velocity(as_surface, now, before, law, {.rate = recovery_in_step / dt}, dt);
  return touches_.emplace_back(touch);
}

void RigidContacts::find_touches(double time, double dt, std::span<const RigidState> start,
                                 std::span<const RigidState> states) {
  touches_.clear();
  const auto after_step = [&](std::size_t k) {
    const Obstacle& obstacle = model_.obstacles[free_[k]];
    return obstacle.placed(drifted(*obstacle.free, states[k], dt));
  };
  std::size_t free = 0;
  tips_.place([&](std::size_t o) {
    const Obstacle& obstacle = model_.obstacles[o];
    return obstacle.free ? after_step(free++) : obstacle.step_from(time, dt);
  });
  tips_.for_each_inside([&](const Placed& of_tips, const Placed& other, Vec3d end, const Gap& gap) {
    const ContactLaw law =
        law_of(model_.obstacles[of_tips.obstacle].law, model_.obstacles[other.obstacle].law);
    add_touch(side_of(of_tips, end), side_of(other, end), law, end, gap, dt, start, states);
  });
  held_.place(time, dt);
  for (std::size_t k = 0; k < free_.size(); ++k) {
    const Obstacle& obstacle = model_.obstacles[free_[k]];
    held_.for_each_inside(obstacle, after_step(k),
                          [&](const HeldPoint& point, Vec3d x, Vec3d velocity, const Gap& gap) {
                            Touch& touch =
                                add_touch({.velocity = velocity, .start = velocity},
                                          {.free = static_cast<int>(k)}, obstacle.law,
                                          x - point.offset * gap.normal, gap, dt, start, states);
                            touch.held = point.id;
                          });
  }
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

double RigidContacts::find_mobilities(const std::vector<Moving>& moving) {
  double speed = 0;
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
  return speed;
}

void RigidContacts::add_impulses(std::vector<RigidState>& states) const {
  for (const Touch& t : touches_) {
    const auto add = [&](int body, Vec3d arm, Vec3d impulse) {
      if (body < 0) return;
      states[body].velocity += (1 / model_.obstacles[free_[body]].free->mass) * impulse;
      states[body].angular_momentum += cross(arm, impulse);
    };
    add(t.first, t.arm, t.impulse());
    add(t.second, t.other_arm, -t.impulse());
  }
}

void RigidContacts::add_losses(std::span<const RigidState> start, std::vector<RigidState>& states) {
  for (const Touch& t : touches_) {
    const auto mean_of = [&](int body, Vec3d arm) {
      if (body < 0) return Vec3d{};
      const Sym3d& inertia = model_.obstacles[free_[body]].free->inertia;
      Vec3d sum;
      for (const RigidState& state : {start[body], states[body]}) {
        sum += state.velocity + cross(angular_velocity(inertia, state), arm);
      }
      return 0.5 * sum;
    };
    const Vec3d second = mean_of(t.second, t.other_arm);
    const Vec3d relative = t.given + mean_of(t.first, t.arm) - second;
    if (t.held < 0) {
      states[t.first >= 0 ? t.first : t.second].loss -= dot(t.impulse(), relative);
      continue;
    }
    const std::size_t o = free_[t.second];
    HeldImpulse found{.id = t.held, .obstacle = o, .terms = {}};
    found.terms.set(t.normal_impulse(), t.tangential_impulse(),
                    states[t.second].place + t.other_arm - model_.obstacles[o].place, second,
                    relative);
    on_held_.push_back(found);
  }
}

void RigidContacts::resolve(double time, double dt, std::span<const RigidState> start,
                            std::vector<RigidState>& states) {
  on_held_.clear();
  if (free_.empty()) return;
  find_touches(time, dt, start, states);
  if (touches_.empty()) return;
  std::vector<Moving> moving;
  for (std::size_t k = 0; k < free_.size(); ++k) {
    const RigidMass& mass = *model_.obstacles[free_[k]].free;
    moving.push_back({states[k].velocity, angular_velocity(mass.inertia, states[k]), 1 / mass.mass,
                      turned(rotation_of(states[k].turn), inverse(mass.inertia))});
  }
  sweep_all(find_mobilities(moving), moving);
  add_impulses(states);
  add_losses(start, states);
}

}  // namespace phyxel
