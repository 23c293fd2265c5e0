/// The largest stiffening of a phyxel relative to rest, found on the GPU.
#pragma once

#include <vector>

#include "solver/diagnose.cuh"
#include "solver/stiffest.hpp"

namespace phyxel::cuda {

/// `Stiffening` without initial values, for shared memory.
struct TileStiffening {
  double ratio, stretch;
  Index phyxel;
};

/// True if a is stiffer than b. Ties of the ratio go to the larger stretch, ties of the stretch to
/// the smaller id, as in `Stiffest`.
__device__ inline bool is_stiffer(const TileStiffening& a, const TileStiffening& b) {
  if (a.phyxel < 0 || b.phyxel < 0) return b.phyxel < 0;
  if (a.ratio != b.ratio) return a.ratio > b.ratio;
  if (a.stretch != b.stretch) return a.stretch > b.stretch;
  return a.phyxel < b.phyxel;
}

/// Finds the stiffest phyxel of each tile; -1 for a tile without phyxels.
/// @param gradient displacement gradients, nine rows
/// @param number_at global id of the phyxel in each tile slot
template <class Real, class StateReal>
__global__ void find_stiffest(const __grid_constant__ Fields<Real, StateReal> f,
                              const TileMaterial* materials, const Real* gradient,
                              const Index* number_at, TileStiffening* found) {
  __shared__ TileStiffening shared[diagnose_threads];
  TileStiffening mine{0, 0, -1};
  for (int part = 0; part < tile_size / diagnose_threads; ++part) {
    const std::size_t place =
        static_cast<std::size_t>(blockIdx.x) * tile_size + part * diagnose_threads + threadIdx.x;
    if (f.force_constants[3 * f.places + place] == Real(0)) continue;  // no phyxel has this slot
    const TileMaterial m = materials[blockIdx.x];
    Mat3<double> grad_u;
    for (int e = 0; e < 9; ++e) grad_u(e / 3, e % 3) = gradient[e * f.places + place];
    const PrincipalStretches<double> s = principal_stretches(grad_u);
    TileStiffening here{stiffening(m.law_index, m.law, m.volume_stiffness, s), s.largest,
                        number_at[place]};
    // A NaN counts as infinite.
    if (!(here.ratio < HUGE_VAL)) here.ratio = HUGE_VAL;
    if (!(here.stretch < HUGE_VAL)) here.stretch = HUGE_VAL;
    if (is_stiffer(here, mine)) mine = here;
  }
  shared[threadIdx.x] = mine;
  for (unsigned half = blockDim.x / 2; half > 0; half /= 2) {
    __syncthreads();
    if (threadIdx.x < half && is_stiffer(shared[threadIdx.x + half], shared[threadIdx.x])) {
      shared[threadIdx.x] = shared[threadIdx.x + half];
    }
  }
  if (threadIdx.x == 0) found[blockIdx.x] = shared[0];
}

}  // namespace phyxel::cuda
