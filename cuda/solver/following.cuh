/// Loads on the GPU that follow the surface.
#pragma once

#include <vector>

#include "phyxel/physics/follower.hpp"
#include "solver/passes.cuh"

namespace phyxel::cuda {

/// Adds the present forces of loads that follow the surface. One block per tile of a list.
/// @param rest their forces at rest [N], shape [3, places]
/// @param gradient displacement gradients of the phyxels of the listed tiles, shape
/// [9, tiles * tile_size]
template <class Real>
__global__ void add_following(Real* load, std::size_t places, const Real* rest,
                              const Index* tile_of_block, const Real* gradient,
                              std::size_t stride) {
  const std::size_t place = place_of(tile_of_block[blockIdx.x]);
  const Vec3<Real> f = column3(rest, places, place);
  if (f.x == Real(0) && f.y == Real(0) && f.z == Real(0)) return;
  const std::size_t at = place_of(static_cast<Index>(blockIdx.x));
  Mat3<Real> grad_u;
  for (int e = 0; e < 9; ++e) grad_u(e / 3, e % 3) = gradient[e * stride + at];
  set_column3(load, places, place, column3(load, places, place) + following_force(grad_u, f));
}

/// The tiles of a model whose loads follow the surface, and room for the gradients there.
template <class Real, class StateReal>
class FollowingLoads {
 public:
  /// @param places tile slots of the phyxels on which such loads act
  FollowingLoads(DeviceModel<Real, StateReal>& model, const std::vector<Index>& places)
      : m_(model) {
    std::vector<Index> tiles;
    for (const Index place : places) tiles.push_back(place / tile_size);
    std::sort(tiles.begin(), tiles.end());
    tiles.erase(std::unique(tiles.begin(), tiles.end()), tiles.end());
    tiles_ = sent(tiles, "tiles of loads that follow the surface");
    gradients_ = {9 * stride(), "gradients for loads that follow the surface"};
  }

  /// Adds their forces at the present displacements to the loads.
  void add(const Passes<Real, StateReal>& passes) const {
    const auto tiles = static_cast<Index>(tiles_.size());
    if (tiles == 0) return;
    passes.put_gradients({gradients_.data(), stride(), tiles_.data()}, tiles);
    m_.launch_blocks("add_following", add_following<Real>, static_cast<unsigned>(tiles), 0, false,
                     m_.loads(), m_.places(), static_cast<const Real*>(m_.fields().following),
                     static_cast<const Index*>(tiles_.data()),
                     static_cast<const Real*>(gradients_.data()), stride());
  }
  std::size_t bytes() const { return tiles_.bytes() + gradients_.bytes(); }

 private:
  std::size_t stride() const { return tiles_.size() * static_cast<std::size_t>(tile_size); }

  DeviceModel<Real, StateReal>& m_;
  DeviceArray<Index> tiles_;
  DeviceArray<Real> gradients_;
};

}  // namespace phyxel::cuda
