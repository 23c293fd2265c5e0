#include "phyxel/neighbourhood.hpp"

#include <fmt/format.h>
#include <omp.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "model/box.hpp"
#include "model/graded_hash.hpp"
#include "model/nearest_distances.hpp"
#include "model/neighbour_search.hpp"
#include "model/spatial_hash.hpp"
#include "phyxel/error.hpp"
#include "stage.hpp"
#include "tabulated.hpp"

namespace phyxel {
namespace {

constexpr Index block_size = 4096;  // rows a thread fills at a time

/// Builds rows in parallel: fill(i, row) appends row i's indices; rows come out ascending and in
/// order whatever the number of threads. @param stage that this is all of
template <class Fill>
Csr build_rows(Index rows, Stage& stage, Fill&& fill) {
  const Index blocks = (rows + block_size - 1) / block_size;
  std::vector<std::vector<Index>> block_indices(static_cast<std::size_t>(blocks));
  Csr csr;
  csr.offsets.assign(static_cast<std::size_t>(rows) + 1, 0);
  stage.expect(static_cast<std::size_t>(blocks));
#pragma omp parallel for schedule(dynamic)
  for (Index b = 0; b < blocks; ++b) {
    std::vector<Index> row;
    std::vector<Index>& indices = block_indices[b];
    const Index end = std::min(rows, (b + 1) * block_size);
    for (Index i = b * block_size; i < end; ++i) {
      row.clear();
      fill(i, row);
      std::sort(row.begin(), row.end());
      csr.offsets[i + 1] = static_cast<Offset>(row.size());
      indices.insert(indices.end(), row.begin(), row.end());
    }
    stage.count();
  }
  std::partial_sum(csr.offsets.begin(), csr.offsets.end(), csr.offsets.begin());
  csr.indices.resize(static_cast<std::size_t>(csr.entries()));
#pragma omp parallel for schedule(dynamic)
  for (Index b = 0; b < blocks; ++b) {
    std::copy(block_indices[b].begin(), block_indices[b].end(),
              csr.indices.begin() + csr.offsets[b * block_size]);
    std::vector<Index>().swap(block_indices[b]);
  }
  return csr;
}

/// A hash whose cells hold a handful of points each, without knowing the cloud's shape: starts
/// from the bounding box and shrinks while cells are crowded.
SpatialHash roomy_hash(std::span<const Vec3d> position) {
  const auto [low, high] = box_around(position);
  double cell = roomy_cell_size(low, high, position.size());
  for (int attempt = 0;; ++attempt) {
    SpatialHash hash(position, cell);
    if (hash.mean_occupancy() <= 8 || attempt == 4) return hash;
    cell *= std::cbrt(3 / hash.mean_occupancy());
  }
}

/// True if a good part of the points lie in cells that hold very many, as in a graded cloud.
bool is_crowded(const SpatialHash& hash, std::span<const Vec3d> position) {
  constexpr std::size_t most_samples = 1000;
  const std::size_t samples = std::min(position.size(), most_samples);
  std::size_t beside = 0;  // points in the cells of the samples
  for (std::size_t k = 0; k < samples; ++k) {
    hash.visit_ring(position[k * position.size() / samples], 0,
                    [&](const SpatialHash::Entry&) { ++beside; });
  }
  return beside > 32 * samples;
}

/// True if some sizes are more than twice as large as others.
bool are_graded(std::span<const double> size) {
  const auto [least, most] = std::minmax_element(size.begin(), size.end());
  return *most > 2 * *least;
}

/// @throws InputError if there is not one value for each phyxel, or with the first that is negative
///   or not finite
void check_lengths(const char* name, std::span<const double> values, std::size_t phyxels) {
  if (values.size() != phyxels) {
    throw InputError(fmt::format("{}: {} values for {} phyxels; allowed: one for each", name,
                                 values.size(), phyxels));
  }
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (values[i] >= 0 && std::isfinite(values[i])) continue;
    throw InputError(
        fmt::format("{} of phyxel {} is {} m; allowed: >= 0, finite", name, i, values[i]));
  }
}

/// @throws InputError with the first point that is not finite
void check_points(const char* name, std::span<const Vec3d> points) {
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vec3d p = points[i];
    if (is_finite(p)) continue;
    throw InputError(fmt::format("{} {} is at [{:g}, {:g}, {:g}] m; allowed: finite numbers", name,
                                 i, p.x, p.y, p.z));
  }
}

}  // namespace

double median_of(std::span<const double> values) {
  std::vector<double> sorted(values.begin(), values.end());
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  return *middle;
}

Csr transpose(const Csr& csr, Index columns) {
  for (std::size_t k = 0; k < csr.indices.size(); ++k) {
    if (csr.indices[k] >= 0 && csr.indices[k] < columns) continue;
    throw InputError(fmt::format("index {} of a pattern is {}; allowed: 0 to {}", k, csr.indices[k],
                                 columns - 1));
  }
  Csr result;
  result.offsets.assign(static_cast<std::size_t>(columns) + 1, 0);
  for (const Index j : csr.indices) ++result.offsets[j + 1];
  std::partial_sum(result.offsets.begin(), result.offsets.end(), result.offsets.begin());
  std::vector<Offset> next(result.offsets.begin(), result.offsets.end() - 1);
  result.indices.resize(csr.indices.size());
  for (Index i = 0; i < csr.rows(); ++i) {
    for (const Index j : csr.row(i)) result.indices[next[j]++] = i;
  }
  return result;
}

NeighbourhoodRule NeighbourhoodRule::resolved(bool has_spacing) const {
  NeighbourhoodRule rule = *this;
  if (support != Support::automatic) return rule;
  rule.support = has_spacing && !radius && !max_neighbours ? Support::pairwise : Support::uniform;
  return rule;
}

std::vector<double> graded_spacing(std::span<const double> mean, std::span<const double> own) {
  if (own.empty()) return {mean.begin(), mean.end()};
  const double ratio =
      median_of(tabulated(own.size(), [&](std::size_t i) { return mean[i] / own[i]; }));
  return tabulated(own.size(), [&](std::size_t i) { return ratio * own[i]; });
}

std::vector<double> support_radii(std::span<const double> spacing, const NeighbourhoodRule& rule,
                                  double median) {
  if (rule.differs()) {
    std::vector<double> support;
    support.reserve(spacing.size());
    for (const double r : spacing) support.push_back(rule.factor * r);
    return support;
  }
  return std::vector<double>(spacing.size(), rule.radius ? *rule.radius : rule.factor * median);
}

std::vector<double> mean_spacing(std::span<const Vec3d> position, int nearest) {
  if (nearest < 1) throw InputError(fmt::format("nearest = {}; allowed: >= 1", nearest));
  check_points("phyxel", position);
  return mean_spacing(position, nearest, nullptr);
}

std::vector<double> mean_spacing(std::span<const Vec3d> position, int nearest, double* farthest) {
  const Index n = static_cast<Index>(position.size());
  std::vector<double> spacing(position.size(), 0);
  if (n < 2) return spacing;
  Stage stage("distances between phyxels");
  const SpatialHash hash = roomy_hash(position);
  std::vector<double> size;
  std::optional<GradedHash> graded;
  if (is_crowded(hash, position)) {
    size = local_sizes(position);
    graded.emplace(position, size);
  }
  stage.expect(static_cast<std::size_t>(n / block_size));
#pragma omp parallel
  {
    const int wanted = std::min<int>(nearest, n - 1);
    std::vector<double> room(static_cast<std::size_t>(wanted));
#pragma omp for schedule(dynamic, block_size)
    for (Index i = 0; i < n; ++i) {
      NearestDistances found(room.data(), wanted);
      const Vec3d here = position[i];
      const auto offer = [&](const SpatialHash::Entry& e) {
        if (e.index != i) found.offer(dot(e.position - here, e.position - here));
      };
      if (graded) {
        search_nearest(found, *graded, here, size[i], offer);
      } else {
        search_nearest(
            found, hash.farthest_ring(here), hash.cell_size(),
            [&](int ring) { hash.visit_ring(here, ring, offer); }, [&] { hash.visit_all(offer); });
      }
      spacing[i] = found.mean_distance();
      if (farthest) farthest[i] = std::sqrt(found.largest());
      if ((i + 1) % block_size == 0) stage.count();
    }
  }
  stage.finish();
  return spacing;
}

Neighbourhood find_neighbours(std::span<const Vec3d> position, std::span<const double> spacing,
                              const NeighbourhoodRule& rule) {
  check_points("phyxel", position);
  check_lengths("spacing", spacing, position.size());
  return neighbours_within(
      position, support_radii(spacing, rule, spacing.empty() ? 0 : median_of(spacing)), rule);
}

Neighbourhood neighbours_within(std::span<const Vec3d> position, std::vector<double> support,
                                const NeighbourhoodRule& rule) {
  const Index n = static_cast<Index>(position.size());
  Neighbourhood result;
  result.support = std::move(support);
  result.symmetric = !rule.one_sided();
  if (n == 0) return result;
  Stage stage("neighbours");
  const bool pairwise = rule.pairwise();
  const double largest = *std::max_element(result.support.begin(), result.support.end());
  // A search visits phyxels by octaves of their supports where these vary.
  std::optional<GradedHash> graded;
  std::optional<SpatialHash> even;
  if (are_graded(result.support)) {
    graded.emplace(position, result.support);
  } else {
    even.emplace(position, median_of(result.support));
  }
  // The distance within which phyxels of support `other` are neighbours of one of support `h`.
  const auto reach = [pairwise](double h, double other) {
    return pairwise ? pair_support(h, other) : h;
  };

  using Candidate = std::pair<double, Index>;
  result.neighbours = build_rows(n, stage, [&](Index i, std::vector<Index>& row) {
    const Vec3d here = position[i];
    const double h = result.support[i];
    const auto visit_near = [&](auto&& visit) {
      if (graded) {
        graded->visit_ball(
            here, [&](double other) { return reach(h, other); }, visit);
      } else {
        even->visit_near(here, rings_within(reach(h, largest), even->cell_size()), visit);
      }
    };
    const auto within = [&](const SpatialHash::Entry& e) {
      const double r = reach(h, result.support[e.index]);
      return e.index != i && dot(e.position - here, e.position - here) < r * r;
    };
    if (!rule.max_neighbours) {
      visit_near([&](const SpatialHash::Entry& e) {
        if (within(e)) row.push_back(e.index);
      });
      return;
    }
    // Nearest kept; ties go to the smaller index, so that the choice is one on every machine.
    std::vector<Candidate> candidates;
    visit_near([&](const SpatialHash::Entry& e) {
      if (within(e)) candidates.emplace_back(dot(e.position - here, e.position - here), e.index);
    });
    const std::size_t kept =
        std::min(candidates.size(), static_cast<std::size_t>(*rule.max_neighbours));
    std::partial_sort(candidates.begin(), candidates.begin() + static_cast<std::ptrdiff_t>(kept),
                      candidates.end());
    for (std::size_t k = 0; k < kept; ++k) row.push_back(candidates[k].second);
  });
  if (!result.symmetric) result.inverse_lists = transpose(result.neighbours, n);
  stage.finish();
  return result;
}

namespace {

/// `phyxels_reaching` for few points: each phyxel finds the points within its support, so that only
/// the points need a table.
Csr phyxels_reaching_few(std::span<const Vec3d> point, std::span<const Vec3d> position,
                         std::span<const double> support, Stage& stage) {
  const auto n = static_cast<Index>(position.size());
  std::vector<double> sample;
  constexpr std::size_t enough = 1000;
  for (std::size_t k = 0; k < enough; ++k) sample.push_back(support[k * support.size() / enough]);
  // A ball cuts eight cells of this size at most.
  const SpatialHash hash(point, 2 * median_of(sample));
  const Index blocks = (n + block_size - 1) / block_size;
  struct Pair {
    Index point, phyxel;
  };
  std::vector<std::vector<Pair>> found(static_cast<std::size_t>(blocks));
  stage.expect(static_cast<std::size_t>(blocks));
#pragma omp parallel for schedule(dynamic)
  for (Index b = 0; b < blocks; ++b) {
    for (Index i = b * block_size; i < std::min(n, (b + 1) * block_size); ++i) {
      const double h = support[i];
      hash.visit_ball(position[i], h, [&](const SpatialHash::Entry& e) {
        const Vec3d apart = position[i] - e.position;
        if (dot(apart, apart) < h * h) found[b].push_back({e.index, i});
      });
    }
    stage.count();
  }
  Csr csr;
  csr.offsets.assign(point.size() + 1, 0);
  for (const std::vector<Pair>& pairs : found) {
    for (const Pair& pair : pairs) ++csr.offsets[pair.point + 1];
  }
  std::partial_sum(csr.offsets.begin(), csr.offsets.end(), csr.offsets.begin());
  csr.indices.resize(static_cast<std::size_t>(csr.entries()));
  std::vector<Offset> next(csr.offsets.begin(), csr.offsets.end() - 1);
  // Phyxels come in ascending order, and so do those of each row.
  for (const std::vector<Pair>& pairs : found) {
    for (const Pair& pair : pairs) csr.indices[next[pair.point]++] = pair.phyxel;
  }
  return csr;
}

}  // namespace

Csr phyxels_reaching(std::span<const Vec3d> point, std::span<const Vec3d> position,
                     std::span<const double> support) {
  Csr csr;
  if (position.empty() || point.empty()) {
    csr.offsets.assign(point.size() + 1, 0);
    return csr;
  }
  Stage stage("phyxels near the surface");
  constexpr std::size_t many = 16;  // phyxels a point, above which a table of all costs more
  if (position.size() / many > point.size()) {
    csr = phyxels_reaching_few(point, position, support, stage);
    stage.finish();
    return csr;
  }
  const auto add_reaching = [&](Vec3d here, const SpatialHash::Entry& e, std::vector<Index>& row) {
    const double h = support[e.index];
    if (dot(e.position - here, e.position - here) < h * h) row.push_back(e.index);
  };
  const auto points = static_cast<Index>(point.size());
  if (are_graded(support)) {
    const GradedHash hash(position, support);
    csr = build_rows(points, stage, [&](Index s, std::vector<Index>& row) {
      hash.visit_ball(
          point[s], [](double largest) { return largest; },
          [&](const SpatialHash::Entry& e) { add_reaching(point[s], e, row); });
    });
    stage.finish();
    return csr;
  }
  const double largest = *std::max_element(support.begin(), support.end());
  const SpatialHash hash(position, median_of(support));
  const int rings = rings_within(largest, hash.cell_size());
  csr = build_rows(points, stage, [&](Index s, std::vector<Index>& row) {
    hash.visit_near(point[s], rings,
                    [&](const SpatialHash::Entry& e) { add_reaching(point[s], e, row); });
  });
  stage.finish();
  return csr;
}

std::pair<double, Index> nearest_to(Vec3d point, std::span<const Vec3d> position) {
  std::pair<double, Index> nearest{std::numeric_limits<double>::infinity(),
                                   position.empty() ? -1 : 0};
  for (std::size_t i = 0; i < position.size(); ++i) {
    const double d2 = dot(position[i] - point, position[i] - point);
    if (d2 < nearest.first) nearest = {d2, static_cast<Index>(i)};
  }
  return nearest;
}

Csr phyxels_near(std::span<const Vec3d> point, std::span<const Vec3d> position,
                 std::span<const double> support, Index* unreached) {
  check_points("point", point);
  check_points("phyxel", position);
  check_lengths("support", support, position.size());
  Csr reaching = phyxels_reaching(point, position, support);
  std::vector<Index> nearest(point.size(), -1);
  Index lost = 0;
  if (!position.empty()) {
#pragma omp parallel for schedule(dynamic, 64) reduction(+ : lost)
    for (Index s = 0; s < reaching.rows(); ++s) {
      if (reaching.length(s) > 0) continue;
      nearest[s] = nearest_to(point[s], position).second;
      ++lost;
    }
  }
  if (unreached) *unreached = lost;
  if (lost == 0) return reaching;
  Csr csr;
  for (Index s = 0; s < reaching.rows(); ++s) {
    const auto row = reaching.row(s);
    csr.indices.insert(csr.indices.end(), row.begin(), row.end());
    if (row.empty()) csr.indices.push_back(nearest[s]);
    csr.offsets.push_back(static_cast<Offset>(csr.indices.size()));
  }
  return csr;
}

}  // namespace phyxel
