#include "solver/point_fit.hpp"

#include <Eigen/QR>
#include <cmath>

#include "phyxel/physics/moment.hpp"
#include "phyxel/physics/weight.hpp"

namespace phyxel {
namespace {

constexpr int quadratic_terms = 6;
constexpr Eigen::Index fewest_for_quadratic = 14;
/// Least length of a quadratic term beside the longest, in what the linear part leaves.
constexpr double least_term = 1e-3;

using Terms = Eigen::Matrix<double, quadratic_terms, 1>;
using Slopes = Eigen::Matrix<double, quadratic_terms, 3>;

Terms terms_at(Vec3d x) {
  return (Terms() << x.x * x.x, x.x * x.y, x.x * x.z, x.y * x.y, x.y * x.z, x.z * x.z).finished();
}
Slopes slopes_at(Vec3d x) {
  return (Slopes() << 2 * x.x, 0, 0,  //
          x.y, x.x, 0,                //
          x.z, 0, x.x,                //
          0, 2 * x.y, 0,              //
          0, x.z, x.y,                //
          0, 0, 2 * x.z)
      .finished();
}
Eigen::Vector3d in_eigen(Vec3d v) { return {v.x, v.y, v.z}; }
Vec3d from_eigen(const Eigen::Vector3d& v) { return {v[0], v[1], v[2]}; }

}  // namespace

PointFit fit_at(Vec3d point, std::span<const Vec3d> near, double reach) {
  const auto n = static_cast<Eigen::Index>(near.size());
  Eigen::VectorXd weight(n);
  double sum = 0;
  Vec3d first;
  for (Eigen::Index k = 0; k < n; ++k) {
    const Vec3d x = near[static_cast<std::size_t>(k)] - point;
    weight[k] = weight_shape_anywhere(dot(x, x), 1 / (reach * reach));
    sum += weight[k];
    first += weight[k] * x;
  }
  // Places are counted from the weighted mean, in units of the reach, so that constant and linear
  // terms are orthogonal.
  const Vec3d mean = point + first / sum, here = (point - mean) / reach;
  std::vector<Vec3d> place;
  Sym3d moment;
  for (Eigen::Index k = 0; k < n; ++k) {
    place.push_back((near[static_cast<std::size_t>(k)] - mean) / reach);
    moment += moment_term(place.back(), weight[k]);
  }
  const Sym3d inverse = pseudo_inverse(moment).matrix;
  Eigen::VectorXd value(n);
  Eigen::MatrixXd gradient(n, 3);
  for (Eigen::Index k = 0; k < n; ++k) {
    const Vec3d slope = weight[k] * (inverse * place[static_cast<std::size_t>(k)]);
    value[k] = weight[k] / sum + dot(slope, here);
    gradient.row(k) = in_eigen(slope);
  }
  if (n >= fewest_for_quadratic) {
    // What the linear part leaves of each quadratic term, at the phyxels and at the point.
    Eigen::MatrixXd term(n, quadratic_terms);
    for (Eigen::Index k = 0; k < n; ++k) {
      term.row(k) = terms_at(place[static_cast<std::size_t>(k)]);
    }
    const Terms constant = term.transpose() * weight / sum;
    Slopes linear = Slopes::Zero();
    for (Eigen::Index k = 0; k < n; ++k) {
      const Vec3d slope = weight[k] * (inverse * place[static_cast<std::size_t>(k)]);
      linear += term.row(k).transpose() * in_eigen(slope).transpose();
    }
    for (Eigen::Index k = 0; k < n; ++k) {
      const Terms fitted = constant + linear * in_eigen(place[static_cast<std::size_t>(k)]);
      term.row(k) -= fitted.transpose();
    }
    const Terms left_here = terms_at(here) - constant - linear * in_eigen(here);
    const Slopes slope_here = slopes_at(here) - linear;
    const Eigen::VectorXd root = weight.cwiseSqrt();
    Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> fit;
    fit.setThreshold(least_term);
    fit.compute(root.asDiagonal() * term);
    const Eigen::MatrixXd share = fit.pseudoInverse() * root.asDiagonal();  // [terms, n]
    value += share.transpose() * left_here;
    gradient += share.transpose() * slope_here;
  }
  PointFit found;
  for (Eigen::Index k = 0; k < n; ++k) {
    found.value.push_back(value[k]);
    found.gradient.push_back(from_eigen(gradient.row(k)) / reach);
  }
  return found;
}

}  // namespace phyxel
