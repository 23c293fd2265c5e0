#include "solver/fragment_labels.hpp"

#include <algorithm>
#include <array>

#include "joined_over_ranks.hpp"
#include "model/ghosts.hpp"
#include "solver/broken_pairs.hpp"
#include "sort_unique.hpp"

namespace phyxel {
namespace {

/// Sets of indices that are joined. The smallest index of a set is its root.
class DisjointSets {
 public:
  explicit DisjointSets(std::size_t count) : parent_(count) {
    for (std::size_t k = 0; k < count; ++k) parent_[k] = k;
  }
  std::size_t root(std::size_t k) {
    while (parent_[k] != k) k = parent_[k] = parent_[parent_[k]];
    return k;
  }
  void join(std::size_t a, std::size_t b) {
    a = root(a), b = root(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<std::size_t> parent_;
};

/// Calls use(i, j) for the unbroken pairs of the phyxels i that this rank owns.
template <class Use>
void for_each_unbroken(const Model& model, const BrokenPairs& broken, Use&& use) {
  for (const Part& part : model.parts) {
    for (Index i = part.begin; i < part.owned_end(); ++i) {
      const std::span<const Index> gone = broken.of(i);
      for (const Index j : model.neighbourhood.neighbours.row(i)) {
        if (!std::binary_search(gone.begin(), gone.end(), j)) use(i, j);
      }
    }
  }
}

/// The labels of the phyxels that this rank owns, by pairs of two of these.
std::vector<Index> labels_here(const Model& model, const BrokenPairs& broken) {
  const auto n = static_cast<std::size_t>(model.size());
  DisjointSets sets(n);
  for_each_unbroken(model, broken, [&](Index i, Index j) {
    if (model.owns(j)) sets.join(static_cast<std::size_t>(i), static_cast<std::size_t>(j));
  });
  std::vector<Index> least(n, model.global_count());
  for (std::size_t i = 0; i < n; ++i) {
    Index& of_set = least[sets.root(i)];
    of_set = std::min(of_set, model.global_id(static_cast<Index>(i)));
  }
  std::vector<Index> label(n);
  for (std::size_t i = 0; i < n; ++i) label[i] = least[sets.root(i)];
  return label;
}

/// Replaces each of some labels by the least of those that links of all ranks connect with it.
void join_labels(const std::vector<std::array<Index, 2>>& links, std::vector<Index>& label) {
  std::vector<Index> linked;
  for (const auto& link : links) linked.insert(linked.end(), link.begin(), link.end());
  sort_unique(linked);
  const auto at = [&](Index of) {
    return static_cast<std::size_t>(std::lower_bound(linked.begin(), linked.end(), of) -
                                    linked.begin());
  };
  DisjointSets sets(linked.size());
  for (const auto& [a, b] : links) sets.join(at(a), at(b));
  for (Index& of : label) {
    if (std::binary_search(linked.begin(), linked.end(), of)) of = linked[sets.root(at(of))];
  }
}

}  // namespace

std::vector<Index> fragment_labels(const Model& model, std::span<const PhyxelPair> pairs) {
  BrokenPairs broken(model);
  broken.set(pairs, {});
  std::vector<Index> label = labels_here(model, broken);
  if (!model.share) return label;
  refresh_ghosts(*model.share, label);
  std::vector<std::array<Index, 2>> links;
  for_each_unbroken(model, broken, [&](Index i, Index j) {
    if (label[i] != label[j]) links.push_back({label[i], label[j]});
  });
  sort_unique(links);
  join_labels(joined_over_ranks(*model.share->communicator, links), label);
  return label;
}

}  // namespace phyxel
