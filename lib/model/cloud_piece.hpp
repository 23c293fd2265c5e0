/// Clouds made piece by piece, for ranks none of which is to have the whole.
#pragma once

#include <cstdint>

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

/// A piece of a cloud that there is.
CloudPiece cut_piece(const Cloud& cloud, Piece piece);

/// A number that tells two clouds apart.
std::uint64_t cloud_digest(const Cloud& cloud);

}  // namespace phyxel
