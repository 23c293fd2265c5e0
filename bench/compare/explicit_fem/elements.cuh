/// The material and the two elements. An element has `nodes` nodes and `numbers` numbers that its
/// rest shape gives; `forces` takes displacements to forces.
#pragma once

#include <cmath>

#include "bar.cuh"

namespace fem {

/// Computes the first Piola-Kirchhoff stress of a St Venant-Kirchhoff material, times `scale`.
/// @param H gradient of the displacement
FEM_HD void stress(const float H[3][3], float scale, float P[3][3]) {
  float e[6];  // strains xx yy zz yz xz xy, the last three doubled
  e[0] = H[0][0] + 0.5f * (H[0][0] * H[0][0] + H[1][0] * H[1][0] + H[2][0] * H[2][0]);
  e[1] = H[1][1] + 0.5f * (H[0][1] * H[0][1] + H[1][1] * H[1][1] + H[2][1] * H[2][1]);
  e[2] = H[2][2] + 0.5f * (H[0][2] * H[0][2] + H[1][2] * H[1][2] + H[2][2] * H[2][2]);
  e[3] = H[1][2] + H[2][1] + H[0][1] * H[0][2] + H[1][1] * H[1][2] + H[2][1] * H[2][2];
  e[4] = H[0][2] + H[2][0] + H[0][0] * H[0][2] + H[1][0] * H[1][2] + H[2][0] * H[2][2];
  e[5] = H[0][1] + H[1][0] + H[0][0] * H[0][1] + H[1][0] * H[1][1] + H[2][0] * H[2][1];
  const float m = lame_mu * scale, l = lame_lambda * scale * (e[0] + e[1] + e[2]);
  const float s0 = l + 2 * m * e[0], s1 = l + 2 * m * e[1], s2 = l + 2 * m * e[2];
  const float s3 = m * e[3], s4 = m * e[4], s5 = m * e[5];
  for (int i = 0; i < 3; ++i) {
    const float a = H[i][0] + (i == 0), b = H[i][1] + (i == 1), c = H[i][2] + (i == 2);
    P[i][0] = a * s0 + b * s5 + c * s4;
    P[i][1] = a * s5 + b * s1 + c * s3;
    P[i][2] = a * s4 + b * s3 + c * s2;
  }
}

/// Inverts a matrix and returns its determinant.
inline double invert(const double J[3][3], double inverse[3][3]) {
  const double det = J[0][0] * (J[1][1] * J[2][2] - J[1][2] * J[2][1]) -
                     J[0][1] * (J[1][0] * J[2][2] - J[1][2] * J[2][0]) +
                     J[0][2] * (J[1][0] * J[2][1] - J[1][1] * J[2][0]);
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      const int a = (j + 1) % 3, b = (j + 2) % 3, c = (i + 1) % 3, e = (i + 2) % 3;
      inverse[i][j] = (J[a][c] * J[b][e] - J[a][e] * J[b][c]) / det;
    }
  }
  return det;
}

/// The linear tetrahedron. Its numbers are the gradients of the shape functions of its last three
/// nodes, and its volume.
struct Tetrahedron {
  static constexpr int nodes = 4, numbers = 10;
  static constexpr int resident_threads = 832;  ///< Threads of `step_resident`.
  static constexpr int resident_elements = 2;   ///< Elements of a thread there, at most.
  static constexpr const char* name = "tetrahedra";
  /// The largest stable time step times the speed of pressure waves over the width of a cell.
  static constexpr double courant = 0.55;

  static FEM_HD void forces(const float (*u)[3], const float* d, float (*f)[3]) {
    float H[3][3], P[3][3];
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        H[i][j] = (u[1][i] - u[0][i]) * d[j] + (u[2][i] - u[0][i]) * d[3 + j] +
                  (u[3][i] - u[0][i]) * d[6 + j];
      }
    }
    stress(H, -d[9], P);
    for (int i = 0; i < 3; ++i) {
      for (int a = 0; a < 3; ++a) {
        f[a + 1][i] = P[i][0] * d[3 * a] + P[i][1] * d[3 * a + 1] + P[i][2] * d[3 * a + 2];
      }
      f[0][i] = -(f[1][i] + f[2][i] + f[3][i]);
    }
  }

  /// Computes the numbers d of an element. @param X rest positions of its nodes [m]
  static void prepare(const double (*X)[3], float* d) {
    double J[3][3], inverse[3][3];
    for (int a = 0; a < 3; ++a) {
      for (int j = 0; j < 3; ++j) J[a][j] = X[a + 1][j] - X[0][j];
    }
    const double det = invert(J, inverse);
    for (int a = 0; a < 3; ++a) {
      for (int j = 0; j < 3; ++j) d[3 * a + j] = float(inverse[j][a]);
    }
    d[9] = float(std::fabs(det) / 6);
  }
};

/// Takes values at the corners of a brick to their sums with products of signs: a Walsh-Hadamard
/// transform.
FEM_HD void corners_to_modes(float c[8]) {
  for (int bit = 1; bit < 8; bit *= 2) {
    for (int a = 0; a < 8; ++a) {
      if (a & bit) continue;
      const float low = c[a], high = c[a | bit];
      c[a] = low + high;
      c[a | bit] = high - low;
    }
  }
}

/// Takes forces on modes to forces at the corners: the transpose of `corners_to_modes`.
FEM_HD void modes_to_corners(float c[8]) {
  for (int bit = 1; bit < 8; bit *= 2) {
    for (int a = 0; a < 8; ++a) {
      if (a & bit) continue;
      const float mean = c[a], slope = c[a | bit];
      c[a] = mean - slope;
      c[a | bit] = mean + slope;
    }
  }
}

/// Takes the displacements of a brick's modes to forces on them, in place.
/// @tparam skew whether the brick may be other than a cube, and J and S are needed in full
/// @param J inverse of dX/dξ, over 8; only the first number of it for a cube
/// @param S sums of rest positions in the four hourglass modes, or null for a cube
/// @param V volume. @param k stiffness of hourglass modes
template <bool skew>
FEM_HD void brick_modes(float (*c)[8], const float* J, const float* S, float V, float k) {
  constexpr int hourglass[4] = {6, 5, 3, 7};
  float H[3][3], P[3][3];
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      H[i][j] = skew ? c[i][1] * J[3 * j] + c[i][2] * J[3 * j + 1] + c[i][4] * J[3 * j + 2]
                     : c[i][1 << j] * J[0];
    }
  }
  stress(H, -V, P);
  for (int i = 0; i < 3; ++i) {
    c[i][0] = 0;
    for (int a = 0; a < 4; ++a) {
      float q = c[i][hourglass[a]];
      if (skew) q -= H[i][0] * S[3 * a] + H[i][1] * S[3 * a + 1] + H[i][2] * S[3 * a + 2];
      q *= -k;
      c[i][hourglass[a]] = q;
      if (skew) {
        for (int j = 0; j < 3; ++j) P[i][j] -= q * S[3 * a + j];
      }
    }
    for (int b = 0; b < 3; ++b) {
      c[i][1 << b] =
          skew ? P[i][0] * J[b] + P[i][1] * J[3 + b] + P[i][2] * J[6 + b] : P[i][b] * J[0];
    }
  }
}

/// The eight-node brick with one point and hourglass stiffness. Its numbers are the J, S, V and k
/// of `brick_modes`.
struct Brick {
  static constexpr int nodes = 8, numbers = 23;
  static constexpr int volume = 21, stiffness = 22;  ///< Places of V and k among the numbers.
  static constexpr int resident_threads = 544, resident_elements = 1;
  static constexpr const char* name = "bricks";
  static constexpr double courant = 0.95;

  static FEM_HD void forces(const float (*u)[3], const float* d, float (*f)[3]) {
    float c[3][8];
    for (int i = 0; i < 3; ++i) {
      for (int a = 0; a < 8; ++a) c[i][a] = u[a][i];
      corners_to_modes(c[i]);
    }
    brick_modes<true>(c, d, d + 9, d[volume], d[stiffness]);
    for (int i = 0; i < 3; ++i) {
      modes_to_corners(c[i]);
      for (int a = 0; a < 8; ++a) f[a][i] = c[i][a];
    }
  }

  static void prepare(const double (*X)[3], float* d) {
    double J[3][3], inverse[3][3];  // J[k][j] = dX_j/dξ_k
    const int hourglass[4] = {6, 5, 3, 7};
    const auto sum = [&](int mode, int j) {
      double s = 0;
      for (int a = 0; a < 8; ++a) s += (__builtin_popcount(mode & ~a) & 1 ? -1 : 1) * X[a][j];
      return s;
    };
    for (int k = 0; k < 3; ++k) {
      for (int j = 0; j < 3; ++j) J[k][j] = sum(1 << k, j) / 8;
    }
    const double V = 8 * invert(J, inverse);
    for (int j = 0; j < 3; ++j) {
      for (int k = 0; k < 3; ++k) d[3 * j + k] = float(inverse[j][k] / 8);
    }
    for (int a = 0; a < 4; ++a) {
      for (int j = 0; j < 3; ++j) d[9 + 3 * a + j] = float(sum(hourglass[a], j));
    }
    d[volume] = float(V);
    d[stiffness] = float(youngs_modulus * std::cbrt(V) / 48);  // bends a single cube exactly
  }

  /// Computes the numbers of a cube. @param edge length of its edges [m]
  static void prepare_cube(double edge, float* d) {
    double X[8][3];
    for (int a = 0; a < 8; ++a) {
      for (int j = 0; j < 3; ++j) X[a][j] = (a >> j & 1) * edge;
    }
    prepare(X, d);
  }
};

}  // namespace fem
