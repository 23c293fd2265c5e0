/// Colours in linear light, picked in a perceptual colour space.
#pragma once

#include "phyxel/types.hpp"

namespace phyxel::app {

/// Linear-light sRGB primaries (x red, y green, z blue), 0 to 1.
using Colour = Vec3<float>;

/// OKLCH to linear sRGB, clipped to the gamut. Source: Ottosson 2020, "A perceptual color space
/// for image processing".
/// @param lightness 0 to 1. @param chroma 0 to about 0.3. @param hue [degrees].
Colour oklch(double lightness, double chroma, double hue);

/// Material colour of a body, and of the dots of its phyxels: hues a golden angle apart, so that
/// any number of bodies differ.
Colour body_colour(Index body);
Colour dot_colour(Index body);

/// Linear light to the 8-bit sRGB value.
std::uint8_t encode(float linear);

}  // namespace phyxel::app
