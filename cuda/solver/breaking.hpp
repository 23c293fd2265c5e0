/// Pairs that break, in the tiles of a GPU. An entry of a list whose pair is broken is overwritten
/// by a null point, as those that fill short lists are, so that the two passes of a step do not
/// change. A second copy of the lists has all pairs, and so tells which are broken.
///
/// The functions here are the work of single threads; nothing that one of them writes is read by
/// another one in the same launch. They are compiled for the device and for the host, where tests
/// run them.
#pragma once

#include <cstdint>

#include "phyxel/physics/fracture.hpp"
#include "phyxel/physics/laws.hpp"
#include "phyxel/physics/row_moment.hpp"
#include "phyxel/physics/weight.hpp"
#include "setup/tiling.hpp"
#include "setup/wait_free.hpp"

namespace phyxel::cuda {

/// The lists of one pass, with and without broken pairs.
struct BreakingLists {
  const Index* halo = nullptr;  ///< As in `TileLists`.
  int halo_stride = 0;
  const TileLists::Row* rows = nullptr;
  std::uint16_t* entries = nullptr;      ///< As the passes read them.
  const std::uint16_t* whole = nullptr;  ///< The same with all pairs.

  /// The number of entries of a place, including null points.
  PHYXEL_HD int length(Index place) const { return rows[place / warp_size].length; }
  /// The index of entry e of a place in the arrays.
  PHYXEL_HD std::size_t at(Index place, int e) const {
    const auto lane =
        static_cast<std::size_t>(rows[place / warp_size].chunk + e / chunk) * warp_size +
        static_cast<std::size_t>(place % warp_size);
    return lane * chunk + static_cast<std::size_t>(e % chunk);
  }
  /// The place of the neighbour that an entry of a place names; -1 for a null point.
  PHYXEL_HD Index neighbour(Index place, std::uint16_t entry) const {
    const Index tile = place / tile_size, slot = entry / 16;
    if (slot < tile_size) return tile * tile_size + slot;
    if (slot < tile_size + far_slots) return -1;
    return halo[static_cast<std::size_t>(tile) * static_cast<std::size_t>(halo_stride) +
                static_cast<std::size_t>(slot - tile_size - far_slots)];
  }
  /// The entry of a null point that the lane of a place reads without conflicts.
  PHYXEL_HD static std::uint16_t null_entry(Index place) {
    return static_cast<std::uint16_t>(16 * (tile_size + place % columns));
  }
  /// Calls visit(index in the arrays, neighbour) for the pairs of a place that are not broken, in
  /// the order of its list.
  template <class Visit>
  PHYXEL_HD void for_each_bound(Index place, Visit&& visit) const {
    for (int e = 0; e < length(place); ++e) {
      const std::size_t k = at(place, e);
      if (const Index j = neighbour(place, entries[k]); j >= 0) visit(k, j);
    }
  }
  /// Calls visit(neighbour) for all pairs of a place, likewise.
  template <class Visit>
  PHYXEL_HD void for_each_whole(Index place, Visit&& visit) const {
    for (int e = 0; e < length(place); ++e) {
      if (const Index j = neighbour(place, whole[at(place, e)]); j >= 0) visit(j);
    }
  }
  /// Calls visit(neighbour) for the pairs of a place that are broken, likewise.
  template <class Visit>
  PHYXEL_HD void for_each_broken(Index place, Visit&& visit) const {
    for (int e = 0; e < length(place); ++e) {
      const std::size_t k = at(place, e);
      if (entries[k] == whole[k]) continue;
      visit(neighbour(place, whole[k]));
    }
  }
  /// Overwrites the entries of a place that name a neighbour. @returns their number
  PHYXEL_HD int cut(Index place, Index neighbour_place) const {
    int cut = 0;
    for_each_bound(place, [&](std::size_t k, Index j) {
      if (j != neighbour_place) return;
      entries[k] = null_entry(place);
      ++cut;
    });
    return cut;
  }
};

/// Constants of a part of a body for pairs that break.
struct BreakingPart {
  double law[Laws::most_constants + 2];  ///< As in `ChosenLaw::constants`.
  int law_index = 0;                     ///< Index in `Laws`.
  double hourglass = 0;                  ///< κ [N/m]
  double inverse_h_squared = 0;          ///< [1/m²]; -1/H² with weights of pairs.
  double modulus = 0;                    ///< M of pressure waves [Pa].
  int body = 0;                          ///< Number of its body in the scene.
  bool breaks = false;                   ///< True if pairs of its body may break.
  bool pulls = false;  ///< True if the first pass sets forces of hourglass control.
};

/// The arrays of a model whose pairs break, by tile slot.
template <class Real>
struct BreakingView {
  BreakingLists first, second;  ///< Of both passes; `second` has no rows if `first` serves both.
  const BreakingPart* parts = nullptr;
  const Index* part_of_tile = nullptr;  ///< Of tiles of ghosts, too.
  std::size_t places = 0;
  const double* volume = nullptr;  ///< When whole [m³].
  const Real* growth = nullptr;    ///< As of `Fracture`, or null if no pair breaks in steps.
  const Real* supports = nullptr;  ///< `Fields::inverse_h_squared`.
  const Real* before = nullptr;  ///< Displacements at the start of the step, [3, places], or null.
  double* carried = nullptr;     ///< What each phyxel carries, as `BrokenPairs::set_carried` says.
  Index* lost = nullptr;         ///< The number of broken pairs of each phyxel.
  char* lost_in_tile = nullptr;  ///< Nonzero for tiles with broken pairs.
  // Of `Fields`.
  Real* moment_constants = nullptr;
  Real* force_constants = nullptr;
  Real* closing = nullptr;

  PHYXEL_HD const BreakingPart& part(Index place) const {
    return parts[part_of_tile[place / tile_size]];
  }
  PHYXEL_HD Vec3<Real> column(const Real* array, Index place) const {
    const auto at = static_cast<std::size_t>(place);
    return {array[at], array[places + at], array[2 * places + at]};
  }
  PHYXEL_HD void set_column(Real* array, Index place, Vec3<double> v) const {
    const auto at = static_cast<std::size_t>(place);
    array[at] = static_cast<Real>(v.x);
    array[places + at] = static_cast<Real>(v.y);
    array[2 * places + at] = static_cast<Real>(v.z);
  }
  /// The weight of a pair at a distance r [m].
  PHYXEL_HD double weight(Index place, Index neighbour, double r_squared) const {
    const double inverse = part(place).inverse_h_squared;
    if (inverse < 0) {
      return pair_weight(r_squared, static_cast<double>(supports[place]),
                         static_cast<double>(supports[neighbour]), -inverse);
    }
    return weight_shape_anywhere(r_squared, inverse);
  }
};

/// What a look at the pairs of a phyxel has found.
template <class Real>
struct Look {
  Real squared_slack = Real(0);  ///< The least of its pairs (`squared_slack`) [m²].
  bool breaks = false;           ///< True if a pair breaks.
};

/// The excess of a pair's squared length (`excess_growth`); 0 if it never breaks. Both ends of a
/// pair find it by this function, and so alike.
/// @param growth receives that of the pair
template <class Real, class Point>
PHYXEL_HD Real excess_of_pair(const BreakingView<Real>& v, Index i, const Point& of_i, Index j,
                              const Point& of_j, Real& growth) {
  growth = growth_of_pair(v.growth[i], v.growth[j]);
  const Real excess = excess_growth(of_j.x - of_i.x, of_j.u - of_i.u, growth);
  return growth > Real(0) ? excess : Real(0);
}

/// Looks at the pairs of the phyxel at a place. @param point_at point_at(place) has its position x
/// at rest and its present displacement u
template <class Real, class PointAt>
PHYXEL_HD Look<Real> look_at(const BreakingView<Real>& v, const PointAt& point_at, Index i) {
  Look<Real> look;
  look.squared_slack = std::numeric_limits<Real>::max();
  if (!(v.growth[i] > Real(0))) return look;
  const auto of_i = point_at(i);
  v.first.for_each_bound(i, [&](std::size_t, Index j) {
    const auto of_j = point_at(j);
    Real growth;
    const Real excess = excess_of_pair(v, i, of_i, j, of_j, growth);
    if (!(growth > Real(0))) return;
    if (excess > Real(0)) {
      look.breaks = true;
      return;
    }
    const Real slack =
        squared_slack(of_j.x - of_i.x, excess, growth, std::numeric_limits<Real>::epsilon());
    look.squared_slack = slack < look.squared_slack ? slack : look.squared_slack;
  });
  return look;
}
/// The distance by which pairs may lengthen without breaking [m]. @param squared_slack of `Look`
template <class Real>
PHYXEL_HD double slack_of(Real squared_slack) {
  using std::sqrt;
  return 0.5 * (1 - 1e-5) * sqrt(static_cast<double>(squared_slack));
}

/// Sums over the pairs of a phyxel, broken ones included or not.
template <bool whole, class Real, class PointAt>
PHYXEL_HD RowMoment moment_of(const BreakingView<Real>& v, const PointAt& point_at, Index i) {
  RowMoment sums;
  const auto x_i = to<double>(point_at(i).x);
  const auto add = [&](Index j) {
    const auto x = to<double>(point_at(j).x) - x_i;
    sums.add(x, v.weight(i, j, dot(x, x)));
  };
  if constexpr (whole) {
    v.first.for_each_whole(i, add);
  } else {
    v.first.for_each_bound(i, [&](std::size_t, Index j) { add(j); });
  }
  return sums;
}

/// Moments of a phyxel by the pairs that are not broken.
struct LeftMoments {
  PseudoInverse<double> inverse;  ///< A⁻¹ [1/m²]
  Vec3<double> offset;            ///< b [m]
};
template <class Real, class PointAt>
PHYXEL_HD LeftMoments left_moments(const BreakingView<Real>& v, const PointAt& point_at, Index i) {
  const RowMoment sums = moment_of<false>(v, point_at, i);
  return {pseudo_inverse(sums.moment), sums.offset};
}

/// The energy of a phyxel by the pairs that are not broken. @param displacement displacement(place)
/// [m]. @param closing ĉ [1/m]
template <class Real, class PointAt, class DisplacementOf>
PHYXEL_HD PointEnergy energy_of(const BreakingView<Real>& v, const PointAt& point_at, Index i,
                                const LeftMoments& moments, Vec3<double> closing,
                                const DisplacementOf& displacement) {
  const BreakingPart& part = v.part(i);
  const auto x_i = to<double>(point_at(i).x), u_i = displacement(i);
  const auto for_each = [&](const auto& visit) {
    v.first.for_each_bound(i, [&](std::size_t, Index j) {
      const auto x = to<double>(point_at(j).x) - x_i;
      visit(x, displacement(j) - u_i, v.weight(i, j, dot(x, x)));
    });
  };
  const PointConstants<double> constants{v.volume[i], moments.inverse.matrix, part.hourglass,
                                         moments.offset, closing};
  return point_energy(for_each, constants, [&](const Mat3<double>& grad_u) {
    return response_after_step<double>(
        part.law_index, part.law, grad_u, [](int) { return 0.0; }, 0.0);
  });
}

/// Writes what the stress of a phyxel that has lost pairs depends on.
template <class Real>
PHYXEL_HD void write_constants(const BreakingView<Real>& v, Index i, const LeftMoments& now,
                               double carried) {
  const Sym3<double>& a = now.inverse.matrix;
  const double moments[] = {a.xx, a.xy, a.xz, a.yy, a.yz, a.zz, carried * v.volume[i]};
  for (std::size_t r = 0; r < 7; ++r) {
    v.moment_constants[r * v.places + static_cast<std::size_t>(i)] = static_cast<Real>(moments[r]);
  }
  v.set_column(v.force_constants, i, now.offset);
  if (v.closing) v.set_column(v.closing, i, {});
}

/// Makes the constants of a phyxel that has lost pairs.
template <class Real, class PointAt>
PHYXEL_HD void remake_constants(const BreakingView<Real>& v, const PointAt& point_at, Index i) {
  const LeftMoments now = left_moments(v, point_at, i);
  const double most =
      carried_share(now.inverse, pseudo_inverse(moment_of<true>(v, point_at, i).moment));
  write_constants(v, i, now, most < v.carried[i] ? most : v.carried[i]);
  v.lost_in_tile[i / tile_size] = 1;
}

/// Breaks the phyxel at a place from the neighbours that are stretched too far.
/// @param in_step true at the end of a step of Verlet's method, of which the middle counts for
/// energies. @param add_energy add_energy(E) adds an energy that is taken [J]
template <class Real, class PointAt, class AddEnergy>
PHYXEL_HD void break_from(const BreakingView<Real>& v, const PointAt& point_at, bool in_step,
                          Index i, AddEnergy&& add_energy) {
  const auto displacement = [&](Index j) {
    const auto now = to<double>(point_at(j).u);
    return in_step ? 0.5 * (to<double>(v.column(v.before, j)) + now) : now;
  };
  const PseudoInverse<double> intact = pseudo_inverse(moment_of<true>(v, point_at, i).moment);
  const LeftMoments had = left_moments(v, point_at, i);
  const bool was_whole = v.lost[i] == 0;
  const Vec3<double> closing =
      was_whole && v.closing ? to<double>(v.column(v.closing, i)) : Vec3<double>{};
  double carried = 1;
  if (!was_whole) {
    const double most = carried_share(had.inverse, intact);
    carried = most < v.carried[i] ? most : v.carried[i];
  }
  const PointEnergy before = energy_of(v, point_at, i, had, closing, displacement);
  const auto of_i = point_at(i);
  v.first.for_each_bound(i, [&](std::size_t k, Index j) {
    Real growth;
    if (!(excess_of_pair(v, i, of_i, j, point_at(j), growth) > Real(0))) return;
    v.first.entries[k] = BreakingLists::null_entry(i);
    if (v.second.rows) v.second.cut(i, j);
    ++v.lost[i];
  });
  const LeftMoments has = left_moments(v, point_at, i);
  const PointEnergy after = energy_of(v, point_at, i, has, Vec3<double>{}, displacement);
  const BreakOfPoint made =
      break_of_point(carried, before, carried_share(has.inverse, intact), after);
  v.carried[i] = made.carried;
  v.lost_in_tile[i / tile_size] = 1;
  write_constants(v, i, has, made.carried);
  add_energy(made.before);
  add_energy(-made.after);
}

/// The force of closed cracks on a phyxel [N].
template <class Real, class PointAt>
PHYXEL_HD Vec3<double> closed_force(const BreakingView<Real>& v, const PointAt& point_at, Index i) {
  Vec3<double> force;
  const auto of_i = point_at(i);
  v.first.for_each_broken(i, [&](Index j) {
    const auto of_j = point_at(j);
    const auto x = to<double>(of_j.x) - to<double>(of_i.x);
    const ClosedPair pair =
        closed_pair(v.part(i).modulus, v.volume[i], v.part(j).modulus, v.volume[j], x);
    force += pair.force(x, to<double>(of_j.u) - to<double>(of_i.u));
  });
  return force;
}

/// How far a tile's pairs have come near breaking.
struct TileWatch {
  double apart = 0;      ///< By how much pairs can have lengthened since the state was put in [m].
  double next_look = 0;  ///< `apart` at which the pairs are looked at again [m].
};

}  // namespace phyxel::cuda
