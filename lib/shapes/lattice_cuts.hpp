/// Where regions of space in which a lattice is held or moved cut it.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "phyxel/cloud.hpp"

namespace phyxel {

/// What is asked of the layers of a lattice.
struct LayerPlan {
  std::array<std::array<bool, 2>, 3> on_end{};  ///< Whether layers lie on the ends, by axis.
  std::array<std::vector<double>, 3> planes;    ///< Where else layers lie, by axis, ascending [m].
  std::vector<SupportCut> cuts;   ///< Regions that hold all axes and whose boundaries have layers.
  std::vector<SupportCut> moved;  ///< `SupportCuts::moved`.
};

/// The box that a lattice fills, or that its round solid lies in.
struct LatticeBox {
  Vec3d low, extent;             ///< Lower corner and size [m].
  std::array<bool, 3> flat{};    ///< Whether the ends of each axis are flat faces of the solid.
  std::array<bool, 3> on_end{};  ///< Whether layers lie on them without being asked to.
  double spacing = 0;            ///< Wanted distance between layers [m].
  double depth = 0;  ///< Places nearer to each other are the same, a rounding error [m].
};

/// The ranges of a box's coordinates along the x, y and z axes [m]; `nullopt` for a ball, and for a
/// box whose edges are not parallel to the axes.
std::optional<std::array<std::array<double, 2>, 3>> ranges_along_axes(const SpaceRegion& region);

/// True if a region is a box whose edges are parallel to the axes.
bool is_along_axes(const SpaceRegion& region);

/// Plans layers on those faces of boxes along the axes that are inside a lattice, so that a support
/// acts where its box ends. The order of the supports has no effect: those that hold all axes are
/// laid first, each kind in the order of `comes_before`.
///
/// A box thinner than 0.8 spacings has one layer, in its middle. A face less than half a spacing
/// from another layer, or from an end of the lattice, moves there. Of a box that holds all phyxels
/// on an end along all axes, and of one at an end without a layer, a face moves to that end only if
/// nearer than 0.05 spacings. Balls and turned boxes have no layers, nor have boxes with a face on
/// which a round solid has none: such supports hold the phyxels that they contain.
LayerPlan plan_layers(const LatticeBox& lattice, std::span<const SupportRegion> supports);

}  // namespace phyxel
