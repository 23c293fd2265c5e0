/// Even distribution of points over the faces of a surface.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "phyxel/cloud.hpp"
#include "phyxel/space_region.hpp"

namespace phyxel {

class InsideSampler;
class Stage;

/// A point on a vertex, an edge or a triangle, with the index of that piece.
struct PointOn {
  std::size_t piece;
  Vec3d point;
};

/// The point of a triangle nearest to `p`. Source: Ericson 2005, section 5.1.5.
Vec3d nearest_on_triangle(Vec3d p, Vec3d a, Vec3d b, Vec3d c);

/// Evens out the distances between points on faces: they repel each other, move along the face, and
/// are put back on the triangle of the nearest sample point. The first `fixed` points stay.
/// @param site the points; all after the first `fixed` lie on faces [m]
/// @param sample points spread over the whole surface, with their triangles
/// @param spacing typical distance between the points [m]
/// @param stage is told the share of sweeps that is done
void relax_on_faces(const Surface& surface, std::span<const PointOn> sample,
                    std::vector<Vec3d>& site, std::size_t fixed, double spacing, int sweeps,
                    Stage& stage);

/// Evens out the distances between points on the boundary of a region inside a surface: they repel
/// each other and are put back on the boundary, and stay inside the surface. The first `fixed`
/// points stay where they are.
/// @param spacing typical distance between the points [m]
void relax_on_cut(const SpaceRegion& region, const InsideSampler& sampler, std::vector<Vec3d>& site,
                  std::size_t fixed, double spacing, int sweeps);

}  // namespace phyxel
