/// The oracle for a model of one body with the paper's rules, and equation (6) of Farias et al.
/// 2008 by double loops.
#pragma once

#include <algorithm>

#include "phyxel/model.hpp"
#include "support/oracle.hpp"

namespace phyxel::testing {

inline oracle::V3 to_eigen(Vec3d v) { return {v.x, v.y, v.z}; }
inline Vec3d from_eigen(const oracle::V3& v) { return {v.x(), v.y(), v.z()}; }

/// v = m / ρ with ρ the kernel density, the phyxel itself included. Source: Mueller et al. 2004.
inline std::vector<double> kernel_volumes(const Model& model) {
  std::vector<double> volume;
  for (Index i = 0; i < model.size(); ++i) {
    const double h = model.neighbourhood.support[i];
    double density = model.mass[i] * oracle::w(0, h);
    for (const Index j : model.neighbourhood.neighbours.row(i)) {
      density += model.mass[j] * oracle::w(norm(model.position[j] - model.position[i]), h);
    }
    volume.push_back(model.mass[i] / density);
  }
  return volume;
}

inline oracle::Body oracle_body(const Model& model) {
  oracle::Body body;
  for (const Vec3d& x : model.position) body.x.push_back(to_eigen(x));
  body.v = kernel_volumes(model);
  body.h = model.neighbourhood.support;
  for (Index i = 0; i < model.size(); ++i) {
    const auto row = model.neighbourhood.neighbours.row(i);
    body.neighbours.emplace_back(row.begin(), row.end());
  }
  body.young = model.parts[0].material.young;
  body.poisson = model.parts[0].material.poisson;
  body.law = model.parts[0].material.law;
  return body;
}

inline std::vector<oracle::V3> to_eigen(const std::vector<Vec3d>& u) {
  std::vector<oracle::V3> list;
  for (const Vec3d& v : u) list.push_back(to_eigen(v));
  return list;
}

/// Force of each phyxel on each of its neighbours, in the order of the lists.
inline std::vector<Vec3d> oracle_pair_forces(const oracle::Body& b,
                                             const std::vector<oracle::V3>& u) {
  std::vector<Vec3d> list;
  for (int i = 0; i < static_cast<int>(b.x.size()); ++i) {
    const oracle::M3 g = oracle::grad_u(b, u, i), j = oracle::M3::Identity() + g;
    oracle::M3 p = oracle::stress(b, oracle::strain(b, g));
    if (b.green()) p = j * p;
    const oracle::M3 a = oracle::inverse_moment(b, i);
    for (const int n : b.neighbours[i]) {
      const oracle::V3 x = b.x[n] - b.x[i];
      list.push_back(from_eigen(-b.v[i] * p * (a * x * oracle::w(x.norm(), b.h[i]))));
    }
  }
  return list;
}

/// Equation (6): deformed surfels, and normals by F⁻ᵀ of the same blend.
inline SurfelState oracle_surfels(const Model& model, const oracle::Body& b,
                                  const std::vector<oracle::V3>& u) {
  std::vector<oracle::M3> gradient;
  for (int i = 0; i < static_cast<int>(b.x.size()); ++i)
    gradient.push_back(oracle::grad_u(b, u, i));
  SurfelState out;
  for (Index s = 0; s < model.surfels.carriers.rows(); ++s) {
    oracle::V3 sum = oracle::V3::Zero();
    oracle::M3 blend = oracle::M3::Zero();
    double weight = 0;
    const auto carriers = model.surfels.carriers.row(s);
    for (const Index i : carriers) {
      const oracle::V3 x = to_eigen(model.surfels.position[s]) - b.x[i];
      const double w = carriers.size() == 1 ? 1 : oracle::w(x.norm(), b.h[i]);
      sum += w * (u[i] + gradient[i] * x);
      blend += w * gradient[i];
      weight += w;
    }
    out.position.push_back(model.surfels.position[s] + from_eigen(sum / weight));
    const oracle::M3 f = oracle::M3::Identity() + blend / weight;
    const oracle::V3 n =
        f.determinant() * f.inverse().transpose() * to_eigen(model.surfels.normal[s]);
    out.normal.push_back(from_eigen(n.normalized()));
  }
  return out;
}

/// Largest |a - b| over the largest |b|.
inline double relative_error(const std::vector<Vec3d>& a, const std::vector<Vec3d>& b) {
  double error = a.size() == b.size() ? 0 : HUGE_VAL, size = 0;
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i) {
    const double gap = norm(a[i] - b[i]);
    error = std::isfinite(gap) ? std::max(error, gap) : HUGE_VAL;
    size = std::max(size, norm(b[i]));
  }
  return error / size;
}

}  // namespace phyxel::testing
