/// Host vectors with values per phyxel, of which each rank owns those of its phyxels. Sums over all
/// ranks are exact, so they do not depend on the number of threads or ranks.
#pragma once

#include <algorithm>
#include <limits>
#include <vector>

#include "exact_sum.hpp"
#include "model/ghosts.hpp"
#include "phyxel/model.hpp"
#include "phyxel/share.hpp"

namespace phyxel {

class OwnedVectors {
 public:
  using Vector = std::vector<Vec3d>;  ///< shape [n, 3]; values of ghosts are undefined

  OwnedVectors(const Model& model, int threads) : model_(model), threads_(threads) {}

  Vector make() const { return Vector(static_cast<std::size_t>(model_.size())); }

  /// Calls each(i) for the phyxels that are not ghosts.
  template <class Each>
  void for_each(Each&& each) const {
    for (const Part& part : model_.parts) {
#pragma omp parallel for schedule(static) num_threads(threads_)
      for (Index i = part.begin; i < part.owned_end(); ++i) each(i);
    }
  }

  /// Σ term(i) over all phyxels of all ranks, rounded once. Collective.
  template <class Term>
  double sum(Term&& term) const {
    ExactSum all;
#pragma omp parallel num_threads(threads_)
    {
      ExactSum own;
      for (const Part& part : model_.parts) {
#pragma omp for schedule(static) nowait
        for (Index i = part.begin; i < part.owned_end(); ++i) own.add(term(i));
      }
#pragma omp critical
      all.add(own);
    }
    if (model_.share) model_.share->communicator->add(all.ready());
    return all.value();
  }
  double product(const Vector& a, const Vector& b) const {
    return sum([&](Index i) { return dot(a[i], b[i]); });
  }

  /// The largest of value(i) over all phyxels of all ranks, at least 0. Collective.
  template <class Value>
  double largest(Value&& value) const {
    double largest = 0;
    for (const Part& part : model_.parts) {
      for (Index i = part.begin; i < part.owned_end(); ++i) {
        largest = std::max(largest, value(i));
      }
    }
    return model_.share ? model_.share->communicator->largest(largest) : largest;
  }

  /// Copies the owners' values to ghosts. Collective.
  template <class T>
  void refresh_ghosts(std::vector<T>& values) const {
    if (model_.share) phyxel::refresh_ghosts(*model_.share, values);
  }

  /// The smallest support of the phyxels of all ranks [m]; infinite if there is none. Collective.
  double smallest_support() const {
    double smallest = std::numeric_limits<double>::infinity();
    for (Index i = 0; i < model_.size(); ++i) {
      const double h = model_.neighbourhood.support[i];
      if (h > 0) smallest = std::min(smallest, h);
    }
    return model_.share ? model_.share->communicator->smallest(smallest) : smallest;
  }

 private:
  const Model& model_;
  int threads_;
};

}  // namespace phyxel
