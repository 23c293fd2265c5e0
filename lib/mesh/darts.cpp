#include "mesh/darts.hpp"

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <numeric>

#include "mesh/filling_device.hpp"
#include "mesh/filling_rules.hpp"
#include "mesh/random_bits.hpp"
#include "parallel_sort.hpp"
#include "stage.hpp"
#include "tabulated.hpp"

namespace phyxel {
namespace {

/// A spatial hash table to which points are added one by one.
class GrowingHash {
 public:
  GrowingHash(double cell_size, std::size_t expected)
      : inverse_(1 / cell_size), mask_(std::bit_ceil(4 * expected + 16) - 1), head_(mask_ + 1, -1) {
    point_.reserve(expected);
    next_.reserve(expected);
  }

  void add(Vec3d p) {
    Index& head = head_[bucket(cell(p.x), cell(p.y), cell(p.z))];
    next_.push_back(head);
    head = static_cast<Index>(point_.size());
    point_.push_back(p);
  }

  /// Square of the distance to the nearest point [m^2], or `limit` if none is nearer. Exact for
  /// limits up to the square of the cell size.
  double nearest2(Vec3d p, double limit) const {
    visit_near(p, [&](Index, double distance2) {
      limit = std::min(limit, distance2);
      return true;
    });
    return limit;
  }

  const std::vector<Vec3d>& points() const { return point_; }

  /// Calls visit(number, squared distance) for the points in the cells around a place until it is
  /// false.
  /// @returns false if it was
  template <class Visit>
  bool visit_near(Vec3d p, Visit&& visit) const {
    const std::int64_t x = cell(p.x), y = cell(p.y), z = cell(p.z);
    for (std::int64_t k = z - 1; k <= z + 1; ++k) {
      for (std::int64_t j = y - 1; j <= y + 1; ++j) {
        for (std::int64_t i = x - 1; i <= x + 1; ++i) {
          for (Index q = head_[bucket(i, j, k)]; q >= 0; q = next_[q]) {
            const Vec3d d = point_[q] - p;
            if (!visit(q, dot(d, d))) return false;
          }
        }
      }
    }
    return true;
  }

 private:
  std::int64_t cell(double v) const { return static_cast<std::int64_t>(std::floor(v * inverse_)); }
  std::size_t bucket(std::int64_t x, std::int64_t y, std::int64_t z) const {
    const auto u = [](std::int64_t v) { return static_cast<std::uint64_t>(v); };
    return mix_bits(u(x) * 73856093u ^ u(y) * 19349663u ^ u(z) * 83492791u) & mask_;
  }

  double inverse_;
  std::size_t mask_;
  std::vector<Index> head_, next_;
  std::vector<Vec3d> point_;
};

/// Candidate sample points in random order, some of which have been accepted.
class Darts {
 public:
  /// @param share fraction of the sample points that are candidates
  /// @param radius largest radius that `take` will be called with [m]
  /// @param before points accepted in advance
  /// @param expected approximate number of points that will be accepted
  Darts(const std::vector<SampleBlock>& blocks, double share, std::uint64_t seed, double radius,
        std::span<const Vec3d> before, std::size_t expected)
      : origin_(blocks.front().centre),
        before_(before.size()),
        taken_(radius, before.size() + expected) {
    std::uint64_t sample = 0;
    for (const SampleBlock& block : blocks) {
      for (std::size_t k = 0; k < block.offset.size(); ++k, ++sample) {
        const std::uint64_t bits = mix_bits(seed ^ mix_bits(sample));
        if (share < 0.5 && unit_fraction(bits) > share) continue;
        dart_.push_back({mix_bits(bits), block.position(k) - origin_, HUGE_VAL});
      }
    }
    parallel_sort(dart_, [](const Dart& a, const Dart& b) { return a.rank < b.rank; });
    for (const Vec3d& p : before) taken_.add(p - origin_);
  }

  /// Accepts candidates at least `radius` [m] from each accepted point, until there are `most`.
  void take(double radius, std::size_t most) {
    for (Dart& dart : dart_) {
      if (count() == most) return;
      if (dart.clearance2 < radius * radius) continue;
      dart.clearance2 = taken_.nearest2(dart.place, radius * radius);
      if (dart.clearance2 < radius * radius) continue;
      taken_.add(dart.place);
      dart.clearance2 = -1;
    }
  }

  std::size_t count() const { return taken_.points().size() - before_; }
  std::vector<Vec3d> points() const {
    std::vector<Vec3d> site(taken_.points().begin() + static_cast<std::ptrdiff_t>(before_),
                            taken_.points().end());
    for (Vec3d& p : site) p += origin_;
    return site;
  }

 private:
  struct Dart {
    std::uint64_t rank;
    Vec3d place;
    double clearance2;  ///< Squared distance to the nearest accepted point, when last computed.
  };
  Vec3d origin_;
  std::size_t before_;
  GrowingHash taken_;
  std::vector<Dart> dart_;
};

std::size_t samples_in(const std::vector<SampleBlock>& blocks) {
  std::size_t samples = 0;
  for (const SampleBlock& block : blocks) samples += block.offset.size();
  return samples;
}

}  // namespace

std::vector<Vec3d> throw_darts(const std::vector<SampleBlock>& blocks, Index n, double spacing,
                               std::uint64_t seed, std::span<const Vec3d> before) {
  // Twelve candidates a point suffice; a hundred more keep a small n from getting, by chance,
  // fewer candidates than points.
  const double share = (12.0 * n + 100) / static_cast<double>(samples_in(blocks));
  // Random packings of spheres jam at a diameter of 0.90 spacings.
  double radius = 0.9 * spacing;
  Stage stage("placing phyxels");
  Darts darts(blocks, share, seed, radius, before, static_cast<std::size_t>(n));
  while (darts.count() < static_cast<std::size_t>(n)) {
    darts.take(radius, static_cast<std::size_t>(n));
    stage.reach(static_cast<double>(darts.count()) / n);
    // Below this radius, the distance between samples no longer matters.
    radius = radius > 1e-6 * spacing ? 0.96 * radius : 0;
  }
  stage.finish();
  return darts.points();
}

namespace {

/// A sample point that may be accepted.
struct Candidate {
  std::uint64_t rank;  ///< Ranks are random, and no two are the same.
  Vec3d place;         ///< [m]
  double spacing;      ///< The one wanted there [m].
};

/// Points relative to `origin`.
std::vector<Vec3d> from_origin(std::span<const Vec3d> points, Vec3d origin) {
  return tabulated(points.size(), [&](std::size_t k) { return points[k] - origin; });
}

/// The number of the first sample point of each block, and of all at the end.
std::vector<std::size_t> first_samples(const std::vector<SampleBlock>& blocks) {
  std::vector<std::size_t> first{0};
  for (const SampleBlock& block : blocks) first.push_back(first.back() + block.offset.size());
  return first;
}

/// All sample points in their order, relative to `origin`.
std::vector<Vec3d> all_in_order(const std::vector<SampleBlock>& blocks, Vec3d origin) {
  const std::vector<std::size_t> first = first_samples(blocks);
  std::vector<Vec3d> all(first.back());
#pragma omp parallel for schedule(dynamic, 256)
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    for (std::size_t k = 0; k < blocks[b].offset.size(); ++k) {
      all[first[b] + k] = blocks[b].position(k) - origin;
    }
  }
  return all;
}

/// All sample points in random order, relative to `origin`.
Bulk<Candidate> all_in_random_order(const std::vector<SampleBlock>& blocks,
                                    const SpacingField& spacing, Vec3d origin, std::uint64_t seed) {
  const std::vector<std::size_t> first = first_samples(blocks);
  Bulk<Candidate> all(first.back());
#pragma omp parallel for schedule(dynamic, 256)
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    for (std::size_t k = 0; k < blocks[b].offset.size(); ++k) {
      const std::size_t sample = first[b] + k;
      const Vec3d place = blocks[b].position(k) - origin;
      all[sample] = {rank_of(sample, seed), place, spacing.at(place + origin)};
    }
  }
  parallel_sort(all, [](const Candidate& a, const Candidate& b) { return a.rank < b.rank; });
  return all;
}

/// Points to which others have to keep a distance: in one table, or in one for each octave of that
/// distance.
class Spaced {
 public:
  /// @param expected number of points
  Spaced(const SpacingField& spacing, double gap, std::size_t expected)
      : spacing_(spacing), gap_(gap) {
    if (spacing.is_uniform()) {
      tables_.emplace_back(gap * spacing.coarsest(), expected);
    } else {
      const int octaves = octave_of(gap * spacing.coarsest()) + 1;
      for (int k = 0; k < octaves; ++k) {
        // Twice as large as needed, since the asking point may belong to the octave above.
        tables_.emplace_back(gap * spacing.finest() * std::ldexp(4.0, k), expected / octaves);
      }
    }
    numbers_.resize(tables_.size());
  }

  /// @param spacing the one wanted at the place [m]
  void add(Vec3d place, double spacing) {
    const int octave = octave_of(gap_ * spacing);
    tables_[octave].add(place);
    numbers_[octave].push_back(static_cast<Index>(points_.size()));
    points_.push_back(place);
    wanted_.push_back(spacing);
  }
  /// Calls visit(number) for points nearer to a place than its gap until it is false.
  /// @param spacing the one wanted at the place [m]
  /// @returns false if it was
  template <class Visit>
  bool visit_near(Vec3d place, double spacing, Visit&& visit) const {
    const double gap = gap_ * spacing;
    const int octave = octave_of(gap);
    // The gap changes by less than a factor of two over its own length.
    for (int k = std::max(octave - 1, 0);
         k <= std::min(octave + 1, static_cast<int>(tables_.size()) - 1); ++k) {
      const bool all = tables_[k].visit_near(place, [&](Index q, double distance2) {
        return !(distance2 < gap * gap) || visit(numbers_[k][q]);
      });
      if (!all) return false;
    }
    return true;
  }
  /// True if a point is nearer to a place than its gap. @param spacing likewise
  bool is_near(Vec3d place, double spacing) const {
    return !visit_near(place, spacing, [](Index) { return false; });
  }
  const std::vector<Vec3d>& points() const { return points_; }
  /// The spacing wanted at each point [m].
  const std::vector<double>& wanted() const { return wanted_; }

 private:
  int octave_of(double gap) const {
    if (spacing_.is_uniform()) return 0;
    return std::max(0, std::ilogb(gap / (gap_ * spacing_.finest())));
  }

  const SpacingField& spacing_;
  double gap_;
  std::vector<GrowingHash> tables_;
  std::vector<std::vector<Index>> numbers_;  ///< Of the points in each table.
  std::vector<Vec3d> points_;
  std::vector<double> wanted_;
};

/// Tells which points are accepted if one goes through them in order and accepts each that has no
/// accepted one near. All threads decide at once: a point is refused when one before it that is
/// near has been accepted, and accepted when all of these have been refused.
/// Source: Blelloch, Fineman and Shun 2012 (Greedy sequential maximal independent set and matching
/// are parallel on average).
std::vector<char> accepted_in_order(const Spaced& spaced) {
  enum : char { open, accepted, refused };
  const std::vector<Vec3d>& place = spaced.points();
  std::vector<std::atomic<char>> state(place.size());
  std::vector<Index> left(place.size());
  std::iota(left.begin(), left.end(), 0);
  while (!left.empty()) {
#pragma omp parallel for schedule(dynamic, 64)
    for (std::size_t k = 0; k < left.size(); ++k) {
      const Index i = left[k];
      bool waits = false;
      const bool none = spaced.visit_near(place[i], spaced.wanted()[i], [&](Index j) {
        const char other = j < i ? state[j].load(std::memory_order_relaxed) : char{refused};
        waits = waits || other == open;
        return other != accepted;
      });
      if (!none) {
        state[i].store(refused, std::memory_order_relaxed);
      } else if (!waits) {
        state[i].store(accepted, std::memory_order_relaxed);
      }
    }
    std::erase_if(left, [&](Index i) { return state[i] != open; });
  }
  std::vector<char> is_accepted;
  for (const std::atomic<char>& s : state) is_accepted.push_back(s == accepted);
  return is_accepted;
}

}  // namespace

std::vector<Vec3d> fill_with_darts(const std::vector<SampleBlock>& blocks,
                                   const SpacingField& spacing, double gap, std::uint64_t seed,
                                   std::span<const Vec3d> before, const SurfaceOnDevice* device) {
  if (blocks.empty()) return {};
  const Vec3d origin = blocks.front().centre;
  if (device && spacing.is_uniform()) {
    auto site = device->darts(all_in_order(blocks, origin), from_origin(before, origin),
                              gap * spacing.coarsest(), seed);
    if (site) return from_origin(*site, -origin);
  }
  const Bulk<Candidate> all = all_in_random_order(blocks, spacing, origin, seed);
  Spaced taken(spacing, gap, before.size() + all.size() / 16);
  for (const Vec3d& p : before) taken.add(p - origin, spacing.at(p - origin + origin));
  // Most candidates have a point nearby that was accepted long before: these are sorted out first,
  // batch by batch. Batches grow, since ever fewer are left.
  std::vector<char> is_free;
  for (std::size_t begin = 0, end = 0; begin < all.size(); begin = end) {
    end = std::min(all.size(), begin + std::max<std::size_t>(1024, begin / 4));
    is_free.resize(end - begin);
#pragma omp parallel for schedule(dynamic, 256)
    for (std::size_t k = begin; k < end; ++k) {
      is_free[k - begin] = !taken.is_near(all[k].place, all[k].spacing);
    }
    Spaced rest(spacing, gap, static_cast<std::size_t>(std::ranges::count(is_free, 1)));
    for (std::size_t k = begin; k < end; ++k) {
      if (is_free[k - begin]) rest.add(all[k].place, all[k].spacing);
    }
    const std::vector<char> is_accepted = accepted_in_order(rest);
    for (std::size_t k = 0; k < is_accepted.size(); ++k) {
      if (is_accepted[k]) taken.add(rest.points()[k], rest.wanted()[k]);
    }
  }
  std::vector<Vec3d> site(taken.points().begin() + static_cast<std::ptrdiff_t>(before.size()),
                          taken.points().end());
  for (Vec3d& p : site) p += origin;
  return site;
}

}  // namespace phyxel
