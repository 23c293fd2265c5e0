/// Notches: discs and surfaces along which bodies are cut before they move.
#pragma once

#include <span>
#include <vector>

#include "model/box.hpp"
#include "phyxel/scene.hpp"

namespace phyxel {

/// The disc or the triangles of a notch, in place.
class Notch {
 public:
  /// Reads the surface of a notch from its file, if it has one.
  /// @throws InputError naming the file, for one that cannot be read
  Notch(const NotchRequest& request, const BodyRequest& body);

  /// True if the way from a to b crosses it. A point in the plane of a disc or triangle lies above
  /// it, so that no way ends in it; an edge belongs to both of its triangles.
  /// @param near of `near`, for a point and a reach within which both lie
  bool cuts(Vec3d a, Vec3d b, std::span<const std::size_t> near) const;
  /// The triangles within a reach of a point [m]; of a disc, one number for it if it may be there.
  std::vector<std::size_t> near(Vec3d x, double reach) const;

 private:
  struct Triangle {
    Vec3d corner, first, second;  // a corner, and the edges from it
    Box box;
  };
  bool disc_cuts(Vec3d a, Vec3d b) const;

  NotchRequest disc_;                // unless there are triangles
  Vec3d normal_;                     // of the disc
  std::vector<Triangle> triangles_;  // by the low end of their boxes along x
  double widest_ = 0;                // extent of a triangle along x at most [m]
};

}  // namespace phyxel
