/// What is done on many threads is what one thread would have done.
#include <gmock/gmock.h>
#include <omp.h>

#include <numeric>
#include <random>

#include "exact_sum.hpp"
#include "mesh/darts.hpp"
#include "mesh/random_bits.hpp"
#include "model/spatial_hash.hpp"
#include "parallel_sort.hpp"
#include "tabulated.hpp"

namespace phyxel {
namespace {

class Threads : public ::testing::TestWithParam<int> {
 protected:
  void SetUp() override { omp_set_num_threads(GetParam()); }
  void TearDown() override { omp_set_num_threads(before_); }
  const int before_ = omp_get_max_threads();
};

/// More than two pieces' worth, so that there is something to bring together.
constexpr int many = 400'000;

TEST_P(Threads, SortAsOne) {
  std::mt19937_64 engine(1);
  // All different, few values many times, one or two.
  for (const std::int64_t kinds : {std::int64_t{1} << 62, std::int64_t{7}, std::int64_t{1}}) {
    std::vector<std::int64_t> values(many);
    for (std::int64_t& v : values)
      v = std::uniform_int_distribution<std::int64_t>(0, kinds)(engine);
    std::vector<std::int64_t> expected = values;
    std::sort(expected.begin(), expected.end());
    parallel_sort(values);
    EXPECT_TRUE(values == expected) << kinds;
    parallel_sort(values);
    EXPECT_TRUE(values == expected) << kinds;
    parallel_sort(values, std::greater<>());
    std::reverse(expected.begin(), expected.end());
    EXPECT_TRUE(values == expected) << kinds;
  }
  for (const int few : {0, 1, 2, 70'000}) {
    std::vector<int> values(static_cast<std::size_t>(few));
    std::iota(values.rbegin(), values.rend(), 0);
    parallel_sort(values);
    EXPECT_TRUE(std::is_sorted(values.begin(), values.end())) << few;
  }
}

TEST_P(Threads, HashPointsAsOne) {
  std::mt19937_64 engine(2);
  std::vector<Vec3d> points(5000);
  std::uniform_real_distribution<double> anywhere(0, 1);
  for (Vec3d& p : points) p = {anywhere(engine), anywhere(engine), anywhere(engine)};
  const auto visited = [&] {
    const SpatialHash hash(points, 0.1);
    std::vector<Index> order;
    hash.visit_all([&](const SpatialHash::Entry& e) {
      EXPECT_EQ(e.position, points[e.index]);
      order.push_back(e.index);
    });
    for (int k = 0; k < 50; ++k) {
      hash.visit_near(points[k], 1, [&](const SpatialHash::Entry& e) { order.push_back(e.index); });
    }
    order.push_back(static_cast<Index>(1000 * hash.mean_occupancy()));
    return order;
  };
  const std::vector<Index> here = visited();
  omp_set_num_threads(1);
  EXPECT_EQ(here, visited());
  std::vector<Index> all(here.begin(), here.begin() + 5000);
  std::sort(all.begin(), all.end());
  for (Index i = 0; i < 5000; ++i) EXPECT_EQ(all[i], i);
}

/// Of clouds with rings of cells around them that hold no point, too.
TEST(SpatialHash, VisitsEachPointOfABallOnce) {
  std::mt19937_64 engine(4);
  std::uniform_real_distribution<double> anywhere(-0.3, 1.3), size(0, 0.5);
  std::vector<Vec3d> points(3000);
  for (Vec3d& p : points) p = {anywhere(engine), anywhere(engine), 0.1 * anywhere(engine)};
  const SpatialHash hash(points, 0.1);
  std::size_t visited = 0, inside = 0;
  for (int k = 0; k < 200; ++k) {
    const Vec3d place{anywhere(engine), anywhere(engine), anywhere(engine)};
    const double radius = size(engine);
    std::vector<int> times(points.size(), 0);
    hash.visit_ball(place, radius, [&](const SpatialHash::Entry& e) {
      ++times[e.index];
      ++visited;
    });
    for (std::size_t i = 0; i < points.size(); ++i) {
      const bool near = norm(points[i] - place) <= radius;
      EXPECT_LE(times[i], 1);
      if (near) {
        EXPECT_EQ(times[i], 1);
      }
      inside += near;
    }
  }
  EXPECT_LT(visited, 4 * inside);  // cells of a fifth of the largest ball
}

TEST_P(Threads, FillAndAddAsOne) {
  const auto squares = tabulated(1000, [](std::size_t k) { return k * k; });
  ASSERT_EQ(squares.size(), 1000U);
  for (std::size_t k = 0; k < 1000; ++k) EXPECT_EQ(squares[k], k * k);
  EXPECT_TRUE(tabulated(0, [](std::size_t k) { return k; }).empty());
  ExactSum one;
  const auto term = [](int k) { return std::ldexp(1.0 / (k + 1), k % 200 - 100); };
  for (int k = 3; k < 1000; ++k) one.add(term(k));
  const auto all = added_up<ExactSum>(3, 1000, [&](ExactSum& sum, int k) { sum.add(term(k)); });
  EXPECT_EQ(all.value(), one.value());
}

TEST_P(Threads, ChooseAsOne) {
  const auto wanted = [](Index i) { return i % 7 == 3 || i > 990; };
  std::vector<Index> expected;
  for (Index i = 5; i < 1000; ++i) {
    if (wanted(i)) expected.push_back(i);
  }
  EXPECT_EQ(chosen(5, 1000, wanted), expected);
  EXPECT_TRUE(chosen(5, 5, wanted).empty());
  EXPECT_EQ(chosen(3, 4, wanted), std::vector<Index>{3});
  EXPECT_TRUE(chosen(0, 1000, [](Index) { return false; }).empty());
}

TEST_P(Threads, SortWhatHasNoFirstValue) {
  Bulk<std::pair<std::uint64_t, Index>> values = in_bulk(many, [](std::size_t k) {
    return std::pair<std::uint64_t, Index>(k * 2654435761U % 65536, static_cast<Index>(k));
  });
  parallel_sort(values);
  EXPECT_TRUE(std::is_sorted(values.begin(), values.end()));
  std::vector<char> seen(many, 0);
  for (const auto& [key, k] : values) {
    EXPECT_EQ(key, static_cast<std::size_t>(k) * 2654435761U % 65536);
    seen[k] = 1;
  }
  EXPECT_EQ(std::count(seen.begin(), seen.end(), 1), many);
}

/// Sample points that keep a distance are those that one loop accepts, in the order of their random
/// ranks, where the distance is the same everywhere and where it is not.
TEST_P(Threads, ThrowDartsAsOne) {
  std::mt19937_64 engine(3);
  std::uniform_real_distribution<float> anywhere(-0.5, 0.5);
  std::vector<SampleBlock> blocks(20);
  std::vector<Vec3d> all;
  for (SampleBlock& block : blocks) {
    block.centre = {0.5, 0.5, 0.5};
    for (int k = 0; k < 300; ++k) {
      block.offset.push_back({anywhere(engine), anywhere(engine), anywhere(engine)});
      all.push_back(block.position(static_cast<std::size_t>(k)));
    }
  }
  constexpr std::uint64_t seed = 5;
  std::vector<std::pair<std::uint64_t, std::size_t>> order;
  for (std::size_t k = 0; k < all.size(); ++k) {
    order.emplace_back(mix_bits(mix_bits(seed ^ mix_bits(k))), k);
  }
  std::sort(order.begin(), order.end());
  const std::vector<Vec3d> before{{0.1, 0.2, 0.3}, {0.7, 0.7, 0.7}};
  const FinerRegion corner{{.centre = {0, 0, 0}, .radius = 0.3, .is_ball = true}, 4};
  for (const SpacingField& spacing :
       {SpacingField(0.1), SpacingField(nullptr, {corner}, 0.25, 4, 0.12)}) {
    std::vector<Vec3d> expected = before;
    for (const auto& dart : order) {
      const Vec3d place = all[dart.second];
      const double gap = 0.8 * spacing.at(place);
      if (std::ranges::all_of(expected, [&](Vec3d p) { return norm(p - place) >= gap; })) {
        expected.push_back(place);
      }
    }
    const std::vector<Vec3d> found = fill_with_darts(blocks, spacing, 0.8, seed, before);
    ASSERT_EQ(found.size(), expected.size() - before.size());
    for (std::size_t k = 0; k < found.size(); ++k) {
      EXPECT_LT(norm(found[k] - expected[before.size() + k]), 1e-15);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Of, Threads, ::testing::Values(1, 2, 3, 5));

}  // namespace
}  // namespace phyxel
