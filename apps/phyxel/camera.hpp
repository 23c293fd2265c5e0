/// A perspective camera, and the fit of a camera to points.
#pragma once

#include <limits>
#include <span>
#include <vector>

#include "phyxel/types.hpp"

namespace phyxel::app {

/// A pinhole camera. Image coordinates are pixels, x right, y down; pixel (0, 0) covers [0, 1)².
struct Camera {
  int width = 0, height = 0;  ///< Image size [px].
  Vec3d eye;                  ///< [m]
  Vec3d right, up, forward;   ///< Orthonormal axes.
  double focal = 0;           ///< Pixels per unit of x / depth.

  struct Place {
    double x, y, depth;
  };  ///< [px], [px], [m] along `forward`.
  Place project(Vec3d point) const;
  /// The direction from the eye through a place on the image [px], 1 m along `forward`.
  Vec3d ray(double x, double y) const {
    return forward + ((x - 0.5 * width) / focal) * right + ((0.5 * height - y) / focal) * up;
  }
};

/// Fit of the nearest camera with a given direction that sees all points.
class CameraFit {
 public:
  /// @param up need not be orthogonal to `view`; if it is parallel to it or zero, a coordinate axis
  ///   replaces it
  /// @param field_of_view along the shorter side of the image [degrees]
  /// @throws InputError for a zero or non-finite `view`, an image size below 16 or above 16384
  ///   pixels, or a field of view outside 1 to 150 degrees
  CameraFit(int width, int height, Vec3d view, Vec3d up, double field_of_view = 30);

  /// Adds points, moved by `-way` [m]. Non-finite points are skipped.
  void include(std::span<const Vec3d> points, Vec3d way = {});
  bool empty() const { return !(nearest_ <= farthest_); }
  double extent() const;  ///< Largest extent of the points along the camera's axes [m].
  Vec3d middle() const;   ///< Of the box around the points along the camera's axes [m].
  Camera camera() const;

 private:
  Camera camera_;
  double slope_x_ = 0, slope_y_ = 0;  // half width and half height of the view at depth 1
  static constexpr double infinity_ = std::numeric_limits<double>::infinity();
  // The bounds on the eye from the four sides of the frustum, and the extremes along the axes [m].
  double left_ = -infinity_, right_ = infinity_, below_ = -infinity_, above_ = infinity_;
  double nearest_ = infinity_, farthest_ = -infinity_;
  double low_x_ = infinity_, high_x_ = -infinity_, low_y_ = infinity_, high_y_ = -infinity_;
};

/// Cameras that go round a point from one side to another, equally far from it, and see all points.
/// @param start first direction of view @param up axis of the turn @param middle the point [m]
/// @param degrees angle between the first and the last camera, to the right as the viewer sees it
std::vector<Camera> orbit(const Camera& start, Vec3d up, Vec3d middle,
                          std::span<const Vec3d> points, double degrees, std::size_t count);

/// Cameras that go round a point with the axis `up`, as far from it as the first one.
std::vector<Camera> turned_about(const Camera& start, Vec3d up, Vec3d middle, double degrees,
                                 std::size_t count);

}  // namespace phyxel::app
