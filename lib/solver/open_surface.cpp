#include "phyxel/open_surface.hpp"

#include <algorithm>

#include "model/nearest_carrier.hpp"
#include "rank_exchange.hpp"
#include "solver/crack_sides.hpp"
#include "solver/fragment_labels.hpp"

namespace phyxel {
namespace {

/// A surfel and the phyxel to which it belongs, by global ids.
struct Owned {
  Index surfel = 0, phyxel = -1;
  Index label = -1;  ///< Label of the phyxel's fragment.
};

/// The surfels of the whole model, in its order, on the first rank; none on other ranks.
std::vector<Owned> surfels_of_all(const Model& model, const std::vector<Index>& label) {
  std::vector<Owned> here;
  for (Index s = 0; s < static_cast<Index>(model.surfels.position.size()); ++s) {
    const Index nearest = nearest_carrier(model, s);
    const Index id = model.share ? model.share->global_surfel_id[s] : s;
    here.push_back(nearest < 0 ? Owned{id} : Owned{id, model.global_id(nearest), label[nearest]});
  }
  if (!model.share) return here;
  const Communicator& ranks = *model.share->communicator;
  std::vector<std::vector<Owned>> sent(static_cast<std::size_t>(ranks.size()));
  sent.front() = std::move(here);
  std::vector<Owned> all;
  for (const std::vector<Owned>& of_rank : exchanged(ranks, sent)) {
    for (const Owned& one : of_rank) {
      all.resize(std::max(all.size(), static_cast<std::size_t>(one.surfel) + 1));
      all[one.surfel] = one;
    }
  }
  return all;
}

}  // namespace

std::optional<std::vector<Triangle>> uncut_triangles(const Model& model,
                                                     std::span<const Triangle> all,
                                                     std::span<const PhyxelPair> broken) {
  if (broken.empty() || model.global_surfel_count() == 0) return std::nullopt;
  const std::vector<Owned> surfels = surfels_of_all(model, fragment_labels(model, broken));
  if (surfels.empty()) return std::nullopt;
  const auto is_cut = [&](Index a, Index b) {
    const Owned &x = surfels[a], &y = surfels[b];
    return x.label != y.label || std::binary_search(broken.begin(), broken.end(),
                                                    PhyxelPair{std::min(x.phyxel, y.phyxel),
                                                               std::max(x.phyxel, y.phyxel)});
  };
  std::vector<Triangle> uncut;
  for (const Triangle& t : all) {
    if (!is_cut(t[0], t[1]) && !is_cut(t[1], t[2]) && !is_cut(t[2], t[0])) uncut.push_back(t);
  }
  if (uncut.size() == all.size()) return std::nullopt;
  return uncut;
}

}  // namespace phyxel
