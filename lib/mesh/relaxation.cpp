#include "mesh/relaxation.hpp"

#include <omp.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "mesh/nearest_site.hpp"
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
    visit_near(p, [&](double distance2) {
      limit = std::min(limit, distance2);
      return true;
    });
    return limit;
  }
  /// True if the square of the distance to a point is below `limit` [m^2], for such limits.
  bool has_within(Vec3d p, double limit) const {
    return !visit_near(p, [&](double distance2) { return !(distance2 < limit); });
  }

  const std::vector<Vec3d>& points() const { return point_; }

 private:
  /// Calls visit(squared distance) for the points in the cells around a place until it is false.
  /// @returns false if it was
  template <class Visit>
  bool visit_near(Vec3d p, Visit&& visit) const {
    const std::int64_t x = cell(p.x), y = cell(p.y), z = cell(p.z);
    for (std::int64_t k = z - 1; k <= z + 1; ++k) {
      for (std::int64_t j = y - 1; j <= y + 1; ++j) {
        for (std::int64_t i = x - 1; i <= x + 1; ++i) {
          for (Index q = head_[bucket(i, j, k)]; q >= 0; q = next_[q]) {
            const Vec3d d = point_[q] - p;
            if (!visit(dot(d, d))) return false;
          }
        }
      }
    }
    return true;
  }
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
};

/// All sample points in random order, relative to `origin`.
Bulk<Candidate> all_in_random_order(const std::vector<SampleBlock>& blocks, Vec3d origin,
                                    std::uint64_t seed) {
  std::vector<std::size_t> first{0};
  for (const SampleBlock& block : blocks) first.push_back(first.back() + block.offset.size());
  Bulk<Candidate> all(first.back());
#pragma omp parallel for schedule(dynamic, 256)
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    for (std::size_t k = 0; k < blocks[b].offset.size(); ++k) {
      const std::size_t sample = first[b] + k;
      all[sample] = {mix_bits(mix_bits(seed ^ mix_bits(sample))), blocks[b].position(k) - origin};
    }
  }
  parallel_sort(all, [](const Candidate& a, const Candidate& b) { return a.rank < b.rank; });
  return all;
}

}  // namespace

namespace {

/// Points that have been accepted, with the distance that others have to keep from them: in one
/// table, or in one for each octave of that distance.
class Accepted {
 public:
  /// @param origin places are relative to it. @param expected number of points
  Accepted(const SpacingField& spacing, double gap, Vec3d origin, std::size_t expected)
      : spacing_(spacing), gap_(gap), origin_(origin) {
    if (spacing.is_uniform()) {
      tables_.emplace_back(gap * spacing.coarsest(), expected);
      return;
    }
    const int octaves = octave_of(gap * spacing.coarsest()) + 1;
    for (int k = 0; k < octaves; ++k) {
      // Twice as large as needed, since the asking point may belong to the octave above.
      tables_.emplace_back(gap * spacing.finest() * std::ldexp(4.0, k), expected / octaves);
    }
  }

  void add(Vec3d place) {
    tables_[spacing_.is_uniform() ? 0 : octave_of(gap_at(place))].add(place);
    added_.push_back(place);
  }
  /// True if a point that has been accepted is nearer to a place than it may be.
  bool is_near(Vec3d place) const {
    if (spacing_.is_uniform()) {
      const double gap = gap_ * spacing_.coarsest();
      return tables_.front().has_within(place, gap * gap);
    }
    const double gap = gap_at(place);
    const int octave = octave_of(gap);
    // The gap changes by less than a factor of two over its own length.
    for (int k = std::max(octave - 1, 0);
         k <= std::min(octave + 1, static_cast<int>(tables_.size()) - 1); ++k) {
      if (tables_[k].has_within(place, gap * gap)) return true;
    }
    return false;
  }
  const std::vector<Vec3d>& points() const { return added_; }

 private:
  double gap_at(Vec3d place) const { return gap_ * spacing_.at(place + origin_); }
  int octave_of(double gap) const {
    return std::max(0, std::ilogb(gap / (gap_ * spacing_.finest())));
  }

  const SpacingField& spacing_;
  double gap_;
  Vec3d origin_;
  std::vector<GrowingHash> tables_;
  std::vector<Vec3d> added_;
};

}  // namespace

std::vector<Vec3d> fill_with_darts(const std::vector<SampleBlock>& blocks,
                                   const SpacingField& spacing, double gap, std::uint64_t seed,
                                   std::span<const Vec3d> before) {
  if (blocks.empty()) return {};
  const Vec3d origin = blocks.front().centre;
  const Bulk<Candidate> all = all_in_random_order(blocks, origin, seed);
  Accepted taken(spacing, gap, origin, before.size() + all.size() / 16);
  for (const Vec3d& p : before) taken.add(p - origin);
  // Most candidates have a point nearby that was accepted long before: all threads sort these out,
  // batch by batch, and one goes through the rest in order. Batches grow, since ever fewer are
  // left.
  std::vector<char> is_free;
  for (std::size_t begin = 0, end = 0; begin < all.size(); begin = end) {
    end = std::min(all.size(), begin + std::max<std::size_t>(1024, begin / 4));
    is_free.resize(end - begin);
#pragma omp parallel for schedule(dynamic, 256)
    for (std::size_t k = begin; k < end; ++k) is_free[k - begin] = !taken.is_near(all[k].place);
    for (std::size_t k = begin; k < end; ++k) {
      if (is_free[k - begin] && !taken.is_near(all[k].place)) taken.add(all[k].place);
    }
  }
  std::vector<Vec3d> site(taken.points().begin() + static_cast<std::ptrdiff_t>(before.size()),
                          taken.points().end());
  for (Vec3d& p : site) p += origin;
  return site;
}

SampledVoronoi::SampledVoronoi(std::vector<SampleBlock> blocks) : blocks_(std::move(blocks)) {
  first_.push_back(0);
  for (const SampleBlock& block : blocks_) {
    first_.push_back(first_.back() + static_cast<Offset>(block.offset.size()));
  }
  owner_.resize(static_cast<std::size_t>(first_.back()));
}

void SampledVoronoi::assign(const std::vector<Vec3d>& site, double spacing) {
  const NearestSite nearest(site, spacing);
  const auto n_blocks = static_cast<std::ptrdiff_t>(blocks_.size());
#pragma omp parallel
  {
    NearestSite::Scratch scratch;
#pragma omp for schedule(dynamic, 64)
    for (std::ptrdiff_t b = 0; b < n_blocks; ++b) {
      nearest.find(blocks_[b], scratch);
      std::copy(scratch.owner.begin(), scratch.owner.end(), owner_.begin() + first_[b]);
    }
  }
}

void SampledVoronoi::add_up_cells(Vec3d origin, std::vector<Vec3d>& sum,
                                  std::vector<Offset>& count) const {
  // Each thread has a range of the sites and goes through all samples, so that the rounding of the
  // sums does not depend on the number of threads.
#pragma omp parallel
  {
    const auto thread = static_cast<std::size_t>(omp_get_thread_num()),
               threads = static_cast<std::size_t>(omp_get_num_threads());
    const auto first = static_cast<Index>(sum.size() * thread / threads),
               last = static_cast<Index>(sum.size() * (thread + 1) / threads);
    std::fill(sum.begin() + first, sum.begin() + last, Vec3d{});
    std::fill(count.begin() + first, count.begin() + last, 0);
    for (std::size_t b = 0; b < blocks_.size(); ++b) {
      const SampleBlock& block = blocks_[b];
      const Index* const owner = owner_.data() + first_[b];
      for (std::size_t k = 0; k < block.offset.size(); ++k) {
        const Index i = owner[k];
        if (i < first || i >= last) continue;
        sum[i] += block.position(k) - origin;
        ++count[i];
      }
    }
  }
}

void SampledVoronoi::relax(std::vector<Vec3d>& site, double spacing, int sweeps, std::size_t fixed,
                           Stage* stage) {
  const Vec3d origin = blocks_.front().centre;
  std::vector<Vec3d> sum(site.size());
  std::vector<Offset> count(site.size());
  for (int sweep = 0; sweep < sweeps; ++sweep) {
    assign(site, spacing);
    add_up_cells(origin, sum, count);
    bool homeless = false;
    for (std::size_t i = fixed; i < site.size(); ++i) {
      if (count[i] > 0) site[i] = origin + sum[i] / static_cast<double>(count[i]);
      homeless |= count[i] == 0;
    }
    if (homeless) settle_homeless(site, count, fixed);
    if (stage) stage->reach((sweep + 1.0) / sweeps);
  }
}

void SampledVoronoi::settle_homeless(std::vector<Vec3d>& site, const std::vector<Offset>& count,
                                     std::size_t fixed) const {
  std::vector<Index> order(site.size() - fixed);
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = static_cast<Index>(fixed + i);
  std::stable_sort(order.begin(), order.end(),
                   [&](Index a, Index b) { return count[a] > count[b]; });
  const auto homeless = static_cast<std::size_t>(
      std::count_if(order.begin(), order.end(), [&](Index i) { return count[i] == 0; }));
  // Each empty site moves to the sample point farthest from the site of one of the largest cells.
  std::vector<Index> guest(site.size(), -1);
  std::vector<double> farthest(site.size(), -1);
  std::vector<Vec3d> place(site.size());
  for (std::size_t k = 0; k < std::min(homeless, order.size() - homeless); ++k) {
    guest[order[k]] = order[order.size() - 1 - k];
  }
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    for (std::size_t k = 0; k < blocks_[b].offset.size(); ++k) {
      const Index host = owner_[first_[b] + k];
      if (guest[host] < 0) continue;
      const Vec3d d = blocks_[b].position(k) - site[host];
      if (dot(d, d) <= farthest[host]) continue;
      farthest[host] = dot(d, d);
      place[host] = blocks_[b].position(k);
    }
  }
  for (std::size_t host = 0; host < site.size(); ++host) {
    if (guest[host] >= 0 && farthest[host] >= 0) site[guest[host]] = place[host];
  }
}

void SampledVoronoi::snap(std::vector<Vec3d>& site, double spacing,
                          const std::vector<std::uint8_t>& which, std::size_t fixed) {
  assign(site, spacing);
  std::vector<double> nearest2(site.size(), HUGE_VAL);
  std::vector<Vec3d> place = site;
  std::vector<Offset> count(site.size(), 0);
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    for (std::size_t k = 0; k < blocks_[b].offset.size(); ++k) {
      const Index i = owner_[first_[b] + k];
      ++count[i];
      if (!which[i]) continue;
      const Vec3d d = blocks_[b].position(k) - site[i];
      if (dot(d, d) >= nearest2[i]) continue;
      nearest2[i] = dot(d, d);
      place[i] = blocks_[b].position(k);
    }
  }
  site.swap(place);
  const auto begin = count.begin() + static_cast<std::ptrdiff_t>(fixed);
  if (std::find(begin, count.end(), 0) != count.end()) settle_homeless(site, count, fixed);
}

}  // namespace phyxel
