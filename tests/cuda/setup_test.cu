/// Neighbours, tiles and moments found on the GPU, compared with those of the CPU.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>

#include "model/assembly.hpp"
#include "model/neighbour_search.hpp"
#include "partition/partition.hpp"
#include "partition/share.hpp"
#include "phyxel/error.hpp"
#include "phyxel/law_table.hpp"
#include "phyxel/solver.hpp"
#include "setup/device_tiling.hpp"
#include "setup/primitives.cuh"
#include "setup/survey.hpp"
#include "solver/cuda_backend.hpp"
#include "support/backend.hpp"
#include "support/clouds.hpp"
#include "support/laws.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;

/// A scene and its clouds, for both set-ups.
struct Bodies {
  Scene scene;
  std::vector<Cloud> clouds;
};

Bodies jittered() { return {one_body(), {lattice(23, 17, 19, 0.1, 0.2)}}; }
/// A lattice, whose distances are equal up to rounding: ties must be decided alike.
Bodies regular() {
  Bodies b{one_body(), {lattice(16, 16, 16, 0.1)}};
  b.scene.bodies[0].neighbourhood.radius = 0.2;
  return b;
}
Bodies adaptive() {
  Bodies b{one_body(), {lattice(13, 12, 14, 0.1, 0.4)}};
  b.scene.bodies[0].neighbourhood.support = NeighbourhoodRule::Support::adaptive;
  return b;
}
/// Bodies inside one another with different spacings, which must not be neighbours.
Bodies overlapping() {
  Bodies b{one_body(), {lattice(9, 9, 9, 0.1, 0.2), lattice(14, 5, 6, 0.05, 0.1)}};
  b.scene.bodies.push_back(b.scene.bodies[0]);
  b.clouds.push_back(lattice(3, 3, 3, 0.1, 0.1));
  b.scene.bodies.push_back(b.scene.bodies[0]);
  b.scene.bodies[2].neighbourhood.support = NeighbourhoodRule::Support::adaptive;
  return b;
}
Bodies kernel_volumes() {
  Bodies b{one_body(), {lattice(12, 11, 10, 0.1, 0.3)}};
  b.scene.bodies[0].volume_rule = VolumeRule::kernel;
  return b;
}
/// A sheet, a thread, two at one place and a lone one, far apart.
Bodies degenerate() {
  Cloud cloud;
  for (int x = 0; x < 20; ++x) {
    for (int y = 0; y < 20; ++y) cloud.position.push_back({0.1 * x, 0.1 * y, 0});
  }
  for (int x = 0; x < 20; ++x) cloud.position.push_back({0.1 * x, 50, 0});
  cloud.position.push_back({100, 100, 100});
  cloud.position.push_back(cloud.position.front());
  cloud.volume.assign(cloud.position.size(), 1e-3);
  return {one_body(), {cloud}};
}
/// Two clusters so far apart that most cells are empty, for the special cases of the search.
Bodies clumps() {
  Cloud cloud = lattice(8, 8, 8, 0.1, 0.3);
  Cloud far = lattice(3, 2, 2, 0.1, 0.3);
  for (const Vec3d& x : far.position) cloud.position.push_back(x + Vec3d{4000, 1, 2});
  cloud.volume.assign(cloud.position.size(), 1e-3);
  return {one_body(), {cloud}};
}

struct Case {
  const char* name;
  Bodies (*make)();
};
void PrintTo(const Case& c, std::ostream* out) { *out << c.name; }

class Setup : public ::testing::TestWithParam<Case> {
 protected:
  const Bodies bodies_ = GetParam().make();
  const Model host_ = build_model(bodies_.scene, bodies_.clouds);
  const Model device_ = build_model(bodies_.scene, bodies_.clouds, cuda_surveyor());
};

TEST_P(Setup, SurveyEqualsTheCpus) {
  EXPECT_TRUE(host_.has_lists());
  EXPECT_FALSE(device_.has_lists());
  EXPECT_EQ(device_.neighbourhood.support, host_.neighbourhood.support);  // to the last bit
  EXPECT_EQ(device_.neighbourhood.symmetric, host_.neighbourhood.symmetric);
  for (std::size_t p = 0; p < host_.parts.size(); ++p) {
    EXPECT_EQ(device_.parts[p].lists.pairs, host_.parts[p].lists.pairs);
    EXPECT_EQ(device_.parts[p].lists.fewest, host_.parts[p].lists.fewest);
    EXPECT_EQ(device_.parts[p].lists.most, host_.parts[p].lists.most);
  }
  EXPECT_EQ(device_.degenerate.describe(), host_.degenerate.describe());
  EXPECT_EQ(device_.warnings, host_.warnings);
  EXPECT_EQ(model_digest(device_), model_digest(host_));
  // Both sum in the order of indices, without fusing: one rank's GPU finds what several ranks' CPUs
  // do.
  EXPECT_EQ(device_.mass, host_.mass);
  EXPECT_EQ(device_.volume, host_.volume);
}

void expect_same(const cuda::TileLists& found, const cuda::TileLists& expected) {
  ASSERT_EQ(found.halo_stride, expected.halo_stride);
  EXPECT_EQ(found.halo, expected.halo);
  EXPECT_EQ(found.entries, expected.entries);
  ASSERT_EQ(found.rows.size(), expected.rows.size());
  for (std::size_t k = 0; k < found.rows.size(); ++k) {
    ASSERT_EQ(found.rows[k].chunk, expected.rows[k].chunk);
    ASSERT_EQ(found.rows[k].length, expected.rows[k].length);
  }
}

/// Expects a tiling that a device has made to be the host's.
void expect_same(const cuda::DeviceTiling& on_device, const cuda::Tiling& expected) {
  const cuda::Tiling found = cuda::fetched_tiling(on_device);
  EXPECT_EQ(found.phyxel, expected.phyxel);
  EXPECT_EQ(found.place, expected.place);
  EXPECT_EQ(found.part, expected.part);
  EXPECT_EQ(found.own_tiles, expected.own_tiles);
  EXPECT_EQ(found.boundary_tiles, expected.boundary_tiles);
  expect_same(found.neighbours, expected.neighbours);
  ASSERT_EQ(found.inverse.rows.empty(), expected.inverse.rows.empty());
  expect_same(found.inverse, expected.inverse);
}

TEST_P(Setup, TilesEqualTheCpusToTheLastEntry) {
  const cuda::Tiling expected = cuda::make_tiling(host_);
  expect_same(cuda::make_device_tiling(device_), expected);
  expect_same(cuda::make_device_tiling(host_), expected);  // from the lists of the host
}

TEST_P(Setup, MomentsEqualTheCpusToTheLastBit) {
  const cuda::DeviceTiling found = cuda::make_device_tiling(device_),
                           expected = cuda::make_device_tiling(host_);
  const auto a = cuda::fetched(found.inverse_moment), b = cuda::fetched(expected.inverse_moment);
  const auto c = cuda::fetched(found.moment_offset), d = cuda::fetched(expected.moment_offset);
  for (std::size_t k = 0; k < b.size(); ++k) {
    const double found_here[] = {a[k].xx, a[k].xy, a[k].xz, a[k].yy, a[k].yz,
                                 a[k].zz, c[k].x,  c[k].y,  c[k].z},
                 wanted[] = {b[k].xx, b[k].xy, b[k].xz, b[k].yy, b[k].yz,
                             b[k].zz, d[k].x,  d[k].y,  d[k].z};
    for (int e = 0; e < 9; ++e) ASSERT_EQ(found_here[e], wanted[e]) << k;
  }
}

/// One of three shares, with the lists of the whole model and without lists.
ModelShare a_share(const Model& whole) {
  const Graph graph = phyxel_graph(whole);
  const Groups tiles = curve_groups(whole, cuda::tile_size);
  const std::vector<int> part_of =
      ungrouped(make_partition(grouped_graph(graph, tiles), 3, Partitioner::bisection), tiles);
  ModelShare made = share_of(whole, make_part_halos(graph, part_of, 3)[1], part_of);
  made.share.place = values_of(made.share, cuda::make_tiling(whole).place);
  made.model.share = std::make_shared<Share>(made.share);
  return made;
}

TEST_P(Setup, TilesOfSharesEqualTheCpusToTheLastEntry) {
  const ModelShare share = a_share(host_);
  const Model without = without_lists(share.model);
  const cuda::DeviceTiling found = cuda::make_device_tiling(without),
                           expected = cuda::make_device_tiling(share.model);
  const cuda::Tiling of_host = cuda::make_tiling(share.model);
  expect_same(found, of_host);
  expect_same(expected, of_host);
  const auto a = cuda::fetched(found.inverse_moment), b = cuda::fetched(expected.inverse_moment);
  const auto c = cuda::fetched(found.moment_offset), d = cuda::fetched(expected.moment_offset);
  for (Index place = 0; place < found.own_tiles * cuda::tile_size; ++place) {
    ASSERT_EQ(std::memcmp(&a[place], &b[place], sizeof a[place]), 0) << place;
    ASSERT_TRUE(c[place] == d[place]) << place;
  }
}

TEST_P(Setup, WhatIsAroundEqualsTheCpus) {
  const auto surveyor = cuda_share_surveyor(0);
  for (const Part& part : host_.parts) {
    const auto begin = static_cast<std::size_t>(part.begin),
               size = static_cast<std::size_t>(part.end - part.begin);
    const auto position = std::span(host_.position).subspan(begin, size);
    const std::vector<double> support(host_.neighbourhood.support.begin() + part.begin,
                                      host_.neighbourhood.support.begin() + part.end);
    std::vector<double> farthest(size), expected_farthest(size);
    const std::vector<double> spacing = surveyor->mean_spacing(position, 10, farthest.data());
    EXPECT_EQ(spacing, mean_spacing(position, 10, expected_farthest.data()));
    EXPECT_EQ(farthest, expected_farthest);

    std::vector<char> own(size);
    for (std::size_t i = 0; i < size; ++i) own[i] = i % 5 < 2;
    const bool one_sided = !host_.neighbourhood.symmetric;
    NeighbourhoodRule rule;
    if (one_sided) rule.support = NeighbourhoodRule::Support::adaptive;
    const Neighbourhood hood = neighbours_within(position, support, rule);
    const std::vector<double> sums = kernel_sums(position, hood, spacing, rule.pairwise());
    const Around around = surveyor->around(position, support, spacing, own, one_sided),
                 expected = around_by_lists(hood, 0, own);
    EXPECT_EQ(around.needed, expected.needed);
    EXPECT_EQ(around.length, expected.length);
    for (std::size_t i = 0; i < size; ++i) {
      if (own[i]) EXPECT_EQ(around.kernel_sum[i], sums[i]);
    }
  }
}

TEST_P(Setup, IsTheSameTwice) {
  const cuda::DeviceTiling one = cuda::make_device_tiling(device_),
                           two = cuda::make_device_tiling(device_);
  EXPECT_EQ(cuda::fetched(one.neighbours.entries), cuda::fetched(two.neighbours.entries));
  const auto a = cuda::fetched(one.inverse_moment), b = cuda::fetched(two.inverse_moment);
  for (std::size_t k = 0; k < a.size(); ++k) {
    ASSERT_TRUE(a[k].xx == b[k].xx && a[k].yz == b[k].yz) << k;  // to the last bit
  }
  const Model again = build_model(bodies_.scene, bodies_.clouds, cuda_surveyor());
  EXPECT_EQ(again.mass, device_.mass);
}

INSTANTIATE_TEST_SUITE_P(Bodies, Setup,
                         ::testing::Values(Case{"Jittered", jittered}, Case{"Regular", regular},
                                           Case{"Adaptive", adaptive},
                                           Case{"Overlapping", overlapping},
                                           Case{"KernelVolumes", kernel_volumes},
                                           Case{"Degenerate", degenerate}, Case{"Clumps", clumps}),
                         [](const auto& test) { return std::string(test.param.name); });

TEST(SetupOnGpu, TooManyNeighboursAreRefused) {
  Scene scene = one_body();
  scene.bodies[0].neighbourhood.radius = 1.2;
  const std::vector<Cloud> clouds{lattice(18, 18, 18, 0.1)};
  const Model model = build_model(scene, clouds, cuda_surveyor());
  try {
    cuda::make_device_tiling(model);
    FAIL() << "a halo larger than 16-bit slots was accepted";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("allowed"), std::string::npos);
  }
}

TEST(SetupOnGpu, ListsLeftThereAreMissedOnTheCpu) {
  const Bodies b = jittered();
  const Model model = build_model(b.scene, b.clouds, cuda_surveyor());
  EXPECT_THROW(make_cpu_backend(model, Precision::double_), InputError);
}

/// The step limit of the GPU, by a linear law in working precision, equals that of the CPU, by
/// differences of forces in double.
TEST(SetupOnGpu, StepLimitEqualsTheCpus) {
  for (const bool volume : {false, true}) {
    for (const LawEntry& law : law_table()) {
      Bodies b = overlapping();
      b.scene.bodies[1].material = rubber_of(law.name);
      if (volume) b.scene.bodies[1].material.volume_stiffness = 3e6;
      if (volume) b.scene.bodies[1].material.hourglass = 5;  // so that it sets the limit
      const Model model = build_model(b.scene, b.clouds);
      const StepLimit expected = step_limit(model);
      const std::pair<Precision, double> precisions[] = {
          {Precision::single, 1e-5}, {Precision::mixed, 1e-5}, {Precision::double_, 1e-7}};
      for (const auto& [precision, tolerance] : precisions) {  // some 100 roundings; differences
        const auto backend = make_cuda_backend(model, precision);
        const StepLimit found = step_limit(model, *backend);
        EXPECT_EQ(found.iterations, expected.iterations);
        EXPECT_NEAR(found.omega_max, expected.omega_max, tolerance * expected.omega_max);
        EXPECT_EQ(found.sound_step, expected.sound_step);
      }
    }
  }
}

/// 100 steps from either set-up give the same positions, up to rounding of the moments.
TEST(SetupOnGpu, StepsFromEitherSetUpAgree) {
  Bodies b = jittered();
  b.scene.gravity = {0, 0, -9.81};
  b.scene.bodies[0].spin = {1, 2, 3};
  std::vector<State> ends;
  for (const bool on_device : {false, true}) {
    const Model model = on_device ? build_model(b.scene, b.clouds, cuda_surveyor())
                                  : build_model(b.scene, b.clouds);
    const auto backend = make_cuda_backend(model, Precision::double_);
    const double dt = 0.5 * step_limit(model, *backend).largest_step;
    Solver solver(*backend, initial_state(model, b.scene, dt));
    solver.step(100);
    ends.push_back(solver.state());
  }
  double largest = 0, apart = 0;
  for (std::size_t i = 0; i < ends[0].displacement.size(); ++i) {
    largest = std::max(largest, norm(ends[0].displacement[i]));
    apart = std::max(apart, norm(ends[0].displacement[i] - ends[1].displacement[i]));
  }
  EXPECT_GT(largest, 0);
  EXPECT_LT(apart, 1e-10 * largest);  // limits agree to 1e-13, a spin's path magnifies them little
}

}  // namespace
}  // namespace phyxel
