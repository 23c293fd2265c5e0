/// Which phyxels that carry a surfel are on its side of all cracks.
#pragma once

#include <algorithm>
#include <utility>
#include <vector>

#include "model/nearest_carrier.hpp"
#include "phyxel/model.hpp"
#include "phyxel/state.hpp"

namespace phyxel {

/// The sides of the cracks of a model.
class CrackSides {
 public:
  /// Without any cracks.
  CrackSides() = default;
  /// @param broken the broken pairs of all ranks, ascending
  CrackSides(const Model& model, std::vector<PhyxelPair> broken) : broken_(std::move(broken)) {
    if (broken_.empty()) return;
    std::vector<Index> ids;
    for (const PhyxelPair& pair : broken_) ids.insert(ids.end(), pair.begin(), pair.end());
    std::sort(ids.begin(), ids.end());
    torn_.resize(static_cast<std::size_t>(model.size()));
    for (Index i = 0; i < model.size(); ++i) {
      torn_[i] = std::binary_search(ids.begin(), ids.end(), model.global_id(i));
    }
  }

  /// True if there are no cracks.
  bool empty() const { return broken_.empty(); }
  /// The broken pairs of all ranks, ascending.
  const std::vector<PhyxelPair>& broken() const { return broken_; }

  /// True if the phyxels with two global ids have broken from each other.
  bool are_parted(Index a, Index b) const {
    return std::binary_search(broken_.begin(), broken_.end(),
                              PhyxelPair{std::min(a, b), std::max(a, b)});
  }
  /// True if a carrier of a surfel has broken pairs.
  bool may_cut(const Model& model, Index surfel) const {
    const auto row = model.surfels.carriers.row(surfel);
    return !empty() && std::any_of(row.begin(), row.end(), [&](Index i) { return torn_[i]; });
  }
  /// True for those carriers of a surfel, in their order, that are on the side of the nearest one:
  /// carriers that have not broken from it, unless they are too far from it to be its neighbours
  /// and have broken from a neighbour of it.
  std::vector<char> on_side(const Model& model, Index surfel) const {
    const auto row = model.surfels.carriers.row(surfel);
    std::vector<char> kept(row.size(), 1);
    if (!may_cut(model, surfel)) return kept;
    const Index nearest = nearest_carrier(model, surfel);
    const auto parted = [&](Index i, Index j) {
      return torn_[i] && torn_[j] && are_parted(model.global_id(i), model.global_id(j));
    };
    std::vector<Index> neighbours{nearest};
    std::vector<std::size_t> far;
    for (std::size_t k = 0; k < row.size(); ++k) {
      kept[k] = !parted(nearest, row[k]);
      const double distance = norm(model.position[row[k]] - model.position[nearest]);
      if (distance >= model.neighbourhood.support[nearest]) {
        far.push_back(k);
      } else if (kept[k]) {
        neighbours.push_back(row[k]);
      }
    }
    for (const std::size_t k : far) {
      kept[k] = std::none_of(neighbours.begin(), neighbours.end(),
                             [&](Index i) { return parted(i, row[k]); });
    }
    return kept;
  }

 private:
  std::vector<PhyxelPair> broken_;
  std::vector<char> torn_;  // true for phyxels with broken pairs; empty without any
};

}  // namespace phyxel
