/// Which part of a model a phyxel belongs to.
#pragma once

#include <algorithm>

#include "phyxel/model.hpp"

namespace phyxel {

/// Returns the part of phyxel i.
inline const Part& part_of(const Model& model, Index i) {
  return *std::upper_bound(model.parts.begin(), model.parts.end(), i,
                           [](Index at, const Part& part) { return at < part.end; });
}

/// True if two phyxels are of the same part.
inline bool are_of_one_part(const Model& model, Index i, Index j) {
  const Part& part = part_of(model, i);
  return j >= part.begin && j < part.end;
}

}  // namespace phyxel
