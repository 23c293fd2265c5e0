#include "mesh/repulsion.hpp"

namespace phyxel {

Repulsion::Repulsion(std::span<const Vec3d> point, const SpacingField& spacing)
    : spacing_(spacing.coarsest()) {
  if (spacing.is_uniform()) {
    uniform_.emplace(point, 0.5 * repulsion_reach * spacing_);
  } else {
    size_ = spacing.at(point);
    graded_.emplace(point, size_);
  }
}

}  // namespace phyxel
