/// Even distribution of points over the faces of a surface.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mesh/cuts.hpp"
#include "mesh/surface_points.hpp"
#include "phyxel/cloud.hpp"
#include "phyxel/space_region.hpp"

namespace phyxel {

class InsideSampler;
class Stage;
class SurfaceOnDevice;

/// Evens out the distances between points on faces: they repel each other, move along the face, and
/// are put back on the triangle of the nearest sample point. The first `fixed` points stay.
/// @param site the points; all after the first `fixed` lie on faces [m]
/// @param sample points spread over the whole surface, with their triangles
/// @param spacing wanted distance between the points
/// @param margin places that no point moves to
/// @param stage is told the share of sweeps that is done
/// @param device does a part of the work; null for the host alone
void relax_on_faces(const Surface& surface, std::span<const PointOn> sample,
                    std::vector<Vec3d>& site, std::size_t fixed, const SpacingField& spacing,
                    const CutMargin& margin, int sweeps, Stage& stage,
                    const SurfaceOnDevice* device = nullptr);

/// Evens out the distances between points on the boundary of a region inside a surface: they repel
/// each other and are put back on the boundary, and stay inside the surface. The first `fixed`
/// points stay where they are.
/// @param spacing wanted distance between the points
void relax_on_cut(const SpaceRegion& region, const InsideSampler& sampler, std::vector<Vec3d>& site,
                  std::size_t fixed, const SpacingField& spacing, int sweeps);

/// Evens out the distances between points on straight pieces of edges likewise.
/// @param piece ends of the pieces [m]. @param sample points spread over them, with their pieces
void relax_on_edges(std::span<const Crease> piece, std::span<const PointOn> sample,
                    std::vector<Vec3d>& site, std::size_t fixed, const SpacingField& spacing,
                    const CutMargin& margin, int sweeps);

}  // namespace phyxel
