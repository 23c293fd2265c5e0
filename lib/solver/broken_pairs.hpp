/// The broken pairs of a model's phyxels, and what follows from them for each phyxel: its moments,
/// the share of its volume that carries stress, and its energy.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <unordered_map>
#include <vector>

#include "exact_sum.hpp"
#include "model/parts.hpp"
#include "phyxel/backend.hpp"
#include "phyxel/model.hpp"
#include "phyxel/physics/fracture.hpp"
#include "phyxel/state.hpp"
#include "solver/part_law.hpp"

namespace phyxel {

/// Constants of a phyxel's stress, which change where pairs break.
struct PointBreakage {
  Sym3d inverse_moment;  ///< A⁻¹ [1/m²]
  Vec3d moment_offset;   ///< b [m]
  Vec3d closing;         ///< ĉ [1/m]; zero if a pair is broken, as an open neighbourhood is not
                         ///< closed.
  double carried = 1;    ///< Share of its volume that carries stress.
};

/// The broken pairs of the phyxels that this rank steps. It takes memory for these alone.
class BrokenPairs {
 public:
  /// @param model must outlive this
  explicit BrokenPairs(const Model& model) : model_(model) {}

  /// True if no pair is broken.
  bool empty() const { return broken_.empty(); }
  /// The neighbours from which phyxel i has broken, ascending; none if it has broken from none.
  std::span<const Index> of(Index i) const;
  /// The phyxels with broken pairs that this rank steps, ascending.
  std::vector<Index> phyxels() const;
  /// The pairs as of `State::broken`.
  std::vector<PhyxelPair> pairs() const;
  /// The phyxels that carry stress with less than their volume, as of `State::worn`.
  std::vector<WornPhyxel> worn() const;
  /// Replaces the pairs by those of a state, and what their phyxels carry.
  /// @throws InputError for a pair of phyxels that are not neighbours, for pairs out of order, and
  /// for a worn phyxel that has no broken pair
  void set(std::span<const PhyxelPair> pairs, std::span<const WornPhyxel> worn);
  /// Breaks phyxel i, which this rank steps, from neighbours that it was bound to.
  void add(Index i, std::span<const Index> neighbours);
  /// Sets the share of its volume with which phyxel i, which has broken pairs, carries stress.
  void set_carried(Index i, double carried) { broken_.at(i).carried = carried; }

  /// The constants of phyxel i now; without broken pairs those of the model.
  PointBreakage of_point(Index i) const;
  /// The share of the pairs of phyxel i that are broken.
  double share(Index i) const;
  /// Bytes of its lists.
  std::size_t bytes() const;

 private:
  /// The broken pairs of one phyxel.
  struct OfPhyxel {
    std::vector<Index> neighbours;  // it has broken from, ascending
    double carried = 1;             // no more than this
  };
  /// The indices of the pairs' phyxels by their global ids; -1 of those that are not here.
  std::unordered_map<Index, Index> indices_of(std::span<const PhyxelPair> pairs) const;

  const Model& model_;
  std::unordered_map<Index, OfPhyxel> broken_;
};

/// True for the bodies of the scene of which pairs that this rank has may break, shape [bodies].
std::vector<char> breaking_bodies(const Model& model);

/// The broken pairs of all ranks, ascending. Collective on a share.
/// @param here those of this rank
std::vector<PhyxelPair> joined_pairs(const Model& model, std::vector<PhyxelPair> here);

/// The pairs of broken phyxels that push apart where cracks are closed.
class CrackFaces {
 public:
  /// @param model must outlive this
  explicit CrackFaces(const Model& model);

  /// Calls use(pair, x, u) for the neighbours from which phyxel i has broken, in the order of its
  /// list, with x and u of `ClosedPair`. @param displacement displacement(j) [m]
  template <class DisplacementOf, class Use>
  void for_each(Index i, const BrokenPairs& broken, DisplacementOf&& displacement,
                Use&& use) const {
    const std::span<const Index> gone = broken.of(i);
    const Vec3d u_i = displacement(i);
    for (const Index j : model_.neighbourhood.neighbours.row(i)) {
      if (!std::binary_search(gone.begin(), gone.end(), j)) continue;
      const Vec3d x = model_.position[j] - model_.position[i];
      use(closed_pair(modulus_of(i), model_.volume[i], modulus_of(j), model_.volume[j], x), x,
          displacement(j) - u_i);
    }
  }
  /// The energy of the closed cracks of phyxel i [J], likewise.
  template <class DisplacementOf>
  double energy(Index i, const BrokenPairs& broken, DisplacementOf&& displacement) const {
    double energy = 0;
    for_each(i, broken, displacement,
             [&](const ClosedPair& pair, Vec3d x, Vec3d u) { energy += pair.energy(x, u); });
    return energy;
  }

 private:
  double modulus_of(Index i) const {
    return moduli_[static_cast<std::size_t>(&part_of(model_, i) - model_.parts.data())];
  }

  const Model& model_;
  std::vector<double> moduli_;  // M of pressure waves of each part [Pa]
};

/// What broken pairs have left of each phyxel. @param displacement displacement(j) of phyxels of
/// broken pairs [m]
template <class DisplacementOf>
Breakage breakage_of(const Model& model, const BrokenPairs& broken, const CrackFaces& faces,
                     DisplacementOf&& displacement) {
  const auto size = static_cast<std::size_t>(model.size());
  Breakage now{std::vector<double>(size, 0), std::vector<double>(size, 1),
               std::vector<double>(size, 0)};
  for (const Index i : broken.phyxels()) {
    now.broken[i] = broken.share(i);
    now.carried[i] = broken.of_point(i).carried;
    now.closed[i] = faces.energy(i, broken, displacement);
  }
  return now;
}

/// The energies of single phyxels.
class PointEnergies {
 public:
  /// @param model must outlive this; its bodies have elastic laws
  explicit PointEnergies(const Model& model);

  /// The energy of phyxel i.
  /// @param broken pairs that do not count. @param at `broken.of_point(i)`. @param displacement
  /// displacement(j) [m] of i and its neighbours
  template <class DisplacementOf>
  PointEnergy of(Index i, const BrokenPairs& broken, const PointBreakage& at,
                 DisplacementOf&& displacement) const {
    std::vector<Vec3d> u;
    const std::span<const Index> row = model_.neighbourhood.neighbours.row(i);
    for (const Index j : row) u.push_back(displacement(j) - displacement(i));
    return of_row(i, broken, at, u);
  }

 private:
  /// @param u displacements of the neighbours relative to the phyxel [m]
  PointEnergy of_row(Index i, const BrokenPairs& broken, const PointBreakage& at,
                     std::span<const Vec3d> u) const;

  const Model& model_;
  std::vector<PartLaw> laws_;      // of each part
  std::vector<double> hourglass_;  // κ of each part [N/m]
};

}  // namespace phyxel
