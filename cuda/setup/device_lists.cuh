/// Neighbour lists of tiles, found on the device by a spatial hash.
#pragma once

#include <string>

#include "setup/device_hash.cuh"
#include "setup/device_tiling.hpp"

namespace phyxel::cuda {

/// Calls visit(j, x_j - x_i) for each neighbour j of the phyxel; or, if `inverse_reach` is the
/// largest support of each body, for each phyxel that has it as a neighbour.
template <class Visit>
__device__ void visit_neighbours(const HashView& hash, int body, Index phyxel, Vec3d here,
                                 const double* support, const double* inverse_reach,
                                 Visit&& visit) {
  const double h = support[phyxel];
  hash.visit_near(body, here, inverse_reach ? inverse_reach[body] : h,
                  [&](std::uint32_t k, Vec3d p) {
                    const Vec3d x = p - here;
                    const Index j = hash.index[k];
                    const double reach = inverse_reach ? support[j] : h;
                    if (j != phyxel && dot(x, x) < reach * reach && hash.is_of(body, k)) {
                      visit(j, x);
                    }
                  });
}

/// Neighbours of phyxels, or phyxels that have them as neighbours: searched for by a hash, or read
/// from lists that the host made.
struct NeighbourSource {
  HashView hash;
  const Vec3d* position;        ///< Rest positions [m], shape [n].
  const double* support;        ///< [m], shape [n].
  const double* inverse_reach;  ///< Largest support of each body [m]; null: lists of neighbours.
  const Offset* offsets;        ///< Of the rows of lists, shape [n + 1]; null: no lists.
  const Index* rows;

  /// Calls visit(j) for each neighbour j of phyxel i.
  template <class Visit>
  __device__ void visit(Index i, Visit&& visit) const {
    if (offsets) {
      for (Offset e = offsets[i]; e < offsets[i + 1]; ++e) visit(rows[e]);
    } else {
      visit_neighbours(hash, hash.body_of(i), i, position[i], support, inverse_reach,
                       [&](Index j, Vec3d) { visit(j); });
    }
  }
  /// The k-th phyxel in an order in which those that follow one another lie together.
  __device__ Index in_order(std::int64_t k) const {
    return offsets ? static_cast<Index>(k) : hash.index[k];
  }
};

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
