#include "mesh/repulsion.hpp"

#include "tabulated.hpp"

namespace phyxel {

Repulsion::Repulsion(std::span<const Vec3d> point, const SpacingField& spacing)
    : spacing_(spacing.coarsest()) {
  if (spacing.is_uniform()) {
    uniform_.emplace(point, 0.5 * repulsion_reach * spacing_);
  } else {
    size_ = tabulated(point.size(), [&](std::size_t k) { return spacing.at(point[k]); });
    graded_.emplace(point, size_);
  }
}

}  // namespace phyxel
