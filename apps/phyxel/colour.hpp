/// Colours in linear light, chosen in a perceptual colour space.
#pragma once

#include "phyxel/types.hpp"

namespace phyxel::app {

/// A colour in linear-light sRGB primaries (x red, y green, z blue), 0 to 1.
using Colour = Vec3<float>;

/// Conversion of OKLCH to linear sRGB, clipped to the gamut. Source: Ottosson 2020, "A perceptual
/// color space for image processing".
/// @param lightness 0 to 1 @param chroma 0 to about 0.3 @param hue [degrees]
Colour oklch(double lightness, double chroma, double hue);

/// Colour of a body and of the dots of its phyxels. Hues are a golden angle apart, so that any
/// number of bodies differ.
Colour body_colour(Index body);
Colour dot_colour(Index body);

/// The 8-bit sRGB value of linear light.
std::uint8_t encode(float linear);

}  // namespace phyxel::app
