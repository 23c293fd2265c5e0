/// Draws shaded triangles and spheres into a depth buffer, without display or GPU.
#pragma once

#include <span>
#include <vector>

#include "camera.hpp"
#include "colour.hpp"
#include "phyxel/cloud.hpp"

namespace phyxel::app {

/// 8-bit sRGB picture, rows from top to bottom.
struct Image {
  int width = 0, height = 0;
  std::vector<std::uint8_t> rgb;  ///< Shape [height, width, 3].
  std::uint8_t* pixel(int x, int y) {
    return &rgb[3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                     static_cast<std::size_t>(x))];
  }
  const std::uint8_t* pixel(int x, int y) const { return const_cast<Image*>(this)->pixel(x, y); }
};

/// How dots show through the surface in front of them.
struct DotStyle {
  double radius = 0;       ///< [m]; never below `smallest` on the image.
  double smallest = 0.6;   ///< [px]
  double largest = 1e9;    ///< [px]
  double fade = 0;         ///< Depth below the surface [m] at which a dot has lost 63% of itself.
  double faintest = 0.12;  ///< Opacity of the deepest dots.
};

/// A picture in the making: `samples`² samples a pixel, each with colour, depth and body. Drawing
/// is serial and in the caller's order, so that equal input gives equal pictures.
class Rasteriser {
 public:
  /// @param up the direction the soft light from above comes from.
  Rasteriser(const Camera& camera, Vec3d up, Colour top, Colour bottom);

  /// Smoothly shaded triangles. Triangles that reach behind the camera or beyond the image by many
  /// widths are left out; both sides are drawn, a back side with its normals turned.
  /// @param colour shape [points]; @param body shape [points] or empty (one body).
  void draw_surface(std::span<const Vec3d> point, std::span<const Vec3d> normal,
                    std::span<const Triangle> triangle, std::span<const Colour> colour,
                    std::span<const Index> body);

  /// Darkens the samples drawn so far where the depth buffer shows them in a hollow.
  /// @param reach size of the hollows that count [m].
  void shade_hollows(double reach);

  /// Opaque spheres.
  void draw_spheres(std::span<const Vec3d> centre, std::span<const Colour> colour,
                    std::span<const Index> body, const DotStyle& style);

  /// Spheres that shine through the surface of their own body; other bodies hide them.
  void draw_dots(std::span<const Vec3d> centre, std::span<const Colour> colour,
                 std::span<const Index> body, const DotStyle& style);

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
  int samples_, width_, height_;  // samples a pixel and axis; image size in samples
  float centre_x_, centre_y_, per_focal_;
  Vec3<float> sky_;              // direction of the soft light, in the camera's axes
  std::vector<float> nearness_;  // 1 / depth [1/m], 0 where nothing was drawn
  std::vector<Colour> colour_;
  std::vector<Index> body_;
};

}  // namespace phyxel::app
