/// Exact sums over ranks.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "exact_sum.hpp"
#include "phyxel/communicator.hpp"
#include "phyxel/model.hpp"
#include "phyxel/share.hpp"

namespace phyxel {

/// Adds the sums of all ranks, in place. Collective; the number of sums is the same on all ranks.
inline void add_over_ranks(const Communicator& ranks, const std::vector<ExactSum*>& sums) {
  std::vector<std::int64_t> words;
  for (ExactSum* sum : sums) {
    const std::span<std::int64_t> ready = sum->ready();
    words.insert(words.end(), ready.begin(), ready.end());
  }
  ranks.add(words);
  const std::int64_t* from = words.data();
  for (ExactSum* sum : sums) {
    std::copy_n(from, ExactSum::words, sum->ready().begin());
    from += ExactSum::words;
  }
}

/// Adds the sums of all ranks, in place, of sums that stand in one vector.
inline void add_over_ranks(const Communicator& ranks, std::vector<ExactSum>& sums) {
  std::vector<ExactSum*> all;
  for (ExactSum& sum : sums) all.push_back(&sum);
  add_over_ranks(ranks, all);
}

/// Adds the sums of all ranks, in place, of objects with several sums each, which `all()` lists.
/// Nothing is added if the model is no share.
template <class Sums>
void add_each_over_ranks(const Model& model, std::vector<Sums>& objects) {
  if (!model.share) return;
  std::vector<ExactSum*> all;
  for (Sums& sums : objects) {
    for (ExactSum* sum : sums.all()) all.push_back(sum);
  }
  add_over_ranks(*model.share->communicator, all);
}

/// Adds the sums of all ranks if the model is a share; a whole model has them already.
template <class Sums>
void add_over_ranks(const Model& model, Sums& sums) {
  if (model.share) add_over_ranks(*model.share->communicator, sums);
}

}  // namespace phyxel
