/// The bound of how far phyxels of pairs have moved apart.
#include "solver/pair_motion.hpp"

#include <gtest/gtest.h>

#include <random>

#include "support/clouds.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;

/// A block whose displacements are set by hand.
struct MovedBlock {
  static constexpr int width = 8, record = 8;
  auto record_of() const {
    return [this](Index slot) { return &records[static_cast<std::size_t>(slot) * record]; };
  }
  MovedBlock()
      : model(model_of(one_body(), lattice(12, 6, 5, 0.1))),
        layout(model, {}, width),
        lists(model.neighbourhood.neighbours, layout),
        motion(model, layout, lists, {1}, 1),
        records(static_cast<std::size_t>(layout.slots()) * record) {
    for (Index i = 0; i < model.size(); ++i) {
      const Vec3d x = model.position[i];
      double* at = &records[static_cast<std::size_t>(layout.slot(i)) * record];
      at[0] = x.x, at[1] = x.y, at[2] = x.z;
    }
    motion.start(record_of());
  }
  double* displacement(Index i) {
    return &records[static_cast<std::size_t>(layout.slot(i)) * record + 4];
  }
  Vec3d place(Index i) const {
    const double* at = &records[static_cast<std::size_t>(layout.slot(i)) * record];
    return {at[0] + at[4], at[1] + at[5], at[2] + at[6]};
  }
  /// Moves each phyxel to to(i) and adds the step.
  template <class To>
  void step(To&& to) {
    std::vector<Vec3d> places;
    for (Index i = 0; i < model.size(); ++i) places.push_back(to(i));
    for (Index i = 0; i < model.size(); ++i) {
      const Vec3d u = places[static_cast<std::size_t>(i)] - model.position[i];
      double* at = displacement(i);
      at[0] = u.x, at[1] = u.y, at[2] = u.z;
    }
    motion.measure(record_of());
    motion.end_step();
  }
  /// Calls use(pack, length) for each pair.
  template <class Use>
  void for_each_pair(Use&& use) const {
    for (Index i = 0; i < model.size(); ++i) {
      for (const Index j : model.neighbourhood.neighbours.row(i)) {
        use(layout.slot(i) / width, norm(place(j) - place(i)));
      }
    }
  }
  std::vector<double> lengths() const {
    std::vector<double> all;
    for_each_pair([&](Index, double length) { all.push_back(length); });
    return all;
  }

  Model model;
  Layout layout;
  PackedLists lists;
  PairMotion<double> motion;
  std::vector<double> records;
};

/// Whatever phyxels do in 20 steps, in bodies that turn and swell, too.
TEST(PairMotion, BoundsTheChangeOfEachLength) {
  for (const unsigned seed : {1u, 2u, 3u}) {
    MovedBlock block;
    const std::vector<double> before = block.lengths();
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> any(-0.01, 0.01);
    const Vec3d turn{0.05, -0.02 * seed, 0.1};
    for (int s = 0; s < 20; ++s) {
      block.step([&](Index i) {
        const Vec3d x = block.place(i);
        return x + cross(turn, x) + 0.01 * x + Vec3d{any(random), any(random), any(random)};
      });
      std::size_t k = 0;
      block.for_each_pair([&](Index pack, double length) {
        EXPECT_LE(std::abs(length - before[k++]), block.motion.apart(pack));
      });
    }
  }
}

/// The bound is no more than what two neighbours do that alone move, apart by 0.2 m of 0.1.
TEST(PairMotion, IsSharpForTwoThatPart) {
  MovedBlock block;
  const Index i = 200, j = block.model.neighbourhood.neighbours.row(i).front();
  const Vec3d way =
      (0.1 / norm(block.place(j) - block.place(i))) * (block.place(j) - block.place(i));
  const double before = norm(block.place(j) - block.place(i));
  block.step([&](Index k) {
    return block.place(k) + (k == i ? -1.0 * way : k == j ? way : Vec3d{});
  });
  EXPECT_NEAR(norm(block.place(j) - block.place(i)) - before, 0.2, 1e-12);
  const double bound = block.motion.apart(block.layout.slot(i) / MovedBlock::width);
  EXPECT_GE(bound, 0.2);
  EXPECT_LE(bound, 0.2 * std::sqrt(3.0) + 1e-6);  // of a box around a diagonal way
}

/// A body that turns and flies has a bound of rounding only, from the second step on.
TEST(PairMotion, LeavesOutTheTurningOfABody) {
  MovedBlock block;
  const double angle = 0.01;
  const auto turned = [&](Vec3d x) {
    return Vec3d{std::cos(angle) * x.x - std::sin(angle) * x.y,
                 std::sin(angle) * x.x + std::cos(angle) * x.y, x.z + 0.3};
  };
  block.step([&](Index i) { return turned(block.place(i)); });
  const double first = block.motion.apart(10);
  EXPECT_GT(first, 1e-4);
  for (int s = 0; s < 50; ++s) block.step([&](Index i) { return turned(block.place(i)); });
  EXPECT_LT(block.motion.apart(10) - first, 1e-6 * first);
}

}  // namespace
}  // namespace phyxel
