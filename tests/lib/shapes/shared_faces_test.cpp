/// Supports of lattices whose faces touch each other, or are too near to other layers for layers of
/// their own.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "phyxel/equilibrium.hpp"
#include "phyxel/model.hpp"
#include "phyxel/physics/laws.hpp"
#include "phyxel/solver.hpp"
#include "support/backend.hpp"
#include "support/clouds.hpp"
#include "support/refusal.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

constexpr Axes only_x{true, false, false}, only_y{false, true, false}, x_and_y{true, true, false},
    y_and_z{false, true, true};

Selection in_box(Vec3d low, Vec3d high) {
  Selection select;
  select.box = Selection::Box{low, high};
  select.where = "test.toml:9:1";
  return select;
}
/// The part of a beam between two places along it.
Selection between(double begin, double end) { return in_box({begin, -1, -1}, {end, 1, 1}); }

/// A beam of length 10 and height 1, ν = 0, under its own weight across: ρ g / E is 1e-6 / m.
Scene beam(std::vector<FixRequest> fixed,
           ShapeRequest::Placement placement = ShapeRequest::Placement::nodes) {
  Scene scene =
      one_body({.young = 1e6, .poisson = 0, .density = 1000, .law = SmallStrain<double>::name});
  scene.gravity = {0, 0, -1e-3};
  BodyRequest& body = scene.bodies[0];
  body.source.shape = {.name = "beam", .size = {10, 1, 1}, .spacing = 0.2, .placement = placement};
  body.fixed = std::move(fixed);
  return scene;
}

struct Rest {
  Model model;
  State state;
  /// How far the end x = 0 goes down, on average over its phyxels [m].
  double sag() const {
    double sum = 0, volume = 0;
    for (Index i = 0; i < model.size(); ++i) {
      if (model.position[i].x > 1e-6) continue;
      sum -= model.volume[i] * state.displacement[i].z;
      volume += model.volume[i];
    }
    return sum / volume;
  }
};

Rest rest_of(const Scene& scene) {
  Rest rest{build_model(scene), {}};
  const auto backend = make_test_backend(rest.model, Precision::double_);
  rest.state = find_equilibrium(rest.model, *backend).state;
  return rest;
}

/// The sag of a cantilever of some length by Timoshenko's theory, ν = 0 [m]:
/// ρ g / E (3/2 L⁴ + 6/5 L²) for a height of 1.
double theory(double length) { return 1e-6 * (1.5 * std::pow(length, 4) + 1.2 * length * length); }

/// Lattices of five cells over the height sag by 1 to 2% more than the theory has it.
constexpr double tolerance = 0.025;

/// A clamp beside a part that is held across only acts at the face that they share, whichever entry
/// comes first: the phyxels there are the clamp's.
TEST(SharedFaces, BelongToTheClampInBothOrders) {
  const FixRequest part{between(-1, 2), only_y}, clamp{between(2, 11)};
  const Rest one = rest_of(beam({part, clamp})), other = rest_of(beam({clamp, part}));
  EXPECT_EQ(one.model.position, other.model.position);
  EXPECT_EQ(one.state.displacement, other.state.displacement);
  EXPECT_EQ(one.model.motions[0].phyxels, other.model.motions[1].phyxels);
  EXPECT_EQ(one.model.motions[1].phyxels, other.model.motions[0].phyxels);
  EXPECT_NEAR(one.sag() / theory(2), 1, tolerance);  // with the face left to the part: 1.9
}

/// The number of phyxels that two sets of sorted indices share.
std::size_t common(const std::vector<Index>& a, const std::vector<Index>& b) {
  std::vector<Index> both;
  std::set_intersection(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(both));
  return both.size();
}

/// A phyxel and axis is in one support, also in fitted bodies, and where three meet.
TEST(SharedFaces, HaveOneSupportForEachAxis) {
  const FixRequest part{between(-1, 2), x_and_y}, roller{between(2, 5), only_x};
  for (const auto placement : {ShapeRequest::Placement::nodes, ShapeRequest::Placement::fitted}) {
    const Model two = build_model(beam({part, roller}, placement));
    EXPECT_EQ(two.position, build_model(beam({roller, part}, placement)).position);
    EXPECT_EQ(common(two.motions[0].phyxels, two.motions[1].phyxels), 0u);
    const auto on_face = [&](Index i) { return std::abs(two.position[i].x - 2) < 1e-6; };
    const auto count = [&](const Motion& motion) {
      return std::ranges::count_if(motion.phyxels, on_face);
    };
    EXPECT_GE(count(two.motions[0]), 25);
    EXPECT_EQ(count(two.motions[1]), 0);
  }
  // Above, the clamp; below, two that share no axis, and so both hold the face.
  const FixRequest below{in_box({-1, -1, -1}, {3, 1, 0.2}), only_y},
      beside{in_box({3, -1, -1}, {11, 1, 0.2}), only_x}, above{in_box({-1, -1, 0.2}, {11, 1, 1})};
  const Model three = build_model(beam({below, beside, above}));
  EXPECT_EQ(common(three.motions[0].phyxels, three.motions[2].phyxels), 0u);
  EXPECT_EQ(common(three.motions[1].phyxels, three.motions[2].phyxels), 0u);
  const std::size_t layer = 6;  // phyxels along y
  EXPECT_EQ(common(three.motions[0].phyxels, three.motions[1].phyxels) % layer, 0u);
  EXPECT_GT(common(three.motions[0].phyxels, three.motions[1].phyxels), 0u);
}

/// Two clamps that touch hold as one does.
TEST(SharedFaces, OfTwoClampsAreHeldOnce) {
  const FixRequest near{between(2, 5)}, far{between(5, 11)};
  const Rest one = rest_of(beam({near, far})), other = rest_of(beam({far, near}));
  EXPECT_EQ(one.state.displacement, other.state.displacement);
  EXPECT_NEAR(one.sag() / theory(2), 1, tolerance);
  EXPECT_EQ(one.model.motions[0].phyxels, other.model.motions[1].phyxels);
  EXPECT_EQ(common(one.model.motions[0].phyxels, one.model.motions[1].phyxels), 0u);
}

/// A face cannot follow two supports of which neither holds all that the other does, nor two that
/// move otherwise.
TEST(SharedFaces, RefuseSupportsThatContradictEachOther) {
  const FixRequest left{between(-1, 2), x_and_y}, right{between(2, 11), y_and_z};
  for (const Scene& scene : {beam({left, right}), beam({right, left})}) {
    EXPECT_THAT(
        refusal_of([&] { build_model(scene); }),
        AllOf(HasSubstr("test.toml:9:1: fixed 2 of body \"body\" shares phyxels with fixed 1"),
              HasSubstr("\"xy\""), HasSubstr("\"yz\""), HasSubstr("twice along \"y\""),
              HasSubstr("allowed: ")));
  }
  Scene moving = beam({{between(-1, 2)}});
  moving.bodies[0].motions = {{.select = between(2, 11), .velocity = {0, 0, 1}}};
  EXPECT_THAT(refusal_of([&] { build_model(moving); }),
              AllOf(HasSubstr("motion 1 of body \"body\" shares a face with fixed 1"),
                    HasSubstr("cannot follow both along \"xyz\""), HasSubstr("allowed: ")));
  // Of one that holds fewer axes, the face follows the other.
  moving.bodies[0].fixed[0].axes = only_y;
  const Model model = build_model(moving);
  EXPECT_EQ(common(model.motions[0].phyxels, model.motions[1].phyxels), 0u);
  // Boxes that overlap, one of them moving.
  moving.bodies[0].fixed = {{between(-1, 2.4)}};
  EXPECT_THAT(refusal_of([&] { build_model(moving); }),
              HasSubstr("already fixed or moved by fixed 1"));
}

/// Supports at rest may overlap anywhere, also those by name and of the whole body: together they
/// hold what each of them would.
TEST(SharedFaces, OfSupportsAtRestMayOverlap) {
  Selection end, bottom, all;
  end.region = "x+";
  bottom.region = "z-";
  all.all = true;
  const FixRequest clamp{end}, roller{bottom, {false, false, true}}, plane{all, only_y},
      boxes[] = {{between(-1, 2.4)}, {between(2, 4)}};
  const auto held = [](const std::vector<FixRequest>& fixed) {
    const Model model = build_model(beam(fixed));
    std::vector<int> times(3 * static_cast<std::size_t>(model.size()), 0);
    for (const Motion& motion : model.motions) {
      for (const Index i : motion.phyxels) {
        for (int k = 0; k < 3; ++k) times[3 * i + k] += motion.axes.bits() >> k & 1;
      }
    }
    EXPECT_THAT(times, ::testing::Each(::testing::Le(1)));
    return times;
  };
  EXPECT_EQ(held({clamp, roller, plane}), held({plane, roller, clamp}));
  const Model model = build_model(beam({clamp, roller, plane}));
  const std::vector<int> times = held({clamp, roller, plane});
  for (Index i = 0; i < model.size(); ++i) {
    const Vec3d p = model.position[i];
    EXPECT_EQ(times[3 * i], p.x > 9.99);
    EXPECT_EQ(times[3 * i + 1], 1);
    EXPECT_EQ(times[3 * i + 2], p.x > 9.99 || p.z < -0.49);
  }
  const auto count = [](const std::vector<int>& axes) { return std::ranges::count(axes, 1); };
  EXPECT_EQ(held({boxes[0], boxes[1]}), held({boxes[1], boxes[0]}));
  EXPECT_EQ(count(held({boxes[0], boxes[1]})), count(held({{between(-1, 4)}})));
  EXPECT_THAT(refusal_of([&] {
                build_model(beam({{end, x_and_y}, {all, y_and_z}}));
              }),
              AllOf(HasSubstr("fixed 2 of body \"body\" shares phyxels with fixed 1"),
                    HasSubstr("twice along \"y\"")));
}

/// A motion that goes nowhere holds as a fixed entry does.
TEST(SharedFaces, AreSharedWithMotionsAtRest) {
  Scene scene = beam({{between(-1, 2)}});
  scene.bodies[0].motions = {{.select = between(2, 9), .duration = 1}};
  const Model model = build_model(scene);
  EXPECT_EQ(common(model.motions[0].phyxels, model.motions[1].phyxels), 0u);
  EXPECT_GT(model.motions[1].phyxels.size(), 1000u);
}

/// Of two thin boxes that have moved to one layer, one is left with nothing, and the refusal says
/// why. A box outside the body is another matter.
TEST(SharedFaces, LeaveNothingToASecondBoxOnTheirLayer) {
  const FixRequest thin{between(1.9, 2)}, thinner{between(2, 2.05)}, outside{between(20, 21)};
  const auto refusal = [](std::vector<FixRequest> fixed) {
    return refusal_of([&] { build_model(beam(fixed)); });
  };
  const auto names_the_face =
      AllOf(HasSubstr("selects no phyxel"), HasSubstr("leave this entry out"));
  EXPECT_THAT(refusal({thin, thinner}), names_the_face);
  EXPECT_THAT(refusal({thinner, thin}), names_the_face);
  EXPECT_THAT(refusal({thin, outside}), AllOf(HasSubstr("selects no phyxel"),
                                              ::testing::Not(HasSubstr("leave this entry out"))));
}

/// Loads act where their boxes are, even if the face of a support with the same box has moved.
TEST(MovedFaces, AreThoseOfSupportsOnly) {
  Scene scene = beam({{between(2, 9.93)}});
  scene.bodies[0].loads = {{.select = between(2, 9.93), .force = {0, 0, 1}}};
  const Model model = build_model(scene);
  const auto farthest = [&](const std::vector<Index>& phyxels) {
    double x = 0;
    for (const Index i : phyxels) x = std::max(x, model.position[i].x);
    return x;
  };
  EXPECT_DOUBLE_EQ(farthest(model.motions[0].phyxels), 10);
  EXPECT_LT(farthest(model.loads[0].phyxels), 9.93);
}

/// A box that ends too near to the layer of another one is held there, and the rest of its faces
/// where they are; the warning names the entry and both places.
TEST(MovedFaces, ActAtTheNearestLayer) {
  const FixRequest part{between(0.5, 1.93), only_y}, clamp{between(2, 11)};
  const Rest rest = rest_of(beam({part, clamp}));
  EXPECT_NEAR(rest.sag() / theory(2), 1, tolerance);
  EXPECT_THAT(rest.model.warnings,
              ElementsAre(AllOf(HasSubstr("body \"body\", fixed 1: box"), HasSubstr("x = 1.93 m"),
                                HasSubstr("x = 2 m"))));
  std::vector<double> x;
  for (const Index i : rest.model.motions[0].phyxels) x.push_back(rest.model.position[i].x);
  EXPECT_DOUBLE_EQ(*std::ranges::min_element(x), 0.5);
  EXPECT_LT(*std::ranges::max_element(x), 1.9);
}

/// A clamp that leaves a layer at the far end thinner than half a spacing holds that, too, and acts
/// at its other face.
TEST(MovedFaces, ActAtTheNearestEnd) {
  const Rest rest = rest_of(beam({{between(2, 9.93)}}));
  EXPECT_NEAR(rest.sag() / theory(2), 1, tolerance);  // without layers: 1.2
  EXPECT_EQ(rest.model.walls[0].regions.size(), 1u);
  EXPECT_THAT(rest.model.warnings, ElementsAre(AllOf(HasSubstr("fixed 1: box"),
                                                     HasSubstr("x = 9.93 m acts at x = 10 m"))));
  const auto at_end = std::ranges::count_if(
      rest.model.motions[0].phyxels, [&](Index i) { return rest.model.position[i].x > 9.99; });
  EXPECT_EQ(at_end, 36);
}

/// Moved faces are placed as the body is.
TEST(MovedFaces, ArePlacedWithTheBody) {
  Scene scene = beam({});
  BodyRequest& body = scene.bodies[0];
  body.rotation = {0, 90, 0};  // the beam then lies along -z
  body.scale = 2;
  body.translation = {5, 0, 1};
  body.fixed = {{in_box({0, -9, -99}, {9, 9, -3})}, {in_box({0, -9, -2.9}, {9, 9, 9}), only_y}};
  const Model model = build_model(scene);
  EXPECT_EQ(model.motions[0].phyxels.size() + model.motions[1].phyxels.size(),
            static_cast<std::size_t>(model.size()));
  EXPECT_THAT(model.warnings, ElementsAre(AllOf(HasSubstr("fixed 2"), HasSubstr("z = -2.9 m"),
                                                HasSubstr("z = -3 m"))));
}

double step_of(std::vector<FixRequest> fixed) {
  Scene scene = beam(std::move(fixed));
  scene.bodies[0].source.shape.size.x = 3;
  return step_limit(build_model(scene), 1).largest_step;
}

/// Boxes that reach less than half a spacing into the body, and hold a part of an end or a few axes
/// only, leave the step as it is without them; with layers on their faces it would be a quarter
/// shorter. So do boxes deep inside. A face just beyond half a spacing has a layer.
TEST(MovedFaces, LeaveTheStepLong) {
  const double without = step_of({}), spacing = 0.2;
  for (const double reach : {0.005, 0.03, 0.06, 0.099}) {
    const FixRequest part{in_box({-1, -1, -1}, {reach, 1, 0.1})},
        pad{in_box({1, -1, 0.5 - reach}, {2, 1, 1})}, few{between(-1, reach), only_y},
        inside{between(1, 1 + reach + spacing), only_y};
    for (const FixRequest& fix : {part, pad, few, inside}) {
      EXPECT_GT(step_of({fix}) / without, 0.97) << reach;
    }
    // All phyxels on the end are held: the face stays where it is, and the step long.
    const FixRequest clamp{between(-1, reach)};
    EXPECT_GT(step_of({clamp}) / without, 0.97) << reach;
    EXPECT_EQ(build_model(beam({clamp})).warnings.size(), 0u) << reach;
  }
  const Model shallow = build_model(beam({{between(-1, 0.06), only_y}}));
  EXPECT_THAT(shallow.warnings, ElementsAre(HasSubstr("x = 0.06 m acts at x = 0 m")));
  const Model deeper = build_model(beam({{between(-1, 0.12), only_y}}));
  EXPECT_THAT(deeper.warnings, IsEmpty());
  EXPECT_EQ(deeper.motions[0].phyxels.size(), 2 * shallow.motions[0].phyxels.size());
}

/// Boxes that hold some axes only act deeper than they end, as docs/scenes.md says: their faces
/// have no walls.
TEST(SharedFaces, OfFewAxesActDeeper) {
  constexpr Axes x_and_z{true, false, true};
  const double sag = rest_of(beam({{between(2, 11), x_and_z}})).sag() / theory(2);
  EXPECT_GT(sag, 1.1);
  EXPECT_LT(sag, 1.2);
}

/// Between a fixed and a moved support of a body of `placement`, `gap` apart, the scene's warnings.
std::vector<std::string> warnings_of_gap(double gap, ShapeRequest::Placement placement,
                                         Vec3d moved = {0, 0, 0.1}) {
  Scene scene = beam({{.select = between(-1, 4)}}, placement);
  scene.bodies[0].motions = {
      {.select = between(4 + gap, 11), .displacement = moved, .duration = 1}};
  if (moved == Vec3d{}) {
    scene.bodies[0].motions.clear();
    scene.bodies[0].fixed.push_back({.select = between(4 + gap, 11)});
  }
  return build_model(scene).warnings;
}

/// A layer between two supports that has no phyxels of its own carries a wrong force from one to
/// the other. In lattices, faces that are too near become one, and what has moved is said.
TEST(Gaps, ThinnerThanASpacingAreSaid) {
  using Placement = ShapeRequest::Placement;
  for (const double gap : {0.05, 0.19}) {
    EXPECT_THAT(warnings_of_gap(gap, Placement::fitted),
                Contains(AllOf(HasSubstr("fixed 1 and motion 1 are"), HasSubstr("m apart"))))
        << gap;
  }
  EXPECT_THAT(warnings_of_gap(0.5, Placement::fitted), Not(Contains(HasSubstr("apart"))));
  EXPECT_THAT(warnings_of_gap(0.15, Placement::fitted, {}), Not(Contains(HasSubstr("apart"))));
}

}  // namespace
}  // namespace phyxel
