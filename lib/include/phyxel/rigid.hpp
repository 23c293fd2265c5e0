/// Free rigid bodies: obstacles that move as forces ask them to.
#pragma once

#include <array>

#include "phyxel/physics/rigid.hpp"
#include "phyxel/types.hpp"

namespace phyxel {

/// The state of a free rigid body.
struct RigidState {
  Vec3d place;             ///< Its centre of mass at t [m].
  UnitQuaternion turn;     ///< Its rotation from rest to t.
  Vec3d velocity;          ///< Velocity of its centre of mass over the last step [m/s].
  Vec3d angular_momentum;  ///< Angular momentum about that centre over the last step [N m s].
  Vec3d impulse;  ///< Impulse of the phyxels in the last step, which moves it in the next [N s].
  Vec3d angular_impulse;  ///< Angular impulse of the phyxels about its centre, likewise [N m s].
  double loss = 0;        ///< Energy lost in contact with other rigid bodies since t = 0 [J].

  /// The number of its numbers.
  static constexpr int count = 20;
  /// All numbers, in the order of the members.
  std::array<double, count> numbers() const {
    std::array<double, count> all{};
    std::size_t k = 0;
    const auto add = [&](Vec3d v) {
      for (const double number : {v.x, v.y, v.z}) all[k++] = number;
    };
    add(place);
    all[k++] = turn.w;
    for (const Vec3d v : {turn.v, velocity, angular_momentum, impulse, angular_impulse}) add(v);
    all[k] = loss;
    return all;
  }
  /// The state with these numbers. @param n shape [count]
  static RigidState from(const double* n) {
    const auto vector = [&](int first) { return Vec3d{n[first], n[first + 1], n[first + 2]}; };
    return {vector(0), {n[3], vector(4)}, vector(7), vector(10), vector(13), vector(16), n[19]};
  }
};

/// The angular velocity of a body [rad/s]. @param inertia at rest (`RigidMass`) [kg m²]
inline Vec3d angular_velocity(const Sym3d& inertia, const RigidState& state) {
  const Mat3d turn = rotation_of(state.turn);
  return turn * (inverse(inertia) * (transpose(turn) * state.angular_momentum));
}

}  // namespace phyxel
