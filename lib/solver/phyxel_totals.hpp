/// The contribution of one phyxel to `Diagnostics`, shared by all devices.
#pragma once

#include <cmath>

#include "phyxel/physics/hourglass.hpp"
#include "phyxel/physics/laws.hpp"
#include "phyxel/physics/verlet.hpp"

namespace phyxel {

/// Indices of the sums over phyxels, in the order of `Totals::for_each_sum`.
struct Sums {
  enum : int {
    kinetic_energy,
    strain_energy,
    volume_energy,
    hourglass_energy,
    plastic_work,
    viscous_work,
    gravity_energy,
    load_energy,
    force_scale,
    torque_scale,
    momentum,  // three components each
    angular_momentum = momentum + 3,
    internal_force = angular_momentum + 3,
    internal_torque = internal_force + 3,
    count = internal_torque + 3
  };
};

/// State of one phyxel from which the totals are computed.
struct PhyxelState {
  double mass, volume;          ///< [kg], [m³]
  Vec3<double> position;        ///< At the present displacement [m].
  Vec3<double> displacement;    ///< [m]
  Vec3<double> velocity;        ///< [m/s], at the start of `flow`.
  DampedFlow flow;              ///< From the time of the velocity to that of the displacement.
  Vec3<double> free;            ///< 1 along free axes, 0 along prescribed ones.
  Vec3<double> internal, load;  ///< Internal forces and those of constant loads [N].
  Vec3<double> following;       ///< Of loads that follow the surface [N], counted elsewhere.
  Vec3<double> external;        ///< The caller's forces [N], whose energy is the caller's to count.
  Vec3<double> gravity;         ///< [m/s²]
  Mat3<double> grad_u;          ///< ∇u
  double hourglass, residual;   ///< κ [N/m] and Σ_j w_ij |r_ij|² [m²]; 0: no hourglass control.
};

/// The contribution of one phyxel.
struct PhyxelTotals {
  double sum[Sums::count];
  double displacement, speed;  ///< Magnitudes [m], [m/s].
  bool finite;                 ///< False if a value of the phyxel is not finite.
  bool inverted;               ///< True if det F <= 0.
};

namespace detail {
PHYXEL_HD void put(double* sum, Vec3<double> v) {
  sum[0] = v.x;
  sum[1] = v.y;
  sum[2] = v.z;
}
}  // namespace detail

/// Computes the contribution of a phyxel to the totals.
/// @param response response of its material at the present displacement (`response_after_step`)
PHYXEL_HD PhyxelTotals totals_of(const PhyxelState& p, const PointResponse<double>& response) {
  PhyxelTotals t{};
  double all = 0;
  for (int e = 0; e < 9; ++e) all += p.grad_u(e / 3, e % 3);
  for (const Vec3<double>& v : {p.displacement, p.internal, p.velocity}) all += v.x + v.y + v.z;
  t.finite = all - all == 0;
  t.inverted = volume_change(p.grad_u) <= -1;

  const Vec3<double> loads = p.load + p.following;
  const Vec3<double> acceleration = (1 / p.mass) * (p.internal + (loads + p.external)) + p.gravity;
  const Vec3<double> change = p.flow.gain * acceleration - (1 - p.flow.keep) * p.velocity;
  const Vec3<double> velocity =
      p.velocity + Vec3<double>{p.free.x * change.x, p.free.y * change.y, p.free.z * change.z};
  const Vec3<double> momentum = p.mass * velocity;
  t.sum[Sums::kinetic_energy] = 0.5 * dot(momentum, velocity);
  detail::put(t.sum + Sums::momentum, momentum);
  detail::put(t.sum + Sums::angular_momentum, cross(p.position, momentum));
  t.sum[Sums::strain_energy] = p.volume * response.strain_energy;
  t.sum[Sums::volume_energy] = p.volume * response.volume_energy;
  t.sum[Sums::plastic_work] = p.volume * response.plastic_work;
  t.sum[Sums::viscous_work] = p.volume * response.viscous_work;
  if (p.hourglass > 0) t.sum[Sums::hourglass_energy] = hourglass_energy(p.hourglass, p.residual);
  t.sum[Sums::gravity_energy] = -p.mass * dot(p.gravity, p.displacement);
  t.sum[Sums::load_energy] = -dot(p.load, p.displacement);
  detail::put(t.sum + Sums::internal_force, p.internal);
  detail::put(t.sum + Sums::internal_torque, cross(p.position, p.internal));
  using std::sqrt;
  t.sum[Sums::force_scale] = sqrt(dot(p.internal, p.internal));
  t.sum[Sums::torque_scale] = sqrt(dot(p.position, p.position)) * t.sum[Sums::force_scale];
  t.displacement = sqrt(dot(p.displacement, p.displacement));
  t.speed = sqrt(dot(velocity, velocity));
  return t;
}

}  // namespace phyxel
