/// The paper's body structure (section 5.1) and the arrays that its text implies.
#pragma once

#include <cuda_runtime.h>

namespace phyxel::paper {

/// "The final body structure that holds all the phyxel attributes", field by field; `Real` is the
/// paper's float, or double in the proofs. All pointers are device memory.
template <class Real>
struct CuBody {
  Real* d_positions_masses;      ///< x, y, z [m] and mass [kg], shape [n, 4]; a mass of 0 is fixed.
  Real* d_displacements_volume;  ///< u [m] and volume [m³], shape [n, 4].
  Real* d_forces;                ///< [N], shape [n, n, 3]: row i holds the forces that i exerts;
                                 ///< calcStrainStressB stores the total force on i at (i, i).
  Real* d_momentMatrices;        ///< A⁻¹ [m], shape [n, 3, 3].
  int numPhyxels;
  int maxNeighbors;
  unsigned short* d_neighbors;  ///< Shape [maxNeighbors, n]: slot k of phyxel i at k·n + i.
  Real* d_omega;                ///< ω_ij [1/m³], same shape.
  Real* d_gradui;               ///< Rows ∇u, ∇v, ∇w, shape [n, 3, 3].
  Real* d_lastDisplacements;    ///< u(t - Δt) [m], shape [n, 3].
};

/// Value of an unused neighbour slot.
inline constexpr unsigned short no_neighbor = 0xFFFF;

/// Inverse neighbourhood: "all phyxels that have a certain phyxel P as a neighbor".
struct CuInverse {
  int* d_offsets;             ///< Shape [n + 1].
  unsigned short* d_phyxels;  ///< Phyxels that have P as a neighbour, ascending.
  unsigned short* d_slots;    ///< Slot of P in each of their lists (for the CSR gather).
};

/// Arrays of the CSR gather, which replace the n×n matrix of `d_forces`.
template <class Real>
struct CuGather {
  Real* d_pairStress;  ///< -v P A⁻¹, shape [n, 3, 3].
  Real* d_ownForces;   ///< Total forces [N], shape [n, 3]; calcStrainStressB stores them.
};

/// The surfels. Weights and carriers are in slots, as the neighbours of phyxels.
template <class Real>
struct CuSurfels {
  Real* d_positions;  ///< Rest positions [m], shape [n_surfels, 3].
  Real* d_normals;    ///< Rest normals, shape [n_surfels, 3].
  int numSurfels;
  int maxNeighbors;
  unsigned short* d_neighbors;  ///< Shape [maxNeighbors, n_surfels].
  Real* d_omega;                ///< Weights, same shape.
  Real* d_vertexBuffer;         ///< Interleaved normals and positions (OpenGL's GL_N3F_V3F).
};

/// Textures of read-only arrays.
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
/// Double has no texels: one number is fetched as two integers, four numbers as two texels.
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
