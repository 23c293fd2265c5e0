/// A regular lattice of bricks, which needs no index or element data. A block of threads advances
/// 4 x 8 x 8 nodes: it reads 6 x 10 x 10 of them and computes 5 x 9 x 9 elements.
#pragma once

#include <cstdint>

#include "mesh.cuh"

namespace fem {

/// A lattice of bricks and the constants of one, as in `brick_modes`.
struct Lattice {
  /// Nodes that a block of threads advances.
  static constexpr int block_x = 4, block_y = 8, block_z = 8;
  static constexpr int block = block_x * block_y * block_z;
  /// Nodes that it reads.
  static constexpr int near_x = block_x + 2, near_y = block_y + 2, near_z = block_z + 2;
  static constexpr int near = near_x * near_y * near_z;
  /// Elements that it computes.
  static constexpr int elements_x = block_x + 1, elements_y = block_y + 1, elements_z = block_z + 1;
  static constexpr int elements = elements_x * elements_y * elements_z;
  static constexpr int shared_floats = 3 * near + 24 * elements;

  int along, across;  ///< Cells.
  float J, V, k;

  /// The number of a node.
  FEM_HD std::int64_t number(int x, int y, int z) const {
    return (std::int64_t(x) * (across + 1) + y) * (across + 1) + z;
  }
};

inline Lattice make_lattice(const Mesh& mesh) {
  float d[Brick::numbers];
  Brick::prepare_cube(mesh.cell, d);
  return {mesh.along, mesh.across, d[0], d[Brick::volume], d[Brick::stiffness]};
}

// The phases of a block's step, as in tiles.cuh. (x, y, z) is the first node of the block.

/// Copies the displacements u of a block to `near`, shape [3, near_x, near_y, near_z].
FEM_HD void load_block(const Lattice& lattice, int x, int y, int z, int thread, int threads,
                       const float4* u, float* near) {
  using L = Lattice;
  for (int s = thread; s < L::near; s += threads) {
    const int i = x - 1 + s / (L::near_y * L::near_z), j = y - 1 + s / L::near_z % L::near_y,
              k = z - 1 + s % L::near_z;
    float4 value = {0, 0, 0, 0};
    if (i >= 0 && i <= lattice.along && j >= 0 && j <= lattice.across && k >= 0 &&
        k <= lattice.across) {
      value = u[lattice.number(i, j, k)];
    }
    near[s] = value.x;
    near[L::near + s] = value.y;
    near[2 * L::near + s] = value.z;
  }
}

/// Computes the forces of a block's elements at their corners, shape [3, 8, elements].
FEM_HD void compute_block(const Lattice& lattice, int x, int y, int z, int thread, int threads,
                          const float* near, float* forces) {
  using L = Lattice;
  for (int e = thread; e < L::elements; e += threads) {
    const int a = e / (L::elements_y * L::elements_z), b = e / L::elements_z % L::elements_y,
              c = e % L::elements_z;
    const int i = x - 1 + a, j = y - 1 + b, k = z - 1 + c;
    if (i < 0 || i >= lattice.along || j < 0 || j >= lattice.across || k < 0 ||
        k >= lattice.across) {
      for (int q = 0; q < 24; ++q) forces[q * L::elements + e] = 0;
      continue;
    }
    const int s = (a * L::near_y + b) * L::near_z + c;
    float w[3][8];
    for (int p = 0; p < 3; ++p) {
      for (int q = 0; q < 8; ++q) {
        w[p][q] = near[p * L::near + s + (q & 1) * L::near_y * L::near_z +
                       (q >> 1 & 1) * L::near_z + (q >> 2 & 1)];
      }
      corners_to_modes(w[p]);
    }
    brick_modes<false>(w, &lattice.J, nullptr, lattice.V, lattice.k);
    for (int p = 0; p < 3; ++p) {
      modes_to_corners(w[p]);
      for (int q = 0; q < 8; ++q) forces[(p * 8 + q) * L::elements + e] = w[p][q];
    }
  }
}

/// Sums the forces at node (a, b, c) of a block.
FEM_HD void sum_block(int a, int b, int c, const float* forces, float sum[3]) {
  using L = Lattice;
  for (int p = 0; p < 3; ++p) {
    sum[p] = 0;
    for (int q = 0; q < 8; ++q) {
      const int i = a + 1 - (q & 1), j = b + 1 - (q >> 1 & 1), k = c + 1 - (q >> 2 & 1);
      sum[p] += forces[(p * 8 + q) * L::elements + (i * L::elements_y + j) * L::elements_z + k];
    }
  }
}

}  // namespace fem
