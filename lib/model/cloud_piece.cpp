#include "model/cloud_piece.hpp"

#include <xxhash.h>

#include <algorithm>
#include <array>

namespace phyxel {

std::pair<Offset, Offset> range_of(Piece piece, Index size) {
  return {Offset{size} * piece.number / piece.of, Offset{size} * (piece.number + 1) / piece.of};
}

std::vector<Index> members_within(const std::vector<Index>& members, Offset first, Offset last) {
  const auto begin = std::lower_bound(members.begin(), members.end(), first),
             end = std::lower_bound(begin, members.end(), last);
  std::vector<Index> here;
  for (auto i = begin; i != end; ++i) here.push_back(*i - static_cast<Index>(first));
  return here;
}

CloudPiece cut_piece(const Cloud& cloud, Piece piece) {
  const auto whole = static_cast<Index>(cloud.position.size());
  const auto [first, last] = range_of(piece, whole);
  const auto cut = [&, begin = first,
                    end = last](const auto& values) -> std::decay_t<decltype(values)> {
    if (values.empty()) return {};
    return {values.begin() + begin, values.begin() + end};
  };
  CloudPiece made{{cut(cloud.position), cut(cloud.volume), cloud.surface, {}},
                  static_cast<Index>(first),
                  whole};
  made.cloud.lattice = cloud.lattice;
  made.cloud.spacing = cut(cloud.spacing);
  made.cloud.cuts = cloud.cuts;
  for (const auto& [name, members] : cloud.regions) {
    made.cloud.regions[name] = members_within(members, first, last);
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
  if (!cloud.cuts.moved.empty()) add(std::array{static_cast<double>(cloud.cuts.moved.size())});
  for (const auto& [name, members] : cloud.regions) {
    add(name);
    add(members);
  }
  return digest;
}

}  // namespace phyxel
