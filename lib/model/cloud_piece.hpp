/// Clouds made piece by piece, for ranks none of which is to have the whole.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "phyxel/cloud.hpp"

namespace phyxel {

struct Piece {
  int number = 0, of = 1;
};

/// Consecutive phyxels of a cloud, and all of its surface.
struct CloudPiece {
  Cloud cloud;  ///< Regions count from the first phyxel of the piece.
  Index first = 0, whole = 0;
};

/// The phyxels [first, second) of a piece. @param size number of phyxels of the whole cloud
std::pair<Offset, Offset> range_of(Piece piece, Index size);
/// The members of a region among the phyxels [first, last), counted from `first`.
std::vector<Index> members_within(const std::vector<Index>& members, Offset first, Offset last);

/// A piece of a cloud that there is.
CloudPiece cut_piece(const Cloud& cloud, Piece piece);

/// A number that tells two clouds apart.
std::uint64_t cloud_digest(const Cloud& cloud);

}  // namespace phyxel
