#include "compose.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "annotation.hpp"
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

/// Points of a frame with their colours.
struct DrawnPoints {
  std::vector<Vec3d> point;
  std::vector<Colour> colour;
  std::vector<Index> body;  // empty for one body

  /// Leaves out the points that a plane cuts away.
  void cut(const CutPlane& plane) {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < point.size(); ++i) {
      if (plane.height(point[i]) > 0) continue;
      point[kept] = point[i];
      colour[kept] = colour[i];
      if (!body.empty()) body[kept] = body[i];
      ++kept;
    }
    point.resize(kept);
    colour.resize(kept);
    body.resize(std::min(kept, body.size()));
  }
};

/// The bodies of a frame, ready to be drawn from any side: surfaces, or else phyxels.
class Bodies {
 public:
  Bodies(const FrameData* surface, const FrameData* phyxels, const Setting& setting)
      : setting_(setting),
        frame_(surface != nullptr ? surface : phyxels),
        phyxels_(phyxels),
        has_surface_(surface != nullptr) {
    if (frame_ == nullptr) return;
    std::vector<Colour> colour = colours(*frame_, body_colour);
    if (setting.colouring) colour_by_field(surface, phyxels, *setting.colouring, colour);
    const std::span<const Index> body = body_numbers(*frame_);
    if (surface == nullptr) {
      spheres_ = {frame_->point, std::move(colour), {body.begin(), body.end()}};
      if (setting.cut) spheres_.cut(*setting.cut);
      return;
    }
    surface_ = {surface->point,
                surface->normal,
                std::move(colour),
                {body.begin(), body.end()},
                surface->triangle};
    if (surface->normal.size() != surface->point.size()) {
      surface_.normal = vertex_normals(surface->point, surface->triangle);
    }
    if (setting.cut) outlines_ = cut_away(surface_, *setting.cut);
    if (phyxels != nullptr) find_torn(*phyxels);
  }

  bool any() const { return frame_ != nullptr; }
  std::span<const Vec3d> points() const { return has_surface_ ? surface_.point : spheres_.point; }
  double time() const { return frame_->time; }  ///< [s]

  void draw(Rasteriser& rasteriser) const {
    if (has_surface_) {
      rasteriser.draw_surface(surface_.point, surface_.normal, surface_.triangle, surface_.colour,
                              surface_.body);
    }
    const Camera& camera = rasteriser.camera();
    const DotStyle style{.radius = 0.42 * setting_.spacing,
                         .largest = 0.04 * std::min(camera.width, camera.height)};
    rasteriser.draw_spheres(spheres_.point, spheres_.colour, spheres_.body, style);
  }

  /// Draws the faces that a plane cuts into surfaces.
  void draw_faces(Rasteriser& rasteriser) const {
    for (const CutOutline& outline : outlines_) {
      draw_face(rasteriser, outline, *setting_.cut, [&](const std::vector<Vec3d>& places) {
        return face_colours(places, outline.body);
      });
    }
  }

 private:
  /// Finds the phyxels that have lost pairs, which are seen where a surface has opened.
  void find_torn(const FrameData& phyxels) {
    const auto broken = field_values(phyxels, "broken");
    if (!broken) return;
    std::vector<Colour> colour = colours(phyxels, body_colour);
    const std::optional<Colouring>& colouring = setting_.colouring;
    const auto values = colouring ? field_values(phyxels, colouring->field) : std::nullopt;
    for (std::size_t i = 0; i < phyxels.point.size(); ++i) {
      if (!((*broken)[i] > 0)) continue;
      spheres_.point.push_back(phyxels.point[i]);
      spheres_.colour.push_back(values ? field_colour((*values)[i], *colouring) : colour[i]);
      spheres_.body.push_back(body_numbers(phyxels).empty() ? 0 : phyxels.body[i]);
    }
    if (setting_.cut) spheres_.cut(*setting_.cut);
  }

  /// Colours the points by a field. NaN has the colour of the lowest value.
  static void colour_by_field(const FrameData* surface, const FrameData* phyxels,
                              const Colouring& colouring, std::vector<Colour>& colour) {
    const std::vector<double> values = shown_values(surface, phyxels, colouring);
    if (values.size() != colour.size()) return;
    for (std::size_t i = 0; i < values.size(); ++i) colour[i] = field_colour(values[i], colouring);
  }

  /// The colours of places inside a body: those of its field there, or one that is paler than its
  /// surface.
  std::vector<Colour> face_colours(const std::vector<Vec3d>& places, Index body) const {
    constexpr Colour white{1, 1, 1};
    std::vector<Colour> colour(places.size(), 0.6f * body_colour(body) + 0.4f * white);
    if (!setting_.colouring || phyxels_ == nullptr) return colour;
    const double reach = carrier_reach(setting_.spacing);
    const auto values = inner_values(*phyxels_, body, setting_.colouring->field, places, reach);
    for (std::size_t k = 0; k < values.size(); ++k) {
      colour[k] = field_colour(values[k], *setting_.colouring);
    }
    return colour;
  }

  const Setting& setting_;
  const FrameData *frame_, *phyxels_;
  bool has_surface_;
  DrawnSurface surface_;
  DrawnPoints spheres_;  // phyxels without a surface, or beside the cracks of one
  std::vector<CutOutline> outlines_;
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

/// True if dots of phyxels would be so near to each other that they hide the surface.
bool crowds_dots(const Setting& setting) {
  const double depth = setting.camera.project(setting.middle).depth;
  return depth > 0 && setting.spacing * setting.camera.focal / depth < setting.nearest_dots;
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
  const Bodies bodies(surface, phyxels, setting);
  if (bodies.any()) {
    bodies.draw(rasteriser);
    bodies.draw_faces(rasteriser);
    if (!setting.obstacles.empty()) add_obstacles(rasteriser, bodies, setting);
    rasteriser.shade_hollows(surface != nullptr ? 0.05 * setting.extent : 1.5 * setting.spacing);
  }
  if (surface != nullptr && phyxels != nullptr && !setting.colouring && !crowds_dots(setting)) {
    DotStyle style;
    style.largest = 0.04 * std::min(setting.camera.width, setting.camera.height);
    style.radius = 0.20 * setting.spacing;
    style.fade = std::max(3 * setting.spacing, 0.04 * setting.extent);
    const std::span<const Index> body = body_numbers(*phyxels);
    DrawnPoints dots{phyxels->point, colours(*phyxels, dot_colour), {body.begin(), body.end()}};
    if (setting.cut) dots.cut(*setting.cut);
    rasteriser.draw_dots(dots.point, dots.colour, dots.body, style);
  }
  Image image = rasteriser.resolve();
  if (bodies.any() && setting.time_decimals >= 0) {
    const double scale = text_scale(image);
    const int margin = static_cast<int>(9 * scale);
    draw_text(image, margin, image.height - margin - static_cast<int>(7 * scale), scale,
              fmt::format("t = {:.{}f} s", bodies.time(), setting.time_decimals));
  }
  if (bodies.any() && setting.scale_bar) {
    draw_scale_bar(image, setting.camera, setting.middle);
    draw_axes(image, setting.camera);
  }
  if (bodies.any() && setting.colouring) draw_colour_bar(image, *setting.colouring);
  return image;
}

}  // namespace phyxel::app
