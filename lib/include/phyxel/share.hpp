/// One rank's share of a model that several ranks step together.
#pragma once

#include <memory>
#include <vector>

#include "phyxel/communicator.hpp"
#include "phyxel/halo.hpp"
#include "phyxel/types.hpp"

namespace phyxel {

/// What a share knows of the whole. Of each body it has the phyxels that it owns, then ghosts whose
/// stresses are found here, too, then ghosts whose stresses are not (see `Part`).
struct Share {
  Index whole = 0;            ///< Phyxels of the whole model.
  std::vector<Index> number;  ///< Which of them each phyxel is, shape [n].
  std::vector<char> owned;    ///< Whether each is no ghost, shape [n].
  /// Where each is in the whole model's tiles (`Tiling::place`), shape [n]; empty: no GPU steps
  /// this.
  std::vector<Index> place;
  std::vector<Index> surfel_number;  ///< Which of the whole model's surfels each surfel is.
  /// 1: ghosts' stresses come from their owners. 2: displacements of two rings of ghosts do, and
  /// the inner ring's stresses are found twice.
  int rings = 1;
  const Communicator* communicator =
      nullptr;  ///< Of all ranks that share the model; outlives this.
  std::shared_ptr<const HaloPlan> halo;
  std::shared_ptr<HaloTransport> transport;
};

}  // namespace phyxel
