#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "shapes/lattice_shapes.hpp"

namespace phyxel {
namespace {

/// Numbering, layer by layer, of the nodes on the surface of a box of m[0] x m[1] x m[2] cells.
struct BoxPoints {
  std::array<Index, 3> m;

  Index ring() const { return 2 * (m[0] + m[1]); }
  Index layer() const { return (m[0] + 1) * (m[1] + 1); }
  Index count() const { return 2 * layer() + (m[2] - 1) * ring(); }
  Index number(Index i, Index j, Index k) const {
    if (k == 0) return i + (m[0] + 1) * j;
    const Index before = layer() + (k - 1) * ring();
    if (k == m[2]) return before + i + (m[0] + 1) * j;
    if (j == 0) return before + i;
    if (j == m[1]) return before + m[0] + 1 + i;
    return before + 2 * (m[0] + 1) + 2 * (j - 1) + (i == 0 ? 0 : 1);
  }
};

/// Maps a point of the cube [-1, 1]^3 to the solid.
Vec3d shaped(Lattice::Solid solid, Vec3d p) {
  const auto even_angle = [](double t) { return std::tan(std::numbers::pi / 4 * t); };
  if (solid == Lattice::Solid::sphere) {
    return normalised(Vec3d{even_angle(p.x), even_angle(p.y), even_angle(p.z)});
  }
  if (solid == Lattice::Solid::cylinder) {
    // Concentric squares are mapped to circles (Shirley and Chiu 1997).
    const double r = std::max(std::abs(p.x), std::abs(p.y));
    if (r == 0) return p;
    const Vec3d d = normalised(Vec3d{even_angle(p.x / r), even_angle(p.y / r), 0});
    return {r * d.x, r * d.y, p.z};
  }
  return p;
}

class SolidSurface {
 public:
  SolidSurface(const Lattice& lattice, const std::array<Index, 3>& cells)
      : lattice_(lattice), points_{cells} {}

  Surface run() {
    surface_.position.resize(points_.count());
    for (int axis = 0; axis < 3; ++axis) {
      add_face(axis, false);
      add_face(axis, true);
    }
    surface_.normal = vertex_normals(surface_.position, surface_.triangle);
    return std::move(surface_);
  }

 private:
  /// The name of the group of a face's triangles; none for a sphere.
  std::string group_of(int axis, bool high) const {
    if (lattice_.solid == Lattice::Solid::sphere) return {};
    if (lattice_.solid == Lattice::Solid::cylinder && axis < 2) return "side";
    return side_names[axis][high];
  }

  void add_face(int axis, bool high) {
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    const Index mu = points_.m[u], mv = points_.m[v];
    const auto point = [&](Index a, Index b) {
      std::array<Index, 3> at;
      at[axis] = high ? points_.m[axis] : 0;
      at[u] = a;
      at[v] = b;
      const Index number = points_.number(at[0], at[1], at[2]);
      surface_.position[number] = place(at);
      return number;
    };
    const std::string name = group_of(axis, high);
    std::vector<Index>* const group = name.empty() ? nullptr : &surface_.groups[name];
    const auto add = [&](Index a, Index b, Index c) {
      if (group) group->push_back(static_cast<Index>(surface_.triangle.size()));
      surface_.triangle.push_back(high ? Triangle{a, b, c} : Triangle{a, c, b});
    };
    for (Index b = 0; b < mv; ++b) {
      for (Index a = 0; a < mu; ++a) {
        const Index p = point(a, b), q = point(a + 1, b), r = point(a + 1, b + 1),
                    s = point(a, b + 1);
        // Diagonals run from the middle of the face to its corners. The corners of a cylinder's cap
        // lie on its rim, where a triangle of three rim points would be nearly degenerate.
        if ((2 * a + 1 < mu) == (2 * b + 1 < mv)) {
          add(p, q, r);
          add(p, r, s);
        } else {
          add(p, q, s);
          add(q, r, s);
        }
      }
    }
  }

  Vec3d place(const std::array<Index, 3>& at) const {
    const auto unit = [&](int axis) { return 2.0 * at[axis] / points_.m[axis] - 1; };
    const Vec3d p = shaped(lattice_.solid, {unit(0), unit(1), unit(2)});
    const Vec3d half = 0.5 * lattice_.extent;
    return lattice_.low + half + Vec3d{half.x * p.x, half.y * p.y, half.z * p.z};
  }

  const Lattice& lattice_;
  BoxPoints points_;
  Surface surface_;
};

}  // namespace

Surface lattice_surface(const Lattice& lattice, double spacing, int corners) {
  constexpr double most_surfels = 1e6;
  // A side of the cube is mapped to a quarter of a circle.
  const double quarter = std::numbers::pi / 4;
  const bool box = lattice.solid == Lattice::Solid::box;
  const bool sphere = lattice.solid == Lattice::Solid::sphere;
  const double length[3] = {lattice.extent.x * (box ? 1 : quarter),
                            lattice.extent.y * (box ? 1 : quarter),
                            lattice.extent.z * (sphere ? quarter : 1)};
  const double area = 2 * (length[0] * length[1] + length[1] * length[2] + length[2] * length[0]);
  const double step = std::max(spacing, std::sqrt(area / most_surfels));
  std::array<Index, 3> cells;
  for (int axis = 0; axis < 3; ++axis) {
    const bool round = !box && (sphere || axis < 2);
    // The length of a needle limits the number of steps.
    cells[axis] = static_cast<Index>(std::clamp(std::round(length[axis] / step),
                                                round ? 0.25 * corners : 1.0, most_surfels / 16));
  }
  return SolidSurface(lattice, cells).run();
}

}  // namespace phyxel
