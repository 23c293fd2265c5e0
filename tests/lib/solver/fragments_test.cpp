/// Fragments of broken bodies, and surfaces that cracks open.
#include "phyxel/fragments.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "phyxel/diagnostics.hpp"
#include "phyxel/point_fields.hpp"
#include "support/torn_bar.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;

/// A bar of 24 by 5 by 5 phyxels, cut through after `columns` of them.
struct CutBar {
  explicit CutBar(int columns) {
    scene = one_body({.young = 1e6, .poisson = 0.25, .density = 1000});
    scene.bodies[0].notches.push_back(
        {.centre = {0.05 * columns, 0, 0}, .normal = {1, 0, 0}, .radius = 10});
    model = model_of(scene, lattice(24, 5, 5, 0.05));
    backend = make_test_backend(model, Precision::double_);
    state = initial_state(model, scene, 1e-4);
    backend->upload(state);
  }
  bool is_left(Index i) const { return model.position[i].x < scene.bodies[0].notches[0].centre.x; }

  Scene scene;
  Model model;
  std::unique_ptr<Backend> backend;
  State state;
};

void expect_near(Vec3d found, Vec3d wanted, double error) {
  EXPECT_LE(norm(found - wanted), error) << found.x << " " << found.y << " " << found.z;
}

/// Each half moves as a rigid body of its own, about its own centre.
TEST(Fragments, ABarThatIsCutThroughIsTwoWithTheirOwnMotions) {
  CutBar bar(7);
  const Vec3d velocity[] = {{1, 2, 3}, {-4, 0, 1}}, spin[] = {{0, 0, 5}, {7, -1, 2}};
  const Vec3d corner{0.05, 0.05, 0.05};
  Vec3d middle[2];
  double mass[2] = {0, 0};
  for (Index i = 0; i < bar.model.size(); ++i) {
    const int side = bar.is_left(i) ? 1 : 0;  // the heavier half comes first
    if (side == 1) bar.state.displacement[i] = corner;
    mass[side] += bar.model.mass[i];
    middle[side] += bar.model.mass[i] * (bar.model.position[i] + bar.state.displacement[i]);
  }
  for (const int side : {0, 1}) middle[side] = (1 / mass[side]) * middle[side];
  for (Index i = 0; i < bar.model.size(); ++i) {
    const int side = bar.is_left(i) ? 1 : 0;
    const Vec3d r = bar.model.position[i] + bar.state.displacement[i] - middle[side];
    bar.state.velocity[i] = velocity[side] + cross(spin[side], r);
  }
  bar.backend->upload(bar.state);
  const std::vector<FragmentReading> found = read_fragments(bar.model, *bar.backend);
  ASSERT_EQ(found.size(), 2u);
  for (const int side : {0, 1}) {
    const FragmentReading& half = found[static_cast<std::size_t>(side)];
    EXPECT_EQ(half.body, bar.scene.bodies[0].name);
    EXPECT_EQ(half.number, side + 1);
    EXPECT_EQ(half.phyxels, 25 * (side == 0 ? 17 : 7));
    EXPECT_NEAR(half.mass, mass[side], 1e-12 * mass[side]);
    expect_near(half.centre, middle[side], 1e-13);
    expect_near(half.velocity, velocity[side], 1e-12);
    expect_near(half.spin, spin[side], 1e-10);
    // A block of points about its axis: L along x is 2 m s² (n² - 1)/12 ω.
    if (side == 1) {
      EXPECT_NEAR(half.angular_momentum.x, mass[1] * 2 * 0.05 * 0.05 * 24 / 12 * spin[1].x, 1e-10);
    }
  }
  EXPECT_EQ(found[1].first, 0);
  const std::vector<double> number = fragment_numbers(bar.model, *bar.backend);
  for (Index i = 0; i < bar.model.size(); ++i) {
    EXPECT_EQ(number[i], bar.is_left(i) ? 2 : 1);
  }
  const FragmentTotals totals = totals_of(found);
  EXPECT_EQ(totals.fragments, 2);
  EXPECT_EQ(totals.dust, 0);
  EXPECT_NEAR(totals.largest_share, mass[0] / (mass[0] + mass[1]), 1e-12);
}

/// A phyxel that has lost all its pairs is dust, and no fragment.
TEST(Fragments, PhyxelsWithoutPairsAreDust) {
  CutBar bar(12);
  const Index corner = 0;
  const Vec3d away{0, 0, 9};
  for (const Index j : bar.model.neighbourhood.neighbours.row(corner)) {
    const PhyxelPair pair{corner, j};
    if (std::find(bar.state.broken.begin(), bar.state.broken.end(), pair) ==
        bar.state.broken.end()) {
      bar.state.broken.push_back(pair);
    }
  }
  std::sort(bar.state.broken.begin(), bar.state.broken.end());
  bar.state.velocity[corner] = away;
  bar.backend->upload(bar.state);
  const std::vector<FragmentReading> found = read_fragments(bar.model, *bar.backend);
  ASSERT_EQ(found.size(), 3u);
  EXPECT_EQ(found[0].number, 1);
  EXPECT_EQ(found[0].phyxels, 300);  // the whole half is heavier by the phyxel that the other lost
  EXPECT_EQ(found[1].phyxels, 299);
  EXPECT_TRUE(found[2].is_dust());
  EXPECT_EQ(found[2].first, corner);
  EXPECT_EQ(found[2].phyxels, 1);
  EXPECT_EQ(found[2].velocity.z, away.z);
  EXPECT_TRUE(std::isnan(found[2].spin.x));
  const FragmentTotals totals = totals_of(found);
  EXPECT_EQ(totals.fragments, 2);
  EXPECT_EQ(totals.dust, 1);
  EXPECT_NEAR(totals.dust_share, 1.0 / 600, 1e-12);
  EXPECT_EQ(fragment_numbers(bar.model, *bar.backend)[corner], 0);
}

/// Fragments of a bar that flies apart: masses and momenta add up to those of the body, and each
/// phyxel is in the fragment whose number it has.
TEST(Fragments, AddUpToTheBody) {
  for (const Precision precision : {Precision::single, Precision::double_}) {
    TornBar bar(precision);
    bar.solver->step(1000);
    const std::vector<FragmentReading> found = read_fragments(bar.model, *bar.backend);
    EXPECT_GT(totals_of(found).fragments, 3);
    const State state = bar.solver->state();
    double mass = 0, mass_of_all = 0;
    Vec3d momentum, angular, momentum_of_all, angular_of_all;
    std::map<double, double> mass_of;
    const std::vector<double> number = fragment_numbers(bar.model, *bar.backend);
    for (Index i = 0; i < bar.model.size(); ++i) {
      const Vec3d p = bar.model.mass[i] * state.velocity[i];
      mass_of_all += bar.model.mass[i];
      momentum_of_all += p;
      angular_of_all += cross(bar.model.position[i] + state.displacement[i], p);
      mass_of[number[i]] += bar.model.mass[i];
    }
    for (const FragmentReading& one : found) {
      mass += one.mass;
      momentum += one.mass * one.velocity;
      angular += one.angular_momentum + cross(one.centre, one.mass * one.velocity);
      EXPECT_NEAR(mass_of[one.number], one.mass, 1e-12 * one.mass) << one.number;
    }
    EXPECT_EQ(mass_of.size(), found.size());
    EXPECT_NEAR(mass, mass_of_all, 1e-12 * mass_of_all);
    expect_near(momentum, momentum_of_all, 1e-12 * norm(momentum_of_all));
    expect_near(angular, angular_of_all, 1e-11 * norm(angular_of_all));
    // No force acts from outside, so that it is the momentum of the log, too.
    const double rounding = precision == Precision::single ? 1e-5 : 1e-11;
    expect_near(momentum, bar.now().momentum, rounding * norm(momentum_of_all));
  }
}

TEST(Fragments, BodiesThatCannotBreakHaveNone) {
  const Model model = model_of(one_body(), lattice(4, 4, 4, 0.1));
  const auto backend = make_test_backend(model, Precision::double_);
  EXPECT_TRUE(read_fragments(model, *backend).empty());
  for (const double number : fragment_numbers(model, *backend)) EXPECT_EQ(number, 0);
}

}  // namespace
}  // namespace phyxel
