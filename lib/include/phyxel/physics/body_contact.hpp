/// Contact of points of one surface with the deformed surface of a body: the gap, the impulse that
/// closes it, and who takes the reaction.
///
/// The body's signed distance φ is known at rest. A place q beside its deformed surface is led back
/// to where it would be at rest by the deformation gradients F_k of the phyxels k of that surface
/// near it, so that edges, thin parts and corners act as they are:
///
///   X(q) = Σ ω_k (X_k + ½ (G_k + Ḡ)(q - y_k)),   G_k = F_k⁻¹,   Ḡ = Σ ω_k G_k,
///   m = Ḡᵀ ∇φ(X(q)),   n̄ = m/|m|,   g = φ(X(q))/|m| + n̄ · (x - q),
///
/// where y_k are the places of these phyxels, ω_k smooth weights, zero for those that face away,
/// and x the point. q lies inside the point's own body, half a spacing from x: it is outside the
/// other body even where x has entered it, so that the nearest face is the one through which x has
/// come, on edges and at corners, too. The force that closes the gap is shared among the phyxels of
/// the surface by weights r_k that reproduce linear functions along it, so that both momenta of the
/// bodies are kept to rounding, with friction, too.
#pragma once

#include <cmath>

#include "phyxel/physics/contact.hpp"
#include "phyxel/physics/distance_field.hpp"
#include "phyxel/physics/near_lists.hpp"
#include "phyxel/physics/weight.hpp"
#include "phyxel/types.hpp"

namespace phyxel {

/// The constants of a phyxel of a contact layer, between two searches for points that may touch.
struct SurfaceSite {
  Vec3<double> rest;  ///< X [m]
  /// Change of velocity by a force over a step, along each axis; 0 along prescribed ones [m/s/N].
  Vec3<double> mobility;
  Vec3<double> inward;  ///< From X to the place at rest whose distance is looked up [m].
  /// φ(X) of its own body, where its surface is smooth: distances are taken from there [m].
  double level = 0;
  double area = 0;        ///< A measure of the area of its part of the surface [m²].
  double offset = 0;      ///< Its distance from its body's surface [m].
  double range = 0;       ///< Distance up to which it knows of other surfaces [m].
  double wave_speed = 0;  ///< Of pressure waves in its body [m/s].
  /// Sine of the angle by which its body's surface falls away beside it: 0.7 at an edge of a box.
  /// 0 if it lies below the surface.
  double fall = 0;

  /// True if it lies on an edge or a corner of its body's surface.
  PHYXEL_HD bool is_edge() const { return fall > 0.25; }
};

/// The motion of a phyxel of a contact layer over a step, before contact.
struct alignas(32) SurfaceMotion {
  Vec3<double> after;    ///< Predicted place at the end of the step [m].
  double range = 0;      ///< That of its site [m]: beside the place, which it is looked at with.
  Vec3<double> before;   ///< Place at the start of the step [m].
  Vec3<double> earlier;  ///< Velocity at the start of the step [m/s].
  Vec3<double> probe;    ///< q - x: F times `inward` [m].
  Mat3<double> back;     ///< G: the inverse of its deformation gradient at the start.
  Vec3<double> out;      ///< Unit normal of its surface; zero if that is unknown.
};

/// The inverse of a deformation gradient. That of a phyxel without volume is the identity, as it
/// says nothing of where a point would be at rest.
/// @param gradient of displacement
PHYXEL_HD Mat3<double> inverse_deformation(const Mat3<double>& gradient) {
  const Mat3<double> f = identity<double>() + gradient;
  const double volume = determinant(f);
  constexpr double least = 1e-3;
  return volume > least ? (1 / volume) * transpose(cofactor(f)) : identity<double>();
}

/// The weight of a phyxel of a surface for a point, zero from `range` on.
/// @param square of their distance [m²]
PHYXEL_HD double surface_weight(double square, double range) {
  return weight_shape_anywhere(square, 1 / (range * range));
}

/// How much of a phyxel of a surface counts for a point: all of one whose surface faces the
/// point's, so that the other side of a thin part, of a slit, or of the point's own body does not.
PHYXEL_HD double facing(const SurfaceMotion& point, const SurfaceMotion& other) {
  const double t = 2.5 * (0.1 - dot(point.out, other.out));
  return t <= 0 ? 0 : t >= 1 ? 1 : t * t * (3 - 2 * t);
}

/// Sets the range, the probe, the inverse deformation gradient and the normal of a phyxel.
/// @param gradient of displacement
PHYXEL_HD void set_gradient(SurfaceMotion& motion, const SurfaceSite& site,
                            const Mat3<double>& gradient) {
  motion.range = site.range;
  motion.probe = site.inward + gradient * site.inward;
  motion.back = inverse_deformation(gradient);
  const Vec3<double> out = -(transpose(motion.back) * site.inward);
  const double length = std::sqrt(dot(out, out));
  motion.out = length > 0 ? (1 / length) * out : out;
}

/// The weight with which a phyxel of a surface carries the force on a point: that of its distance
/// times its area, as far as it faces the point, so that a uniform pressure is passed on uniformly,
/// and faces beside the one that is touched carry nothing.
/// @param normal n̄, away from the body. @param square of the distance from the point [m²]
PHYXEL_HD double carrying_weight(Vec3<double> normal, double square, double range,
                                 const SurfaceSite& site, const SurfaceMotion& motion) {
  const double weight = surface_weight(square, range);
  if (!(weight > 0)) return 0;
  constexpr double from = 0.2, to = 0.5, least = 1e-6;  // cosines; edges have 0.71, corners 0.58
  const double part = (dot(normal, motion.out) - from) / (to - from);
  const bool is_known = dot(motion.out, motion.out) > 0;
  return weight * site.area * (!is_known || part > 1 ? 1 : part > least ? part : least);
}

/// A point that is inside a body at the end of a step.
struct SurfaceTouch {
  bool is_inside = false;
  bool is_alone = false;        ///< True if no phyxel of the surface within range faces it.
  double gap = 0;               ///< g - offset [m].
  Vec3<double> normal;          ///< n̄, away from the body.
  Vec3<double> centre;          ///< Mean place of those that carry it, as the step starts [m].
  double height = 0;            ///< n̄ · (x - Σ r_k y_k) at the start of the step [m].
  Sym3<double> inverse_spread;  ///< T⁺ [1/m²], where T = Σ ω_k z_k z_kᵀ, z_k along the surface.
};

/// How a phyxel of a surface carries a point: by its part of all weights, and its part of the
/// force.
struct SurfaceShare {
  double weight = 0;  ///< ω_k, whose sum is 1.
  double part = 0;    ///< r_k = ω_k (1 + T⁺ d · z_k), whose sum is 1, too.
  double area = 0;    ///< |r_k| times the area of the point [m²].
};

/// The part of a vector along a surface.
PHYXEL_HD Vec3<double> along(Vec3<double> normal, Vec3<double> v) {
  return v - dot(normal, v) * normal;
}

/// The pseudo-inverse of a symmetric tensor that has n as a null vector.
PHYXEL_HD Sym3<double> inverse_along(Vec3<double> n, const Sym3<double>& t) {
  // Two unit vectors across n, one of them across the axis that is farthest from n.
  const Vec3<double> axis = std::fabs(n.x) < 0.6   ? Vec3<double>{1, 0, 0}
                            : std::fabs(n.y) < 0.6 ? Vec3<double>{0, 1, 0}
                                                   : Vec3<double>{0, 0, 1};
  Vec3<double> a = cross(n, axis);
  a = (1 / std::sqrt(dot(a, a))) * a;
  const Vec3<double> b = cross(n, a);
  const double aa = dot(a, t * a), ab = dot(a, t * b), bb = dot(b, t * b);
  // Eigenvalues m ± q, and the eigenvector of the larger one.
  const double middle = 0.5 * (aa + bb), half = 0.5 * (aa - bb);
  const double q = std::sqrt(half * half + ab * ab);
  const double large = middle + q, small = middle - q;
  if (!(large > 0)) return {};
  Vec3<double> u = half > 0 ? (half + q) * a + ab * b : ab * a + (q - half) * b;
  const double length = std::sqrt(dot(u, u));
  u = length > 0 ? (1 / length) * u : a;
  const Vec3<double> v = cross(n, u);
  constexpr double cut_off = 1e-3;  // phyxels on one line do not spread along the other
  const double p = 1 / large, s = small > cut_off * large ? 1 / small : 0.0;
  return {p * u.x * u.x + s * v.x * v.x, p * u.x * u.y + s * v.x * v.y,
          p * u.x * u.z + s * v.x * v.z, p * u.y * u.y + s * v.y * v.y,
          p * u.y * u.z + s * v.y * v.z, p * u.z * u.z + s * v.z * v.z};
}

/// The gap of a place beside a deformed surface, and its unit normal; zero if it has none.
/// @param gap that of its place at rest. @param level that of the surface [m]
/// @param back inverse of the deformation gradient
PHYXEL_HD Gap deformed_gap(const Gap& gap, double level, const Mat3<double>& back) {
  const Vec3<double> m = transpose(back) * gap.normal;
  const double length = std::sqrt(dot(m, m));
  if (!(length > 0)) return {0, {}};
  return {(gap.distance - level) / length, (1 / length) * m};
}

/// The correction of the gap of a point far from all phyxels of a surface, as a share of its range.
/// A surface that is touched has phyxels within half a range, of weight 0.4; gradients of phyxels
/// at the rim of the range say little of the place of a point.
/// @param weights Σ w
PHYXEL_HD double distance_of_lone_point(double weights) {
  constexpr double enough = 0.4, most = 0.3;
  return weights < enough ? most * (1 - weights / enough) : 0;
}

/// The weight of single gaps over the gap of the mean place, from the spread of the places at rest
/// to which phyxels of a surface lead a point: 0 up to a quarter of a range, 1 from half a range
/// on. The spread is large in the crease of a folded limb, whose two walls lead to places far
/// apart, with the inside of the body between them.
/// @param square of their spread [m²]
PHYXEL_HD double doubt_of_place(double square, double range) {
  const double t = 4 * std::sqrt(square > 0 ? square : 0.0) / range - 1;
  return t <= 0 ? 0 : t >= 1 ? 1 : t * t * (3 - 2 * t);
}

/// The place at rest of a place beside a deformed surface, and its gap.
struct PlaceAtRest {
  double weights = 0;  ///< Of all near phyxels; the rest is known above `least_weight`.
  Vec3<double> place;  ///< X(q) [m]
  Gap gap;             ///< Its normal may be shorter than 1, where walls have none in common.
};
/// Weight of phyxels below which they say nothing of a place.
inline constexpr double least_weight = 0.05;

/// The weights of a surface's phyxels near a point.
struct SurfaceWeights {
  const SurfaceMotion& point;

  /// The weight of a phyxel by its distance alone.
  PHYXEL_HD double nearness(const SurfaceMotion& other) const {
    const Vec3<double> apart = other.after - point.after;
    return surface_weight(dot(apart, apart), common_range(point.range, other.range));
  }
  /// The weight of a phyxel by its distance and its facing. Most phyxels are out of range.
  PHYXEL_HD double weight(const SurfaceMotion& other) const {
    const double near = nearness(other);
    return near > 0 ? facing(point, other) * near : 0.0;
  }
};

/// The sums of the weights of the phyxels of a surface near a point.
struct WeightsNear {
  double facing = 0;    ///< Of `SurfaceWeights::weight`.
  double nearness = 0;  ///< Of `SurfaceWeights::nearness`, of those that face the point.
  /// True if the surface is so near that it tells where the point is.
  PHYXEL_HD bool tell() const { return facing > 0 && nearness > least_weight; }
};

/// Finds the sums of weights. The parameters have the meaning of those of `surface_touch`.
template <class Threads, class MotionOf>
PHYXEL_HD WeightsNear weights_near(const Threads& threads, const SurfaceMotion& point,
                                   const Offset* list, MotionOf&& motion_of) {
  const SurfaceWeights weigh{point};
  WeightsNear all;
  threads.each(list, [&](Offset k) {
    const SurfaceMotion& other = motion_of(k);
    const double w = weigh.weight(other);
    if (!(w > 0)) return;
    all.facing += w;
    all.nearness += weigh.nearness(other);
  });
  return {threads.sum(all.facing), threads.sum(all.nearness)};
}

/// Finds where the place q of a point is at rest. The parameters are those of `surface_touch`.
template <class Threads, class SiteOf, class MotionOf>
PHYXEL_HD PlaceAtRest place_at_rest(const Threads& threads, const SurfaceSite& site,
                                    const SurfaceMotion& point, const Offset* list,
                                    SiteOf&& site_of, MotionOf&& motion_of,
                                    const PlacedDistances& field) {
  PlaceAtRest found;
  const Vec3<double> q = point.after + point.probe;
  const SurfaceWeights weigh{point};
  Mat3<double> back{};                  // Σ w G
  Vec3<double> rest{}, led{}, apart{};  // Σ w X, Σ w G (q - y), Σ w (q - y)
  double level = 0;                     // Σ w φ(X)
  WeightsNear near;
  Vec3<double> here{};  // Σ w (X + G (q - y)), from the point at rest
  double square = 0;    // Σ w of its square
  threads.each(list, [&](Offset k) {
    const SurfaceMotion& other = motion_of(k);
    const double w = weigh.weight(other);
    if (!(w > 0)) return;
    const Vec3<double> way = q - other.after;
    near.facing += w;
    near.nearness += weigh.nearness(other);
    back += w * other.back;
    rest += w * site_of(k).rest;
    const Vec3<double> whole = other.back * way, at = site_of(k).rest - site.rest + whole;
    led += w * whole;
    here += w * at;
    square += w * dot(at, at);
    apart += w * way;
    level += w * site_of(k).level;
  });
  near = {threads.sum(near.facing), threads.sum(near.nearness)};
  found.weights = near.nearness;
  if (!near.tell()) return found;
  const double scale = 1 / near.facing;
  back = scale * threads.sum(back);
  found.place = scale * (threads.sum(rest) + 0.5 * (threads.sum(led) + back * threads.sum(apart)));
  here = scale * threads.sum(here);
  const double spread_of_rest = scale * threads.sum(square) - dot(here, here);
  const double doubt = doubt_of_place(spread_of_rest, site.range);
  const double own_level = scale * threads.sum(level);
  Gap& gap = found.gap;
  gap = deformed_gap(field.gap(found.place), own_level, back);
  if (doubt > 0) {
    double distance = 0;
    Vec3<double> normal{};
    threads.each(list, [&](Offset k) {
      const SurfaceMotion& other = motion_of(k);
      const double w = weigh.weight(other);
      if (!(w > 0)) return;
      const Vec3<double> at = site_of(k).rest + other.back * (q - other.after);
      const Gap own = deformed_gap(field.gap(at), own_level, other.back);
      distance += w * own.distance;
      normal += w * own.normal;
    });
    gap.distance += doubt * (scale * threads.sum(distance) - gap.distance);
    gap.normal += doubt * (scale * threads.sum(normal) - gap.normal);
  }
  return found;
}

/// Finds whether a point is inside a body, from the phyxels of the body's surface near it. Who
/// carries it is left to `carry`.
/// @param threads share the phyxels among them (`OneThread`); all return the same
/// @param list of these phyxels, as of `OneThread::each`
/// @param site_of,motion_of return those of an entry of the list
/// @param field distances from the body's surface at rest
/// @param least distance at rest between a point and a part of its own body that it may touch
/// [m]; 0 for other bodies
/// @param reach gap below which the point counts as inside, as a share of its range
template <class Threads, class SiteOf, class MotionOf>
PHYXEL_HD SurfaceTouch surface_touch(const Threads& threads, const SurfaceSite& site,
                                     const SurfaceMotion& point, const Offset* list,
                                     SiteOf&& site_of, MotionOf&& motion_of,
                                     const PlacedDistances& field, double least, double reach) {
  SurfaceTouch touch;
  const PlaceAtRest rest = place_at_rest(threads, site, point, list, site_of, motion_of, field);
  touch.is_alone = !(rest.weights > 0);
  if (!(rest.weights > least_weight)) return touch;
  // What leads back to the point's own neighbourhood is no other part of the body.
  if (const Vec3<double> way = rest.place - site.rest; dot(way, way) < least * least) return touch;
  const double length = std::sqrt(dot(rest.gap.normal, rest.gap.normal));
  constexpr double shortest = 0.3;  // opposite walls have no common normal
  if (!(length > shortest)) return touch;
  touch.normal = (1 / length) * rest.gap.normal;
  touch.gap = rest.gap.distance - dot(touch.normal, point.probe) - site.offset +
              distance_of_lone_point(rest.weights) * site.range;
  if (!(touch.gap < reach * site.range) ||
      dot(touch.normal, point.out) > -0.2 * dot(point.out, point.out)) {
    return touch;
  }
  touch.is_inside = true;
  return touch;
}

/// Finds how the phyxels of a surface carry a point that is inside their body.
/// @param touch result of `surface_touch`, whose other parameters these are; receives the rest
/// @param shares zero; receive those of the entries
template <class Threads, class SiteOf, class MotionOf>
PHYXEL_HD void carry(const Threads& threads, const SurfaceSite& site, const SurfaceMotion& point,
                     const Offset* list, SiteOf&& site_of, MotionOf&& motion_of,
                     SurfaceTouch& touch, SurfaceShare* shares) {
  const auto square_of = [&](Offset k) {
    const Vec3<double> apart = motion_of(k).after - point.after;
    return dot(apart, apart);
  };
  const auto range_of = [&](Offset k) { return common_range(site.range, site_of(k).range); };
  const Vec3<double> n = touch.normal;
  double carried = 0;
  threads.each(list, [&](Offset k) {
    const double w = carrying_weight(n, square_of(k), range_of(k), site_of(k), motion_of(k));
    shares[k].weight = w;
    carried += w;
    touch.centre += w * (motion_of(k).before - point.before);
  });
  carried = threads.sum(carried);
  touch.centre = (1 / carried) * threads.sum(touch.centre);  // from the point
  Sym3<double> spread{};
  threads.each(list, [&](Offset k) {
    const double share = shares[k].weight = shares[k].weight / carried;
    if (!(share > 0)) return;
    const Vec3<double> z = along(n, motion_of(k).before - point.before - touch.centre);
    spread.xx += share * z.x * z.x;
    spread.xy += share * z.x * z.y;
    spread.xz += share * z.x * z.z;
    spread.yy += share * z.y * z.y;
    spread.yz += share * z.y * z.z;
    spread.zz += share * z.z * z.z;
  });
  touch.inverse_spread = inverse_along(n, threads.sum(spread));
  const Vec3<double> tilt = touch.inverse_spread * along(n, -touch.centre);
  Vec3<double> reached{};  // Σ r (y - x)
  threads.each(list, [&](Offset k) {
    if (!(shares[k].weight > 0)) return;
    const Vec3<double> y = motion_of(k).before - point.before;
    shares[k].part = shares[k].weight * (1 + dot(tilt, y - touch.centre));
    shares[k].area = std::fabs(shares[k].part) * site.area;
    reached += shares[k].part * y;
  });
  touch.height = -dot(n, threads.sum(reached));
  touch.centre += point.before;
}

/// How a point that is inside a body moves, relative to the surface, by a force on it.
struct SurfaceResponse {
  /// Change of the relative velocity by a force over a step, along each axis [m/s/N].
  Vec3<double> mobility;
  double target = 0;  ///< Velocity along n̄ that the step shall end with at least [m/s].
  /// Share of what a force on the point moves that is free (`ContactPasses::velocity_of_free`), if
  /// supports hold most of it: then only velocities along free axes count. Else 1.
  double free = 1;
};

/// The change of a velocity along a unit vector by a force along it. @param mobility of each axis
PHYXEL_HD double mobility_along(Vec3<double> mobility, Vec3<double> way) {
  return way.x * way.x * mobility.x + way.y * way.y * mobility.y + way.z * way.z * mobility.z;
}

/// The speed at which a point that is inside a body as a step starts is moved out of it.
struct DepthRecovery {
  double rate = 0;         ///< Speed over depth [1/s].
  double fastest = 1e300;  ///< Largest speed [m/s].
};

/// The part of the depth at its start by which a step moves a point out of a body.
inline constexpr double recovery_in_step = 0.2;

/// The recovery of a point of a surface: a fifth of the depth in a step, up to a hundredth of the
/// range. Steps far below the stable one recover as much by time as a stable one, since a fifth of
/// the depth in a very short step would fling the point out. A shorter stable time than that below
/// makes energy where folds press on each other; a longer one leaves bodies at rest deeper.
PHYXEL_HD DepthRecovery depth_recovery(const SurfaceSite& site, double dt) {
  constexpr double most = 0.01;   // of the range in a step
  constexpr double stable = 0.5;  // stable steps are at most as many times range / wave speed
  const double in_stable = site.wave_speed / (stable * site.range);  // [1/s]
  const double rate = in_stable < 1 / dt ? in_stable : 1 / dt;
  return {recovery_in_step * rate, most * site.range * rate};
}

/// The least velocity along n̄ with which a step shall end, so that it closes the gap and throws
/// back what has come,
///
///   w = max(-g⁻/Δt, n̄ · (v - (1 + e) v⁻)),   g⁻ = g - Δt n̄ · v,
///
/// where v is the velocity of the point relative to the surface before contact, v⁻ that at the
/// start of the step, and e the restitution, which counts for points that approach. Where the point
/// was inside as the step started, g⁻ < 0, the step recovers a part of the depth (`DepthRecovery`),
/// so that points that meet deep inside, as at corners, are not flung apart.
/// @param recovery of the point
PHYXEL_HD double target_velocity(const SurfaceTouch& touch, Vec3<double> velocity,
                                 Vec3<double> earlier, const ContactLaw& law,
                                 const DepthRecovery& recovery, double dt) {
  const double ahead = dot(touch.normal, velocity), before = touch.gap / dt - ahead;
  const double out = -recovery.rate * dt * before;
  const double closing = before >= 0 ? -before : out < recovery.fastest ? out : recovery.fastest;
  const double approach = -dot(touch.normal, earlier);
  if (!(law.restitution > 0 && approach > 0)) return closing;
  const double rebound = ahead + (1 + law.restitution) * approach;
  return closing < rebound ? rebound : closing;
}

/// The force of a body on a point in a step [N], and how it acts back.
struct SurfaceForce {
  double push = 0;          ///< On the point, along n̄ [N].
  Vec3<double> tangential;  ///< On the point.
  Vec3<double> twist;       ///< Couples of friction: b = height T⁺ tangential [N/m].

  /// Sets friction on the point, and its couple.
  PHYXEL_HD void set_friction(const SurfaceTouch& touch, Vec3<double> force) {
    tangential = force;
    twist = touch.height * (touch.inverse_spread * force);
  }
  /// The reaction on a phyxel of the body's surface to the normal part.
  PHYXEL_HD Vec3<double> normal_reaction(const SurfaceTouch& touch,
                                         const SurfaceShare& share) const {
    return -share.part * push * touch.normal;
  }
  /// The reaction to friction, and to its couple. @param y its place as the step starts [m]
  PHYXEL_HD Vec3<double> tangential_reaction(const SurfaceTouch& touch, const SurfaceShare& share,
                                             Vec3<double> y) const {
    const double turning = share.weight * dot(twist, y - touch.centre);
    return turning * touch.normal - share.part * tangential;
  }
};

/// Adds Coulomb's friction to the normal part of a force, also where supports hold both bodies
/// along the slip (`give_of_prescribed`). @param velocity as of `surface_force`
PHYXEL_HD void add_friction(const SurfaceTouch& touch, const SurfaceResponse& response,
                            Vec3<double> velocity, const ContactLaw& law, SurfaceForce& force) {
  if (!(law.static_friction > 0)) return;
  const Vec3<double> slip = along(touch.normal, velocity);
  const double speed = std::sqrt(dot(slip, slip));
  if (!(speed > 0)) return;
  const Vec3<double> way = (1 / speed) * slip;
  const double along_slip = mobility_along(response.mobility, way);
  const double least = give_of_prescribed * mobility_along(response.mobility, touch.normal);
  const double sideways = along_slip > least ? along_slip : least;
  if (!(sideways > 0)) return;
  const double stop = speed / sideways, hold = law.kinetic_friction * force.push;
  const double size = stop <= law.static_friction * force.push || stop < hold ? stop : hold;
  force.set_friction(touch, -size * way);
}

/// The force that gives a point its target velocity w, and Coulomb's friction,
///
///   f = (w - n̄ · v)/D_n > 0,   f_t = -v_t/|v_t| min(μ f, |v_t|/D_t),
///   D = Σ_i |r_i| c_i d · M_i d / a  along a direction d,
///
/// where v is the velocity of the point relative to the surface, M_i the mobility of a phyxel, a
/// the area of the point, and c_i = Σ a |r_i| over all contacts that the phyxel takes part in:
/// masses are split by areas, so that no gap is closed twice over.
PHYXEL_HD SurfaceForce surface_force(const SurfaceTouch& touch, const SurfaceResponse& response,
                                     Vec3<double> velocity, const ContactLaw& law) {
  SurfaceForce force{};
  const Vec3<double> n = touch.normal;
  const double across = mobility_along(response.mobility, n);
  const double rate = response.target - dot(n, velocity);
  if (!(across > 0 && rate > 0)) return force;  // nothing is free to move, or nothing has to
  force.push = rate / across;
  add_friction(touch, response, velocity, law, force);
  return force;
}

}  // namespace phyxel
