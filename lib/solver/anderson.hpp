/// Anderson's mixing: faster convergence of a fixed-point iteration.
#pragma once

#include <Eigen/Dense>
#include <deque>
#include <vector>

namespace phyxel {

/// The iteration x ← x + f(x), whose next x combines the last ones so that what remains of their f
/// is least. Source: D. G. Anderson 1965 (Iterative procedures for nonlinear integral equations),
/// in the form of Walker and Ni 2011 (Anderson acceleration for fixed-point iterations, section 2).
class AndersonMixing {
 public:
  /// Forgets all that has been seen: for another f, or other unknowns.
  void forget() { history_.clear(); }

  /// Returns the next x.
  /// @param x,f the present x and f(x), of the same size at each call since `forget`
  /// @param share of f that is taken: less than 1 for an f that changes by more than x does
  /// @param product returns the inner product of two such vectors; collective if it is
  template <class Product>
  std::vector<double> next(const std::vector<double>& x, const std::vector<double>& f, double share,
                           Product&& product) {
    history_.push_front({x, f});
    if (history_.size() > most + 1) history_.pop_back();
    const auto count = static_cast<Eigen::Index>(history_.size()) - 1;
    std::vector<Pair> change;
    for (Eigen::Index k = 0; k < count; ++k) {
      change.push_back({difference(history_[k].x, history_[k + 1].x),
                        difference(history_[k].f, history_[k + 1].f)});
    }
    Eigen::MatrixXd matrix(count, count);
    Eigen::VectorXd right(count);
    for (Eigen::Index a = 0; a < count; ++a) {
      right[a] = product(change[a].f, f);
      for (Eigen::Index b = 0; b <= a; ++b) {
        matrix(a, b) = matrix(b, a) = product(change[a].f, change[b].f);
      }
    }
    std::vector<double> next(x.size());
    for (std::size_t i = 0; i < x.size(); ++i) next[i] = x[i] + share * f[i];
    if (count == 0 || !(matrix.trace() > 0)) return next;
    // Changes that depend on each other count once.
    Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> solver;
    solver.setThreshold(1e-12).compute(matrix);
    const Eigen::VectorXd weight = solver.solve(right);
    for (Eigen::Index k = 0; k < count; ++k) {
      for (std::size_t i = 0; i < x.size(); ++i) {
        next[i] -= weight[k] * (change[k].x[i] + share * change[k].f[i]);
      }
    }
    return next;
  }

 private:
  static constexpr std::size_t most = 5;  // changes that are combined
  struct Pair {
    std::vector<double> x, f;
  };
  static std::vector<double> difference(const std::vector<double>& a,
                                        const std::vector<double>& b) {
    std::vector<double> all(a.size());
    for (std::size_t i = 0; i < a.size(); ++i) all[i] = a[i] - b[i];
    return all;
  }

  std::deque<Pair> history_;  // the latest first
};

}  // namespace phyxel
