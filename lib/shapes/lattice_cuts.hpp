/// Where regions of space in which a lattice is held or moved cut it.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "phyxel/cloud.hpp"

namespace phyxel {

/// What is asked of the layers of a lattice.
struct LayerPlan {
  std::array<std::array<bool, 2>, 3> on_end{};  ///< Whether layers lie on the ends, by axis.
  std::array<std::vector<double>, 3> planes;    ///< Where else layers lie, by axis, ascending [m].
  std::vector<SupportCut> cuts;                 ///< Regions whose boundaries have layers.
};

/// The box that a lattice fills, or that its round solid lies in.
struct LatticeBox {
  Vec3d low, extent;             ///< Lower corner and size [m].
  std::array<bool, 3> flat{};    ///< Whether the ends of each axis are flat faces of the solid.
  std::array<bool, 3> on_end{};  ///< Whether layers lie on them without being asked to.
  double spacing = 0;            ///< Wanted distance between layers [m].
  double depth = 0;              ///< How deep layers lie below a region's boundary [m].
};

/// True if a region is a box whose edges are parallel to the axes.
bool is_along_axes(const SpaceRegion& region);

/// Plans layers on those faces of boxes along the axes that are inside a lattice, so that a support
/// acts where its box ends. A box thinner than 0.8 spacings has
/// one layer, in its middle. Balls, turned boxes and boxes whose layers would be less than half a
/// spacing from others have none, on any of their faces: they hold the phyxels that they contain.
LayerPlan plan_layers(const LatticeBox& lattice, std::span<const SpaceRegion> regions);

}  // namespace phyxel
