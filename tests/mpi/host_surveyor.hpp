/// A surveyor of shares on the host, for tests of the set-up by devices.
#pragma once

#include <span>
#include <vector>

#include "model/assembly.hpp"
#include "model/neighbour_search.hpp"
#include "model/share_surveyor.hpp"

namespace phyxel::testing {

/// Answers as a device does, from the lists of the host: the share that `build_share` makes of the
/// answers has no lists.
class HostSurveyor final : public ShareSurveyor {
 public:
  std::vector<double> mean_spacing(std::span<const Vec3d> position, int nearest,
                                   double* farthest) const override {
    return phyxel::mean_spacing(position, nearest, farthest);
  }
  Around around(std::span<const Vec3d> position, std::span<const double> support,
                std::span<const double> spacing, std::span<const char> own,
                bool one_sided) const override {
    NeighbourhoodRule rule;
    if (one_sided) rule.support = NeighbourhoodRule::Support::adaptive;
    Model m;
    m.position = {position.begin(), position.end()};
    m.parts.push_back({.end = static_cast<Index>(position.size())});
    m.neighbourhood = neighbours_within(position, {support.begin(), support.end()}, rule);
    find_moments(m);
    Around around = around_by_lists(m.neighbourhood, 0, own);
    if (!spacing.empty()) {
      around.kernel_sum =
          kernel_sums(position, m.neighbourhood, {spacing.begin(), spacing.end()}, false);
    }
    around.degenerate = m.degenerate;
    const auto keep_own = [&](std::vector<Index>& phyxels) {
      std::erase_if(phyxels, [&](Index i) { return !own[i]; });
    };
    keep_own(around.degenerate.isolated);
    keep_own(around.degenerate.collinear);
    keep_own(around.degenerate.coplanar);
    keep_own(around.degenerate.coincident);
    return around;
  }
};
}  // namespace phyxel::testing
