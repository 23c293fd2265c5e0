#include "compose.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "label.hpp"

namespace phyxel::app {
namespace {

constexpr Colour background_top{0.90f, 0.91f, 0.92f}, background_bottom{0.66f, 0.67f, 0.69f};

std::vector<Colour> colours(const FrameData& frame, Colour (*of_body)(Index)) {
  std::vector<Colour> colour(frame.point.size(), of_body(0));
  if (frame.body.size() != colour.size()) return colour;
  Index known = 0;
  Colour latest = of_body(known);
  for (std::size_t i = 0; i < colour.size(); ++i) {
    if (frame.body[i] != known) latest = of_body(known = frame.body[i]);
    colour[i] = latest;
  }
  return colour;
}

std::span<const Index> bodies(const FrameData& frame) {
  if (frame.body.size() != frame.point.size()) return {};
  return frame.body;
}

}  // namespace

double typical_spacing(const std::vector<Vec3d>& point) {
  const std::size_t n = point.size();
  if (n < 2) return 0;
  constexpr std::size_t most_probes = 32;
  const std::size_t probes = std::min(most_probes, n);
  std::array<std::size_t, most_probes> probe{};
  std::array<double, most_probes> nearest;
  nearest.fill(std::numeric_limits<double>::infinity());
  for (std::size_t k = 0; k < probes; ++k) probe[k] = k * n / probes;
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t k = 0; k < probes; ++k) {
      const Vec3d d = point[i] - point[probe[k]];
      const double square = dot(d, d);
      if (square < nearest[k] && i != probe[k]) nearest[k] = square;
    }
  }
  const auto middle = nearest.begin() + static_cast<std::ptrdiff_t>(probes / 2);
  std::nth_element(nearest.begin(), middle, nearest.begin() + static_cast<std::ptrdiff_t>(probes));
  return std::isfinite(*middle) ? std::sqrt(*middle) : 0;
}

Image draw_picture(const FrameData* surface, const FrameData* phyxels, const Setting& setting) {
  Rasteriser rasteriser(setting.camera, setting.up, background_top, background_bottom);
  if (surface != nullptr) {
    const bool has_normals = surface->normal.size() == surface->point.size();
    const auto normal =
        has_normals ? surface->normal : vertex_normals(surface->point, surface->triangle);
    rasteriser.draw_surface(surface->point, normal, surface->triangle,
                            colours(*surface, body_colour), bodies(*surface));
    rasteriser.shade_hollows(0.05 * setting.extent);
  }
  if (phyxels != nullptr) {
    DotStyle style;
    style.largest = 0.04 * std::min(setting.camera.width, setting.camera.height);
    if (surface != nullptr) {
      style.radius = 0.20 * setting.spacing;
      style.fade = std::max(3 * setting.spacing, 0.04 * setting.extent);
      rasteriser.draw_dots(phyxels->point, colours(*phyxels, dot_colour), bodies(*phyxels), style);
    } else {
      style.radius = 0.42 * setting.spacing;
      rasteriser.draw_spheres(phyxels->point, colours(*phyxels, body_colour), bodies(*phyxels),
                              style);
      rasteriser.shade_hollows(1.5 * setting.spacing);
    }
  }
  Image image = rasteriser.resolve();
  const FrameData* timed = surface != nullptr ? surface : phyxels;
  if (timed != nullptr && setting.time_decimals >= 0) {
    const double scale = text_scale(image);
    const int margin = static_cast<int>(9 * scale);
    draw_text(image, margin, image.height - margin - static_cast<int>(7 * scale), scale,
              fmt::format("t = {:.{}f} s", timed->time, setting.time_decimals));
  }
  return image;
}

}  // namespace phyxel::app
