#include "annotation.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "colour_range.hpp"
#include "label.hpp"

namespace phyxel::app {
namespace {

using Ink = std::array<std::uint8_t, 3>;  // sRGB

/// A place on an image [px].
struct Spot {
  double x, y;
};

/// Draws a straight line with round ends. @param thick its width [px]
void draw_line(Image& image, Spot from, Spot to, double thick, Ink ink) {
  const double dx = to.x - from.x, dy = to.y - from.y, square = dx * dx + dy * dy;
  const double around = 0.5 * thick + 1;
  const auto first = [&](double a, double b) {
    return std::max(0, static_cast<int>(std::floor(std::min(a, b) - around)));
  };
  const auto end = [&](double a, double b, int size) {
    return std::min(size, static_cast<int>(std::ceil(std::max(a, b) + around)));
  };
  for (int y = first(from.y, to.y); y < end(from.y, to.y, image.height); ++y) {
    for (int x = first(from.x, to.x); x < end(from.x, to.x, image.width); ++x) {
      const double px = x + 0.5 - from.x, py = y + 0.5 - from.y;
      const double along = square > 0 ? std::clamp((px * dx + py * dy) / square, 0.0, 1.0) : 0;
      const double away = std::hypot(px - along * dx, py - along * dy);
      const double cover = std::clamp(0.5 * thick + 0.5 - away, 0.0, 1.0);
      std::uint8_t* pixel = image.pixel(x, y);
      for (std::size_t k = 0; k < 3; ++k) {
        pixel[k] = static_cast<std::uint8_t>(std::lround(pixel[k] + cover * (ink[k] - pixel[k])));
      }
    }
  }
}

}  // namespace

double round_length(const Camera& camera, Vec3d place) {
  const double depth = camera.project(place).depth;
  const double longest = 0.2 * camera.width * depth / camera.focal;
  if (!(depth > 0) || !std::isfinite(longest)) return 0;
  const double unit = std::pow(10, std::floor(std::log10(longest)));
  for (const double by : {5.0, 2.0}) {
    if (by * unit <= longest) return by * unit;
  }
  return unit;
}

void draw_scale_bar(Image& image, const Camera& camera, Vec3d place) {
  constexpr std::uint8_t ink = 64;
  const double length = round_length(camera, place);
  if (!(length > 0)) return;
  const double scale = text_scale(image);
  const int margin = static_cast<int>(9 * scale), thick = std::max(1, static_cast<int>(scale));
  const int width = static_cast<int>(length * camera.focal / camera.project(place).depth);
  const int cap = static_cast<int>(2 * scale), bottom = image.height - static_cast<int>(23 * scale);
  if (bottom - 2 * cap < 0 || margin + width >= image.width) return;  // the picture has no room
  const auto fill = [&](int x0, int x1, int y0, int y1) {
    for (int y = y0; y < y1; ++y) std::fill_n(image.pixel(x0, y), 3 * (x1 - x0), ink);
  };
  fill(margin, margin + width, bottom - thick, bottom);
  fill(margin, margin + thick, bottom - cap - thick, bottom);
  fill(margin + width - thick, margin + width, bottom - cap - thick, bottom);
  draw_text(image, margin + width + static_cast<int>(4 * scale),
            bottom - static_cast<int>(6 * scale), scale, short_number(length) + " m");
}

void draw_axes(Image& image, const Camera& camera) {
  struct Axis {
    const char* name;
    Vec3d direction;
    Ink ink;
  };
  std::array<Axis, 3> axes{Axis{"x", {1, 0, 0}, {172, 62, 58}}, Axis{"y", {0, 1, 0}, {62, 116, 58}},
                           Axis{"z", {0, 0, 1}, {52, 88, 168}}};
  std::stable_sort(axes.begin(), axes.end(), [&](const Axis& a, const Axis& b) {
    return dot(a.direction, camera.forward) > dot(b.direction, camera.forward);
  });
  const double scale = text_scale(image), length = 13 * scale, wide = 6 * scale;
  const Spot origin{9 * scale + length + wide, image.height - 34 * scale - length};
  if (origin.y - length - wide < 0 || origin.x + length + wide > image.width) return;
  for (const Axis& axis : axes) {
    const double right = dot(axis.direction, camera.right), up = dot(axis.direction, camera.up);
    const double seen = std::hypot(right, up);
    const Spot tip{origin.x + length * right, origin.y - length * up};
    draw_line(image, origin, tip, 1.2 * scale, axis.ink);
    // The name of an axis that points at the camera, or away from it, stands beside the origin.
    const double to_right = seen > 0.1 ? right / seen : 0.7, to_up = seen > 0.1 ? up / seen : -0.7;
    draw_text(image, static_cast<int>(std::lround(tip.x + wide * to_right - 2.5 * scale)),
              static_cast<int>(std::lround(tip.y - wide * to_up - 4.5 * scale)), scale, axis.name);
  }
}

}  // namespace phyxel::app
