/// Overlaps of boxes that move.
#include "model/near_boxes.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>

namespace phyxel {
namespace {

using Pairs = std::set<std::pair<std::size_t, std::size_t>>;

/// The overlaps that a function visits, each of which it may visit once.
template <class ForEach>
Pairs found_by(ForEach&& for_each) {
  Pairs found;
  for_each([&](std::size_t a, std::size_t b) {
    EXPECT_TRUE(found.insert({std::min(a, b), std::max(a, b)}).second) << a << ' ' << b;
  });
  return found;
}

Pairs overlaps_of(const std::vector<Box>& boxes) {
  Pairs found;
  for (std::size_t a = 0; a < boxes.size(); ++a) {
    for (std::size_t b = a + 1; b < boxes.size(); ++b) {
      if (overlap(boxes[a], boxes[b])) found.insert({a, b});
    }
  }
  return found;
}

TEST(NearBoxes, AreAllThatOverlapWhereverTheyHaveMoved) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> place(0, 8), size(0.1, 1.5), way(-1, 1);
  std::vector<Box> boxes{no_box};
  for (int b = 0; b < 120; ++b) {
    const Vec3d low{place(random), place(random), place(random)};
    boxes.push_back({low, low + Vec3d{size(random), size(random), size(random)}});
  }
  NearBoxes near;
  std::size_t most = 0;
  for (int look = 0; look < 60; ++look) {
    const Pairs found = found_by([&](auto&& visit) { near.for_each_overlap(boxes, visit); });
    EXPECT_EQ(found, overlaps_of(boxes)) << look;
    most = std::max(most, found.size());
    const double most_way = look % 10 == 9 ? 2 : 0.05;
    for (Box& box : boxes) {
      const Vec3d by = most_way * Vec3d{way(random), way(random), way(random)};
      box = {box.low + by, box.high + by};
    }
    if (look == 30) boxes[0] = {{}, {4, 4, 4}};  // it had no points before
    if (look == 40) boxes.pop_back();
  }
  EXPECT_GT(most, 50u);
}

}  // namespace
}  // namespace phyxel
