/// Pictures of frames: a shaded surface with the phyxels inside it as dots, as in Figure 1 of
/// Farias et al. 2008.
#pragma once

#include <optional>

#include "colouring.hpp"
#include "cut.hpp"
#include "phyxel/model.hpp"
#include "phyxel/recorder.hpp"
#include "rasteriser.hpp"
#include "rigid_paths.hpp"

namespace phyxel::app {

/// Settings that the pictures of a trajectory share.
struct Setting {
  Camera camera;
  Vec3d up{0, 0, 1};
  double spacing = 0;     ///< Typical distance between phyxels [m].
  double extent = 0;      ///< Extent of the visible points [m].
  int time_decimals = 2;  ///< Decimals of the time label; negative for no label.
  Vec3d middle;           ///< Of the visible points [m].
  /// True for a bar of a round length at `middle`, and for the axes of coordinates.
  bool scale_bar = false;
  double nearest_dots =
      0;  ///< Distance of phyxels below which no dots are drawn on a surface [px].
  std::vector<Obstacle> obstacles = {};     ///< Drawn where they are at the time of a frame.
  RigidPaths paths = {};                    ///< Of those that are free bodies.
  std::optional<Colouring> colouring = {};  ///< Unset: bodies have colours of their own.
  std::optional<CutPlane> cut = {};         ///< Unset: bodies are drawn whole.
};

/// Median distance to the nearest point [m], of a few points distributed over the list; 0 for fewer
/// than two points.
double typical_spacing(const std::vector<Vec3d>& point);

/// Draws a frame, without dots of phyxels if these are too near to each other or colours show a
/// field. Phyxels that have lost pairs, by the field `broken` of their frame, are balls that fill
/// the cracks of a surface. @param surface,phyxels frames of the same time; null if not drawn
Image draw_picture(const FrameData* surface, const FrameData* phyxels, const Setting& setting);

}  // namespace phyxel::app
