#include "solver/rigid_contacts.hpp"

#include <algorithm>
#include <cmath>

#include "phyxel/physics/body_contact.hpp"
#include "phyxel/physics/obstacles.hpp"

namespace phyxel {
namespace {

constexpr int most_sweeps = 1000;
constexpr double tolerance = 1e-9;  // of velocities

Mat3d turned(const Mat3d& turn, const Sym3d& s) {
  const Mat3d whole{{{s.xx, s.xy, s.xz}, {s.xy, s.yy, s.yz}, {s.xz, s.yz, s.zz}}};
  return turn * whole * transpose(turn);
}

/// The law of two rigid bodies.
ContactLaw law_of(const ContactLaw& a, const ContactLaw& b) {
  return {std::sqrt(a.static_friction * b.static_friction),
          std::sqrt(a.kinetic_friction * b.kinetic_friction),
          std::max(a.restitution, b.restitution)};
}

/// The points of a surface by which it touches others: its vertices, and points on its triangles
/// where these are large.
std::vector<Vec3d> tips_of(const Surface& surface) {
  std::vector<Vec3d> tips = surface.position;
  Vec3d low = tips.front(), high = low;
  for (const Vec3d x : tips) {
    low = {std::min(low.x, x.x), std::min(low.y, x.y), std::min(low.z, x.z)};
    high = {std::max(high.x, x.x), std::max(high.y, x.y), std::max(high.z, x.z)};
  }
  const double longest = norm(high - low) / 24;
  for (const Triangle& t : surface.triangle) {
    const Vec3d a = surface.position[t[0]], b = surface.position[t[1]], c = surface.position[t[2]];
    const double edge = std::max({norm(b - a), norm(c - b), norm(a - c)});
    const int parts = static_cast<int>(std::ceil(edge / longest));
    for (int i = 0; i <= parts; ++i) {
      for (int j = 0; i + j <= parts; ++j) {
        if (i == parts || j == parts || i + j == 0) continue;  // vertices
        tips.push_back(a + (i / double(parts)) * (b - a) + (j / double(parts)) * (c - a));
      }
    }
  }
  return tips;
}

}  // namespace

RigidState drifted(const RigidMass& mass, const RigidState& state, double dt) {
  const Mat3d turn = identity<double>() + change_by(state.turn);
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

RigidContacts::RigidContacts(const Model& model) : model_(model) {
  const std::size_t count = model.obstacles.size();
  for (std::size_t o = 0; o < count; ++o) {
    if (model.obstacles[o].free) free_.push_back(o);
  }
  if (free_.empty()) return;
  tips_.resize(count);
  radius_.assign(count, 0);
  middle_.resize(count);
  reach_.assign(count, -1);
  placed_.resize(count);
  for (std::size_t o = 0; o < count; ++o) {
    const Obstacle& obstacle = model.obstacles[o];
    if (obstacle.hollow || !obstacle.is_bounded()) continue;
    if (obstacle.surface) {
      tips_[o] = tips_of(*obstacle.surface);
    } else {
      ObstacleShapes::with(obstacle.form, [&](const auto& shape) {
        if constexpr (requires { shape.solid(); }) {
          shape.for_each_tip([&](Vec3d x, double radius) {
            tips_[o].push_back(x);
            radius_[o] = radius;
          });
        }
      });
    }
    for (const Vec3d x : tips_[o]) middle_[o] += x / static_cast<double>(tips_[o].size());
    for (const Vec3d x : tips_[o]) {
      reach_[o] = std::max(reach_[o], norm(x - middle_[o]) + radius_[o]);
    }
  }
}

void RigidContacts::place_all(double time, double dt, std::span<const RigidState> states) {
  int free = 0;
  for (std::size_t o = 0; o < placed_.size(); ++o) {
    const Obstacle& obstacle = model_.obstacles[o];
    Placed& here = placed_[o];
    here.obstacle = o;
    here.free = obstacle.free ? free++ : -1;
    here.step = obstacle.free ? obstacle.placed(drifted(*obstacle.free, states[here.free], dt))
                              : obstacle.step_from(time, dt);
    here.centre = here.step.turn * middle_[o] + here.step.place;
    here.reach = reach_[o];
  }
}

template <class Each>
void RigidContacts::for_each_pair(Each&& each) const {
  for (const Placed& body : placed_) {
    if (body.free < 0) continue;
    for (const Placed& other : placed_) {
      if (other.obstacle == body.obstacle) continue;
      each(body, other);
      if (other.free < 0 && other.reach >= 0) each(other, body);
    }
  }
}

template <class Each>
void RigidContacts::for_each_inside(const Placed& of_tips, const Placed& other, Each&& each) const {
  const double radius = radius_[of_tips.obstacle];
  ObstacleShapes::with(model_.obstacles[other.obstacle].form, [&](const auto& shape) {
    if (gap_to(shape, other.step, of_tips.centre).distance > of_tips.reach) return;
    for (const Vec3d tip : tips_[of_tips.obstacle]) {
      const Vec3d x = of_tips.step.turn * tip + of_tips.step.place;
      Gap gap = gap_to(shape, other.step, x);
      if (!(gap.distance < radius)) continue;
      // On edges and corners of the other body, the face through which the tip has come is that
      // nearest to a place inside its own body.
      constexpr double share = 0.1;
      const Vec3d inside = x + share * of_tips.reach * normalised(of_tips.centre - x);
      const Gap from = gap_to(shape, other.step, inside);
      constexpr double alike = 0.7;  // cosine
      if (dot(from.normal, gap.normal) < alike) {
        gap = {from.distance + dot(from.normal, x - inside), from.normal};
      }
      gap.distance -= radius;
      if (gap.distance < 0) each(x - radius * gap.normal, gap);
    }
  });
}

void RigidContacts::add_touches(const Placed& of_tips, const Placed& other, double dt,
                                std::span<const RigidState> start,
                                std::span<const RigidState> states) {
  const Obstacle &first = model_.obstacles[of_tips.obstacle],
                 &second = model_.obstacles[other.obstacle];
  const int anchor = of_tips.free >= 0 ? of_tips.free : other.free;
  const ContactLaw law = law_of(first.law, second.law);
  const auto velocity_of = [&](int free, std::span<const RigidState> of, Vec3d arm) {
    const RigidMass& mass = *model_.obstacles[free_[free]].free;
    return of[free].velocity + cross(angular_velocity(mass.inertia, of[free]), arm);
  };
  for_each_inside(of_tips, other, [&](Vec3d end, const Gap& gap) {
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
    touch.target = target_velocity(as_surface, now, before, law, dt);
    touches_.push_back(touch);
  });
}

RigidContacts::Overlap RigidContacts::overlap_at_start() {
  Overlap most;
  std::vector<RigidState> states;
  for (const std::size_t o : free_) states.push_back(model_.obstacles[o].start);
  if (states.empty()) return most;
  place_all(0, 0, states);
  for_each_pair([&](const Placed& of_tips, const Placed& other) {
    for_each_inside(of_tips, other, [&](Vec3d, const Gap& gap) {
      if (-gap.distance > most.depth) most = {of_tips.obstacle, other.obstacle, -gap.distance};
    });
  });
  return most;
}

void RigidContacts::find_touches(double dt, std::span<const RigidState> start,
                                 std::span<const RigidState> states) {
  touches_.clear();
  for_each_pair([&](const Placed& of_tips, const Placed& other) {
    add_touches(of_tips, other, dt, start, states);
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
  place_all(time, dt, states);
  find_touches(dt, start, states);
  if (touches_.empty()) return;
  std::vector<Moving> moving;
  for (std::size_t k = 0; k < free_.size(); ++k) {
    const RigidMass& mass = *model_.obstacles[free_[k]].free;
    const Mat3d turn = identity<double>() + change_by(states[k].turn);
    moving.push_back({states[k].velocity, angular_velocity(mass.inertia, states[k]), 1 / mass.mass,
                      turned(turn, inverse(mass.inertia))});
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
