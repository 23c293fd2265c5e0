/// One rank's share of a model that several ranks step together.
#pragma once

#include <memory>
#include <vector>

#include "phyxel/communicator.hpp"
#include "phyxel/halo.hpp"
#include "phyxel/types.hpp"

namespace phyxel {

/// What a rank's share knows of the whole model. Of each body it has the phyxels that it owns, then
/// its ghosts (see `Part`), whose displacements and stresses come from their owners.
struct Share {
  Index global_count = 0;        ///< Phyxels of the whole model.
  std::vector<Index> global_id;  ///< Index of each phyxel in the whole model, shape [n].
  std::vector<char> owned;       ///< False for ghosts, shape [n].
  /// Where each is in the whole model's tiles (`Tiling::place`), shape [n]; empty: no GPU steps
  /// this.
  std::vector<Index> place;
  std::vector<Index> global_surfel_id;  ///< Index of each surfel in the whole model.
  const Communicator* communicator =
      nullptr;  ///< Of all ranks that share the model; outlives this.
  std::shared_ptr<const HaloPlan> halo;
  std::shared_ptr<HaloTransport> transport;
};

}  // namespace phyxel
