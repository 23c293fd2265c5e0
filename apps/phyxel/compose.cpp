#include "compose.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "draw_obstacles.hpp"
#include "label.hpp"
#include "shadow.hpp"

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

std::span<const Index> body_numbers(const FrameData& frame) {
  if (frame.body.size() != frame.point.size()) return {};
  return frame.body;
}

/// The bodies of a frame, ready to be drawn from any side: surfaces, or else phyxels.
class Bodies {
 public:
  Bodies(const FrameData* surface, const FrameData* phyxels, const Setting& setting)
      : surface_(surface),
        frame_(surface != nullptr ? surface : phyxels),
        radius_(0.42 * setting.spacing) {
    if (frame_ == nullptr) return;
    colour_ = colours(*frame_, body_colour);
    if (setting.colouring) colour_by_field(surface, phyxels, *setting.colouring);
    if (surface != nullptr && surface->normal.size() != surface->point.size()) {
      made_normal_ = vertex_normals(surface->point, surface->triangle);
    }
    if (surface != nullptr && phyxels != nullptr) find_torn(*phyxels, setting.colouring);
  }

  bool any() const { return frame_ != nullptr; }
  std::span<const Vec3d> points() const { return frame_->point; }
  double time() const { return frame_->time; }  ///< [s]

  void draw(Rasteriser& rasteriser) const {
    if (surface_ != nullptr) {
      rasteriser.draw_surface(surface_->point,
                              made_normal_.empty() ? surface_->normal : made_normal_,
                              surface_->triangle, colour_, body_numbers(*surface_));
      rasteriser.draw_spheres(torn_, torn_colour_, torn_body_, style_of(rasteriser.camera()));
    } else {
      rasteriser.draw_spheres(frame_->point, colour_, body_numbers(*frame_),
                              style_of(rasteriser.camera()));
    }
  }

 private:
  DotStyle style_of(const Camera& camera) const {
    return {.radius = radius_, .largest = 0.04 * std::min(camera.width, camera.height)};
  }

  /// Finds the phyxels that have lost pairs, which are seen where a surface has opened.
  void find_torn(const FrameData& phyxels, const std::optional<Colouring>& colouring) {
    const auto broken = field_values(phyxels, "broken");
    if (!broken) return;
    std::vector<Colour> colour = colours(phyxels, body_colour);
    const auto values = colouring ? field_values(phyxels, colouring->field) : std::nullopt;
    for (std::size_t i = 0; i < phyxels.point.size(); ++i) {
      if (!((*broken)[i] > 0)) continue;
      torn_.push_back(phyxels.point[i]);
      torn_colour_.push_back(values ? field_colour((*values)[i], *colouring) : colour[i]);
      torn_body_.push_back(body_numbers(phyxels).empty() ? 0 : phyxels.body[i]);
    }
  }

  /// Colours the points by a field. NaN has the colour of the lowest value.
  void colour_by_field(const FrameData* surface, const FrameData* phyxels,
                       const Colouring& colouring) {
    const std::vector<double> values = shown_values(surface, phyxels, colouring);
    if (values.size() != colour_.size()) return;
    for (std::size_t i = 0; i < values.size(); ++i) {
      colour_[i] = field_colour(values[i], colouring);
    }
  }

  const FrameData *surface_, *frame_;
  double radius_;  // of phyxels without a surface [m]
  std::vector<Colour> colour_;
  std::vector<Vec3d> made_normal_;  // unless the frame has some
  // Phyxels beside cracks of a surface.
  std::vector<Vec3d> torn_;
  std::vector<Colour> torn_colour_;
  std::vector<Index> torn_body_;
};

/// Adds the extents of an obstacle across the light, up to a distance from the middle: those of a
/// shape are where a faraway point is nearest to it.
void include_obstacle(ShadowBounds& bounds, const PlacedObstacle& obstacle, Vec3d middle,
                      double reach) {
  const double far = 100 * reach;
  for (const int k : {0, 1}) {
    const Vec3d axis = bounds.axis(k);
    const auto extent = [&](double sign) {
      const double found = far - obstacle.distance(middle + (sign * far) * axis);
      return sign * std::clamp(found, -reach, reach);
    };
    bounds.include(k, dot(middle, axis) + extent(-1), dot(middle, axis) + extent(1));
  }
}

/// Adds the obstacles at the time of the bodies, and shadows, to a picture of the bodies.
void add_obstacles(Rasteriser& rasteriser, const Bodies& bodies, const Setting& setting) {
  constexpr Colour black{0, 0, 0};
  const std::vector<PlacedObstacle> all = placed(setting.obstacles, setting.paths, bodies.time());
  const Fade fade{setting.middle, 1.0 * setting.extent, 4.0 * setting.extent};
  const Vec3d light = light_direction(setting.camera, setting.up);
  ShadowBounds bounds(setting.camera, light);
  bounds.include(bodies.points());
  std::vector<PlacedObstacle> casting;
  for (const PlacedObstacle& obstacle : all) {
    if (!obstacle.bounded || obstacle.step.hollow) continue;
    casting.push_back(obstacle);
    include_obstacle(bounds, obstacle, setting.middle, fade.end);
  }
  if (bounds.empty()) {
    draw_obstacles(rasteriser, all, fade, [](Vec3d, Index) { return 1.0f; });
    return;
  }
  Rasteriser seen(bounds.camera(setting.middle, fade.end), setting.up, black, black, 1);
  bodies.draw(seen);
  draw_obstacles(seen, casting, fade, [](Vec3d, Index) { return 1.0f; });
  const Shadows shadows(seen);
  rasteriser.darken([&](Vec3d place, Index body) {
    constexpr float strength = 0.45f;
    return 1 - strength * (1 - shadows.light_at(place, body));
  });
  draw_obstacles(rasteriser, all, fade,
                 [&](Vec3d place, Index body) { return shadows.light_at(place, body); });
}

/// Draws a bar of a round length, as it is seen in the middle of the bodies, over the time label.
void draw_scale_bar(Image& image, const Setting& setting) {
  constexpr std::uint8_t ink = 64;
  const double length = round_length(setting.camera, setting.middle);
  if (!(length > 0)) return;
  const double scale = text_scale(image);
  const int margin = static_cast<int>(9 * scale), thick = std::max(1, static_cast<int>(scale));
  const int width = static_cast<int>(length * setting.camera.focal /
                                     setting.camera.project(setting.middle).depth);
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

/// True if dots of phyxels would be so near to each other that they hide the surface.
bool crowds_dots(const Setting& setting) {
  const double depth = setting.camera.project(setting.middle).depth;
  return depth > 0 && setting.spacing * setting.camera.focal / depth < setting.nearest_dots;
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
  const Bodies bodies(surface, phyxels, setting);
  if (bodies.any()) {
    bodies.draw(rasteriser);
    if (!setting.obstacles.empty()) add_obstacles(rasteriser, bodies, setting);
    rasteriser.shade_hollows(surface != nullptr ? 0.05 * setting.extent : 1.5 * setting.spacing);
  }
  if (surface != nullptr && phyxels != nullptr && !setting.colouring && !crowds_dots(setting)) {
    DotStyle style;
    style.largest = 0.04 * std::min(setting.camera.width, setting.camera.height);
    style.radius = 0.20 * setting.spacing;
    style.fade = std::max(3 * setting.spacing, 0.04 * setting.extent);
    rasteriser.draw_dots(phyxels->point, colours(*phyxels, dot_colour), body_numbers(*phyxels),
                         style);
  }
  Image image = rasteriser.resolve();
  if (bodies.any() && setting.time_decimals >= 0) {
    const double scale = text_scale(image);
    const int margin = static_cast<int>(9 * scale);
    draw_text(image, margin, image.height - margin - static_cast<int>(7 * scale), scale,
              fmt::format("t = {:.{}f} s", bodies.time(), setting.time_decimals));
  }
  if (bodies.any() && setting.scale_bar) draw_scale_bar(image, setting);
  if (bodies.any() && setting.colouring) draw_colour_bar(image, *setting.colouring);
  return image;
}

}  // namespace phyxel::app
