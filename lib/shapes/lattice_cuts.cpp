#include "shapes/lattice_cuts.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

namespace phyxel {
namespace {

/// Two layers are not laid nearer to each other than this many spacings.
constexpr double closest = 0.5;
/// A box that is thinner, in spacings, has one layer.
constexpr double thin = 0.8;
/// A box that reaches less deep, in spacings, ends at the end of the lattice.
constexpr double flush = 0.05;

using Range = std::array<double, 2>;

/// The ranges of the coordinates of a box along the axes.
std::optional<std::array<Range, 3>> along_axes(const SpaceRegion& region) {
  constexpr double rounding = 1e-12;
  if (region.is_ball) return {};
  std::array<Range, 3> ranges;
  for (int k = 0; k < 3; ++k) {
    const Vec3d edge = region.edge[k];
    int axis = 0;
    for (int other = 1; other < 3; ++other) {
      if (std::abs(component(edge, other)) > std::abs(component(edge, axis))) axis = other;
    }
    const bool forwards = component(edge, axis) > 0;
    for (int other = 0; other < 3; ++other) {
      if (other != axis && std::abs(component(edge, other)) > rounding) return {};
    }
    const double low = component(region.low, k), high = component(region.high, k);
    ranges[axis] = forwards ? Range{low, high} : Range{-high, -low};
  }
  return ranges;
}

/// What one axis of a box asks for.
struct Asked {
  Range wall;                           ///< The box's ends, or places beyond the lattice [m].
  std::vector<double> planes;           ///< Where layers are to lie [m].
  std::array<bool, 2> ends{};           ///< Ends on which a layer is to lie.
  bool whole = false, is_thin = false;  ///< Whether it holds all layers, or has one of its own.
  bool is_near_end = false;             ///< Whether a plane is near to the end that it holds.
};

/// What a box asks for along an axis of a lattice; nothing if it cannot be cut.
std::optional<Asked> asked(const LatticeBox& lattice, int axis, Range box) {
  const double low = component(lattice.low, axis), length = component(lattice.extent, axis),
               high = low + length, h = lattice.spacing;
  if (box[1] < low || box[0] > high) return {};
  const bool open[2] = {box[0] <= low, box[1] >= high};
  Asked found{.wall = {open[0] ? low - length : box[0], open[1] ? high + length : box[1]}};
  if (open[0] && open[1]) {
    found.whole = true;
    return found;
  }
  if (!lattice.flat[axis]) return {};
  if (!open[0] && box[0] < low + closest * h) return {};
  if (!open[1] && box[1] > high - closest * h) return {};
  if (!open[0] && !open[1] && box[1] - box[0] < thin * h) {
    found.is_thin = true;
    found.planes = {0.5 * (box[0] + box[1])};
    return found;
  }
  if (open[0] || open[1]) {
    const int end = open[0] ? 0 : 1;
    const double reach = open[0] ? box[1] - low : high - box[0];
    if (reach < flush * h) {
      found.is_thin = found.ends[end] = true;
      return found;
    }
    found.is_near_end = reach < closest * h;
  }
  if (!open[0]) found.planes.push_back(box[0] + lattice.depth);
  if (!open[1]) found.planes.push_back(box[1] - lattice.depth);
  return found;
}

/// The planes of an axis with those of one more box, ascending; nothing if they would be too near
/// to each other.
std::optional<std::vector<double>> joined(std::vector<double> planes,
                                          const std::vector<double>& more, double spacing) {
  for (const double plane : more) {
    double nearest = HUGE_VAL;
    for (const double other : planes) nearest = std::min(nearest, std::abs(plane - other));
    if (nearest < 1e-6 * spacing) continue;  // that of a box beside this one
    if (nearest < closest * spacing) return {};
    planes.push_back(plane);
  }
  std::sort(planes.begin(), planes.end());
  return planes;
}

class Planner {
 public:
  explicit Planner(const LatticeBox& lattice) : lattice_(lattice) {
    for (int axis = 0; axis < 3; ++axis) {
      plan_.on_end[axis] = {lattice.on_end[axis], lattice.on_end[axis]};
    }
  }

  void add(const SpaceRegion& region) {
    const auto box = along_axes(region);
    if (!box) return;
    std::array<Asked, 3> of;
    std::array<std::vector<double>, 3> planes;
    for (int axis = 0; axis < 3; ++axis) {
      const std::optional<Asked> found = asked(lattice_, axis, (*box)[axis]);
      if (!found) return;
      of[axis] = *found;
      const auto both = joined(plan_.planes[axis], found->planes, lattice_.spacing);
      if (!both) return;
      planes[axis] = *both;
    }
    // Near to an end, layers are laid only if all phyxels on it are held.
    for (int axis = 0; axis < 3; ++axis) {
      const bool covers = of[(axis + 1) % 3].whole && of[(axis + 2) % 3].whole;
      if (of[axis].is_near_end && !covers) return;
    }
    bool is_thin = false, whole = true;
    for (int axis = 0; axis < 3; ++axis) {
      is_thin = is_thin || of[axis].is_thin;
      whole = whole && of[axis].whole;
      plan_.planes[axis] = planes[axis];
      for (int end = 0; end < 2; ++end) {
        plan_.on_end[axis][end] = plan_.on_end[axis][end] || of[axis].ends[end];
      }
    }
    if (is_thin || whole) return;
    SpaceRegion wall;
    wall.low = {of[0].wall[0], of[1].wall[0], of[2].wall[0]};
    wall.high = {of[0].wall[1], of[1].wall[1], of[2].wall[1]};
    plan_.cuts.push_back({region, wall});
  }

  LayerPlan run() { return std::move(plan_); }

 private:
  const LatticeBox& lattice_;
  LayerPlan plan_;
};

}  // namespace

bool is_along_axes(const SpaceRegion& region) { return along_axes(region).has_value(); }

LayerPlan plan_layers(const LatticeBox& lattice, std::span<const SpaceRegion> regions) {
  Planner planner(lattice);
  for (const SpaceRegion& region : regions) planner.add(region);
  return planner.run();
}

}  // namespace phyxel
