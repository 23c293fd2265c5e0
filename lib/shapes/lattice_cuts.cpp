#include "shapes/lattice_cuts.hpp"

#include <algorithm>
#include <cmath>

namespace phyxel {
namespace {

/// Two layers are not laid nearer to each other than this many spacings.
constexpr double closest = 0.5;
/// A box that is thinner, in spacings, has one layer.
constexpr double thin = 0.8;
/// A box that reaches less deep, in spacings, ends at the end of the lattice.
constexpr double flush = 0.05;

using Range = std::array<double, 2>;

/// One axis of a box, once its layers are chosen.
struct LaidAxis {
  Range acts;  ///< Where the support begins and ends: the box's faces, or where they moved [m].
  std::array<bool, 2> open{};  ///< Whether it goes on to the end of the lattice.
  std::array<bool, 2> ends{};  ///< Ends of the lattice on which a layer is to lie.
  std::vector<double> planes;  ///< Other places where layers are to lie [m].
  bool is_thin = false;        ///< True if it has one layer only.
  bool whole() const { return open[0] && open[1]; }
};

class Planner {
 public:
  explicit Planner(const LatticeBox& lattice) : lattice_(lattice) {
    for (int axis = 0; axis < 3; ++axis) {
      plan_.on_end[axis] = {lattice.on_end[axis], lattice.on_end[axis]};
    }
  }

  void add(const SupportRegion& support) {
    const auto box = ranges_along_axes(support.region);
    if (!box || !can_be_laid(*box)) return;
    std::array<LaidAxis, 3> laid;
    // Phyxels that are free to vibrate on both of two near layers would shorten the time step.
    for (int axis = 0; axis < 3; ++axis) {
      laid[axis] = lay(axis, (*box)[axis], lattice_.on_end[axis] ? closest : flush);
    }
    // Where all phyxels on the end are held, none of them is.
    for (int axis = 0; axis < 3 && support.holds_all; ++axis) {
      const bool covers = laid[(axis + 1) % 3].whole() && laid[(axis + 2) % 3].whole();
      if (covers) laid[axis] = lay(axis, (*box)[axis], flush);
    }
    keep(support, *box, laid);
  }

  LayerPlan run() { return std::move(plan_); }

 private:
  double low(int axis) const { return component(lattice_.low, axis); }
  double high(int axis) const { return low(axis) + component(lattice_.extent, axis); }

  /// True if layers can lie on all faces of a box that are inside the lattice.
  bool can_be_laid(const std::array<Range, 3>& box) const {
    for (int axis = 0; axis < 3; ++axis) {
      const auto [from, to] = box[axis];
      const double slack = lattice_.depth;
      if (to < low(axis) - slack || from > high(axis) + slack) return false;
      const bool whole = from <= low(axis) + slack && to >= high(axis) - slack;
      if (!whole && !lattice_.flat[axis]) return false;
    }
    return true;
  }

  /// The layer or end of the lattice that a layer at `place` would be too near to, or `place`.
  /// @param reach shortest distance from each end [spacings]
  double settled(int axis, double place, Range reach) const {
    double found = place, least = HUGE_VAL;
    const auto offer = [&](double other, double limit) {
      const double distance = std::abs(place - other);
      if (distance >= limit * lattice_.spacing || distance >= least) return;
      found = other;
      least = distance;
    };
    offer(low(axis), reach[0]);
    offer(high(axis), reach[1]);
    for (const double plane : plan_.planes[axis]) offer(plane, closest);
    return found;
  }

  /// Adds a layer at a settled place.
  void lay_at(int axis, double place, LaidAxis& laid) const {
    if (place == low(axis)) {
      laid.ends[0] = true;
    } else if (place == high(axis)) {
      laid.ends[1] = true;
    } else if (std::ranges::count(laid.planes, place) == 0) {
      laid.planes.push_back(place);
    }
  }

  /// Chooses the layers of a box along one axis.
  /// @param reach least distance of a face from the end that its box holds [spacings]
  LaidAxis lay(int axis, Range box, double reach) const {
    const double begin = low(axis), end = high(axis), h = lattice_.spacing;
    LaidAxis laid{.acts = box,
                  .open = {box[0] <= begin + lattice_.depth, box[1] >= end - lattice_.depth},
                  .ends = {},
                  .planes = {}};
    if (laid.whole()) return laid;
    if (!laid.open[0] && !laid.open[1] && box[1] - box[0] < thin * h) {
      const double middle = 0.5 * (box[0] + box[1]);
      const double place = settled(axis, middle, {closest, closest});
      laid.acts = {place, place};
      lay_at(axis, place, laid);
      laid.is_thin = true;
      return laid;
    }
    const std::array<bool, 2> was_open = laid.open;
    for (int side = 0; side < 2; ++side) {
      if (was_open[side]) continue;
      // Beyond the face there is free material, on its other side the support.
      const double held_end = was_open[1 - side] ? reach : closest;
      const double place =
          settled(axis, box[side], side == 0 ? Range{closest, held_end} : Range{held_end, closest});
      if (std::abs(place - box[side]) > lattice_.depth) laid.acts[side] = place;
      laid.open[side] = place == (side == 0 ? begin : end);
      if (!laid.open[side]) lay_at(axis, place, laid);
    }
    laid.is_thin = laid.planes.size() + laid.ends[0] + laid.ends[1] == 1 &&
                   (laid.ends[0] || laid.ends[1] || !(laid.open[0] || laid.open[1]));
    return laid;
  }

  /// Adds the layers of a box to the plan, where it acts, and its wall.
  void keep(const SupportRegion& support, const std::array<Range, 3>& box,
            const std::array<LaidAxis, 3>& laid) {
    bool is_moved = false, is_thin = false, is_whole = true;
    std::array<Range, 3> acts, wall;
    for (int axis = 0; axis < 3; ++axis) {
      const LaidAxis& one = laid[axis];
      is_moved = is_moved || one.acts != box[axis];
      is_thin = is_thin || one.is_thin;
      is_whole = is_whole && one.whole();
      acts[axis] = wall[axis] = one.acts;
      const double length = component(lattice_.extent, axis);
      if (one.open[0]) wall[axis][0] = low(axis) - length;
      if (one.open[1]) wall[axis][1] = high(axis) + length;
      std::vector<double>& planes = plan_.planes[axis];
      for (const double plane : one.planes) {
        if (std::ranges::count(planes, plane) == 0) planes.push_back(plane);
      }
      std::sort(planes.begin(), planes.end());
      for (int end = 0; end < 2; ++end) {
        plan_.on_end[axis][end] = plan_.on_end[axis][end] || one.ends[end];
      }
    }
    const auto box_of = [](const std::array<Range, 3>& range) {
      return SpaceRegion{.low = {range[0][0], range[1][0], range[2][0]},
                         .high = {range[0][1], range[1][1], range[2][1]}};
    };
    if (is_moved) plan_.moved.push_back({support.region, box_of(acts)});
    if (support.holds_all && !is_thin && !is_whole) {
      plan_.cuts.push_back({support.region, box_of(wall)});
    }
  }

  const LatticeBox& lattice_;
  LayerPlan plan_;
};

}  // namespace

std::optional<std::array<Range, 3>> ranges_along_axes(const SpaceRegion& region) {
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

bool is_along_axes(const SpaceRegion& region) { return ranges_along_axes(region).has_value(); }

LayerPlan plan_layers(const LatticeBox& lattice, std::span<const SupportRegion> supports) {
  std::vector<SupportRegion> sorted(supports.begin(), supports.end());
  std::stable_sort(sorted.begin(), sorted.end(),
                   [](const SupportRegion& a, const SupportRegion& b) {
                     if (a.holds_all != b.holds_all) return a.holds_all;
                     return comes_before(a.region, b.region);
                   });
  Planner planner(lattice);
  for (const SupportRegion& support : sorted) planner.add(support);
  return planner.run();
}

}  // namespace phyxel
