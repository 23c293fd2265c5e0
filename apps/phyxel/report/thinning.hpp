/// Coarser surfaces for pages, made of a part of the surfels.
#pragma once

#include <cstddef>
#include <vector>

#include "phyxel/cloud.hpp"
#include "phyxel/recorder.hpp"

namespace phyxel::app {

/// The surfels that represent a surface, and triangles between them.
struct ThinnedSurface {
  std::vector<std::size_t> surfel;  ///< Numbers in the surface, ascending.
  std::vector<Triangle> triangle;   ///< Of positions in `surfel`.
};

/// A part of a surface's surfels: one of each body in each cell of a grid, the nearest to the mean
/// of those in the cell; triangles between surfels of a cell vanish. Source: Rossignac and Borrel
/// 1993, "Multi-resolution 3D approximations for rendering complex scenes".
/// @param most largest number of surfels, at least the number of bodies; a surface that has no more
///   is returned as it is
ThinnedSurface thinned(const FrameData& surface, std::size_t most);

}  // namespace phyxel::app
