/// Friction of a point as the derivative of a potential, for Newton's method.
///
/// Coulomb's friction of a given normal force N on a slip s,
///
///   f = -μ N f₁(|s|) s/|s|,   f₁(y) = 2 y/ε - (y/ε)² below ε, 1 from there on,
///
/// is the derivative of minus the potential μ N f₀(|s|), f₀' = f₁, whose second derivatives are
/// nowhere negative. Source: M. Li et al. 2020 (Incremental Potential Contact, ACM Transactions on
/// Graphics 39, section 5), with the start at zero.
#pragma once

#include <cmath>

#include "phyxel/physics/body_contact.hpp"
#include "phyxel/physics/contact_penalty.hpp"

namespace phyxel {

/// What friction can do at a point: it grows with slip as a spring does, and has a limit.
struct FrictionLimit {
  double force = 0;      ///< μ N [N]
  double stiffness = 0;  ///< That of small slips, 2 μ N/ε [N/m].

  /// ε: the slip from which on friction is whole [m].
  double width() const { return stiffness > 0 ? 2 * force / stiffness : 0; }
};

/// The friction of a slip, and its potential and stiffness.
/// @param slip across the normal [m]
/// @param is_careful true for the stiffness of a spring from the place without slip with the force
/// of this slip: its energy is nowhere below the potential, so that a step of Newton's method does
/// not lead beyond the place where the slip turns round, nor far from here
inline PenaltyForce friction_penalty(const FrictionLimit& limit, Vec3d normal, Vec3d slip,
                                     bool is_careful) {
  const Mat3d across = identity<double>() - outer(normal, normal);
  const double y = std::sqrt(dot(slip, slip)), width = limit.width();
  if (y < width) {
    const double rest = 1 - y / width;
    // f₁/y and f₁'; along a slip of zero both are the same.
    const double secant = 0.5 * limit.stiffness * (1 + rest), tangent = limit.stiffness * rest;
    const Vec3d way = y > 0 ? slip / y : slip;
    return {-secant * slip,
            secant * across - (is_careful ? 0.0 : secant - tangent) * outer(way, way),
            limit.force * y * y / width * (1 - y / (3 * width))};
  }
  if (!(y > 0)) return {{}, limit.stiffness * across, 0};
  const double secant = limit.force / y;
  const Vec3d way = slip / y;
  return {-limit.force * way, secant * (is_careful ? across : across - outer(way, way)),
          limit.force * (y - width / 3)};
}

/// The part of a phyxel of a surface in the slip of a point that it carries: D in
/// slip = d - Σ r_k d_k + h T⁺ Σ ω_k (n̄ · d_k) z_k = d + Σ D_k d_k, the transpose of the forces
/// and couples of `SurfaceForce`. The last term is the turn of the surface under a point that is a
/// height h above those that carry it: a rigid rotation of all is no slip.
/// @param y place of the phyxel where the touch was found [m]
inline Mat3d slip_share(const SurfaceTouch& touch, const SurfaceShare& share, Vec3d y) {
  const Vec3d n = touch.normal;
  const Vec3d turn = touch.height * share.weight * (touch.inverse_spread * (y - touch.centre));
  return outer(turn, n) - share.part * (identity<double>() - outer(n, n));
}

}  // namespace phyxel
