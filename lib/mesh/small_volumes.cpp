#include "mesh/small_volumes.hpp"

#include <algorithm>
#include <cmath>

#include "model/spatial_hash.hpp"

namespace phyxel {
namespace {

/// Least volume of a point beside a cut, in cubes of the spacing. Points along a right-angled edge
/// have a quarter, at the corner of a cube an eighth.
constexpr double least_volume = 0.2;
/// Distance from a cut within which volumes are raised, and distance of the points that lose as
/// much, in spacings.
constexpr double beside = 1, reach = 2;

/// A point near a cut.
struct NearPoint {
  std::size_t index;  ///< Index of the point.
  double spacing;     ///< Spacing wanted at the point [m].
  double least;       ///< Least volume [m³].
  bool is_beside;     ///< True if the point is within `beside` of a cut.
};

}  // namespace

void raise_small_volumes(std::span<const Vec3d> point, const SupportCuts& cuts,
                         const SpacingField& spacing, std::vector<double>& volume,
                         const std::function<bool(std::size_t)>& may_change) {
  if (cuts.list.empty()) return;
  std::vector<NearPoint> near;
  std::vector<Vec3d> place;
  for (std::size_t k = 0; k < point.size(); ++k) {
    if (may_change && !may_change(k)) continue;
    double distance = HUGE_VAL;
    for (const SupportCut& cut : cuts.list) {
      distance = std::min(distance, std::abs(cut.wall.distance(point[k])));
    }
    const double s = spacing.at(point[k]);
    if (distance >= (beside + reach) * s) continue;
    near.push_back({k, s, least_volume * s * s * s, distance < beside * s});
    place.push_back(point[k]);
  }
  const SpatialHash hash(place, reach * spacing.coarsest());
  // One point after the other, since each gain leaves less for the next.
  for (const NearPoint& small : near) {
    double& own = volume[small.index];
    if (!small.is_beside || own >= small.least) continue;
    const auto visit_donors = [&](auto&& visit) {
      const double radius = reach * small.spacing;
      hash.visit_ball(point[small.index], radius, [&](const SpatialHash::Entry& e) {
        const NearPoint& donor = near[static_cast<std::size_t>(e.index)];
        const double excess = volume[donor.index] - donor.least;
        if (excess > 0 && norm(e.position - point[small.index]) < radius) {
          visit(donor.index, excess);
        }
      });
    };
    double spare = 0;
    visit_donors([&](std::size_t, double excess) { spare += excess; });
    if (!(spare > 0)) continue;
    const double gain = std::min(small.least - own, 0.5 * spare);
    visit_donors([&](std::size_t j, double excess) { volume[j] -= gain * (excess / spare); });
    own += gain;
  }
}

}  // namespace phyxel
