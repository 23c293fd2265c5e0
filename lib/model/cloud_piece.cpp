#include "model/cloud_piece.hpp"

#include <xxhash.h>

#include <algorithm>
#include <array>

namespace phyxel {

CloudPiece cut_piece(const Cloud& cloud, Piece piece) {
  const auto whole = static_cast<Offset>(cloud.position.size());
  const Offset first = whole * piece.number / piece.of,
               last = whole * (piece.number + 1) / piece.of;
  const auto cut = [&](const auto& values) -> std::decay_t<decltype(values)> {
    if (values.empty()) return {};
    return {values.begin() + first, values.begin() + last};
  };
  CloudPiece made{{cut(cloud.position), cut(cloud.volume), cloud.surface, {}},
                  static_cast<Index>(first),
                  static_cast<Index>(whole)};
  made.cloud.lattice = cloud.lattice;
  made.cloud.spacing = cut(cloud.spacing);
  made.cloud.cuts = cloud.cuts;
  for (const auto& [name, members] : cloud.regions) {
    std::vector<Index>& here = made.cloud.regions[name];
    const auto begin = std::lower_bound(members.begin(), members.end(), first),
               end = std::lower_bound(begin, members.end(), last);
    for (auto i = begin; i != end; ++i) here.push_back(*i - static_cast<Index>(first));
  }
  return made;
}

std::uint64_t cloud_digest(const Cloud& cloud) {
  std::uint64_t digest = 0;
  const auto add = [&](const auto& values) {
    digest = XXH3_64bits_withSeed(values.data(), values.size() * sizeof(values[0]), digest);
  };
  add(cloud.position);
  add(cloud.volume);
  if (!cloud.spacing.empty()) add(cloud.spacing);
  add(cloud.surface.position);
  add(cloud.surface.triangle);
  add(std::array{static_cast<double>(cloud.cuts.list.size()), cloud.cuts.depth});
  for (const auto& [name, members] : cloud.regions) {
    add(name);
    add(members);
  }
  return digest;
}

}  // namespace phyxel
