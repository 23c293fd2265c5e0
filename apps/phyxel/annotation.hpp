/// What pictures say beside the bodies: a scale bar, and the axes of coordinates.
#pragma once

#include "rasteriser.hpp"

namespace phyxel::app {

/// The longest round length, 1, 2 or 5 times a power of ten, that takes at most a fifth of a
/// picture's width at a place [m]; 0 if the place is behind the camera.
double round_length(const Camera& camera, Vec3d place);

/// Draws a bar of a round length, as it is seen at a place [m], over the time label.
void draw_scale_bar(Image& image, const Camera& camera, Vec3d place);

/// Draws the directions of x, y and z over the scale bar; those that point away come first.
void draw_axes(Image& image, const Camera& camera);

}  // namespace phyxel::app
