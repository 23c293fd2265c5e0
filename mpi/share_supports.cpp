#include <algorithm>
#include <cmath>

#include "model/neighbour_search.hpp"
#include "model/share_surveyor.hpp"
#include "model/spatial_hash.hpp"
#include "mpi/share_pipeline.hpp"
#include "tabulated.hpp"

namespace phyxel {
namespace {

/// Returns a slightly larger distance, so that rounding leaves no phyxel out.
constexpr double margin = 1 + 1e-9;

}  // namespace

void find_spacings(const ShareSetup& setup, const WholeBodies& whole, MigratingPhyxels& own) {
  const std::size_t n = whole.bodies.size();
  const auto wants = [&](std::size_t b) {
    return !setup.scene.bodies[b].neighbourhood.radius || whole.bodies[b].kernel_volumes;
  };
  std::vector<double> reach(n, 0);
  bool any = false;
  for (std::size_t b = 0; b < n; ++b) {
    if (!wants(b) || whole.bodies[b].size < 2) continue;
    any = true;
    // For evenly spread phyxels, one and a half times the distance needed.
    reach[b] = roomy_cell_size(whole.boxes[b].low, whole.boxes[b].high,
                               static_cast<std::size_t>(whole.bodies[b].size)) *
               1.6 * std::cbrt(setup.scene.bodies[b].neighbourhood.nearest / 10.0);
  }
  if (!any) return;
  for (;;) {
    const RemotePhyxels others = remote_phyxels_around(setup.ranks, own, reach, whole.boxes);
    std::vector<double> needed(n, 0);
    for (const auto& [first, last] : ranges_of_bodies(own)) {
      const auto b = static_cast<std::size_t>(own[first].body);
      if (!wants(b)) continue;
      const std::span<MigratingPhyxel> here = std::span(own).subspan(first, last - first);
      const std::span<const MigratingPhyxel> there = of_body(others.phyxels, b);
      const std::size_t size = here.size() + there.size();
      const Bulk<Vec3d> position = in_bulk(size, [&](std::size_t k) {
        return (k < here.size() ? here[k] : there[k - here.size()]).position;
      });
      const int nearest = setup.scene.bodies[b].neighbourhood.nearest;
      Bulk<double> farthest = in_bulk(size, [](std::size_t) { return 0.0; });
      const std::vector<double> spacing =
          setup.options.surveyor
              ? setup.options.surveyor->mean_spacing(position, nearest, farthest.data())
              : mean_spacing(position, nearest, farthest.data());
      const auto enough = std::min<Index>(nearest + 1, whole.bodies[b].size);
      const bool too_few = static_cast<Index>(size) < enough;
      double most = 0;
#pragma omp parallel for schedule(static) reduction(max : most)
      for (std::size_t k = 0; k < here.size(); ++k) {
        here[k].spacing = spacing[k];
        most = std::max(most, too_few ? 2 * reach[b] + 1e-300 : farthest[k] * margin);
      }
      needed[b] = most;
    }
    needed = largest_of(setup.ranks, needed);
    bool done = true;
    for (std::size_t b = 0; b < n; ++b) {
      if (needed[b] <= reach[b]) continue;
      reach[b] = needed[b];
      done = false;
    }
    if (done) return;
  }
}

namespace {

/// Returns the medians of a value of the phyxels of each body for which wants(body); 0 for others.
/// Collective. @param value value(phyxel)
template <class Wants, class Value>
std::vector<double> medians(const ShareSetup& setup, const WholeBodies& whole,
                            const MigratingPhyxels& own, Wants&& wants, Value&& value) {
  if (std::none_of(whole.bodies.begin(), whole.bodies.end(), wants)) {
    return std::vector<double>(whole.bodies.size(), 0);
  }
  std::vector<Bulk<double>> values(whole.bodies.size());
  for (const auto& [first, last] : ranges_of_bodies(own)) {
    const auto b = static_cast<std::size_t>(own[first].body);
    if (!wants(whole.bodies[b])) continue;
    values[b] =
        in_bulk(last - first, [&, from = first](std::size_t k) { return value(own[from + k]); });
  }
  return medians_of(setup.ranks, values);
}

/// Replaces the spacings of own phyxels of graded clouds by those that supports follow from, as
/// `graded_spacing` does. Kernel volumes need the former.
void find_graded_spacings(const ShareSetup& setup, const WholeBodies& whole,
                          MigratingPhyxels& own) {
  const auto is_graded = [](const WholeBody& body) {
    return body.rule.pairwise() && body.has_spacing;
  };
  const std::vector<double> ratio = medians(
      setup, whole, own, is_graded, [](const MigratingPhyxel& p) { return p.spacing / p.support; });
  for (MigratingPhyxel& p : own) {
    const auto b = static_cast<std::size_t>(p.body);
    p.support = is_graded(whole.bodies[b]) ? ratio[b] * p.support : p.spacing;
  }
}

}  // namespace

void find_supports(const ShareSetup& setup, WholeBodies& whole, MigratingPhyxels& own) {
  find_graded_spacings(setup, whole, own);  // `support` has spacings until the end
  const std::vector<double> middle = medians(
      setup, whole, own,
      [](const WholeBody& body) { return !body.rule.radius && !body.rule.differs(); },
      [](const MigratingPhyxel& p) { return p.support; });
  std::vector<double> reach(whole.bodies.size(), 0), finest(whole.bodies.size(), -HUGE_VAL);
  for (const auto& [first, last] : ranges_of_bodies(own)) {
    const auto b = static_cast<std::size_t>(own[first].body);
    const std::size_t begin = first;  // for clang, whose OpenMP takes no bindings
    const std::vector<double> support =
        support_radii(in_bulk(last - first, [&](std::size_t k) { return own[begin + k].support; }),
                      whole.bodies[b].rule, middle[b]);
    double most = 0, least = HUGE_VAL;
#pragma omp parallel for schedule(static) reduction(max : most) reduction(min : least)
    for (std::size_t k = 0; k < support.size(); ++k) {
      own[begin + k].support = support[k];
      most = std::max(most, support[k]);
      least = std::min(least, support[k]);
    }
    reach[b] = most;
    finest[b] = -least;
  }
  reach = largest_of(setup.ranks, reach);
  finest = largest_of(setup.ranks, finest);
  const std::vector<double> length = medians(
      setup, whole, own, [](const WholeBody& body) { return body.rule.pairwise(); },
      [](const MigratingPhyxel& p) { return p.support; });
  for (std::size_t b = 0; b < whole.bodies.size(); ++b) {
    whole.bodies[b].reach = reach[b];
    whole.bodies[b].finest = -finest[b];
    whole.bodies[b].pair_length = length[b];
  }
}

RemotePhyxels remote_phyxels_within(const ShareSetup& setup, const WholeBodies& whole,
                                    const MigratingPhyxels& own, double supports) {
  std::vector<double> reach;
  for (const WholeBody& body : whole.bodies) {
    // Beside walls, a list depends on the rooms of neighbours' neighbours, and a room on phyxels up
    // to two spacings away.
    const double beside =
        body.walls.regions.empty() ? 0 : margin * body.reach + 2 * body.walls.spacing;
    reach.push_back(supports * margin * body.reach + beside);
  }
  return remote_phyxels_around(setup.ranks, own, reach, whole.boxes);
}

}  // namespace phyxel
