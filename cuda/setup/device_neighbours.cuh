/// The neighbours of a model's phyxels on a device.
#pragma once

#include <optional>

#include "phyxel/model.hpp"
#include "phyxel/physics/moment.hpp"
#include "phyxel/physics/weight.hpp"
#include "setup/device_hash.cuh"

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

/// The moment of a phyxel's neighbours.
struct Moments {
  Sym3d moment;  ///< Σ w x xᵀ [m²]
  Vec3d offset;  ///< Σ w x [m]
};
/// The moments of phyxel i, from those of its neighbours for which each(visit) calls visit(j).
template <class Each>
__device__ Moments moments_by(const NeighbourSource& near, Index i, Each&& each) {
  const double inverse_h_squared = 1 / (near.support[i] * near.support[i]);
  Moments found;
  each([&](Index j) {
    const Vec3d x = near.position[j] - near.position[i];
    const double w = weight_shape(dot(x, x), inverse_h_squared);
    found.moment += moment_term(x, w);
    found.offset += w * x;
  });
  return found;
}
/// The moments of phyxel i, summed in the order of global ids, as the host sums.
/// @param global_id of each phyxel; null if it is the phyxel itself
__device__ inline Moments moments_of(const NeighbourSource& near, Index i, const Index* global_id) {
  const auto each = [&](auto&& offer) { near.visit(i, offer); };
  return moments_by(near, i, [&](auto&& visit) { in_ascending_order(global_id, each, visit); });
}

/// Rows of lists.
struct DeviceRows {
  DeviceArray<Offset> offsets;
  DeviceArray<Index> indices;
};

/// Neighbours of a model's phyxels: by a search, or from lists that the host made.
struct Neighbours {
  DeviceArray<Vec3d> position;  ///< Rest positions [m], shape [n].
  DeviceArray<double> support;  ///< [m], shape [n].
  std::optional<DeviceHash> table;
  DeviceArray<double> largest_support;  ///< Largest support of each body [m].
  DeviceRows lists, inverse_lists;

  NeighbourSource near() const {
    return {table ? table->view() : HashView{},
            position.data(),
            support.data(),
            nullptr,
            lists.offsets.data(),
            lists.indices.data()};
  }
  NeighbourSource inverse() const {
    return {table ? table->view() : HashView{},
            position.data(),
            support.data(),
            largest_support.data(),
            inverse_lists.offsets.data(),
            inverse_lists.indices.data()};
  }
};

/// Sends a model's lists to the device, or prepares a search there if it has none.
Neighbours neighbours_of(const Model& model);

/// Makes lists by a search, of own phyxels and in the order of global ids, as the host makes them.
/// @param owned nonzero for own phyxels; null: all are. @param global_id as in `moments_of`
DeviceRows rows_of(const NeighbourSource& near, Index phyxels, const char* owned,
                   const Index* global_id, const std::string& what);

}  // namespace phyxel::cuda
