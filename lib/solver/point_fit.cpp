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
Eigen::Vector3d in_eigen(Vec3d v) { return {v.x, v.y, v.z}; }

}  // namespace

std::vector<double> shares_at(Vec3d point, std::span<const Vec3d> near, double reach) {
  const auto n = static_cast<Eigen::Index>(near.size());
  Eigen::VectorXd weight(n);
  double sum = 0;
  Vec3d first;
  for (Eigen::Index k = 0; k < n; ++k) {
    const Vec3d x = near[static_cast<std::size_t>(k)] - point;
    weight[k] = reach > 0 ? weight_shape_anywhere(dot(x, x), 1 / (reach * reach)) : 0;
    sum += weight[k];
    first += weight[k] * x;
  }
  if (!(sum > 0)) return std::vector<double>(near.size(), 1 / static_cast<double>(n));
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
  Eigen::VectorXd share(n);
  Eigen::MatrixXd term(n, quadratic_terms);
  Slopes linear = Slopes::Zero();
  for (Eigen::Index k = 0; k < n; ++k) {
    const Vec3d x = place[static_cast<std::size_t>(k)], slope = weight[k] * (inverse * x);
    share[k] = weight[k] / sum + dot(slope, here);
    term.row(k) = terms_at(x);
    linear += term.row(k).transpose() * in_eigen(slope).transpose();
  }
  if (n >= fewest_for_quadratic) {
    // What the linear part leaves of each quadratic term, at the phyxels and at the point.
    const Terms constant = term.transpose() * weight / sum;
    for (Eigen::Index k = 0; k < n; ++k) {
      const Terms fitted = constant + linear * in_eigen(place[static_cast<std::size_t>(k)]);
      term.row(k) -= fitted.transpose();
    }
    const Terms left_here = terms_at(here) - constant - linear * in_eigen(here);
    const Eigen::VectorXd root = weight.cwiseSqrt();
    Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> fit;
    fit.setThreshold(least_term);
    fit.compute(root.asDiagonal() * term);
    share += root.asDiagonal() * (fit.pseudoInverse().transpose() * left_here);
  }
  return {share.begin(), share.end()};
}

}  // namespace phyxel
