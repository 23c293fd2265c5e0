/// A ball as a frame, and the message of an error, for the tests of pictures.
#pragma once

#include <cmath>
#include <numbers>
#include <string>

#include "phyxel/error.hpp"
#include "phyxel/recorder.hpp"

namespace phyxel::app {

/// A sphere of `n` x 2n quads with outward normals.
inline FrameData sphere(Vec3d centre, double radius, int n) {
  FrameData frame;
  for (int i = 0; i <= n; ++i) {
    for (int j = 0; j < 2 * n; ++j) {
      const double t = std::numbers::pi * i / n, a = std::numbers::pi * j / n;
      const Vec3d out{std::sin(t) * std::cos(a), std::sin(t) * std::sin(a), std::cos(t)};
      frame.point.push_back(centre + radius * out);
      frame.normal.push_back(out);
    }
  }
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < 2 * n; ++j) {
      const Index a = i * 2 * n + j, b = a + 2 * n;
      const Index d = i * 2 * n + (j + 1) % (2 * n), c = d + 2 * n;
      frame.triangle.push_back({a, b, c});
      frame.triangle.push_back({a, c, d});
    }
  }
  return frame;
}

template <class Call>
std::string message_of(const Call& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

}  // namespace phyxel::app
