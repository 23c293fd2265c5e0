/// Neighbour lists of tiles, found on the device by a spatial hash.
#pragma once

#include <string>

#include "setup/device_neighbours.cuh"
#include "setup/device_tiling.hpp"

namespace phyxel::cuda {

/// Data on the device from which the lists of a model are found. It must outlive the search.
struct ListSource {
  NeighbourSource near;
  const Index* phyxel_at;   ///< Phyxel at each place, or -1.
  const Index* place_of;    ///< Place of each phyxel in the whole model's tiles, shape [n].
  const Index* tile_begin;  ///< First place of each tile in the whole model's tiles.
  /// Places in the whole model, ascending, and the same phyxels' places in a share; null for a
  /// whole model.
  const Index *whole_place, *place_here;
  Index here;        ///< Number of phyxels of the share.
  Index tiles;       ///< Number of tiles that get lists.
  std::string what;  ///< Name of the lists in messages about memory.
};

/// Finds the lists of all tiles.
/// @param longest length of the longest list
/// @throws DeviceError; InputError if a tile reaches more points than 16-bit slots can address
DeviceTileLists find_lists(const ListSource& source, Index longest);

/// The largest of some values; 0 if there are none.
Index largest(const DeviceArray<Index>& values);

}  // namespace phyxel::cuda
