/// The motion of a free rigid body over a step of Verlet's method.
///
/// Its centre of mass moves as a point does. It turns by the rotation Q of the discrete equation of
/// a rigid body (Moser and Veselov 1991, Discrete versions of some classical integrable systems),
///
///   Σ m r × Q r = Δt L,
///
/// with places r from the centre at the start of the step and the angular momentum L about it: what
/// Verlet's method does to points that are held together. L is the same after a step without
/// torque, to rounding.
#pragma once

#include <cmath>
#include <limits>

#include "phyxel/types.hpp"

namespace phyxel {

/// Mass of a rigid body, and how it is spread.
struct RigidMass {
  double mass = 0;  ///< [kg]
  Vec3d centre;     ///< Centre of mass at rest [m].
  Sym3d inertia;    ///< About that centre, at rest [kg m²].
};

/// A unit quaternion: the rotation by 2 arccos(w) about v.
struct UnitQuaternion {
  double w = 1;
  Vec3d v;
};

/// The matrix of a × b as a product with b.
inline Mat3d cross_matrix(Vec3d a) { return {{{0, -a.z, a.y}, {a.z, 0, -a.x}, {-a.y, a.x, 0}}}; }

/// The upper triangle of a matrix that is symmetric but for rounding.
inline Sym3d upper_triangle(const Mat3d& m) {
  return {m(0, 0), m(0, 1), m(0, 2), m(1, 1), m(1, 2), m(2, 2)};
}

/// A symmetric tensor after a rotation.
inline Sym3d turned(const Mat3d& rotation, const Sym3d& s) {
  return upper_triangle(rotation * full(s) * transpose(rotation));
}

/// The rotation of a unit quaternion, less the identity.
inline Mat3d change_by(const UnitQuaternion& q) {
  const Vec3d v = q.v;
  return {
      {{-2 * (v.y * v.y + v.z * v.z), 2 * (v.x * v.y - q.w * v.z), 2 * (v.x * v.z + q.w * v.y)},
       {2 * (v.x * v.y + q.w * v.z), -2 * (v.x * v.x + v.z * v.z), 2 * (v.y * v.z - q.w * v.x)},
       {2 * (v.x * v.z - q.w * v.y), 2 * (v.y * v.z + q.w * v.x), -2 * (v.x * v.x + v.y * v.y)}}};
}

/// The rotation of a unit quaternion.
inline Mat3d rotation_of(const UnitQuaternion& q) { return identity<double>() + change_by(q); }

/// The rotation a after the rotation b, of unit length again.
inline UnitQuaternion after(const UnitQuaternion& a, const UnitQuaternion& b) {
  const double w = a.w * b.w - dot(a.v, b.v);
  const Vec3d v = a.w * b.v + b.w * a.v + cross(a.v, b.v);
  const double length = std::sqrt(w * w + dot(v, v));
  return {w / length, v / length};
}

/// Axis times angle of a rotation [rad], the angle at most π.
inline Vec3d axis_angle(const UnitQuaternion& q) {
  const double sine = norm(q.v), sign = q.w < 0 ? -1 : 1;
  if (sine == 0) return {};
  return (sign * 2 * std::atan2(sine, sign * q.w) / sine) * q.v;
}

/// The inverse of a symmetric matrix that has one.
inline Sym3d inverse(const Sym3d& s) {
  const Mat3d whole = full(s);
  return upper_triangle((1 / determinant(whole)) * cofactor(whole));
}

/// The rotation of a step, in the axes in which the inertia I is given. With the vector part q of
/// its quaternion, and w² = 1 - q², the discrete equation reads
///
///   2 w I q + 2 q × I q = Δt L;
///
/// Newton's method solves it. A body that turns by more than about a radian in a step has no
/// solution, and gets NaN.
/// @param impulse Δt L [N m s²]
inline UnitQuaternion turn_of_step(const Sym3d& inertia, Vec3d impulse) {
  const Mat3d i = full(inertia);
  Vec3d q = 0.5 * (inverse(inertia) * impulse);
  constexpr int most_iterations = 50;
  constexpr double rounding = 1e-15;
  for (int k = 0; k < most_iterations; ++k) {
    const double w = std::sqrt(1 - dot(q, q));
    const Vec3d iq = i * q;
    const Vec3d rest = (2 * w) * iq + 2.0 * cross(q, iq) - impulse;
    const Mat3d slope =
        (2 * w) * i + (-2 / w) * outer(iq, q) + 2.0 * (cross_matrix(q) * i - cross_matrix(iq));
    const Vec3d change = (1 / determinant(slope)) * (transpose(cofactor(slope)) * rest);
    q = q - change;
    const double square = dot(q, q);
    if (!(square < 1)) break;
    if (norm(change) <= rounding) return {std::sqrt(1 - square), q};
  }
  constexpr double none = std::numeric_limits<double>::quiet_NaN();
  return {none, {none, none, none}};
}

}  // namespace phyxel
