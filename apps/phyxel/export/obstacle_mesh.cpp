#include "export/obstacle_mesh.hpp"

#include <numbers>
#include <span>
#include <utility>

#include "phyxel/physics/obstacles.hpp"

namespace phyxel::app {
namespace {

constexpr int sides = 64, arcs = sides / 4;  // of a circle, and of a quarter of it

void add_vertex(Surface& surface, Vec3d position, Vec3d normal) {
  surface.position.push_back(position);
  surface.normal.push_back(normal);
}

/// Adds the two triangles of a rectangle. @param u,v half its edges, with u × v outward
void add_rectangle(Surface& surface, Vec3d middle, Vec3d u, Vec3d v) {
  const auto first = static_cast<Index>(surface.position.size());
  const Vec3d normal = normalised(cross(u, v));
  for (const Vec3d& corner : {-u - v, u - v, u + v, v - u}) {
    add_vertex(surface, middle + corner, normal);
  }
  surface.triangle.push_back({first, first + 1, first + 2});
  surface.triangle.push_back({first, first + 2, first + 3});
}

/// A point of the outline of a shape of revolution, and the normal there.
struct OutlinePoint {
  double radius = 0, z = 0;                ///< [m]
  double normal_radius = 0, normal_z = 0;  ///< Components of the unit normal.
};

/// Adds the surface that a smooth part of an outline sweeps about z. The outside is to the right of
/// the outline, seen with the axis up.
void add_revolution(Surface& surface, std::span<const OutlinePoint> outline) {
  const auto first = static_cast<Index>(surface.position.size());
  const auto rows = static_cast<Index>(outline.size());
  for (int k = 0; k < sides; ++k) {
    const double angle = 2 * std::numbers::pi * k / sides;
    const double c = std::cos(angle), s = std::sin(angle);
    for (const OutlinePoint& p : outline) {
      add_vertex(surface, {p.radius * c, p.radius * s, p.z},
                 {p.normal_radius * c, p.normal_radius * s, p.normal_z});
    }
  }
  for (Index k = 0; k < sides; ++k) {
    for (Index row = 0; row + 1 < rows; ++row) {
      const Index low = first + k * rows + row, next = first + (k + 1) % sides * rows + row;
      const auto at = [&](Index up) { return outline[static_cast<std::size_t>(row + up)].radius; };
      if (at(0) > 0) surface.triangle.push_back({low, next, next + 1});
      if (at(1) > 0) surface.triangle.push_back({low, next + 1, low + 1});
    }
  }
}

/// The outline of a capsule; that of a ball if its length is 0.
std::vector<OutlinePoint> capsule_outline(double radius, double length) {
  std::vector<OutlinePoint> outline;
  for (int k = -arcs; k <= arcs; ++k) {
    const double angle = 0.5 * std::numbers::pi * k / arcs;
    const double c = std::abs(k) == arcs ? 0 : std::cos(angle), s = std::sin(angle);
    const auto add = [&](double z) { outline.push_back({radius * c, z + radius * s, c, s}); };
    if (k <= 0) add(-0.5 * length);
    if (k > 0 || (k == 0 && length > 0)) add(0.5 * length);
  }
  return outline;
}

Surface triangles(const PlaneObstacle& /*plane*/, Vec3d middle, double reach) {
  Surface surface;
  add_rectangle(surface, {middle.x, middle.y, 0}, {reach, 0, 0}, {0, reach, 0});
  return surface;
}

Surface triangles(const SphereObstacle& sphere, Vec3d /*middle*/, double /*reach*/) {
  Surface surface;
  add_revolution(surface, capsule_outline(sphere.radius, 0));
  return surface;
}

Surface triangles(const CapsuleObstacle& capsule, Vec3d /*middle*/, double /*reach*/) {
  Surface surface;
  add_revolution(surface, capsule_outline(capsule.radius, capsule.length));
  return surface;
}

Surface triangles(const CylinderObstacle& cylinder, Vec3d /*middle*/, double /*reach*/) {
  const double r = cylinder.radius, top = 0.5 * cylinder.length;
  Surface surface;
  const OutlinePoint bottom_face[] = {{0, -top, 0, -1}, {r, -top, 0, -1}},
                     side[] = {{r, -top, 1, 0}, {r, top, 1, 0}},
                     top_face[] = {{r, top, 0, 1}, {0, top, 0, 1}};
  for (const auto& part : {std::span(bottom_face), std::span(side), std::span(top_face)}) {
    add_revolution(surface, part);
  }
  return surface;
}

Surface triangles(const BoxObstacle& box, Vec3d /*middle*/, double /*reach*/) {
  Surface surface;
  const Vec3d x{0.5 * box.size_x, 0, 0}, y{0, 0.5 * box.size_y, 0}, z{0, 0, 0.5 * box.size_z};
  for (const auto& [out, u, v] : {std::array{x, y, z}, {y, z, x}, {z, x, y}}) {
    add_rectangle(surface, out, u, v);
    add_rectangle(surface, -out, v, u);
  }
  return surface;
}

}  // namespace

Surface obstacle_mesh(const Obstacle& obstacle, Vec3d middle, double reach) {
  Surface surface;
  ObstacleShapes::with(obstacle.form, [&]<class Shape>(const Shape& shape) {
    if constexpr (std::is_same_v<Shape, MeshObstacle>) {
      if (obstacle.surface) surface = {obstacle.surface->position, {}, obstacle.surface->triangle};
    } else {
      surface = triangles(shape, middle, reach);
    }
  });
  if (obstacle.hollow) {
    for (Vec3d& normal : surface.normal) normal = -normal;
    for (Triangle& corners : surface.triangle) std::swap(corners[1], corners[2]);
  }
  return surface;
}

}  // namespace phyxel::app
