/// A software rasteriser for shaded triangles and spheres.
#pragma once

#include <span>
#include <vector>

#include "camera.hpp"
#include "colour.hpp"
#include "phyxel/cloud.hpp"

namespace phyxel::app {

/// An 8-bit sRGB picture, rows from top to bottom.
struct Image {
  int width = 0, height = 0;
  std::vector<std::uint8_t> rgb;  ///< Shape [height, width, 3].
  std::uint8_t* pixel(int x, int y) {
    return &rgb[3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                     static_cast<std::size_t>(x))];
  }
  const std::uint8_t* pixel(int x, int y) const { return const_cast<Image*>(this)->pixel(x, y); }
};

/// Style of dots that show through the surface in front of them.
struct DotStyle {
  double radius = 0;      ///< Radius [m]; at least `smallest` on the image.
  double smallest = 0.6;  ///< Smallest radius [px].
  double largest = 1e9;   ///< Largest radius [px].
  double fade = 0;  ///< Depth below the surface at which a dot has lost 63% of its opacity [m].
  double faintest = 0.12;  ///< Smallest opacity.
};

/// A piece of an obstacle's surface over a sample.
struct Fragment {
  float nearness = 0;  ///< 1 / depth [1/m].
  Colour colour;
  float opacity = 1;
  Index body = 0;
};

/// A picture being drawn: `samples`² samples per pixel, each with colour, depth and body. Drawing
/// is serial and in the caller's order, so that equal input gives equal pictures.
class Rasteriser {
 public:
  /// @param up direction from which the soft light comes
  /// @param samples number per pixel and axis; 0: as many as a picture needs
  Rasteriser(const Camera& camera, Vec3d up, Colour top, Colour bottom, int samples = 0);

  const Camera& camera() const { return camera_; }
  int samples() const { return samples_; }  ///< Per pixel and axis.

  /// Draws smoothly shaded triangles. Triangles that reach behind the camera, or beyond the image
  /// by many widths, are skipped; both sides are drawn, a back side with its normals inverted.
  /// @param colour shape [points] @param body shape [points], or empty for one body
  void draw_surface(std::span<const Vec3d> point, std::span<const Vec3d> normal,
                    std::span<const Triangle> triangle, std::span<const Colour> colour,
                    std::span<const Index> body);

  /// Darkens the samples drawn so far that lie in a hollow of the depth buffer.
  /// @param reach size of the hollows [m]
  void shade_hollows(double reach);

  /// Draws opaque spheres.
  void draw_spheres(std::span<const Vec3d> centre, std::span<const Colour> colour,
                    std::span<const Index> body, const DotStyle& style);

  /// Draws spheres that show through the surface of their own body; other bodies hide them.
  void draw_dots(std::span<const Vec3d> centre, std::span<const Colour> colour,
                 std::span<const Index> body, const DotStyle& style);

  /// Blends a fragment with what lies behind it; nearer samples hide it. It hides what comes later
  /// if it is more opaque than not. @param x,y [samples]
  void blend(int x, int y, const Fragment& fragment);

  /// Multiplies what was drawn by factor(place [m], body), which is found once for each pixel.
  template <class Factor>
  void darken(const Factor& factor);

  /// The colour of a surface in the light of the bodies, without their dark contours.
  /// @param normal in the camera's axes: right, up, towards the viewer
  /// @param key share of the strongest light that reaches it
  Colour lit(Colour colour, Vec3<float> normal, float key) const;

  /// 1 / depth of a sample [1/m]; 0 where nothing was drawn.
  float nearness(int x, int y) const { return nearness_[at(x, y)]; }
  /// The body of a sample; -1 where nothing was drawn.
  Index body(int x, int y) const { return body_[at(x, y)]; }

  Image resolve() const;

 private:
  struct Vertex;
  struct Disc;
  Vertex vertex(Vec3d point, Vec3d normal, Colour colour) const;
  Disc disc(Vec3d centre, const DotStyle& style) const;
  void draw_triangle(const Vertex& a, const Vertex& b, const Vertex& c, Index body);
  Colour shade(Colour colour, Vec3<float> normal, float x, float y) const;
  template <class Plot>
  void for_each_sample(const Disc& disc, const Plot& plot) const;
  std::size_t at(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) +
           static_cast<std::size_t>(x);
  }

  Camera camera_;
  int samples_, width_, height_;  // samples per pixel and axis; image size in samples
  float centre_x_, centre_y_, per_focal_;
  Vec3<float> sky_;              // direction of the soft light in the camera's axes
  std::vector<float> nearness_;  // 1 / depth [1/m], 0 where nothing was drawn
  std::vector<Colour> colour_;
  std::vector<Index> body_;
};

template <class Factor>
void Rasteriser::darken(const Factor& factor) {
  for (int y = 0; y < height_; y += samples_) {
    for (int x = 0; x < width_; x += samples_) {
      Index known = -1;
      float share = 1;
      for (int k = 0; k < samples_ * samples_; ++k) {
        const std::size_t s = at(x + k % samples_, y + k / samples_);
        if (nearness_[s] == 0) continue;
        if (body_[s] != known) {
          const Vec3d ray =
              camera_.ray((x + k % samples_ + 0.5) / samples_, (y + k / samples_ + 0.5) / samples_);
          share = factor(camera_.eye + (1.0 / nearness_[s]) * ray, known = body_[s]);
        }
        colour_[s] = share * colour_[s];
      }
    }
  }
}

}  // namespace phyxel::app
