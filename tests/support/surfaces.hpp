/// Closed surfaces with known volumes.
#pragma once

#include <map>
#include <utility>

#include "phyxel/cloud.hpp"

namespace phyxel::test {

inline void add_normals(Surface& s) { s.normal = vertex_normals(s.position, s.triangle); }

/// Box from `low` to `high`; triangles 0 and 1 are its lower face, 2 and 3 its upper (z).
inline Surface box(Vec3d low, Vec3d high) {
  Surface s;
  for (int k = 0; k < 8; ++k) {
    s.position.push_back({k & 1 ? high.x : low.x, k & 2 ? high.y : low.y, k & 4 ? high.z : low.z});
  }
  s.triangle = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  add_normals(s);
  return s;
}

inline Surface unit_cube() { return box({0, 0, 0}, {1, 1, 1}); }

/// An octahedron whose triangles are divided in four `levels` times and whose vertices are
/// projected to a sphere.
inline Surface sphere(Vec3d centre, double radius, int levels) {
  Surface s;
  s.position = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
  s.triangle = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4},
                {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
  for (int level = 0; level < levels; ++level) {
    std::map<std::pair<Index, Index>, Index> halfway;
    const auto middle = [&](Index a, Index b) {
      const auto [found, is_new] = halfway.try_emplace({std::min(a, b), std::max(a, b)},
                                                       static_cast<Index>(s.position.size()));
      if (is_new) s.position.push_back(normalised(s.position[a] + s.position[b]));
      return found->second;
    };
    std::vector<Triangle> finer;
    for (const Triangle& t : s.triangle) {
      const Index a = middle(t[0], t[1]), b = middle(t[1], t[2]), c = middle(t[2], t[0]);
      finer.insert(finer.end(), {{t[0], a, c}, {a, t[1], b}, {c, b, t[2]}, {a, b, c}});
    }
    s.triangle = std::move(finer);
  }
  for (Vec3d& p : s.position) p = centre + radius * p;
  add_normals(s);
  return s;
}

/// Joins two surfaces as two parts of one.
inline Surface together(Surface a, const Surface& b) {
  const auto shift = static_cast<Index>(a.position.size());
  a.position.insert(a.position.end(), b.position.begin(), b.position.end());
  for (const Triangle& t : b.triangle) {
    a.triangle.push_back({t[0] + shift, t[1] + shift, t[2] + shift});
  }
  add_normals(a);
  return a;
}

/// Removes one triangle from a surface.
inline Surface without(Surface s, std::size_t triangle) {
  s.triangle.erase(s.triangle.begin() + static_cast<std::ptrdiff_t>(triangle));
  return s;
}

/// Inverts the orientation of a surface.
inline Surface turned(Surface s) {
  for (Triangle& t : s.triangle) std::swap(t[1], t[2]);
  add_normals(s);
  return s;
}

}  // namespace phyxel::test
