/// The paper's body structure (section 5.1), and what its text needs beside it.
#pragma once

#include <cuda_runtime.h>

namespace phyxel::paper {

/// "The final body structure that holds all the phyxel attributes", field by field; `Real` is the
/// paper's float, or double in the proofs. All pointers are device memory.
template <class Real>
struct CuBody {
  Real* d_positions_masses;      ///< x, y, z [m] and mass [kg], shape [n, 4]; mass 0: held.
  Real* d_displacements_volume;  ///< u [m] and volume [m³], shape [n, 4].
  Real* d_forces;                ///< [N], shape [n, n, 3]: row i holds the forces that i applies,
                                 ///< on itself at (i, i), where calcStrainStressB leaves the sum.
  Real* d_momentMatrices;        ///< A⁻¹ [m], shape [n, 3, 3].
  int numPhyxels;
  int maxNeighbors;
  unsigned short* d_neighbors;  ///< Shape [maxNeighbors, n]: slot k of phyxel i at k·n + i.
  Real* d_omega;                ///< ω_ij [1/m³], same shape.
  Real* d_gradui;               ///< ∇u, ∇v, ∇w one after the other, shape [n, 3, 3].
  Real* d_lastDisplacements;    ///< u(t - Δt) [m], shape [n, 3].
};

/// Marks an unused neighbour slot.
inline constexpr unsigned short no_neighbor = 0xFFFF;

/// Inverse neighbourhood: "all phyxels that have a certain phyxel P as a neighbor".
struct CuInverse {
  int* d_offsets;             ///< Shape [n + 1].
  unsigned short* d_phyxels;  ///< Who, ascending.
  unsigned short* d_slots;    ///< In which of their slots (for the CSR gather).
};

/// What replaces d_forces' n×n matrix in the CSR gather.
template <class Real>
struct CuGather {
  Real* d_pairStress;  ///< -v P A⁻¹, shape [n, 3, 3].
  Real* d_ownForces;   ///< Shape [n, 3]; calcStrainStressB leaves the sum here.
};

/// The mesh. Weights and carriers in slots like those of the neighbours.
template <class Real>
struct CuSurfels {
  Real* d_positions;  ///< At rest [m], shape [n_surfels, 3].
  Real* d_normals;    ///< At rest, shape [n_surfels, 3].
  int numSurfels;
  int maxNeighbors;
  unsigned short* d_neighbors;  ///< Shape [maxNeighbors, n_surfels].
  Real* d_omega;                ///< Same shape.
  Real* d_vertexBuffer;         ///< Normal and position, interleaved (OpenGL's GL_N3F_V3F).
};

/// Read-only data through the texture cache.
struct CuTextures {
  cudaTextureObject_t positions_masses, displacements_volume, omega, surfel_omega;
};

template <class Real>
struct Vector4;
template <>
struct Vector4<float> {
  using type = float4;
  using texel = float4;
  using texel1 = float;
  static __device__ float4 fetch(cudaTextureObject_t t, int i) { return tex1Dfetch<float4>(t, i); }
  static __device__ float fetch1(cudaTextureObject_t t, int i) { return tex1Dfetch<float>(t, i); }
};
/// Textures have no texels of double: one is fetched as two integers, four as two texels.
template <>
struct Vector4<double> {
  struct alignas(16) type {
    double x, y, z, w;
  };
  using texel = int4;
  using texel1 = int2;
  static __device__ type fetch(cudaTextureObject_t t, int i) {
    const int4 a = tex1Dfetch<int4>(t, 2 * i), b = tex1Dfetch<int4>(t, 2 * i + 1);
    return {__hiloint2double(a.y, a.x), __hiloint2double(a.w, a.z), __hiloint2double(b.y, b.x),
            __hiloint2double(b.w, b.z)};
  }
  static __device__ double fetch1(cudaTextureObject_t t, int i) {
    const int2 a = tex1Dfetch<int2>(t, i);
    return __hiloint2double(a.y, a.x);
  }
};

}  // namespace phyxel::paper
