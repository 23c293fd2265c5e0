#include "model/cloud_piece.hpp"

#include <algorithm>

#include "model/assembly.hpp"
#include "shapes/lattice_shapes.hpp"

namespace phyxel {

CloudPiece cut_piece(Cloud cloud, Piece piece) {
  const auto whole = static_cast<Offset>(cloud.position.size());
  const Offset first = whole * piece.number / piece.of,
               last = whole * (piece.number + 1) / piece.of;
  const auto cut = [&](auto& values) {
    if (values.empty()) return;
    values = {values.begin() + first, values.begin() + last};
  };
  cut(cloud.position);
  cut(cloud.volume);
  for (auto& [name, members] : cloud.regions) {
    std::vector<Index> here;
    const auto begin = std::lower_bound(members.begin(), members.end(), first),
               end = std::lower_bound(begin, members.end(), last);
    for (auto i = begin; i != end; ++i) here.push_back(*i - static_cast<Index>(first));
    members = here;
  }
  return {std::move(cloud), static_cast<Index>(first), static_cast<Index>(whole)};
}

CloudPiece rest_piece(const BodySource& source, Piece piece) {
  const std::optional<ShapeRequest> lattice = lattice_of(source);
  return lattice ? make_lattice_shape(*lattice, piece) : cut_piece(rest_cloud(source), piece);
}

}  // namespace phyxel
