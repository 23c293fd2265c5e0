/// Loads and prescribed motions of a model, shared by all solvers.
#pragma once

#include <utility>
#include <vector>

#include "phyxel/model.hpp"

namespace phyxel {

/// Calls add(phyxel, force) for the force [N] of every load on every phyxel at `time` [s].
template <class Add>
void for_each_load(const Model& model, double time, Add&& add) {
  for (const Load& load : model.loads) {
    const double scale = load.scale_at(time);
    for (std::size_t k = 0; k < load.phyxels.size(); ++k) {
      add(load.phyxels[k], scale * load.force[k]);
    }
  }
}

/// Adds the loads at `time` [s] to forces [N], shape [n].
inline void add_loads(const Model& model, double time, std::vector<Vec3d>& force) {
  for_each_load(model, time, [&](Index i, Vec3d load) { force[i] += load; });
}

/// Adds the loads at full size to forces [N], shape [n].
inline void add_full_loads(const Model& model, std::vector<Vec3d>& force) {
  for (const Load& load : model.loads) {
    for (std::size_t k = 0; k < load.phyxels.size(); ++k) force[load.phyxels[k]] += load.force[k];
  }
}

/// Returns 1 for the free axes of each phyxel and 0 for prescribed ones, shape [n]. Empty for a
/// model without prescribed motions.
inline std::vector<Vec3d> free_axes(const Model& model) {
  std::vector<Vec3d> free(model.motions.empty() ? 0 : static_cast<std::size_t>(model.size()),
                          {1, 1, 1});
  for (const Motion& motion : model.motions) {
    for (const Index i : motion.phyxels) free[i] = motion.along_axes({}, free[i]);
  }
  return free;
}

/// Sets the displacements that motions prescribe at `time` [s]; others do not change.
/// @param displacement [m], shape [n]
inline void prescribe_displacements(const Model& model, double time,
                                    std::vector<Vec3d>& displacement) {
  for (const Motion& motion : model.motions) {
    const Path path = motion.path_at(time);
    for (const Index i : motion.phyxels) {
      displacement[i] = motion.along_axes(path.at(model.position[i]), displacement[i]);
    }
  }
}

}  // namespace phyxel
