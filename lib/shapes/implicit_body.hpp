/// Bodies described by a function that is negative inside, built from rounded parts.
#pragma once

#include <vector>

#include "phyxel/cloud.hpp"

namespace phyxel {

/// A point on or near a surface.
struct SurfacePoint {
  Vec3d position;  ///< [m]
  Vec3d normal;    ///< Outward unit normal.
};

/// A union of rounded parts, minus some cuts, with smooth seams. `value` approximates the signed
/// distance to the surface [m], negative inside; it is exact for a single limb or ball.
class ImplicitBody {
 public:
  /// The convex hull of two balls, at `from` and `to`, with radii `from_radius` and `to_radius`.
  struct Limb {
    Vec3d from;
    double from_radius;
    Vec3d to;
    double to_radius;
  };
  /// An ellipsoid rotated about the y axis: `pitch` [rad] lifts its +x end towards +z.
  struct Ellipsoid {
    Vec3d centre;
    Vec3d radii;
    double pitch = 0;
  };

  /// Joins a part to those added before; `blend` [m] is the width of the seam.
  void add(const Limb& limb, double blend);
  void add(const Ellipsoid& ellipsoid, double blend);
  /// Subtracts a part from those added before.
  void cut(const Limb& limb, double blend);
  void cut(const Ellipsoid& ellipsoid, double blend);
  /// Adds a part and its mirror image in the plane y = 0.
  template <class Part>
  void add_pair(const Part& part, double blend) {
    add(part, blend);
    add(mirrored(part), blend);
  }
  /// Subtracts a part and its mirror image in the plane y = 0.
  template <class Part>
  void cut_pair(const Part& part, double blend) {
    cut(part, blend);
    cut(mirrored(part), blend);
  }

  /// The approximate signed distance of `p` [m].
  double value(Vec3d p) const;
  /// The surface point nearest to `p`, by Newton steps along the gradient; `p` must be near it.
  SurfacePoint project(Vec3d p) const;

  /// Lower corner of a bounding box [m].
  Vec3d low() const { return low_; }
  Vec3d high() const { return high_; }  ///< Upper corner of the bounding box [m].

 private:
  struct Part {
    bool limb;     ///< True for a limb, false for an ellipsoid.
    bool removes;  ///< True if the part is subtracted.
    double blend;  ///< [m]
    Vec3d at;      ///< Start of the limb or centre of the ellipsoid [m].
    Vec3d along;   ///< Limb: unit vector along it. Ellipsoid: (cos pitch, 0, sin pitch).
    double length, radius,
        slope;            ///< Limb: its length and first radius [m], its loss of radius per length.
    Vec3d inverse_radii;  ///< Ellipsoid [1/m].
    Vec3d ball;           ///< Centre of a ball that contains the part [m].
    double ball_radius;   ///< Radius of that ball [m].
    double stretch;       ///< Largest ratio of the true distance to `distance`.
    double distance(Vec3d p) const;
    /// True if `distance(p)` is certainly more than `reach` [m].
    bool farther(Vec3d p, double reach) const;
  };
  static Limb mirrored(Limb limb);
  static Ellipsoid mirrored(Ellipsoid ellipsoid);
  void append(Part part, bool removes, double blend, Vec3d low, Vec3d high);
  void append(const Limb& limb, bool removes, double blend);
  void append(const Ellipsoid& ellipsoid, bool removes, double blend);

  std::vector<Part> parts_;
  Vec3d low_{1e300, 1e300, 1e300}, high_{-1e300, -1e300, -1e300};
};

/// Triangulates the surface on a lattice of `cell` [m] by marching tetrahedra (Doi and Koide 1991).
/// The result is closed, manifold and oriented outward for any body; triangles may be thin.
/// Source of the six tetrahedra of a cube: Freudenthal 1942.
Surface polygonise(const ImplicitBody& body, double cell);

}  // namespace phyxel
