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

/// The scale η of a slip s of size y, by which friction has the direction s/η = f₁ s/y, and η'.
struct SlipScale {
  double length = 0;  ///< η [m]; y where friction is whole.
  double slope = 1;   ///< η' [1]
};
/// The scale of a slip. @param y its size [m]. @param width ε [m]
inline SlipScale slip_scale(double y, double width) {
  if (!(y < width)) return {y, 1};
  const double length = width / (2 - y / width);
  return {length, length * length / (width * width)};
}

/// The friction of a slip, its potential, and a stiffness of it.
///
/// With the second derivative, steps of Newton's method swing about places where a slip is whole
/// in one direction and then in another. The stiffness here is that of the pair s - η w = 0,
/// f = -μ N w in slip and friction, μ N/η (1 - η' ½ (w ŝ + ŝ w)), nowhere negative for |w| ≤ 1,
/// which is the second derivative where w = s/η, the end of a search. Source: T. F. Chan, G. H.
/// Golub, P. Mulet 1999 (A nonlinear primal-dual method for total variation-based image
/// restoration, SIAM Journal on Scientific Computing 20, section 3), for the same potential.
/// @param slip s, across the normal [m]
/// @param way w: the direction of friction, as far as a search knows it (`next_way`)
inline PenaltyForce friction_penalty(const FrictionLimit& limit, Vec3d normal, Vec3d slip,
                                     Vec3d way) {
  const Mat3d across = identity<double>() - outer(normal, normal);
  const double y = std::sqrt(dot(slip, slip)), width = limit.width();
  if (!(width > 0)) return {{}, y > 0 ? Mat3d{} : limit.stiffness * across, 0};
  const SlipScale scale = slip_scale(y, width);
  const double secant = limit.force / scale.length;
  const Vec3d slip_way = y > 0 ? slip / y : slip;
  const Mat3d both = outer(way, slip_way) + outer(slip_way, way);
  return {-secant * slip, secant * (across - 0.5 * scale.slope * both),
          y < width ? limit.force * y * y / width * (1 - y / (3 * width))
                    : limit.force * (y - width / 3)};
}

/// The direction of friction after a step of Newton's method.
/// @param before,way the slip [m] and the direction before it. @param width ε before it [m]
/// @param slip the slip after it [m]
inline Vec3d next_way(Vec3d before, Vec3d way, double width, Vec3d slip) {
  const double y = std::sqrt(dot(before, before));
  const SlipScale scale = slip_scale(y, width);
  if (!(scale.length > 0)) return {};
  const double along = y > 0 ? dot(before, slip - before) / y : 0;
  const Vec3d next = (slip - scale.slope * along * way) / scale.length;
  const double size = std::sqrt(dot(next, next));
  return size > 1 ? next / size : next;
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
