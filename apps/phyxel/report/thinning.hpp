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
  /// Position in `surfel` of the one that represents each surfel; empty if each represents itself.
  std::vector<std::size_t> representative;

  /// Triangles of the surface as of `triangle`.
  std::vector<Triangle> shown(const std::vector<Triangle>& of_surface) const;
};

/// A part of a surface's surfels: one of each body in each cell of a grid, the nearest to the mean
/// of those in the cell; triangles between surfels of a cell vanish. Source: Rossignac and Borrel
/// 1993, "Multi-resolution 3D approximations for rendering complex scenes".
/// @param most largest number of surfels, at least the number of bodies; a surface that has no more
///   is returned as it is
ThinnedSurface thinned(const FrameData& surface, std::size_t most);

/// Puts the triangles of a surface in the order in which later frames lack them, those that none
/// lacks first.
/// @param of_frames the triangles that each frame has. @returns how many each frame has
std::vector<std::size_t> sort_by_last_frame(std::vector<Triangle>& triangles,
                                            std::vector<std::vector<Triangle>> of_frames);

}  // namespace phyxel::app
