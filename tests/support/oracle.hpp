/// The oracle: a plain evaluation of the papers' equations by double loops over all pairs, written
/// from the papers and not from the library, and short. The tests compare everything else with it.
/// Notation as in Mueller et al. 2004 and Farias et al. 2008: x rest position, u displacement, v
/// volume, w weight, A moment matrix, J = I + grad u.
#pragma once

#include <Eigen/Dense>
#include <map>
#include <string>
#include <vector>

namespace oracle {

using V3 = Eigen::Vector3d;
using M3 = Eigen::Matrix3d;

struct Material {
  double young = 0, poisson = 0, volume_stiffness = 0;
  std::string law = "st-venant-kirchhoff";
  std::map<std::string, double> parameters = {};  // of laws with parameters other than E and ν
  /// True for a law in Green's strain.
  bool green() const { return law == "st-venant-kirchhoff"; }
};

struct Body : Material {
  std::vector<V3> x;
  std::vector<double> v, h;
  std::vector<std::vector<int>> neighbours;
  std::vector<Material> material;  // of each phyxel; empty: that of the body
  double hourglass = 0;            // κ [N/m]
  double pair_length = 0;          // H of weights of pairs [m]; 0 for one-sided weights
  std::vector<V3> closing;         // ĉ [1/m]; empty without closed gradients
};

inline const Material& material_of(const Body& b, int i) {
  return b.material.empty() ? b : b.material[i];
}

inline double w(double r, double h) {
  if (r >= h) return 0;
  return 315 / (64 * M_PI * std::pow(h, 9)) * std::pow(h * h - r * r, 3);
}

/// The weight of j in the sums of i: w(r, h_i), or η (1 - r²/h²)³ with the mean h of the two
/// supports and η = h/H.
inline double weight_of(const Body& b, int i, int j) {
  const double r = (b.x[j] - b.x[i]).norm();
  if (b.pair_length == 0) return w(r, b.h[i]);
  const double h = (b.h[i] + b.h[j]) / 2;
  return r < h ? h / b.pair_length * std::pow(1 - r * r / (h * h), 3) : 0;
}

/// Finds all phyxels closer than h_i.
inline void find_neighbours(Body& b) {
  const int n = static_cast<int>(b.x.size());
  b.neighbours.assign(b.x.size(), {});
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      if (j != i && (b.x[j] - b.x[i]).norm() < b.h[i]) b.neighbours[i].push_back(j);
    }
  }
}

/// A_i^-1, by the pseudo-inverse.
inline M3 inverse_moment(const Body& b, int i) {
  M3 a = M3::Zero();
  for (const int j : b.neighbours[i]) {
    const V3 xij = b.x[j] - b.x[i];
    a += weight_of(b, i, j) * xij * xij.transpose();
  }
  const Eigen::JacobiSVD<M3> svd(a, Eigen::ComputeFullU | Eigen::ComputeFullV);
  M3 inverse = M3::Zero();
  for (int k = 0; k < 3; ++k) {
    const double s = svd.singularValues()[k];
    if (s > 1e-6 * svd.singularValues()[0]) {
      inverse += svd.matrixV().col(k) * svd.matrixU().col(k).transpose() / s;
    }
  }
  return inverse;
}

inline M3 grad_u(const Body& b, const std::vector<V3>& u, int i) {
  M3 g = M3::Zero();
  for (const int j : b.neighbours[i]) {
    const V3 xij = b.x[j] - b.x[i];
    g += (u[j] - u[i]) * (inverse_moment(b, i) * xij * weight_of(b, i, j)).transpose();
  }
  return g;
}

inline M3 strain(const Material& b, const M3& g) {
  const M3 linear = 0.5 * (g + g.transpose());
  return b.green() ? M3(linear + 0.5 * g.transpose() * g) : linear;
}

/// Equation (5) of Farias et al. 2008, in its 6x6 engineering layout.
inline M3 stress(const Material& b, const M3& e) {
  const double nu = b.poisson;
  Eigen::Matrix<double, 6, 6> c = Eigen::Matrix<double, 6, 6>::Zero();
  c.topLeftCorner<3, 3>().setConstant(nu);
  c.diagonal() << 1 - nu, 1 - nu, 1 - nu, 1 - 2 * nu, 1 - 2 * nu, 1 - 2 * nu;
  c *= b.young / ((1 + nu) * (1 - 2 * nu));
  Eigen::Matrix<double, 6, 1> column;
  column << e(0, 0), e(1, 1), e(2, 2), e(0, 1), e(1, 2), e(0, 2);
  const Eigen::Matrix<double, 6, 1> s = c * column;
  M3 sigma;
  sigma << s[0], s[3], s[5], s[3], s[1], s[4], s[5], s[4], s[2];
  return sigma;
}

/// Smith, de Goes and Kim 2018, equations 13 and 14: parameters, energy, stress.
struct NeoHooke {
  double mu, lambda, alpha;
  explicit NeoHooke(const Material& b) {
    const double shear = b.young / (2 * (1 + b.poisson));
    mu = 4 * shear / 3;
    lambda = b.young * b.poisson / ((1 + b.poisson) * (1 - 2 * b.poisson)) + 5 * shear / 6;
    alpha = 1 + mu / lambda - mu / (4 * lambda);
  }
  /// Energy density, zero at rest.
  double energy(const M3& j) const {
    const auto whole = [&](double i, double det) {
      return mu / 2 * (i - 3) + lambda / 2 * std::pow(det - alpha, 2) - mu / 2 * std::log(i + 1);
    };
    return whole(j.squaredNorm(), j.determinant()) - whole(3, 1);
  }
  M3 stress(const M3& j, const M3& cof) const {
    return mu * (1 - 1 / (j.squaredNorm() + 1)) * j + lambda * (j.determinant() - alpha) * cof;
  }
};
inline M3 cofactor(const M3& j) {
  M3 cof;
  cof.col(0) = j.col(1).cross(j.col(2));
  cof.col(1) = j.col(2).cross(j.col(0));
  cof.col(2) = j.col(0).cross(j.col(1));
  return cof;
}

/// ψ = μ |F - R|² + λ/2 (tr S - 3)² with R by singular values, of determinant 1.
struct Corotated {
  double mu, lambda;
  explicit Corotated(const Material& b)
      : mu(b.young / (2 * (1 + b.poisson))),
        lambda(b.young * b.poisson / ((1 + b.poisson) * (1 - 2 * b.poisson))) {}
  static M3 rotation(const M3& j) {
    const Eigen::JacobiSVD<M3> svd(j, Eigen::ComputeFullU | Eigen::ComputeFullV);
    V3 sides = V3::Ones();
    if ((svd.matrixU() * svd.matrixV().transpose()).determinant() < 0) sides[2] = -1;
    return svd.matrixU() * sides.asDiagonal() * svd.matrixV().transpose();
  }
  double energy(const M3& j) const {
    const M3 r = rotation(j);
    return mu * (j - r).squaredNorm() + lambda / 2 * std::pow((r.transpose() * j).trace() - 3, 2);
  }
  M3 stress(const M3& j) const {
    const M3 r = rotation(j);
    return 2 * mu * (j - r) + lambda * ((r.transpose() * j).trace() - 3) * r;
  }
};

/// Hencky 1928 in principal stretches s, by singular values with the sign of det F on the smallest:
/// ψ = μ Σ L(s)² + λ/2 (Σ L(s))², L = ln s, continued as its tangent below s = 0.1.
struct Hencky {
  double mu, lambda;
  explicit Hencky(const Material& b)
      : mu(b.young / (2 * (1 + b.poisson))),
        lambda(b.young * b.poisson / ((1 + b.poisson) * (1 - 2 * b.poisson))) {}
  struct Principal {
    M3 left, right;
    V3 log, slope;
  };
  static Principal principal(const M3& j) {
    const Eigen::JacobiSVD<M3> svd(j, Eigen::ComputeFullU | Eigen::ComputeFullV);
    V3 s = svd.singularValues();
    M3 left = svd.matrixU();
    if ((left * svd.matrixV().transpose()).determinant() < 0) {
      s[2] = -s[2];
      left.col(2) = -left.col(2);
    }
    Principal p{left, svd.matrixV(), {}, {}};
    for (int k = 0; k < 3; ++k) {
      p.log[k] = s[k] > 0.1 ? std::log(s[k]) : std::log(0.1) + (s[k] - 0.1) / 0.1;
      p.slope[k] = s[k] > 0.1 ? 1 / s[k] : 10;
    }
    return p;
  }
  double energy(const M3& j) const {
    const Principal p = principal(j);
    return mu * p.log.squaredNorm() + lambda / 2 * p.log.sum() * p.log.sum();
  }
  M3 stress(const M3& j) const {
    const Principal p = principal(j);
    const V3 t = (2 * mu * p.log + lambda * p.log.sum() * V3::Ones()).cwiseProduct(p.slope);
    return p.left * t.asDiagonal() * p.right.transpose();
  }
};

/// Mooney–Rivlin in the invariants of C = FᵀF, with the derivatives of these by F.
struct MooneyRivlin {
  double c10, c01, l;
  explicit MooneyRivlin(const Material& b)
      : c10(b.parameters.at("c10")), c01(b.parameters.at("c01")) {
    const double mu = 2 * (c10 + c01), lambda = b.parameters.at("bulk_modulus") - 2 * mu / 3;
    l = lambda + 2 * c10;
  }
  double energy(const M3& j) const {
    const M3 c = j.transpose() * j;
    const double i1 = c.trace(), i2 = 0.5 * (i1 * i1 - (c * c).trace());
    const double dj = j.determinant() - 1;
    return c10 * (i1 - 3) + c01 * (i2 - 3) - 2 * (c10 + 2 * c01) * dj + l / 2 * dj * dj;
  }
  M3 stress(const M3& j, const M3& cof) const {
    const M3 c = j.transpose() * j;
    return 2 * c10 * j + 2 * c01 * (c.trace() * j - j * c) +
           (l * (j.determinant() - 1) - 2 * (c10 + 2 * c01)) * cof;
  }
};

/// Residual of the linear fit at i for the displacement of j.
inline V3 residual(const Body& b, const std::vector<V3>& u, const M3& g, int i, int j) {
  return u[j] - u[i] - g * (b.x[j] - b.x[i]);
}
/// (1 - r²/h²)³, the weight w without its unit; the weight of a pair has none.
inline double shape(const Body& b, int i, int j) {
  if (b.pair_length > 0) return weight_of(b, i, j);
  return w((b.x[j] - b.x[i]).norm(), b.h[i]) / w(0, b.h[i]);
}

/// The closed gradient.
inline M3 closed_grad_u(const Body& b, const std::vector<V3>& u, int i) {
  M3 g = grad_u(b, u, i);
  if (b.closing.empty()) return g;
  V3 r = V3::Zero();
  for (const int j : b.neighbours[i]) r += shape(b, i, j) * residual(b, u, g, i, j);
  return g + r * b.closing[i].transpose();
}
/// The derivative of the closed gradient at i by u_j.
inline V3 grad_of(const Body& b, const M3& inverse, int i, int j) {
  const auto slope = [&](int k) {
    const V3 x = b.x[k] - b.x[i];
    return V3(inverse * x * weight_of(b, i, k));
  };
  if (b.closing.empty()) return slope(j);
  double share = shape(b, i, j);
  for (const int k : b.neighbours[i]) share -= shape(b, i, k) * slope(j).dot(b.x[k] - b.x[i]);
  return slope(j) + share * b.closing[i];
}

inline double hourglass_energy(const Body& b, const std::vector<V3>& u) {
  double total = 0;
  for (int i = 0; i < static_cast<int>(b.x.size()); ++i) {
    const M3 g = grad_u(b, u, i);
    for (const int j : b.neighbours[i]) {
      total += 0.5 * b.hourglass * shape(b, i, j) * residual(b, u, g, i, j).squaredNorm();
    }
  }
  return total;
}

inline double energy(const Body& b, const std::vector<V3>& u) {
  double total = b.hourglass > 0 ? hourglass_energy(b, u) : 0;
  for (int i = 0; i < static_cast<int>(b.x.size()); ++i) {
    const Material& m = material_of(b, i);
    const M3 g = closed_grad_u(b, u, i), e = strain(m, g);
    const double dj = (M3::Identity() + g).determinant() - 1;
    const double elastic = m.law == "corotated"       ? Corotated(m).energy(M3::Identity() + g)
                           : m.law == "hencky"        ? Hencky(m).energy(M3::Identity() + g)
                           : m.law == "neo-hookean"   ? NeoHooke(m).energy(M3::Identity() + g)
                           : m.law == "mooney-rivlin" ? MooneyRivlin(m).energy(M3::Identity() + g)
                                                      : 0.5 * e.cwiseProduct(stress(m, e)).sum();
    total += b.v[i] * (elastic + 0.5 * m.volume_stiffness * dj * dj);
  }
  return total;
}

/// Forces by the papers' scatter: phyxel i exerts a force on each of its neighbours, and the
/// opposite one on itself.
inline std::vector<V3> forces(const Body& b, const std::vector<V3>& u) {
  std::vector<V3> f(b.x.size(), V3::Zero());
  for (int i = 0; i < static_cast<int>(b.x.size()); ++i) {
    const M3 g = closed_grad_u(b, u, i), j = M3::Identity() + g, a = inverse_moment(b, i);
    const M3 fit = grad_u(b, u, i);
    const Material& m = material_of(b, i);
    M3 p = stress(m, strain(m, g));
    if (m.green()) p = j * p;
    if (m.law == "neo-hookean") p = NeoHooke(m).stress(j, cofactor(j));
    if (m.law == "hencky") p = Hencky(m).stress(j);
    if (m.law == "corotated") p = Corotated(m).stress(j);
    if (m.law == "mooney-rivlin") p = MooneyRivlin(m).stress(j, cofactor(j));
    if (m.volume_stiffness > 0) p += m.volume_stiffness * (j.determinant() - 1) * cofactor(j);
    for (const int n : b.neighbours[i]) {
      V3 push = -b.v[i] * p * grad_of(b, a, i, n);
      if (b.hourglass > 0) push -= b.hourglass * shape(b, i, n) * residual(b, u, fit, i, n);
      f[n] += push;
      f[i] -= push;
    }
  }
  return f;
}

}  // namespace oracle
