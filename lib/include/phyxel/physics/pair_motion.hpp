/// A bound of how far the phyxels of pairs move apart in a step, without a look at the pairs.
///
/// In a step a phyxel moves by Δu. A part ω × y of it, with y in the middle of the step, turns a
/// body without changing a length; of two phyxels the rests δ differ by as much as their distance
/// changes, at most: |d'|² - |d|² = 2 d_mid·(δ_j - δ_i), where d_mid is no longer than the mean of
/// |d| and |d'|. That holds for any ω; it is chosen for each body so that it turns with it. The δ
/// of a group of phyxels and of their neighbours lie in a box, whose diagonal is the bound.
#pragma once

#include <cmath>
#include <limits>

#include "phyxel/physics/moment.hpp"
#include "phyxel/types.hpp"

namespace phyxel {

/// The least box that holds the rests δ of some phyxels.
template <class Real>
struct MotionBox {
  static constexpr Real none = -std::numeric_limits<Real>::max();
  static constexpr int numbers = 8;
  /// The lower corner with the other sign and the upper corner [m], and the largest turning that
  /// was taken off [m], for rounding. The last number is not used.
  Real most[numbers] = {none, none, none, none, none, none, 0, 0};

  /// Adds the rest of one phyxel. @param x its place at rest [m]. @param before,now its
  /// displacements at both ends of the step [m]. @param omega ω times the step
  PHYXEL_HD void add(Vec3<Real> x, Vec3<Real> before, Vec3<Real> now, Vec3<Real> omega) {
    using std::abs;
    const Vec3<Real> middle = x + Real(0.5) * (before + now), turned = cross(omega, middle);
    add(0, now.x - before.x - turned.x);
    add(1, now.y - before.y - turned.y);
    add(2, now.z - before.z - turned.z);
    raise(6, abs(turned.x));
    raise(6, abs(turned.y));
    raise(6, abs(turned.z));
  }
  /// Adds all that another box holds.
  PHYXEL_HD void add(const MotionBox& other) {
    for (int k = 0; k < numbers; ++k) raise(k, other.most[k]);
  }
  /// Its diagonal, rounded up [m]; 0 if it holds nothing.
  PHYXEL_HD double diagonal() const {
    using std::sqrt;
    if (most[0] == none) return 0;
    double square = 0;
    for (int c = 0; c < 3; ++c) {
      const double length = static_cast<double>(most[c]) + static_cast<double>(most[3 + c]);
      square += length * length;
    }
    const double rounding = 16 * std::numeric_limits<Real>::epsilon() * most[6];
    return (1 + 1e-5) * sqrt(square) + rounding;
  }

 private:
  PHYXEL_HD void add(int c, Real value) {
    raise(c, -value);
    raise(3 + c, value);
  }
  PHYXEL_HD void raise(int k, Real value) {
    most[k] = where_larger(value, most[k], value, most[k]);
  }
};

/// Sums over some phyxels of a body, from which follows how the body turns.
struct TurningSums {
  double count = 0;
  Vec3<double> place, motion, moment;
  Sym3<double> squares;

  /// Adds a phyxel. @param middle its place in the middle of a step [m]. @param step how far it
  /// moves in the step [m]
  PHYXEL_HD void add(Vec3<double> middle, Vec3<double> step) {
    count += 1;
    place += middle;
    motion += step;
    moment += cross(middle, step);
    squares += moment_term(middle, 1.0);
  }
  /// Adds the sums over other phyxels.
  PHYXEL_HD void add(const TurningSums& other) {
    count += other.count;
    place += other.place;
    motion += other.motion;
    moment += other.moment;
    squares += other.squares;
  }
  /// The angle by which the body turns in the step, about each axis; zero of fewer than four
  /// phyxels.
  PHYXEL_HD Vec3<double> turning() const {
    if (count < 4) return {};
    const Vec3<double> centre = place / count;
    const Sym3<double> own = squares + moment_term(centre, -count);
    const double all = own.xx + own.yy + own.zz;
    const Sym3<double> inertia{all - own.xx, -own.xy, -own.xz, all - own.yy, -own.yz, all - own.zz};
    return pseudo_inverse(inertia).matrix * (moment - cross(centre, motion));
  }
};

}  // namespace phyxel
