#include "model/notch.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "model/assembly.hpp"
#include "model/box_overlaps.hpp"
#include "phyxel/error.hpp"
#include "phyxel/mesh.hpp"

namespace phyxel {

Notch::Notch(const NotchRequest& request, const BodyRequest& body) : disc_(request) {
  if (request.mesh.empty()) {
    // Its square may be too small for a number.
    const Vec3d n = request.normal;
    normal_ = normalised((1 / std::max({std::abs(n.x), std::abs(n.y), std::abs(n.z)})) * n);
    return;
  }
  Surface surface = read_mesh(request.mesh);
  place(surface.position, body);
  for (const auto& corners : surface.triangle) {
    const std::array<Vec3d, 3> x{surface.position[corners[0]], surface.position[corners[1]],
                                 surface.position[corners[2]]};
    const Vec3d first = x[1] - x[0], second = x[2] - x[0];
    if (cross(first, second) == Vec3d{}) continue;  // a line
    triangles_.push_back({x[0], first, second, box_around(x)});
    const Box& box = triangles_.back().box;
    widest_ = std::max(widest_, box.high.x - box.low.x);
  }
  if (triangles_.empty()) {
    throw InputError(request.where + (request.where.empty() ? "" : ": ") + request.mesh.string() +
                     ": no triangle has an area; allowed: a surface");
  }
  std::sort(triangles_.begin(), triangles_.end(),
            [](const Triangle& a, const Triangle& b) { return a.box.low.x < b.box.low.x; });
}

std::vector<std::size_t> Notch::near(Vec3d x, double reach) const {
  if (triangles_.empty()) {
    const bool may_cut = std::abs(dot(normal_, x - disc_.centre)) <= reach &&
                         norm(x - disc_.centre) <= disc_.radius + reach;
    return std::vector<std::size_t>(may_cut ? 1 : 0, 0);
  }
  const Box around = grown({x, x}, reach);
  std::vector<std::size_t> numbers;
  auto at = std::lower_bound(
      triangles_.begin(), triangles_.end(), around.low.x - widest_,
      [](const Triangle& triangle, double low) { return triangle.box.low.x < low; });
  for (; at != triangles_.end() && at->box.low.x <= around.high.x; ++at) {
    if (overlap(at->box, around)) {
      numbers.push_back(static_cast<std::size_t>(at - triangles_.begin()));
    }
  }
  return numbers;
}

bool Notch::disc_cuts(Vec3d a, Vec3d b) const {
  const Vec3d from = a - disc_.centre, to = b - disc_.centre;
  const double height = dot(normal_, from), other = dot(normal_, to);
  if ((height < 0) == (other < 0)) return false;
  const Vec3d through = from + (height / (height - other)) * (to - from);
  return dot(through, through) <= disc_.radius * disc_.radius;
}

bool Notch::cuts(Vec3d a, Vec3d b, std::span<const std::size_t> near) const {
  if (triangles_.empty()) return !near.empty() && disc_cuts(a, b);
  return std::any_of(near.begin(), near.end(), [&](std::size_t k) {
    const Triangle& triangle = triangles_[k];
    const Vec3d normal = cross(triangle.first, triangle.second);
    const Vec3d from = a - triangle.corner, to = b - triangle.corner;
    const double height = dot(normal, from), other = dot(normal, to);
    if ((height < 0) == (other < 0)) return false;
    const Vec3d through = from + (height / (height - other)) * (to - from);
    // Shares of the edges, from areas.
    const double area = dot(normal, normal);
    const double first = dot(cross(through, triangle.second), normal) / area;
    const double second = dot(cross(triangle.first, through), normal) / area;
    constexpr double rounding = 1e-12;
    return first >= -rounding && second >= -rounding && first + second <= 1 + rounding;
  });
}

}  // namespace phyxel
