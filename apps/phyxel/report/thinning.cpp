#include "report/thinning.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>

#include "sort_unique.hpp"

namespace phyxel::app {
namespace {

/// The smallest coordinates of some points; 0 where none is finite.
Vec3d lowest(const std::vector<Vec3d>& points) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  Vec3d low{infinity, infinity, infinity};
  for (const Vec3d& p : points) {
    if (!is_finite(p)) continue;
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
  }
  return is_finite(low) ? low : Vec3d{};
}

/// The cell of each surfel in a grid. Cells are numbered from 0 in the order of their first
/// surfels.
struct Cells {
  std::vector<std::size_t> of_surfel;
  std::size_t count = 0;
};

Cells cells_of(const FrameData& surface, Vec3d origin, double width) {
  struct Placed {
    std::array<std::int64_t, 4> cell;  // place in the grid, and body
    std::size_t surfel;
  };
  const std::size_t n = surface.point.size();
  std::vector<Placed> placed;
  for (std::size_t s = 0; s < n; ++s) {
    const auto along = [&](double x, double from) {
      const double steps = std::floor((x - from) / width);
      return steps > 0 && steps < 1e15 ? static_cast<std::int64_t>(steps) : 0;  // 0 for NaN
    };
    const Vec3d& p = surface.point[s];
    const Index body = surface.body.size() == n ? surface.body[s] : 0;
    placed.push_back({{along(p.x, origin.x), along(p.y, origin.y), along(p.z, origin.z), body}, s});
  }
  std::sort(placed.begin(), placed.end(), [](const Placed& a, const Placed& b) {
    return a.cell != b.cell ? a.cell < b.cell : a.surfel < b.surfel;
  });
  Cells cells;
  cells.of_surfel.resize(n);
  for (std::size_t k = 0; k < n; ++k) {
    if (k == 0 || placed[k].cell != placed[k - 1].cell) ++cells.count;
    cells.of_surfel[placed[k].surfel] = cells.count - 1;
  }
  return cells;
}

/// The surfel of each cell that is nearest to the mean of the cell's.
std::vector<std::size_t> representatives(const std::vector<Vec3d>& point, const Cells& cells) {
  std::vector<Vec3d> sum(cells.count);
  std::vector<double> members(cells.count, 0), nearest(cells.count, HUGE_VAL);
  for (std::size_t s = 0; s < point.size(); ++s) {
    sum[cells.of_surfel[s]] += point[s];
    ++members[cells.of_surfel[s]];
  }
  constexpr std::size_t none = std::numeric_limits<std::size_t>::max();
  std::vector<std::size_t> chosen(cells.count, none);
  for (std::size_t s = 0; s < point.size(); ++s) {
    const std::size_t c = cells.of_surfel[s];
    const double distance = norm(point[s] - (1 / members[c]) * sum[c]);
    if (chosen[c] != none && !(distance < nearest[c])) continue;
    chosen[c] = s;
    nearest[c] = distance;
  }
  return chosen;
}

}  // namespace

/// Triangles whose corners have three representatives, once each.
std::vector<Triangle> ThinnedSurface::shown(const std::vector<Triangle>& of_surface) const {
  if (representative.empty()) return of_surface;
  std::vector<Triangle> kept;
  for (const Triangle& whole : of_surface) {
    Triangle merged;
    for (std::size_t c = 0; c < 3; ++c) {
      merged[c] = static_cast<Index>(representative[static_cast<std::size_t>(whole[c])]);
    }
    if (merged[0] == merged[1] || merged[1] == merged[2] || merged[2] == merged[0]) continue;
    std::rotate(merged.begin(), std::min_element(merged.begin(), merged.end()), merged.end());
    kept.push_back(merged);
  }
  sort_unique(kept);
  return kept;
}

std::vector<std::size_t> sort_by_last_frame(std::vector<Triangle>& triangles,
                                            std::vector<std::vector<Triangle>> of_frames) {
  struct Lasting {
    std::size_t frames;  // that have the triangle, from the first
    Triangle triangle;
  };
  std::vector<Lasting> lasting;
  for (const Triangle& triangle : triangles) lasting.push_back({0, triangle});
  for (std::vector<Triangle>& of_frame : of_frames) std::sort(of_frame.begin(), of_frame.end());
  for (Lasting& one : lasting) {
    while (one.frames < of_frames.size() &&
           std::binary_search(of_frames[one.frames].begin(), of_frames[one.frames].end(),
                              one.triangle)) {
      ++one.frames;
    }
  }
  std::stable_sort(lasting.begin(), lasting.end(),
                   [](const Lasting& a, const Lasting& b) { return a.frames > b.frames; });
  for (std::size_t k = 0; k < lasting.size(); ++k) triangles[k] = lasting[k].triangle;
  std::vector<std::size_t> counts;
  for (std::size_t frame = 0; frame < of_frames.size(); ++frame) {
    const auto end = std::find_if(lasting.begin(), lasting.end(),
                                  [&](const Lasting& one) { return one.frames <= frame; });
    counts.push_back(static_cast<std::size_t>(end - lasting.begin()));
  }
  return counts;
}

ThinnedSurface thinned(const FrameData& surface, std::size_t most) {
  const std::size_t n = surface.point.size();
  ThinnedSurface result;
  if (n <= most) {
    result.surfel.resize(n);
    std::iota(result.surfel.begin(), result.surfel.end(), std::size_t{0});
    result.triangle = surface.triangle;
    return result;
  }
  double area = 0;
  for (const auto& [a, b, c] : surface.triangle) {
    const auto at = [&](Index k) { return surface.point[static_cast<std::size_t>(k)]; };
    const double twice = norm(cross(at(b) - at(a), at(c) - at(a)));
    if (std::isfinite(twice)) area += twice / 2;
  }
  const Vec3d origin = lowest(surface.point);
  const auto wanted = static_cast<double>(std::max<std::size_t>(1, most));
  // A plane cuts about 1.5 cells per area of a cell's face; the search goes on from there, until
  // the number is right or the grid is as coarse as it must be.
  double width = area > 0 ? std::sqrt(1.5 * area / wanted) : 1e-9;
  Cells cells = cells_of(surface, origin, width);
  constexpr int most_refinements = 6, most_searches = 40;
  constexpr double near_enough = 0.93;
  for (int k = 0; k < most_searches; ++k) {
    const double share = static_cast<double>(cells.count) / wanted;
    if (share <= 1 && (share > near_enough || k >= most_refinements)) break;
    width *= share > 1 ? std::max(1.02, std::sqrt(share)) : std::sqrt(share / 0.97);
    cells = cells_of(surface, origin, width);
  }
  const std::vector<std::size_t> chosen = representatives(surface.point, cells);
  result.surfel = chosen;
  std::sort(result.surfel.begin(), result.surfel.end());
  for (const std::size_t cell : cells.of_surfel) {
    result.representative.push_back(static_cast<std::size_t>(
        std::lower_bound(result.surfel.begin(), result.surfel.end(), chosen[cell]) -
        result.surfel.begin()));
  }
  result.triangle = result.shown(surface.triangle);
  return result;
}

}  // namespace phyxel::app
