#include "draw_obstacles.hpp"

#include <algorithm>
#include <bit>

namespace phyxel::app {
namespace {

constexpr int largest_facet = 4;  // [px]

/// An obstacle that some rays may meet.
struct Candidate {
  std::size_t obstacle = 0;
  double clear = 0;  ///< Distance up to which they do not [m].
};

/// A piece of surface over a small square of the image.
struct Facet {
  std::size_t obstacle = 0;
  double from = 0;       ///< Distance up to which nothing is met [m].
  Entry entry;           ///< Of the ray through the square's middle.
  double height = 0;     ///< Along its normal from the eye to its tangent plane [m].
  bool is_flat = false;  ///< True if the whole square sees the tangent plane of `entry`.
};

class Painter {
 public:
  Painter(Rasteriser& rasteriser, std::span<const PlacedObstacle> obstacles, const Fade& fade,
          const Lighting& lighting)
      : rasteriser_(rasteriser),
        camera_(rasteriser.camera()),
        samples_(rasteriser.samples()),
        obstacles_(obstacles),
        fade_(fade),
        lighting_(lighting),
        spread_(std::sqrt(0.5) / (camera_.focal * samples_)),
        farthest_(norm(fade.middle - camera_.eye) + fade.end) {}

  void paint() {
    for (std::size_t k = 0; k < obstacles_.size(); ++k) candidates_.push_back({k, 0});
    const auto size = static_cast<unsigned>(std::max(camera_.width, camera_.height));
    paint_square(0, 0, static_cast<int>(std::bit_ceil(size)), 0);
  }

 private:
  /// The cone of the rays through a square of the image [px]. Unit vectors differ by no more than
  /// the vectors to a plane at a distance of 1.
  Cone cone(double x, double y, double size) const {
    return {camera_.eye, normalised(camera_.ray(x + 0.5 * size, y + 0.5 * size)),
            std::sqrt(0.5) * size / camera_.focal};
  }

  /// Paints a square of the image [px], quarter by quarter, with the candidates from `first` on.
  void paint_square(int x, int y, int size, std::size_t first) {
    if (x >= camera_.width || y >= camera_.height) return;
    const Cone rays = cone(x, y, size);
    const std::size_t begin = candidates_.size();
    for (std::size_t k = first; k < begin; ++k) {
      const std::size_t obstacle = candidates_[k].obstacle;
      const double clear =
          clear_distance(obstacles_[obstacle], rays, candidates_[k].clear, farthest_);
      if (clear < farthest_) candidates_.push_back({obstacle, clear});
    }
    if (candidates_.size() > begin && !paint_facets(x, y, size, rays.direction, begin)) {
      const int half = size / 2;
      for (const auto& [u, v] : {std::pair{0, 0}, {half, 0}, {0, half}, {half, half}}) {
        paint_square(x + u, y + v, half, begin);
      }
    }
    candidates_.resize(begin);
  }

  /// Paints a square if it is a pixel, or small and flat. @returns whether it did
  bool paint_facets(int x, int y, int size, Vec3d direction, std::size_t first) {
    if (size > largest_facet) return false;
    facets_.clear();
    for (std::size_t k = first; k < candidates_.size(); ++k) {
      Facet facet{candidates_[k].obstacle, candidates_[k].clear, {farthest_, {}}};
      const auto entry = first_entry(obstacles_[facet.obstacle], {camera_.eye, direction, spread_},
                                     facet.from, farthest_);
      if (entry) {
        facet.entry = *entry;
        facet.height = entry->distance * dot(entry->normal, direction);
        facet.is_flat = (size == 1 && samples_ == 1) || is_flat(x, y, size, facet);
      }
      if (size > 1 && !facet.is_flat) return false;
      if (entry || samples_ > 1) facets_.push_back(facet);
    }
    // What is transparent needs to be drawn after what lies behind it.
    std::stable_sort(facets_.begin(), facets_.end(), [](const Facet& a, const Facet& b) {
      return a.entry.distance > b.entry.distance;
    });
    for (const Facet& facet : facets_) {
      for (int v = y; v < std::min(y + size, camera_.height); ++v) {
        for (int u = x; u < std::min(x + size, camera_.width); ++u) {
          facet.is_flat ? fill_pixel(u, v, facet) : sample_pixel(u, v, facet);
        }
      }
    }
    return true;
  }

  /// Whether the corners of a square see the tangent plane of what its middle sees.
  bool is_flat(int x, int y, int size, const Facet& facet) const {
    for (const auto& [u, v] : {std::pair{0, 0}, {0, size}, {size, 0}, {size, size}}) {
      const Vec3d corner = camera_.ray(x + u, y + v);
      const double depth = facet.height / dot(facet.entry.normal, corner);
      if (!(depth > 0)) return false;
      const double distance = obstacles_[facet.obstacle].distance(camera_.eye + depth * corner);
      if (!(std::abs(distance) < 0.3 * spread_ * facet.entry.distance)) return false;
    }
    return true;
  }

  void fill_pixel(int x, int y, const Facet& facet) {
    const Vec3d normal = facet.entry.normal, middle = camera_.ray(x + 0.5, y + 0.5);
    const Vec3d place = camera_.eye + (facet.height / dot(normal, middle)) * middle;
    Fragment fragment;
    fragment.opacity = fade_.opacity(place);
    if (fragment.opacity <= 0) return;
    fragment.body = body_of_obstacle(obstacles_[facet.obstacle].number);
    fragment.colour = colour(facet, normal, lighting_(place, fragment.body));
    for (int v = 0; v < samples_; ++v) {
      for (int u = 0; u < samples_; ++u) {
        const Vec3d through = sample_ray(x * samples_ + u, y * samples_ + v);
        fragment.nearness = static_cast<float>(dot(normal, through) / facet.height);
        rasteriser_.blend(x * samples_ + u, y * samples_ + v, fragment);
      }
    }
  }

  /// Draws an obstacle where its surface bends or ends.
  void sample_pixel(int x, int y, const Facet& facet) {
    const PlacedObstacle& obstacle = obstacles_[facet.obstacle];
    Fragment fragment;
    fragment.body = body_of_obstacle(obstacle.number);
    float light = -1;  // of the whole pixel, once it is known
    for (int v = 0; v < samples_; ++v) {
      for (int u = 0; u < samples_; ++u) {
        const Vec3d through = sample_ray(x * samples_ + u, y * samples_ + v);
        const double length = norm(through);
        const auto entry =
            first_entry(obstacle, {camera_.eye, through / length, spread_}, facet.from, farthest_);
        if (!entry) continue;
        const Vec3d place = camera_.eye + (entry->distance / length) * through;
        fragment.opacity = fade_.opacity(place);
        if (fragment.opacity <= 0) continue;
        if (light < 0) light = lighting_(place, fragment.body);
        fragment.colour = colour(facet, entry->normal, light);
        fragment.nearness = static_cast<float>(length / entry->distance);
        rasteriser_.blend(x * samples_ + u, y * samples_ + v, fragment);
      }
    }
  }

  Vec3d sample_ray(int x, int y) const {
    return camera_.ray((x + 0.5) / samples_, (y + 0.5) / samples_);
  }

  Colour colour(const Facet& facet, Vec3d normal, float light) const {
    const Vec3d seen{dot(normal, camera_.right), dot(normal, camera_.up),
                     -dot(normal, camera_.forward)};
    const Colour own = obstacle_colour(obstacles_[facet.obstacle].bounded);
    return rasteriser_.lit(own, to<float>(seen), light);
  }

  Rasteriser& rasteriser_;
  const Camera& camera_;
  int samples_;
  std::span<const PlacedObstacle> obstacles_;
  const Fade& fade_;
  const Lighting& lighting_;
  double spread_;                      // of the rays through a sample
  double farthest_;                    // distance at which all obstacles have vanished [m]
  std::vector<Candidate> candidates_;  // of the squares around the present one, largest first
  std::vector<Facet> facets_;          // of the present square
};

}  // namespace

Colour obstacle_colour(bool bounded) {
  static const Colour solid = oklch(0.70, 0.018, 75), plane = oklch(0.86, 0.008, 75);
  return bounded ? solid : plane;
}

float Fade::opacity(Vec3d place) const {
  const double t = std::clamp((end - norm(place - middle)) / (end - begin), 0.0, 1.0);
  return static_cast<float>(t * t * (3 - 2 * t));
}

void draw_obstacles(Rasteriser& rasteriser, std::span<const PlacedObstacle> obstacles,
                    const Fade& fade, const Lighting& lighting) {
  Painter(rasteriser, obstacles, fade, lighting).paint();
}

}  // namespace phyxel::app
