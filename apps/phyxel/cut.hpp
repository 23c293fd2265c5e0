/// Cuts through bodies by a plane, which show their inside.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "phyxel/recorder.hpp"
#include "rasteriser.hpp"

namespace phyxel::app {

/// A plane that cuts away what lies on the side of its normal.
struct CutPlane {
  Vec3d point;   ///< [m]
  Vec3d normal;  ///< Unit vector.

  /// Distance of a place from the plane [m]; positive for what is cut away.
  double height(Vec3d place) const { return dot(place - point, normal); }
};

/// Reads a plane from an option: "x=0.1", "y=0" or "z=-2" [m], whose side towards `eye` is cut
/// away, or a point and a normal, "0,0,0.1,0,1,1", whose normal points to what is cut away.
/// @throws InputError for another text
CutPlane cut_plane(const std::string& text, Vec3d eye);

/// A surface with all that is drawn of it.
struct DrawnSurface {
  std::vector<Vec3d> point, normal;
  std::vector<Colour> colour;
  std::vector<Index> body;  ///< Of each point; empty for one body.
  std::vector<Triangle> triangle;
};

/// The outline of the faces that a plane cuts into the closed surface of a body: directed edges,
/// with the inside on the same side of each.
struct CutOutline {
  Index body = 0;
  std::vector<std::array<Vec3d, 2>> edges;
};

/// Cuts away a part of a surface. Triangles that cross the plane end there.
/// @returns the outlines of the faces, one for each body that is cut
std::vector<CutOutline> cut_away(DrawnSurface& surface, const CutPlane& plane);

/// The colours of places on a face [m].
using FaceColours = std::function<std::vector<Colour>(const std::vector<Vec3d>& places)>;

/// Draws the face of a body where the plane cuts it, if the camera sees it: all that the outline
/// goes around. Nothing is drawn in rows of samples in which the outline is open.
void draw_face(Rasteriser& rasteriser, const CutOutline& outline, const CutPlane& plane,
               const FaceColours& colours);

}  // namespace phyxel::app
