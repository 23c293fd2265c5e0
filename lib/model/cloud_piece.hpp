/// Clouds made piece by piece, for ranks none of which is to have the whole.
#pragma once

#include "phyxel/cloud.hpp"
#include "phyxel/scene.hpp"

namespace phyxel {

struct Piece {
  int number = 0, of = 1;
};

/// Consecutive phyxels of a cloud, and all of its surface.
struct CloudPiece {
  Cloud cloud;  ///< Regions count from the first phyxel of the piece.
  Index first = 0, whole = 0;
};

/// A piece of `rest_cloud(source)`; all of them joined are the cloud. Lattices are made piece by
/// piece; other sources are made or read whole, and cut.
CloudPiece rest_piece(const BodySource& source, Piece piece);
/// A piece of a cloud that there is.
CloudPiece cut_piece(Cloud cloud, Piece piece);

}  // namespace phyxel
