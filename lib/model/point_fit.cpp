#include "model/point_fit.hpp"

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

/// Largest sum of the lengths of slopes, by the reach. Where few phyxels are around, as at edges
/// and corners, the quadratic part is taken in a share, so that small differences of displacements
/// make no large gradient.
constexpr double largest_slopes = 12;

using Terms = Eigen::Matrix<double, quadratic_terms, 1>;
using Slopes = Eigen::Matrix<double, quadratic_terms, 3>;

Terms terms_at(Vec3d x) {
  return (Terms() << x.x * x.x, x.x * x.y, x.x * x.z, x.y * x.y, x.y * x.z, x.z * x.z).finished();
}
/// The derivatives of the quadratic terms.
Slopes slopes_of_terms_at(Vec3d x) {
  return (Slopes() << 2 * x.x, 0, 0, x.y, x.x, 0, x.z, 0, x.x, 0, 2 * x.y, 0, 0, x.z, x.y, 0, 0,
          2 * x.z)
      .finished();
}
Eigen::Vector3d in_eigen(Vec3d v) { return {v.x, v.y, v.z}; }

/// A least-squares fit of a polynomial to values of phyxels.
class Fit {
 public:
  /// Parameters as of `shares_at`.
  Fit(Vec3d point, std::span<const Vec3d> near, double reach)
      : reach_(reach), weight_(static_cast<Eigen::Index>(near.size())) {
    Vec3d first;
    for (Eigen::Index k = 0; k < size(); ++k) {
      const Vec3d x = near[static_cast<std::size_t>(k)] - point;
      weight_[k] = reach > 0 ? weight_shape_anywhere(dot(x, x), 1 / (reach * reach)) : 0;
      sum_ += weight_[k];
      first += weight_[k] * x;
    }
    if (!(sum_ > 0)) return;
    // Places are counted from the weighted mean, in units of the reach, so that constant and linear
    // terms are orthogonal.
    const Vec3d mean = point + first / sum_;
    here_ = (point - mean) / reach;
    Sym3d moment;
    for (Eigen::Index k = 0; k < size(); ++k) {
      place_.push_back((near[static_cast<std::size_t>(k)] - mean) / reach);
      moment += moment_term(place_.back(), weight_[k]);
    }
    const Sym3d inverse = pseudo_inverse(moment).matrix;
    Eigen::MatrixXd term(size(), quadratic_terms);
    for (Eigen::Index k = 0; k < size(); ++k) {
      const Vec3d x = place_[static_cast<std::size_t>(k)];
      slope_.push_back(weight_[k] * (inverse * x));
      term.row(k) = terms_at(x);
      linear_ += term.row(k).transpose() * in_eigen(slope_.back()).transpose();
    }
    constant_ = term.transpose() * weight_ / sum_;
    if (size() < fewest_for_quadratic) return;
    // What the linear part leaves of each quadratic term at the phyxels.
    for (Eigen::Index k = 0; k < size(); ++k) {
      const Terms fitted = constant_ + linear_ * in_eigen(place_[static_cast<std::size_t>(k)]);
      term.row(k) -= fitted.transpose();
    }
    const Eigen::VectorXd root = weight_.cwiseSqrt();
    Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> fit;
    fit.setThreshold(least_term);
    fit.compute(root.asDiagonal() * term);
    rest_ = root.asDiagonal() * fit.pseudoInverse().transpose();
  }

  std::vector<double> shares() const {
    if (!(sum_ > 0)) {
      return std::vector<double>(static_cast<std::size_t>(size()), 1 / static_cast<double>(size()));
    }
    Eigen::VectorXd share(size());
    for (Eigen::Index k = 0; k < size(); ++k) {
      share[k] = weight_[k] / sum_ + dot(slope_[static_cast<std::size_t>(k)], here_);
    }
    if (rest_.size() > 0)
      share += rest_ * (terms_at(here_) - constant_ - linear_ * in_eigen(here_));
    return {share.begin(), share.end()};
  }
  std::vector<Vec3d> slopes() const {
    std::vector<Vec3d> slopes = slope_, rest(static_cast<std::size_t>(size()));
    slopes.resize(static_cast<std::size_t>(size()));
    if (rest_.size() > 0) {
      const Eigen::MatrixXd of_terms = rest_ * (slopes_of_terms_at(here_) - linear_);
      for (Eigen::Index k = 0; k < size(); ++k) {
        rest[static_cast<std::size_t>(k)] = {of_terms(k, 0), of_terms(k, 1), of_terms(k, 2)};
      }
    }
    // The sum of lengths is convex in the share of the quadratic part.
    double linear = 0, all = 0;
    for (std::size_t k = 0; k < slopes.size(); ++k) {
      linear += norm(slopes[k]);
      all += norm(slopes[k] + rest[k]);
    }
    const double share =
        all > largest_slopes ? std::max(0.0, (largest_slopes - linear) / (all - linear)) : 1;
    for (std::size_t k = 0; k < slopes.size(); ++k) {
      slopes[k] = (slopes[k] + share * rest[k]) / reach_;
    }
    return slopes;
  }

 private:
  Eigen::Index size() const { return weight_.size(); }

  double reach_, sum_ = 0;
  Eigen::VectorXd weight_;
  Vec3d here_;                      // the point, as places are counted
  std::vector<Vec3d> place_;        // of phyxels
  std::vector<Vec3d> slope_;        // share of each phyxel in the slope of the linear part
  Terms constant_ = Terms::Zero();  // of the linear fits of the quadratic terms
  Slopes linear_ = Slopes::Zero();
  Eigen::MatrixXd rest_;  // share of each phyxel in the quadratic part, [n, terms]; or none
};

}  // namespace

std::vector<double> shares_at(Vec3d point, std::span<const Vec3d> near, double reach) {
  return Fit(point, near, reach).shares();
}

std::vector<Vec3d> slopes_at(Vec3d point, std::span<const Vec3d> near, double reach) {
  return Fit(point, near, reach).slopes();
}

}  // namespace phyxel
