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

/// Returns the number of bodies of a model.
inline std::size_t count_of_bodies(const Model& model) {
  Index count = 0;
  for (const Part& part : model.parts) count = std::max(count, part.body + 1);
  return static_cast<std::size_t>(count);
}

/// Returns the body of a phyxel by its index in the whole model.
inline Index body_of_id(const Model& model, Index id) {
  Index end = 0;
  for (const Part& part : model.parts) {
    end += part.size;
    if (id < end) return part.body;
  }
  return -1;
}

}  // namespace phyxel
