/// Brittle fracture: a pair of phyxels breaks where it is stretched beyond a critical stretch.
///
/// A broken pair has no weight, from either side, and the moments of its two phyxels are found
/// again without it. Displacements that are linear in space still have their exact gradient, and
/// what is left is an elastic body with a slit; momentum is kept, since forces act between pairs
/// still.
///
/// A pair breaks if |x + u|/|x| - 1 > s_c, where x leads from one phyxel to the other at rest and u
/// is the difference of their displacements. The critical stretch s_c follows from the energy
/// release rate G_c (lib/model/fracture.hpp). Both ends of a pair evaluate the same expression of
/// the same numbers, of which only signs differ: they agree to the last bit, on any rank, and no
/// message is needed. Sources: Silling and Askari 2005 (the criterion, for peridynamic bonds);
/// Ganzenmüller 2015 (pairs of a corrected SPH that break).
#pragma once

#include <cmath>

#include "phyxel/physics/moment.hpp"
#include "phyxel/physics/point.hpp"
#include "phyxel/types.hpp"

namespace phyxel {

/// The share by which the squared length of a pair has grown at the critical stretch,
/// (1 + s_c)² - 1.
PHYXEL_HD double critical_growth(double stretch) { return stretch * (2 + stretch); }

/// The excess of a pair's squared length over the critical one [m²]: |x + u|² - |x|² - g |x|². The
/// pair breaks where it is positive. The terms of |x|² are cancelled by hand, so that small
/// stretches keep their digits in float. It has the same bits for (-x, -u).
/// @param growth g of `critical_growth`
template <class Real>
PHYXEL_HD Real excess_growth(Vec3<Real> x, Vec3<Real> u, Real growth) {
  return fused(-growth, dot(x, x), dot(u, fused(Real(2), x, u)));
}

/// The critical growth of a pair: the smaller value of its two phyxels, so that the weaker one
/// decides. A negative value means that the pairs of a phyxel never break; that of the pair is
/// negative, too.
template <class Real>
PHYXEL_HD Real growth_of_pair(Real growth_i, Real growth_j) {
  return where_larger(growth_i, growth_j, growth_j, growth_i);
}

/// Four times the square of a distance d [m²] by which an unbroken pair may lengthen without
/// breaking: (1 + s_c)|x| - |x + u| = -excess / ((1 + s_c)|x| + |x + u|) ≥ -excess / (2 (1 +
/// s_c)|x|) = d. The rounding error of the excess, some units of |x|², is taken off first. It is
/// zero for a pair that breaks.
/// @param excess of `excess_growth`. @param growth of the pair, positive. @param unit of rounding
template <class Real>
PHYXEL_HD Real squared_slack(Vec3<Real> x, Real excess, Real growth, Real unit) {
  const Real square = dot(x, x), left = -excess - Real(64) * unit * square;
  const Real safe = where_larger(square, Real(0), square, Real(1));
  return where_larger(left, Real(0), left * (left / ((Real(1) + growth) * safe)), Real(0));
}

/// Growth by which a phyxel's pairs never break.
inline constexpr double unbreakable_growth = -1;

/// tr A⁻¹ of a phyxel may grow to so many times that of its whole neighbourhood before its stress
/// fades: the quarter of a neighbourhood that is left at an edge of a body has about this.
inline constexpr double most_moment_growth = 4;

/// Largest stable step of a body that has lost pairs, over that of the whole body, at the least.
/// Half a neighbourhood doubles A⁻¹, and with it the stiffness of a phyxel whose mass stays: 1/√2.
/// Strips that break all over are stable at 0.65 of the limit of the whole strip, and not at 0.7 of
/// it in each case (seen with four times tr A⁻¹ at most); the default safety of 0.8 is taken of
/// this.
inline constexpr double breaking_step_share = 0.7;

/// The share of its volume with which a phyxel that has lost pairs carries stress. It is 1 until
/// tr A⁻¹ has grown to `most_moment_growth` times its value at rest, and falls with the inverse of
/// it, so that the stiffness v A⁻¹ of a phyxel whose neighbours lie nearly in a plane stays
/// bounded, and with it the stable step. A phyxel whose neighbours span fewer dimensions than at
/// rest carries no stress: a gradient of lower rank is not that of a rotation when the phyxel
/// turns. Hourglass control goes on to act between it and the neighbours that it has left.
/// @param now,intact pseudo-inverses without broken pairs, and with all pairs
PHYXEL_HD double carried_share(const PseudoInverse<double>& now,
                               const PseudoInverse<double>& intact) {
  if (now.rank < intact.rank || now.rank == 0) return 0;
  const auto trace = [](const Sym3<double>& a) { return a.xx + a.yy + a.zz; };
  const double growth = trace(now.matrix) / (most_moment_growth * trace(intact.matrix));
  return growth > 1 ? 1 / growth : 1;
}

/// Stiffness of a closed pair over M s. A bar that is cut through bears the same pressure with an
/// eighth to all of M s, within a tenth; strips that break are stable with a half of it and 0.8 of
/// the step limit, and not with all of it.
inline constexpr double closed_share = 0.25;

/// The faces of a crack do not pass through each other: phyxels that have broken from each other
/// push apart where they come nearer than `rest`, like balls that touch, without friction. So
/// closed cracks and dust bear pressure.
struct ClosedPair {
  double stiffness = 0;  ///< `closed_share` M s, with M of the mean of both phyxels [N/m].
  double rest = 0;       ///< s, or the distance at rest if that is less [m].

  /// The force [N] on the phyxel from which x leads to the other one at rest; u: difference of
  /// their displacements [m]. It has the same bits, with the other sign, for (-x, -u).
  PHYXEL_HD Vec3<double> force(Vec3<double> x, Vec3<double> u) const {
    const Vec3<double> apart = x + u;
    const double length = sqrt(dot(apart, apart));
    if (!(length < rest) || length == 0) return {};
    return (-stiffness * (rest - length) / length) * apart;
  }
  /// The half of its energy [J] that belongs to one of the two.
  PHYXEL_HD double energy(Vec3<double> x, Vec3<double> u) const {
    const Vec3<double> apart = x + u;
    const double nearer = rest - sqrt(dot(apart, apart));
    return nearer > 0 ? 0.25 * stiffness * nearer * nearer : 0;
  }
};

/// The closed pair of two phyxels that have broken from each other.
/// @param modulus_i,modulus_j M of pressure waves in the material of each [Pa]
/// @param volume_i,volume_j their volumes when whole [m³]. @param x leads from one to the other at
/// rest [m]
PHYXEL_HD ClosedPair closed_pair(double modulus_i, double volume_i, double modulus_j,
                                 double volume_j, Vec3<double> x) {
  using std::cbrt;
  using std::sqrt;
  const double spacing_i = cbrt(volume_i), spacing_j = cbrt(volume_j), apart = sqrt(dot(x, x));
  const double spacing = spacing_i < spacing_j ? spacing_j : spacing_i;
  return {closed_share * 0.5 * (modulus_i + modulus_j) * spacing,
          spacing < apart ? spacing : apart};
}

/// The energy by which the forces of a phyxel follow from displacements.
struct PointEnergy {
  double elastic = 0;    ///< Of its whole volume [J].
  double hourglass = 0;  ///< Of hourglass control [J].
};

/// The share of its volume with which a phyxel carries stress once it has lost pairs: as much of
/// `share` as its energy allows. The gradient that fits fewer neighbours may be the larger one, of
/// debris above all, and breaking must not make energy, which would break more. What the phyxel has
/// lost does not come back.
/// @param share the share before, or `carried_share` if that is less. @param elastic elastic energy
/// of its whole volume by the pairs that are left [J]. @param available what the phyxel had before,
/// less the energy of hourglass control that is left [J]
PHYXEL_HD double share_after_break(double share, double elastic, double available) {
  if (share * elastic <= available) return share;
  const double left = available / elastic;
  return left > 0 ? left : 0;
}

/// What breaking has made of the energy of a phyxel.
struct BreakOfPoint {
  double carried = 1;  ///< The share of its volume with which it carries stress now.
  double before = 0;   ///< Its energy before [J].
  double after = 0;    ///< Its energy after [J].
};

/// The energies of a phyxel before and after it has lost pairs at displacements that do not change.
/// @param had the share of its volume with which it carried stress. @param before its energy with
/// the pairs that it had. @param most `carried_share` of the pairs that are left. @param after its
/// energy with these
PHYXEL_HD BreakOfPoint break_of_point(double had, const PointEnergy& before, double most,
                                      const PointEnergy& after) {
  BreakOfPoint result;
  result.before = had * before.elastic + before.hourglass;
  result.carried =
      share_after_break(most < had ? most : had, after.elastic, result.before - after.hourglass);
  result.after = result.carried * after.elastic + after.hourglass;
  return result;
}

/// The energy of a phyxel of an elastic law, hourglass control included.
/// @param for_each for_each(visit) calls visit(x, u, w) for the neighbours that the phyxel is bound
/// to, with x_ij [m], u_ij [m] and w_ij
/// @param point its constants, with its whole volume. @param response_of response_of(∇u) is the
/// `PointResponse` of its material
template <class ForEach, class ResponseOf>
PHYXEL_HD PointEnergy point_energy(const ForEach& for_each, const PointConstants<double>& point,
                                   const ResponseOf& response_of) {
  NeighbourSums<double> sums;
  for_each([&](Vec3<double> x, Vec3<double> u, double w) { sums.template add<true>(x, u, w); });
  const Mat3<double> fit = displacement_gradient(sums.gradient, point.inverse_moment);
  const auto response = response_of(WithClosing::gradient(fit, sums, point));
  double residual = 0;
  for_each([&](Vec3<double> x, Vec3<double> u, double w) { add_residual(residual, u, fit, x, w); });
  return {point.volume * (response.strain_energy + response.volume_energy),
          hourglass_energy(point.hourglass, residual)};
}

}  // namespace phyxel
