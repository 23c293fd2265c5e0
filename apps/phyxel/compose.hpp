/// From a frame of a trajectory to a picture: a shaded surface with the phyxels inside it as dots,
/// as in Figure 1 of Farias et al. 2008.
#pragma once

#include "phyxel/recorder.hpp"
#include "rasteriser.hpp"

namespace phyxel::app {

/// What all pictures of one trajectory share.
struct Setting {
  Camera camera;
  Vec3d up{0, 0, 1};
  double spacing = 0;     ///< Typical distance between phyxels [m].
  double extent = 0;      ///< Of everything that is seen [m].
  int time_decimals = 2;  ///< Of the time label; negative: no label.
};

/// Median distance [m] from a few points, spread over the list, to their nearest other point; 0
/// for fewer than two points.
double typical_spacing(const std::vector<Vec3d>& point);

/// @param surface,phyxels of one moment; null: not drawn.
Image draw_picture(const FrameData* surface, const FrameData* phyxels, const Setting& setting);

}  // namespace phyxel::app
