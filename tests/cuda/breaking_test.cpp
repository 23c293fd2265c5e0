/// What the kernels of bodies that break do, thread by thread on the host, against the CPU.
#include "solver/breaking.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "phyxel/diagnostics.hpp"
#include "solver/broken_pairs.hpp"
#include "solver/hourglass.hpp"
#include "support/torn_bar.hpp"

namespace phyxel::cuda {
namespace {

using namespace phyxel::testing;

/// The arrays of a device on the host, in double.
struct HostTiles {
  struct Point {
    Vec3d x, u;
  };

  explicit HostTiles(const Model& of)
      : model(of),
        tiling(make_tiling(of)),
        whole(tiling.neighbours.entries),
        second_whole(tiling.inverse.entries),
        points(tiling.phyxel.size()),
        before(3 * points.size()),
        volume(points.size()),
        growth(points.size(), unbreakable_growth),
        carried(points.size(), 1),
        moments(7 * points.size()),
        forces(4 * points.size()),
        lost(points.size()),
        lost_in_tile(tiling.part.size()) {
    const std::vector<char> breaks = breaking_bodies(model);
    for (const Part& part : model.parts) {
      const ChosenLaw law = chosen_law(part.material);
      BreakingPart constants{};
      std::copy(law.constants.begin(), law.constants.end(), constants.law);
      constants.law_index = law.index;
      constants.hourglass = hourglass_stiffness(model, part);
      const double h = model.neighbourhood.support[part.begin],
                   speed = pressure_wave_speed(part.material);
      constants.inverse_h_squared = 1 / (h * h);
      constants.modulus = part.material.density * speed * speed;
      constants.breaks = breaks[static_cast<std::size_t>(part.body)];
      parts.push_back(constants);
      for (Index i = part.begin; i < part.end; ++i) {
        const auto at = static_cast<std::size_t>(tiling.place[i]);
        points[at].x = model.position[i] - part.origin;
        volume[at] = model.volume[i];
        growth[at] = model.fracture.growth[i];
      }
    }
  }

  BreakingView<double> view() {
    BreakingView<double> v;
    const auto lists = [](TileLists& own, const std::vector<std::uint16_t>& all) {
      return BreakingLists{own.halo.data(), own.halo_stride, own.rows.data(), own.entries.data(),
                           all.data()};
    };
    v.first = lists(tiling.neighbours, whole);
    if (!tiling.inverse.rows.empty()) v.second = lists(tiling.inverse, second_whole);
    v.parts = parts.data();
    v.part_of_tile = tiling.part.data();
    v.places = points.size();
    v.volume = volume.data();
    v.growth = growth.data();
    v.before = before.data();
    v.carried = carried.data();
    v.lost = lost.data();
    v.lost_in_tile = lost_in_tile.data();
    v.moment_constants = moments.data();
    v.force_constants = forces.data();
    return v;
  }
  auto point_at() const {
    return [this](Index place) { return points[static_cast<std::size_t>(place)]; };
  }
  /// Moves phyxels from where they were to where a state has them.
  void move_to(const std::vector<Vec3d>& displacement) {
    for (Index i = 0; i < model.size(); ++i) {
      const auto at = static_cast<std::size_t>(tiling.place[i]);
      const Vec3d u = points[at].u;
      before[at] = u.x;
      before[points.size() + at] = u.y;
      before[2 * points.size() + at] = u.z;
      points[at].u = displacement[i];
    }
  }
  /// Does what the threads of a launch do, all of which look.
  void break_pairs(bool in_step = true) {
    const BreakingView<double> v = view();
    for (Index place = 0; place < static_cast<Index>(points.size()); ++place) {
      if (tiling.phyxel[place] < 0) continue;
      const Look<double> look = look_at(v, point_at(), place);
      least = std::min(least, slack_of(look.squared_slack));
      if (!look.breaks) continue;
      break_from(v, point_at(), in_step, place, [&](double energy) { taken.add(energy); });
    }
  }
  /// The broken pairs in the lists of a pass.
  BrokenPairs broken(const BreakingLists& lists) const {
    BrokenPairs all(model);
    for (Index place = 0; place < static_cast<Index>(points.size()); ++place) {
      std::vector<Index> own;
      if (tiling.phyxel[place] < 0) continue;
      lists.for_each_broken(place, [&](Index j) { own.push_back(tiling.phyxel[j]); });
      if (own.empty()) continue;
      all.add(tiling.phyxel[place], own);
      all.set_carried(tiling.phyxel[place], carried[static_cast<std::size_t>(place)]);
    }
    return all;
  }

  const Model& model;
  Tiling tiling;
  std::vector<std::uint16_t> whole, second_whole;
  std::vector<BreakingPart> parts;
  std::vector<Point> points;
  std::vector<double> before, volume, growth, carried, moments, forces;
  std::vector<Index> lost;
  std::vector<char> lost_in_tile;
  ExactSum taken;
  double least = std::numeric_limits<double>::infinity();  // slack of all looks [m]
};

/// Largest difference of two states' carried shares.
double worn_apart(const std::vector<WornPhyxel>& a, const std::vector<WornPhyxel>& b) {
  if (a.size() != b.size()) return 1;
  double most = 0;
  for (std::size_t k = 0; k < a.size(); ++k) {
    if (a[k].phyxel != b[k].phyxel) return 1;
    most = std::max(most, std::abs(a[k].carried - b[k].carried));
  }
  return most;
}

/// The same displacements break the same pairs, take the same energy, and leave the same constants
/// as on the CPU, but for the order of sums: of some 26 terms, through an inverse matrix whose
/// condition is up to 10⁶ (`moment_cutoff`) in dust.
TEST(Breaking, BreaksAsTheCpuDoes) {
  TornBar bar;
  HostTiles tiles(bar.model);
  ASSERT_GT(tiles.tiling.tiles(), 2);
  for (int s = 0; s < 400; ++s) {
    bar.solver->step(1);
    const State state = bar.solver->state();
    tiles.move_to(state.displacement);
    tiles.break_pairs();
    ASSERT_EQ(tiles.broken(tiles.view().first).pairs(), state.broken) << s;
  }
  const State state = bar.solver->state();
  ASSERT_GT(state.broken.size(), 100u);
  EXPECT_FALSE(state.worn.empty());
  EXPECT_LT(worn_apart(tiles.broken(tiles.view().first).worn(), state.worn), 1e-6);
  const double taken = bar.now().fracture_energy;
  EXPECT_GT(taken, 0);
  EXPECT_NEAR(tiles.taken.value(), taken, 1e-9 * taken);
  EXPECT_GE(tiles.least, 0);
  BrokenPairs broken(bar.model);
  broken.set(state.broken, state.worn);
  for (const Index i : broken.phyxels()) {
    const auto place = static_cast<std::size_t>(tiles.tiling.place[i]);
    const std::size_t n = tiles.points.size();
    const PointBreakage expected = broken.of_point(i);
    const Sym3d& a = expected.inverse_moment;
    const double size = a.xx + a.yy + a.zz;
    EXPECT_NEAR(tiles.moments[place], a.xx, 1e-6 * size);
    EXPECT_NEAR(tiles.moments[4 * n + place], a.yz, 1e-6 * size);
    EXPECT_NEAR(tiles.moments[6 * n + place], expected.carried * bar.model.volume[i],
                1e-6 * bar.model.volume[i]);
    EXPECT_NEAR(tiles.forces[n + place], expected.moment_offset.y,
                1e-12 * bar.model.neighbourhood.support[i]);
    EXPECT_EQ(tiles.lost[place], static_cast<Index>(broken.of(i).size()));
    EXPECT_TRUE(tiles.lost_in_tile[place / tile_size]);
  }
}

/// A state that is put in leaves the constants of the run that it comes from, to the last bit.
TEST(Breaking, StatesThatArePutInHaveTheSameConstants) {
  TornBar bar;
  HostTiles run(bar.model);
  for (int s = 0; s < 300; ++s) {
    bar.solver->step(1);
    run.move_to(bar.solver->state().displacement);
    run.break_pairs();
  }
  const BrokenPairs broken = run.broken(run.view().first);
  ASSERT_FALSE(broken.empty());
  HostTiles put(bar.model);
  const BreakingView<double> v = put.view();
  for (const Index i : broken.phyxels()) {
    const Index place = put.tiling.place[i];
    for (const Index j : broken.of(i)) {
      EXPECT_EQ(v.first.cut(place, put.tiling.place[j]), 1);
    }
    put.carried[place] = run.carried[place];
    remake_constants(v, put.point_at(), place);
  }
  EXPECT_EQ(put.tiling.neighbours.entries, run.tiling.neighbours.entries);
  EXPECT_EQ(put.moments, run.moments);
  EXPECT_EQ(put.forces, run.forces);
  EXPECT_EQ(put.lost_in_tile, run.lost_in_tile);
}

/// Forces of closed cracks are those of the CPU but for the rounding of positions, and opposite for
/// the two phyxels of a pair.
TEST(Breaking, ClosedCracksPushAsOnTheCpu) {
  TornBar bar;
  HostTiles tiles(bar.model);
  bar.solver->step(400);
  const State state = bar.solver->state();
  BrokenPairs broken(bar.model);
  broken.set(state.broken, state.worn);
  BreakingView<double> v = tiles.view();
  for (const Index i : broken.phyxels()) {
    for (const Index j : broken.of(i)) v.first.cut(tiles.tiling.place[i], tiles.tiling.place[j]);
  }
  // Pieces that have flown apart do not touch: they are put back, and pressed together.
  std::vector<Vec3d> displacement;
  for (const Vec3d& x : bar.model.position) displacement.push_back({-0.2 * x.x, 0, 0});
  tiles.move_to(displacement);
  const CrackFaces faces(bar.model);
  Vec3d all;
  double most = 0;
  for (const Index i : broken.phyxels()) {
    Vec3d expected;
    faces.for_each(
        i, broken, [&](Index j) { return displacement[j]; },
        [&](const ClosedPair& pair, Vec3d x, Vec3d u) { expected += pair.force(x, u); });
    const Vec3d found = closed_force(v, tiles.point_at(), tiles.tiling.place[i]);
    most = std::max(most, norm(expected));
    // Positions of about a metre in pairs 0.05 m long.
    EXPECT_LT(norm(found - expected), 1e-13 * bar.model.parts[0].material.young);
    all += found;
  }
  EXPECT_GT(most, 1);
  EXPECT_LT(norm(all), 1e-12 * most * static_cast<double>(broken.phyxels().size()));
}

/// Beside a body with one-sided lists both passes have lists, in which the same pairs break.
TEST(Breaking, BreaksInTheListsOfBothPasses) {
  Scene scene = TornBar().scene;
  scene.bodies.push_back(scene.bodies[0]);
  BodyRequest& other = scene.bodies[1];
  other.name = "other";
  other.fracture.reset();
  other.material.hourglass = 0;
  other.neighbourhood.support = NeighbourhoodRule::Support::adaptive;
  const std::vector<Cloud> clouds{lattice(24, 5, 5, 0.05), lattice(5, 4, 3, 0.1)};
  const Model model = build_model(scene, clouds);
  ASSERT_FALSE(model.neighbourhood.symmetric);
  HostTiles tiles(model);
  std::vector<Vec3d> displacement;
  for (const Vec3d& x : model.position) {
    displacement.push_back({x.x > 0.575 ? 0.02 : 0, x.y > 0.125 ? 0.02 : 0, 0});
  }
  tiles.move_to(displacement);
  tiles.break_pairs(false);
  const BreakingView<double> v = tiles.view();
  const std::vector<PhyxelPair> first = tiles.broken(v.first).pairs();
  EXPECT_GT(first.size(), 100u);
  EXPECT_LT(first.back()[1], model.parts[0].end);
  EXPECT_EQ(first, tiles.broken(v.second).pairs());
}

}  // namespace
}  // namespace phyxel::cuda
