/// The kernels. Displacements have the inverse mass of their node as w.
#pragma once

#include <cstdint>

#include "lattice.cuh"
#include "tiles.cuh"

namespace fem {

constexpr int block_threads = 256;  ///< Threads of a block, except in `step_resident`.

/// Computes the forces f of an element. @param corner receives its nodes
template <class Element>
__device__ __forceinline__ void compute_element(int element, int elements,
                                                const int* __restrict__ corners,
                                                const float* __restrict__ numbers,
                                                const float4* __restrict__ displacements,
                                                int corner[Element::nodes], float (*f)[3]) {
  constexpr int quads = Element::nodes / 4;
  float u[Element::nodes][3], d[Element::numbers];
  for (int a = 0; a < quads; ++a) {
    reinterpret_cast<int4*>(corner)[a] =
        reinterpret_cast<const int4*>(corners)[std::int64_t(element) * quads + a];
  }
  for (int i = 0; i < Element::numbers; ++i) {
    d[i] = numbers[std::int64_t(i) * elements + element];
  }
  for (int a = 0; a < Element::nodes; ++a) {
    const float4 w = displacements[corner[a]];
    u[a][0] = w.x;
    u[a][1] = w.y;
    u[a][2] = w.z;
  }
  Element::forces(u, d, f);
}

/// Adds the forces of each element to those of its nodes.
template <class Element>
__global__ void __launch_bounds__(block_threads)
    add_forces(int elements, const int* __restrict__ corners, const float* __restrict__ numbers,
               const float4* __restrict__ displacements, float4* forces) {
  const int e = blockIdx.x * block_threads + threadIdx.x;
  if (e >= elements) return;
  int corner[Element::nodes];
  float f[Element::nodes][3];
  compute_element<Element>(e, elements, corners, numbers, displacements, corner, f);
  for (int a = 0; a < Element::nodes; ++a) {
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 900
    atomicAdd(&forces[corner[a]], make_float4(f[a][0], f[a][1], f[a][2], 0.f));
#else
    atomicAdd(&forces[corner[a]].x, f[a][0]);
    atomicAdd(&forces[corner[a]].y, f[a][1]);
    atomicAdd(&forces[corner[a]].z, f[a][2]);
#endif
  }
}

/// Moves each node by its force, and sets the force to zero.
static __global__ void __launch_bounds__(block_threads)
    move_nodes(int nodes, float4* displacements, float4* velocities, float4* forces, Step step) {
  const int a = blockIdx.x * block_threads + threadIdx.x;
  if (a >= nodes) return;
  float4 u = displacements[a], v = velocities[a];
  const float4 f = forces[a];
  advance(u, v, f.x, f.y, f.z, step);
  displacements[a] = u;
  velocities[a] = v;
  forces[a] = make_float4(0, 0, 0, 0);
}

/// Writes the forces of each element at its corners.
template <class Element>
__global__ void __launch_bounds__(block_threads)
    write_forces(int elements, const int* __restrict__ corners, const float* __restrict__ numbers,
                 const float4* __restrict__ displacements, float4* corner_forces) {
  const int e = blockIdx.x * block_threads + threadIdx.x;
  if (e >= elements) return;
  int corner[Element::nodes];
  float f[Element::nodes][3];
  compute_element<Element>(e, elements, corners, numbers, displacements, corner, f);
  for (int a = 0; a < Element::nodes; ++a) {
    corner_forces[std::int64_t(e) * Element::nodes + a] =
        make_float4(f[a][0], f[a][1], f[a][2], 0.f);
  }
}

/// Moves each node by the sum of forces at it. @param first, items as in `CornersAtNodes`
static __global__ void __launch_bounds__(block_threads)
    gather_forces(int nodes, const int* __restrict__ first, const int* __restrict__ items,
                  const float4* __restrict__ corner_forces, float4* displacements,
                  float4* velocities, Step step) {
  const int a = blockIdx.x * block_threads + threadIdx.x;
  if (a >= nodes) return;
  float4 u = displacements[a], v = velocities[a];
  float fx = 0, fy = 0, fz = 0;
  for (int i = first[a]; i < first[a + 1]; ++i) {
    const float4 f = corner_forces[items[i]];
    fx += f.x;
    fy += f.y;
    fz += f.z;
  }
  advance(u, v, fx, fy, fz, step);
  displacements[a] = u;
  velocities[a] = v;
}

/// Advances a tile in each block. @param stride, force_stride as in `TileStrides`
template <class Element>
__global__ void __launch_bounds__(block_threads)
    step_tiles(TileView tiles, int stride, int force_stride,
               const float4* __restrict__ displacements, float4* __restrict__ moved,
               float4* velocities, Step step) {
  extern __shared__ float near[];
  float* forces = near + 3 * stride;
  const int tile = blockIdx.x, begin = tile * tiles.own;
  const int owned = min(tiles.own, tiles.nodes - begin);
  load_tile<Element>(tiles, tile, threadIdx.x, block_threads, displacements, near, stride);
  __syncthreads();
  compute_tile<Element>(tiles, tile, threadIdx.x, block_threads, near, stride, forces,
                        force_stride);
  __syncthreads();
  for (int s = threadIdx.x; s < owned; s += block_threads) {
    float f[3];
    sum_tile(tiles, tile, s, forces, force_stride, f);
    float4 u = displacements[begin + s], v = velocities[begin + s];
    advance(u, v, f[0], f[1], f[2], step);
    moved[begin + s] = u;
    velocities[begin + s] = v;
  }
}

/// Advances a body that is one tile by many steps in one block. A thread has a node, and the data
/// of its elements in registers.
/// @tparam threads of the block. @tparam most elements of a thread
template <class Element, int threads, int most>
__global__ void __launch_bounds__(threads, 1)
    step_resident(TileView tiles, int stride, int force_stride, float4* displacements,
                  float4* velocities, Step step, int steps) {
  extern __shared__ float near[];
  float* forces = near + 3 * stride;
  const int elements = tiles.head[0].elements, thread = threadIdx.x;
  float4 u = make_float4(0, 0, 0, 0), v = u;
  if (thread < tiles.nodes) {
    u = displacements[thread];
    v = velocities[thread];
  }
  float d[most][Element::numbers];
  int corner[most][Element::nodes];
  for (int q = 0; q < most; ++q) {
    const int e = thread + q * threads;
    if (e < elements) {
      for (int i = 0; i < Element::numbers; ++i) d[q][i] = tiles.numbers[i * elements + e];
      for (int a = 0; a < Element::nodes; ++a) corner[q][a] = tiles.corner[a * elements + e];
    }
  }
  for (int k = 0; k < steps; ++k) {
    if (thread < tiles.nodes) {
      near[thread] = u.x;
      near[stride + thread] = u.y;
      near[2 * stride + thread] = u.z;
    }
    __syncthreads();
    for (int q = 0; q < most; ++q) {
      const int e = thread + q * threads;
      if (e < elements) {
        float p[Element::nodes][3], f[Element::nodes][3];
        for (int a = 0; a < Element::nodes; ++a) {
          for (int i = 0; i < 3; ++i) p[a][i] = near[i * stride + corner[q][a]];
        }
        Element::forces(p, d[q], f);
        for (int a = 0; a < Element::nodes; ++a) {
          for (int i = 0; i < 3; ++i) forces[i * force_stride + a * elements + e] = f[a][i];
        }
      }
    }
    __syncthreads();
    if (thread < tiles.nodes) {
      float f[3];
      sum_tile(tiles, 0, thread, forces, force_stride, f);
      advance(u, v, f[0], f[1], f[2], step);
    }
  }
  if (thread < tiles.nodes) {
    displacements[thread] = u;
    velocities[thread] = v;
  }
}

/// Advances 4 x 8 x 8 nodes of a lattice in each block.
static __global__ void __launch_bounds__(Lattice::block)
    step_lattice(Lattice lattice, const float4* __restrict__ displacements,
                 float4* __restrict__ moved, float4* velocities, Step step) {
  using L = Lattice;
  extern __shared__ float near[];
  float* forces = near + 3 * L::near;
  const int x = blockIdx.z * L::block_x, y = blockIdx.y * L::block_y, z = blockIdx.x * L::block_z;
  const int thread = threadIdx.x, a = thread / (L::block_y * L::block_z),
            b = thread / L::block_z % L::block_y, c = thread % L::block_z;
  const int i = x + a, j = y + b, k = z + c;
  load_block(lattice, x, y, z, thread, L::block, displacements, near);
  __syncthreads();
  compute_block(lattice, x, y, z, thread, L::block, near, forces);
  __syncthreads();
  if (i > lattice.along || j > lattice.across || k > lattice.across) return;
  float f[3];
  sum_block(a, b, c, forces, f);
  const std::int64_t number = lattice.number(i, j, k);
  float4 u = displacements[number], v = velocities[number];
  advance(u, v, f[0], f[1], f[2], step);
  moved[number] = u;
  velocities[number] = v;
}

}  // namespace fem
