/// The kernels of Farias et al. 2008, section 5.1, by their names, independent of the production
/// kernels. docs/paper.md lists what the paper leaves open and how each gap was filled.
///
/// Each phyxel (or surfel) has a thread, and each launch steps one body. Indices are multiplied by
/// 24-bit products, since 32-bit products took four times as long on a GPU of 2008.
#pragma once

#include "cu_body.cuh"
#include "phyxel/physics/moment.hpp"
#include "phyxel/physics/strain.hpp"
#include "phyxel/physics/surfel.hpp"
#include "phyxel/physics/weight.hpp"

namespace phyxel::paper {

/// C of equation (5), 6×6, "stored in constant device memory".
__constant__ float c_material_float[36];
__constant__ double c_material_double[36];

template <class Real>
__device__ Real material(int entry) {
  if constexpr (sizeof(Real) == sizeof(float)) {
    return c_material_float[entry];
  } else {
    return c_material_double[entry];
  }
}

__device__ inline int thread_index() {
  return static_cast<int>(__umul24(blockIdx.x, blockDim.x) + threadIdx.x);
}

template <class Real>
__device__ Vec3<Real> xyz(typename Vector4<Real>::type v) {
  return {v.x, v.y, v.z};
}

template <class Real>
__device__ Vec3<Real> load3(const Real* array, std::size_t i) {
  return {array[3 * i], array[3 * i + 1], array[3 * i + 2]};
}
template <class Real>
__device__ void store3(Real* array, std::size_t i, Vec3<Real> v) {
  array[3 * i] = v.x;
  array[3 * i + 1] = v.y;
  array[3 * i + 2] = v.z;
}
template <class Real>
__device__ Mat3<Real> load9(const Real* array, int i) {
  const Real* from = array + __mul24(i, 9);
  Mat3<Real> m;
  for (int e = 0; e < 9; ++e) m(e / 3, e % 3) = from[e];
  return m;
}
template <class Real>
__device__ void store9(Real* array, int i, const Mat3<Real>& m) {
  Real* to = array + __mul24(i, 9);
  for (int e = 0; e < 9; ++e) to[e] = m(e / 3, e % 3);
}

/// Entry (i, j) of the n×n matrix. The product of two 16-bit numbers fits 32 bits, but three times
/// the product does not.
__device__ inline std::size_t matrix_entry(int i, int j, int n) {
  return __umul24(static_cast<unsigned>(i), static_cast<unsigned>(n)) + static_cast<unsigned>(j);
}

/// Computes weights, inverse moment matrix and volume of each phyxel, once.
template <class Real>
__global__ void precalcImutableValues(CuBody<Real> body, CuTextures textures,
                                      const Real* d_supports) {
  const int i = thread_index(), n = body.numPhyxels;
  if (i >= n) return;
  using Fetch = Vector4<Real>;
  const auto x_m = Fetch::fetch(textures.positions_masses, i);
  const Real h = d_supports[i];
  const Real inverse_h_squared = Real(1) / (h * h);
  const Real at_centre = Real(315.0 / (64.0 * 3.14159265358979323846)) / (h * h * h);
  Sym3<Real> moment;
  Real density = x_m.w * at_centre;  // [M] includes the phyxel itself in the sum
  for (int k = 0; k < body.maxNeighbors; ++k) {
    const int slot = __mul24(k, n) + i;
    const int j = body.d_neighbors[slot];
    if (j == no_neighbor) break;
    const auto y_m = Fetch::fetch(textures.positions_masses, j);
    const Vec3<Real> x_ij = xyz<Real>(y_m) - xyz<Real>(x_m);
    const Real w = at_centre * weight_shape(dot(x_ij, x_ij), inverse_h_squared);
    body.d_omega[slot] = w;
    moment += moment_term(x_ij, w);
    density += y_m.w * w;
  }
  store9(body.d_momentMatrices, i, full(pseudo_inverse(moment).matrix));
  body.d_displacements_volume[__mul24(i, 4) + 3] = x_m.w / density;
}

/// Equation (4): six stresses from six strains by the full tensor, zeros included.
template <class Real>
__device__ Sym3<Real> hooke(const Sym3<Real>& strain) {
  const Real e[6] = {strain.xx, strain.yy, strain.zz, strain.xy, strain.yz, strain.xz};
  Real s[6];
  for (int row = 0; row < 6; ++row) {
    s[row] = Real(0);
    for (int column = 0; column < 6; ++column)
      s[row] += material<Real>(row * 6 + column) * e[column];
  }
  return {s[0], s[3], s[5], s[1], s[4], s[2]};
}

/// Force of phyxel i on the neighbour at x_ij [N], with q = -v P A⁻¹. Fused products are explicit,
/// so that each caller gets the same bits.
template <class Real>
__device__ Vec3<Real> force_on_neighbor(const Mat3<Real>& q, Vec3<Real> x_ij, Real w) {
  const Vec3<Real> wx = w * x_ij;
  return {fma(q(0, 2), wx.z, fma(q(0, 1), wx.y, q(0, 0) * wx.x)),
          fma(q(1, 2), wx.z, fma(q(1, 1), wx.y, q(1, 0) * wx.x)),
          fma(q(2, 2), wx.z, fma(q(2, 1), wx.y, q(2, 0) * wx.x))};
}

/// Computes strain and stress of each phyxel, and stores the forces that it exerts on its
/// neighbours in the matrix (`dense`), or its pair stress (CSR gather).
template <class Real, bool green, bool dense>
__global__ void calcStrainStressA(CuBody<Real> body, CuGather<Real> gather, CuTextures textures) {
  const int i = thread_index(), n = body.numPhyxels;
  if (i >= n) return;
  using Fetch = Vector4<Real>;
  const Vec3<Real> x_i = xyz<Real>(Fetch::fetch(textures.positions_masses, i));
  const auto u_v = Fetch::fetch(textures.displacements_volume, i);
  const Vec3<Real> u_i = xyz<Real>(u_v);

  Mat3<Real> sum;
  for (int k = 0; k < body.maxNeighbors; ++k) {
    const int slot = __mul24(k, n) + i;
    const int j = body.d_neighbors[slot];
    if (j == no_neighbor) break;
    const Vec3<Real> x_ij = xyz<Real>(Fetch::fetch(textures.positions_masses, j)) - x_i;
    const Vec3<Real> u_ij = xyz<Real>(Fetch::fetch(textures.displacements_volume, j)) - u_i;
    add_gradient_term(sum, u_ij, Fetch::fetch1(textures.omega, slot) * x_ij);
  }
  const Mat3<Real> inverse_moment = load9(body.d_momentMatrices, i);
  const Mat3<Real> grad_u = sum * inverse_moment;
  store9(body.d_gradui, i, grad_u);

  Mat3<Real> piola;
  if constexpr (green) {
    const Sym3<Real> stress = hooke(green_strain(grad_u));
    piola = full(stress) + grad_u * stress;
  } else {
    piola = full(hooke(cauchy_strain(grad_u)));
  }
  const Mat3<Real> q = (-u_v.w) * (piola * inverse_moment);

  Vec3<Real> own;
  for (int k = 0; k < body.maxNeighbors; ++k) {
    const int slot = __mul24(k, n) + i;
    const int j = body.d_neighbors[slot];
    if (j == no_neighbor) break;
    const Vec3<Real> x_ij = xyz<Real>(Fetch::fetch(textures.positions_masses, j)) - x_i;
    const Vec3<Real> force = force_on_neighbor(q, x_ij, Fetch::fetch1(textures.omega, slot));
    if constexpr (dense) store3(body.d_forces, matrix_entry(i, j, n), force);
    own -= force;
  }
  if constexpr (dense) {
    store3(body.d_forces, matrix_entry(i, i, n), own);
  } else {
    store9(gather.d_pairStress, i, q);
    store3(gather.d_ownForces, i, own);
  }
}

/// Sums the forces on each phyxel over its inverse neighbourhood: column i of the matrix.
template <class Real>
__global__ void calcStrainStressB(CuBody<Real> body, CuInverse inverse) {
  const int i = thread_index(), n = body.numPhyxels;
  if (i >= n) return;
  Vec3<Real> sum = load3(body.d_forces, matrix_entry(i, i, n));
  for (int k = inverse.d_offsets[i]; k < inverse.d_offsets[i + 1]; ++k) {
    sum += load3(body.d_forces, matrix_entry(inverse.d_phyxels[k], i, n));
  }
  store3(body.d_forces, matrix_entry(i, i, n), sum);
}

/// Sums the forces on each phyxel in the same order without the matrix, evaluating each force.
template <class Real>
__global__ void calcStrainStressB_csr(CuBody<Real> body, CuInverse inverse, CuGather<Real> gather,
                                      CuTextures textures) {
  const int i = thread_index(), n = body.numPhyxels;
  if (i >= n) return;
  using Fetch = Vector4<Real>;
  const Vec3<Real> x_i = xyz<Real>(Fetch::fetch(textures.positions_masses, i));
  Vec3<Real> sum = load3(gather.d_ownForces, i);
  for (int k = inverse.d_offsets[i]; k < inverse.d_offsets[i + 1]; ++k) {
    const int j = inverse.d_phyxels[k];
    const Vec3<Real> x_ji = x_i - xyz<Real>(Fetch::fetch(textures.positions_masses, j));
    const Real w = Fetch::fetch1(textures.omega, __mul24(inverse.d_slots[k], n) + j);
    sum += force_on_neighbor(load9(gather.d_pairStress, j), x_ji, w);
  }
  store3(gather.d_ownForces, i, sum);
}

/// A step of Verlet's method in displacements (reference 29 of the paper). A phyxel of mass 0 is
/// fixed.
template <class Real, bool dense>
__global__ void integrate(CuBody<Real> body, CuGather<Real> gather, CuTextures textures,
                          Vec3<Real> gravity, Real dt_squared) {
  const int i = thread_index(), n = body.numPhyxels;
  if (i >= n) return;
  using Fetch = Vector4<Real>;
  const Real mass = Fetch::fetch(textures.positions_masses, i).w;
  if (mass == Real(0)) return;
  const Vec3<Real> force =
      dense ? load3(body.d_forces, matrix_entry(i, i, n)) : load3(gather.d_ownForces, i);
  const auto u_v = Fetch::fetch(textures.displacements_volume, i);
  const Vec3<Real> u = xyz<Real>(u_v);
  const Vec3<Real> last = load3(body.d_lastDisplacements, i);
  const Vec3<Real> next = u + ((u - last) + dt_squared * (force / mass + gravity));
  store3(body.d_lastDisplacements, i, u);
  using Four = typename Vector4<Real>::type;
  reinterpret_cast<Four*>(body.d_displacements_volume)[i] = {next.x, next.y, next.z, u_v.w};
}

/// Equation (6), "added with the original positions to fill the OpenGL vertex buffer"; normals
/// follow the cofactor of the same weighted gradient.
template <class Real>
__global__ void updateSurfels(CuBody<Real> body, CuSurfels<Real> surfels, CuTextures textures) {
  const int s = thread_index();
  if (s >= surfels.numSurfels) return;
  using Fetch = Vector4<Real>;
  const Vec3<Real> x_s = load3(surfels.d_positions, s);
  SurfelBlend<Real> blend;
  for (int k = 0; k < surfels.maxNeighbors; ++k) {
    const int slot = __mul24(k, surfels.numSurfels) + s;
    const int i = surfels.d_neighbors[slot];
    if (i == no_neighbor) break;
    blend.add(Fetch::fetch1(textures.surfel_omega, slot),
              xyz<Real>(Fetch::fetch(textures.displacements_volume, i)), load9(body.d_gradui, i),
              x_s - xyz<Real>(Fetch::fetch(textures.positions_masses, i)));
  }
  const Vec3<Real> normal = blend.surfel_normal(load3(surfels.d_normals, s));
  const Real length = sqrt(dot(normal, normal));
  store3(surfels.d_vertexBuffer, 2 * static_cast<std::size_t>(s), (Real(1) / length) * normal);
  store3(surfels.d_vertexBuffer, 2 * static_cast<std::size_t>(s) + 1,
         x_s + blend.surfel_displacement());
}

}  // namespace phyxel::paper
