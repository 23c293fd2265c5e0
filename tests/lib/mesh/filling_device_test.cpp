/// Filling of surfaces with the help of a device: the same clouds, to the last bit.
#include "mesh/filling_device.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>
#include <numeric>

#include "mesh/filling_rules.hpp"
#include "mesh/nearest_site.hpp"
#include "phyxel/mesh.hpp"
#include "support/surfaces.hpp"

#if defined(PHYXEL_TEST_CUDA)
#include "device.hpp"
#include "setup/filling.hpp"
#endif

namespace phyxel {
namespace {

/// What a device was asked for, and whether it declines.
struct Calls {
  int darts = 0, even_out = 0, nodes = 0, repel = 0, gaps = 0, samples = 0;
  bool declines = false;
};

#if !defined(PHYXEL_TEST_CUDA)

/// A device's part, done region by region and voxel by voxel, as a GPU does it.
class RegionByRegion : public SurfaceOnDevice {
 public:
  RegionByRegion(const WindingNumber& surface, Calls& calls) : surface_(surface), calls_(calls) {}

  std::optional<std::vector<Vec3d>> darts(std::span<const Vec3d> candidates,
                                          std::span<const Vec3d> before, double gap,
                                          std::uint64_t seed) const override {
    ++calls_.darts;
    if (calls_.declines) return std::nullopt;
    std::vector<std::size_t> order(candidates.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::ranges::sort(order, {}, [&](std::size_t k) { return rank_of(k, seed); });
    std::vector<Vec3d> accepted;
    for (const std::size_t k : order) {
      const auto is_near = [&](Vec3d other) {
        const Vec3d d = candidates[k] - other;
        return dot(d, d) < gap * gap;
      };
      if (std::ranges::none_of(before, is_near) && std::ranges::none_of(accepted, is_near)) {
        accepted.push_back(candidates[k]);
      }
    }
    return accepted;
  }

  bool even_out(std::span<Vec3d> point, const PointsOnFaces& faces) const override {
    ++calls_.even_out;
    if (calls_.declines) return false;
    const Surface& surface = faces.surface;
    const auto corners_of = [&](std::size_t t) {
      const auto [a, b, c] = surface.triangle[t];
      return Corners{surface.position[a], surface.position[b], surface.position[c]};
    };
    std::vector<Vec3d> place;
    for (const PointOn& sample : faces.samples) place.push_back(sample.point);
    const SpatialHash samples(place, face_sample_cell * faces.spacing);
    const auto nearest_piece = [&](Vec3d at) {
      return faces.samples[samples.nearest(at).index].piece;
    };
    std::vector<std::size_t> piece;
    for (const Vec3d p : point) piece.push_back(nearest_piece(p));
    for (int sweep = 0; sweep < faces.sweeps; ++sweep) {
      const std::vector<Vec3d> before(point.begin(), point.end());
      const SpatialHash table(before, 0.5 * repulsion_reach * faces.spacing);
      for (std::size_t k = faces.fixed; k < point.size(); ++k) {
        const Vec3d step = step_of_repulsion(table, before[k], static_cast<Index>(k), faces.spacing,
                                             [](Index) { return 1.0; });
        point[k] = moved_on_face(before[k], step, piece[k], corners_of, nearest_piece);
      }
    }
    return true;
  }

  std::optional<LatticeNodes> nodes(const InsideSampler::Regions& regions,
                                    const SurfaceMarks& marks) const override {
    ++calls_.nodes;
    if (calls_.declines) return std::nullopt;
    const SpatialHash deep(marks.sites, depth_cell * marks.spacing),
        site(marks.sites, site_cell * marks.spacing),
        sample(marks.samples, sample_cell * marks.spacing);
    LatticeNodes found;
    for_each_sample(regions, [&](const SampleRegion&, Vec3d centre, Vec3<float> offset) {
      const Vec3d place = at_offset(centre, offset);
      const bool is_far = is_deep(deep, centre, radius_of_nodes(marks.spacing),
                                  largest_clearance * marks.spacing, marks.farthest);
      found.position.push_back(place);
      found.clearance.push_back(static_cast<float>(
          is_far ? largest_clearance : clearance_at(site, sample, place, marks.spacing)));
    });
    return found;
  }

  bool repel(std::span<Vec3d> point, const RepelledPoints& which) const override {
    ++calls_.repel;
    if (calls_.declines) return false;
    const std::size_t count = point.size() - which.fixed;
    std::vector<ClearBall> balls(count);
    for (int sweep = 0; sweep < which.sweeps; ++sweep) {
      const SpatialHash table(point, 0.5 * repulsion_reach * which.spacing);
      std::vector<Vec3d> moved(point.begin() + static_cast<std::ptrdiff_t>(which.fixed),
                               point.end());
      for (std::size_t k = 0; k < count; ++k) {
        if (!which.moves[k]) continue;
        const Vec3d before = moved[k];
        moved[k] = repelled_inside(
            which.on_surface, before,
            [&](auto&& strength) {
              return step_of_repulsion(table, before, static_cast<Index>(which.fixed + k),
                                       which.spacing, strength);
            },
            [&](Vec3d after) {
              return stays_inside(surface_.view(), before, after, which.clear, balls[k],
                                  [&](Vec3d place) { return surface_(place) > 0.5; });
            });
      }
      std::copy(moved.begin(), moved.end(),
                point.begin() + static_cast<std::ptrdiff_t>(which.fixed));
    }
    return true;
  }

  std::optional<std::vector<double>> gaps(std::span<const Vec3d> point, double spacing,
                                          std::span<const char> wanted) const override {
    ++calls_.gaps;
    if (calls_.declines) return std::nullopt;
    const SpatialHash table(point, spacing);
    std::vector<double> gap(point.size(), 0);
    for (std::size_t k = 0; k < point.size(); ++k) {
      if (!wanted[k]) continue;
      gap[k] = std::sqrt(table.nearest(point[k], HUGE_VAL, static_cast<Index>(k)).distance2);
    }
    return gap;
  }

  std::optional<std::vector<std::uint32_t>> samples_of_sites(const InsideSampler::Regions& regions,
                                                             std::span<const Vec3d> site,
                                                             double spacing) const override {
    ++calls_.samples;
    if (calls_.declines) return std::nullopt;
    const std::vector<Vec3d> sites(site.begin(), site.end());
    const NearestSite nearest(sites, spacing);
    NearestSite::Scratch scratch;
    std::vector<std::uint32_t> count(site.size(), 0);
    SampleBlock block;
    const auto finish = [&] {
      if (block.offset.empty()) return;
      nearest.find(block, scratch);
      for (const Index owner : scratch.owner) ++count[owner];
      block.offset.clear();
    };
    for_each_sample(regions, [&](const SampleRegion& region, Vec3d centre, Vec3<float> offset) {
      if (!(centre == block.centre)) finish();
      block.centre = centre;
      block.offset.push_back(offset);
      block.region = regions.grid.middle(region.corner, region_side);
      block.region_radius = radius_of_samples(regions.grid.voxel, region_side);
    });
    finish();
    return count;
  }

 private:
  /// Calls visit(region, centre, offset) for each sample point inside, in the order of the host.
  template <class Visit>
  void for_each_sample(const InsideSampler::Regions& regions, Visit&& visit) const {
    for (const SampleRegion& region : regions.list) {
      for (int b = 0; b < 8; ++b) {
        if (!(region.blocks >> b & 1)) continue;
        const Vec3d centre = regions.grid.middle(region.block(b), block_side);
        for (int m = 0; m < block_voxels; ++m) {
          const Voxel voxel = voxel_of(region.block(b), m);
          const Vec3<float> offset = regions.grid.offset(voxel, regions.grid.within(voxel), centre);
          const bool inside = region.inside || surface_(at_offset(centre, offset)) > 0.5;
          if (inside) visit(region, centre, offset);
        }
      }
    }
  }

  const WindingNumber& surface_;
  Calls& calls_;
};

class DoubleOfDevice : public FillingDevice {
 public:
  explicit DoubleOfDevice(Calls& calls) : calls_(calls) {}
  std::unique_ptr<SurfaceOnDevice> take(const WindingNumber& surface, Index) const override {
    return std::make_unique<RegionByRegion>(surface, calls_);
  }

 private:
  Calls& calls_;
};

std::shared_ptr<const FillingDevice> device_of(Calls& calls) {
  return std::make_shared<const DoubleOfDevice>(calls);
}

#else

std::shared_ptr<const FillingDevice> device_of(Calls&) { return cuda_filling_device(0, 1); }

#endif

class FillingByDevice : public ::testing::Test {
 protected:
  void SetUp() override {
#if defined(PHYXEL_TEST_CUDA)
    if (cuda_devices().empty()) GTEST_SKIP() << "no CUDA device";
#endif
  }

  /// Expects that a device changes nothing but who does the work.
  void expect_same(const Surface& surface, const SampleRequest& request) {
    SampleReport own_report, report;
    const Cloud own = sample_surface(surface, request, &own_report);
    const FillingScope scope(device_of(calls_));
    const Cloud cloud = sample_surface(surface, request, &report);
    ASSERT_EQ(cloud.position.size(), own.position.size());
    EXPECT_EQ(std::memcmp(cloud.position.data(), own.position.data(),
                          own.position.size() * sizeof(Vec3d)),
              0);
    EXPECT_EQ(report.smallest_gap, own_report.smallest_gap);
    EXPECT_EQ(report.spacing, own_report.spacing);
    EXPECT_EQ(report.warnings, own_report.warnings);
    EXPECT_EQ(cloud.volume, own.volume);
  }

  Calls calls_;
};

TEST_F(FillingByDevice, MakesTheSameClouds) {
  expect_same(test::unit_cube(), {.phyxels = 1000});
  expect_same(test::sphere({0.3, -2, 5}, 0.7, 2), {.phyxels = 2000});
  expect_same(test::together(test::sphere({0, 0, 0}, 1, 2),
                             test::turned(test::sphere({0.1, 0, 0}, 0.6, 2))),
              {.phyxels = 3000});
#if !defined(PHYXEL_TEST_CUDA)
  EXPECT_EQ(calls_.darts, 3);
  EXPECT_EQ(calls_.even_out, 3);
  EXPECT_GE(calls_.nodes, 3);  // some surfaces take several lattices
  EXPECT_EQ(calls_.repel, 3);
  EXPECT_EQ(calls_.gaps, 3);
  EXPECT_EQ(calls_.samples, 3);
#endif
}

TEST_F(FillingByDevice, MakesTheSameCloudsOfThinBodiesAndFewPhyxels) {
  expect_same(test::box({0, 0, 0}, {4, 2, 0.02}), {.phyxels = 1000});
  expect_same(test::box({0, 0, 0}, {10, 0.05, 0.05}), {.phyxels = 300});
  expect_same(test::together(test::unit_cube(), test::box({2, 0, 0}, {4, 2, 0.02})),
              {.phyxels = 2000});
  expect_same(test::unit_cube(), {.phyxels = 60});
  expect_same(test::unit_cube(), {.phyxels = 700, .seed = 5, .relaxations = 0});
}

TEST_F(FillingByDevice, MakesTheSameCloudsWithPhyxelsOnCuts) {
  SpaceRegion end;
  end.low = {-1, -1, -1};
  end.high = {0.32, 2, 2};
  expect_same(test::unit_cube(), {.phyxels = 1500, .cuts = {end}});
}

#if defined(PHYXEL_TEST_CUDA)

/// Large enough for several stretches of regions, and of nodes that no thread block holds alone.
TEST_F(FillingByDevice, MakesTheSameCloudsOfManyPhyxels) {
  expect_same(test::sphere({0, 0, 0}, 1, 5), {.phyxels = 1'500'000});
  expect_same(test::box({0, 0, 0}, {8, 1, 1}), {.phyxels = 300'000});
}

#else

TEST_F(FillingByDevice, IsDoneByTheHostIfTheDeviceDeclines) {
  calls_.declines = true;
  expect_same(test::sphere({0, 0, 0}, 1, 2), {.phyxels = 1000});
  EXPECT_EQ(calls_.darts, 1);
  EXPECT_EQ(calls_.even_out, 1);
  EXPECT_GE(calls_.nodes, 1);
  EXPECT_EQ(calls_.repel, 1);
  EXPECT_EQ(calls_.gaps, 1);
  EXPECT_EQ(calls_.samples, 1);
}

/// A disc whose flat faces are fans of thin triangles around a point.
Surface fan_disc(int sectors) {
  Surface disc;
  disc.position = {{0, 0, 0}, {0, 0, 0.3}};
  for (int k = 0; k < sectors; ++k) {
    const double angle = 2 * std::numbers::pi * k / sectors;
    const Index low = 2 + 2 * k, high = low + 1, next = 2 + 2 * ((k + 1) % sectors);
    disc.position.push_back({std::cos(angle), std::sin(angle), 0});
    disc.position.push_back({std::cos(angle), std::sin(angle), 0.3});
    disc.triangle.insert(
        disc.triangle.end(),
        {{0, next, low}, {1, high, next + 1}, {low, next, next + 1}, {low, next + 1, high}});
  }
  test::add_normals(disc);
  return disc;
}

/// A winding number beside such triangles visits most of them: the host walks past few.
TEST_F(FillingByDevice, LeavesWindingNumbersOfThinTrianglesToTheHost) {
  expect_same(fan_disc(1000), {.phyxels = 2000});
  EXPECT_EQ(calls_.nodes, 0);
  EXPECT_EQ(calls_.samples, 0);
  EXPECT_EQ(calls_.darts, 1);
  EXPECT_EQ(calls_.repel, 1);
}

TEST_F(FillingByDevice, EndsWithTheScope) {
  { const FillingScope scope(device_of(calls_)); }
  sample_surface(test::unit_cube(), {.phyxels = 1000});
  EXPECT_EQ(calls_.nodes, 0);
}

TEST(Regions, HoldTheBlocksOfASweep) {
  const Surface surface = test::sphere({0.1, 0.2, 0.3}, 1, 3);
  const InsideSampler sampler(surface, true);
  for (const bool at_random : {true, false}) {
    const SampleSweep sweep{
        .voxel = 0.01, .seed = 3, .at_random = at_random};  // tasks have regions
    std::vector<SampleBlock> blocks;
    sampler.collect(sweep, blocks);
    const InsideSampler::Regions regions = sampler.regions(sweep);
    // Block by block, in the same order; regions may have blocks without points inside.
    std::size_t at = 0;
    for (const SampleRegion& region : regions.list) {
      for (int b = 0; b < 8; ++b) {
        if (!(region.blocks >> b & 1) || at == blocks.size()) continue;
        const SampleBlock& block = blocks[at];
        if (!(regions.grid.middle(region.block(b), block_side) == block.centre)) {
          EXPECT_FALSE(region.inside);
          continue;
        }
        EXPECT_EQ(regions.grid.middle(region.corner, region_side), block.region);
        ++at;
        if (!region.inside) continue;
        ASSERT_EQ(block.offset.size(), 64u);
        for (int m = 0; m < block_voxels; ++m) {
          const Voxel voxel = voxel_of(region.block(b), m);
          EXPECT_EQ(regions.grid.offset(voxel, regions.grid.within(voxel), block.centre),
                    block.offset[static_cast<std::size_t>(m)]);
        }
      }
    }
    EXPECT_EQ(at, blocks.size());
    EXPECT_GT(at, 500u);
  }
}

#endif

}  // namespace
}  // namespace phyxel
