/// Soft shadows: what the light does not see.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "rasteriser.hpp"

namespace phyxel::app {

/// The direction towards the light that casts shadows: `up`, slanted to the left and the viewer.
Vec3d light_direction(const Camera& camera, Vec3d up);

/// A rectangle across the light that holds all that casts shadows.
class ShadowBounds {
 public:
  /// @param light direction towards the light
  ShadowBounds(const Camera& camera, Vec3d light);

  /// Adds points. Non-finite points are skipped.
  void include(std::span<const Vec3d> points);

  /// Adds a range along an axis of the rectangle [m]. @param axis 0 or 1
  void include(int axis, double low, double high);
  Vec3d axis(int axis) const { return axis == 0 ? right_ : up_; }

  /// Whether there is nothing to cast a shadow.
  bool empty() const { return !(low_[0] < high_[0] && low_[1] < high_[1]); }

  /// The view from the light. It is so far away that its rays are nearly parallel.
  /// @param middle of the scene [m] @param reach largest distance of things from it [m]
  Camera camera(Vec3d middle, double reach) const;

 private:
  Vec3d right_, up_, light_;
  std::array<double, 2> low_, high_;
};

/// The shadows of a scene. Their edges are the softer the farther they are from what casts them:
/// percentage-closer soft shadows, Fernando 2005.
class Shadows {
 public:
  /// @param seen all that casts shadows, with one sample per pixel
  explicit Shadows(const Rasteriser& seen);

  /// The share of the light that reaches a place [m] past all but its own body, 0 to 1.
  float light_at(Vec3d place, Index body) const;

 private:
  /// The depth of what is in front of a place at a texel [m]; 0 for nothing.
  float in_front(int x, int y, float depth, Index body) const;

  Camera camera_;
  std::vector<float> depth_;  // [m], 0 where nothing was drawn
  std::vector<Index> body_;
  float nearest_;  // smallest depth [m]
};

}  // namespace phyxel::app
