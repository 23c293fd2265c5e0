#include "colour.hpp"

#include <algorithm>
#include <numbers>

namespace phyxel::app {
namespace {

constexpr double first_hue = 165, golden_angle = 137.508;  // [degrees]

double body_hue(Index body) { return first_hue + golden_angle * static_cast<double>(body); }

/// Table of the sRGB transfer function (IEC 61966-2-1) over [0, 1].
std::array<std::uint8_t, 8193> make_encoding() {
  std::array<std::uint8_t, 8193> table{};
  for (std::size_t k = 0; k < table.size(); ++k) {
    const double v = static_cast<double>(k) / 8192;
    const double s = v <= 0.0031308 ? 12.92 * v : 1.055 * std::pow(v, 1 / 2.4) - 0.055;
    table[k] = static_cast<std::uint8_t>(std::lround(255 * s));
  }
  return table;
}

}  // namespace

Colour oklch(double lightness, double chroma, double hue) {
  const double angle = hue * std::numbers::pi / 180;
  const double a = chroma * std::cos(angle), b = chroma * std::sin(angle);
  const auto cube = [](double v) { return v * v * v; };
  const double l = cube(lightness + 0.3963377774 * a + 0.2158037573 * b);
  const double m = cube(lightness - 0.1055613458 * a - 0.0638541728 * b);
  const double s = cube(lightness - 0.0894841775 * a - 1.2914855480 * b);
  const auto clip = [](double v) { return static_cast<float>(std::clamp(v, 0.0, 1.0)); };
  return {clip(4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s),
          clip(-1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s),
          clip(-0.0041960863 * l - 0.7034186147 * m + 1.7076147010 * s)};
}

Colour body_colour(Index body) { return oklch(0.80, 0.095, body_hue(body)); }
Colour dot_colour(Index body) { return oklch(0.36, 0.13, body_hue(body) + 130); }

std::uint8_t encode(float linear) {
  static const auto table = make_encoding();
  // NaN, from normals that are not finite, becomes black.
  const float clipped = linear > 0 ? std::min(linear, 1.0f) : 0.0f;
  return table[static_cast<std::size_t>(clipped * 8192 + 0.5f)];
}

}  // namespace phyxel::app
