/// Labels on pictures, in a built-in font.
#pragma once

#include <string_view>

#include "rasteriser.hpp"

namespace phyxel::app {

/// Draws `text` with its top left corner at pixel (x, y). Known characters are digits, small
/// letters, P, and " .=-+_/^[]"; others leave a gap. @param scale pixels per dot of the 5 x 7 font
void draw_text(Image& image, int x, int y, double scale, std::string_view text);

/// A scale that suits the image [pixels per font dot].
double text_scale(const Image& image);

}  // namespace phyxel::app
