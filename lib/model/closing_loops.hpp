/// Loops over the phyxels of bodies with closed gradients, on the threads of the host.
#pragma once

#include <omp.h>

#include <algorithm>
#include <span>
#include <vector>

#include "bulk.hpp"
#include "exact_sum.hpp"
#include "model/closing_bodies.hpp"
#include "model/closing_gathers.hpp"
#include "model/ghosts.hpp"
#include "rank_sums.hpp"

namespace phyxel::closing {

/// The loops and vectors of the search on the host. `DeviceLoops` (cuda/setup) are those of a
/// device, and give the same bits.
class HostLoops {
 public:
  /// A vector with a value for each phyxel of the model, or several.
  template <class T>
  using Vector = Bulk<T>;
  /// What the search reads of a model.
  template <class T>
  using Input = std::span<const T>;

  explicit HostLoops(const Model& model) : model_(model) {}

  Neighbourhoods neighbourhoods() const {
    const Neighbourhood& hood = model_.with_lists().neighbourhood;
    return {model_.position.data(),         hood.support.data(),
            hood.neighbours.offsets.data(), hood.neighbours.indices.data(),
            model_.inverse_moment.data(),   model_.moment_offset.data()};
  }
  template <class T>
  Input<T> input(const std::vector<T>& values) const {
    return values;
  }
  template <class T>
  Vector<T> vector(const std::vector<T>& values) const {
    return {values.begin(), values.end()};
  }
  /// A vector of zeros. @param width values for each phyxel. @param more values at the end
  template <class T>
  Vector<T> make(std::size_t width = 1, std::size_t more = 0) const {
    return Vector<T>(model_.position.size() * width + more, T{});
  }
  template <class T>
  std::vector<T> fetched(const Vector<T>& values) const {
    return {values.begin(), values.end()};
  }

  static Vec3d terms(const Gathers& gathers, Index j, Row neighbours, const RowWeights& weights,
                     Vec3d start) {
    return terms_on_host(gathers, j, neighbours, weights, start);
  }
  static Differences differences(const Gathers& gathers, Index j, Row neighbours,
                                 const RowWeights& weights) {
    return differences_on_host(gathers, j, neighbours, weights);
  }

  /// Calls each(body, i) for the phyxels that are not ghosts.
  template <class Each>
  void for_each(const Bodies& bodies, const Each& each) const {
    on_threads(bodies, own_end, [&](const Stretch& stretch) {
      const Standing& body = bodies[stretch.body];
      for (Index i = stretch.begin; i < stretch.end; ++i) each(body, i);
    });
  }
  template <class Each>
  void for_each_with_ghosts(const Bodies& bodies, const Each& each) const {
    on_threads(
        bodies, [](const Part& part) { return part.end; },
        [&](const Stretch& stretch) {
          const Standing& body = bodies[stretch.body];
          for (Index i = stretch.begin; i < stretch.end; ++i) each(body, i);
        });
  }
  /// Sets a member of each body to Σ term(body, i) over its phyxels of all ranks, rounded once.
  /// Collective.
  template <class Term>
  void sum(const Bodies& bodies, double Standing::*into, const Term& term) const {
    std::vector<ExactSum> sums(bodies.size());
    on_threads(bodies, own_end, [&](const Stretch& stretch) {
      const Standing& body = bodies[stretch.body];
      ExactSum own;
      for (Index i = stretch.begin; i < stretch.end; ++i) own.add(term(body, i));
#pragma omp critical(phyxel_closure_sum)
      sums[stretch.body].add(own);
    });
    add_over_ranks(model_, sums);
    for (std::size_t b = 0; b < bodies.size(); ++b) bodies[b].*into = sums[b].value();
  }
  /// Copies the owners' values to the ghosts of all bodies from the first to the last. Collective.
  template <class Values>
  void refresh_ghosts(const Bodies& bodies, Values& values) const {
    if (!model_.share || bodies.empty()) return;
    phyxel::refresh_ghosts(*model_.share, values, bodies[0].begin(),
                           bodies[bodies.size() - 1].end());
  }

 private:
  /// Phyxels [begin, end) of one part.
  struct Stretch {
    std::size_t body;
    Index begin, end;
  };
  static Index own_end(const Part& part) { return part.owned_end(); }
  /// Calls visit(stretch) on each thread for its share of the phyxels, so that many small bodies
  /// keep all threads busy.
  /// @param end end(part): the end of the phyxels to visit
  template <class End, class Visit>
  static void on_threads(const Bodies& bodies, End&& end, Visit&& visit) {
    std::int64_t size = 0;
    for (const Body* body : bodies) {
      for (const Part& part : body->parts) size += end(part) - part.begin;
    }
#pragma omp parallel
    {
      const std::int64_t threads = omp_get_num_threads(), thread = omp_get_thread_num();
      const std::int64_t first = size * thread / threads, last = size * (thread + 1) / threads;
      std::int64_t at = 0;
      for (std::size_t b = 0; b < bodies.size(); ++b) {
        for (const Part& part : bodies[b].parts) {
          const std::int64_t length = end(part) - part.begin;
          const std::int64_t from = std::max(first - at, std::int64_t{0}),
                             to = std::min(last - at, length);
          if (from < to) {
            visit({b, part.begin + static_cast<Index>(from), part.begin + static_cast<Index>(to)});
          }
          at += length;
        }
      }
    }
  }

  const Model& model_;
};

}  // namespace phyxel::closing
