/// The content of mesh files of a unit cube, which tests read as it is or damage.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <string>

#include "support/surfaces.hpp"

namespace phyxel::test {

/// Returns the bytes of a number, in either order.
template <class T>
std::string bytes(T value, bool big_endian = false) {
  std::string text(sizeof(T), '\0');
  std::memcpy(text.data(), &value, sizeof(T));
  if (big_endian) std::reverse(text.begin(), text.end());
  return text;
}

inline std::string binary_stl(const Surface& s, const std::string& title = "a cube") {
  std::string text = title;
  text.resize(80, '\0');
  text += bytes(static_cast<std::uint32_t>(s.triangle.size()));
  for (const Triangle& t : s.triangle) {
    for (int k = 0; k < 3; ++k) text += bytes(0.0f);
    for (const Index corner : t) {
      const Vec3d p = s.position[corner];
      for (const double v : {p.x, p.y, p.z}) text += bytes(static_cast<float>(v));
    }
    text += bytes(std::uint16_t{0});
  }
  return text;
}

inline std::string ascii_stl(const Surface& s) {
  std::string text = "solid a cube\n";
  for (const Triangle& t : s.triangle) {
    text += " facet normal 0 0 0\n  outer loop\n";
    for (const Index corner : t) {
      const Vec3d p = s.position[corner];
      text += fmt::format("   vertex {} {} {:e}\n", p.x, p.y, p.z);
    }
    text += "  endloop\n endfacet\n";
  }
  return text + "endsolid a cube\n";
}

inline const std::string cube_vertices =
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nv 0 0 1\nv 1 0 1\nv 0 1 1\nv 1 1 1\n";
inline const std::string cube_faces =
    "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";
inline const std::string ply_cube_vertices =
    "0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 0 1\n1 0 1\n0 1 1\n1 1 1\n";
inline const std::string ply_cube_faces =
    "4 0 2 3 1\n4 4 5 7 6\n4 0 1 5 4\n4 2 6 7 3\n4 0 4 6 2\n4 1 3 7 5\n";
inline std::string ply_header(const std::string& format, int vertices, const std::string& faces) {
  return fmt::format(
      "ply\nformat {} 1.0\nelement vertex {}\nproperty float x\nproperty float y\n"
      "property float z\nelement face {}\nproperty list uchar int vertex_indices\nend_header\n",
      format, vertices, faces);
}

}  // namespace phyxel::test
