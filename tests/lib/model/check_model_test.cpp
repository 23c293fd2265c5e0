/// Every array of a model that a caller has changed is checked before a backend uses it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "phyxel/backend.hpp"
#include "phyxel/error.hpp"
#include "phyxel/model.hpp"
#include "support/clouds.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;
using ::testing::HasSubstr;

const double nan_value = std::nan("");
const double infinity = std::numeric_limits<double>::infinity();

/// Two bodies of 60 phyxels and 4 surfels each, the first of two materials, with one-sided lists,
/// motions and loads.
Model full_model() {
  Scene scene = one_body();
  scene.bodies[0].neighbourhood.max_neighbours = 20;
  scene.bodies.push_back(scene.bodies[0]);
  BodyRequest& first = scene.bodies[0];
  first.inclusions = {{.select = {.indices = std::vector<Index>{1, 2, 3}}, .material = rubber()}};
  first.fixed.push_back({.select = {.indices = std::vector<Index>{0, 4}}});
  first.loads.push_back({.select = {.indices = std::vector<Index>{7, 8}}, .force = {1, 0, 0}});
  Cloud cloud = lattice(5, 4, 3, 0.1, 0.2);
  cloud.surface.position = {{0, 0, 0}, {0.5, 0, 0}, {0, 0.4, 0}, {0, 0, 0.3}};
  cloud.surface.normal.assign(4, {0, 0, 1});
  cloud.surface.triangle = {{0, 1, 2}, {0, 3, 1}};
  return build_model(scene, std::vector<Cloud>{cloud, cloud});
}

struct Fault {
  const char* words;  ///< of the message
  void (*make)(Model&);
};
void PrintTo(const Fault& fault, std::ostream* out) { *out << fault.words; }

class CheckModel : public ::testing::TestWithParam<Fault> {};

TEST_P(CheckModel, RefusesArraysThatDoNotFit) {
  Model model = full_model();
  ASSERT_NO_THROW(check_model(model));
  GetParam().make(model);
  for (const Precision precision : {Precision::single, Precision::double_}) {
    try {
      make_cpu_backend(model, precision);
      FAIL() << "a backend was made";
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr(GetParam().words));
      EXPECT_THAT(error.what(), HasSubstr("; allowed: "));
    }
  }
}

constexpr Fault faults[] = {
    {"model: position[7] is [0, nan, 0]",
     [](Model& m) {
       m.position[7] = {0, nan_value, 0};
     }},
    {"volume has 119 entries for 120 phyxels", [](Model& m) { m.volume.pop_back(); }},
    {"volume[3] is 0; allowed: > 0, finite", [](Model& m) { m.volume[3] = 0; }},
    {"mass has 121 entries for 120 phyxels; allowed: one for each",
     [](Model& m) { m.mass.push_back(1); }},
    {"mass[5] is -1", [](Model& m) { m.mass[5] = -1; }},
    {"mass[6] is inf", [](Model& m) { m.mass[6] = infinity; }},
    {"closing has 2 entries for 120", [](Model& m) { m.closing.resize(2); }},
    {"closing[4] is [0, 0, inf]",
     [](Model& m) {
       m.closing.resize(120);
       m.closing[4].z = infinity;
     }},
    // --- parts
    {"parts[1], its phyxels, are 58 to 60; allowed: from 57", [](Model& m) { ++m.parts[1].begin; }},
    {"parts[2], its phyxels, are 60 to 59", [](Model& m) { m.parts[2].end = 59; }},
    {"parts have 119 phyxels of 120; allowed: all", [](Model& m) { --m.parts[2].end; }},
    {"parts[2], its surfels, are 3 to 8; allowed: from 4",
     [](Model& m) { m.parts[2].surfel_begin = 3; }},
    {"parts have 7 surfels of 8", [](Model& m) { m.parts[2].surfel_end = 7; }},
    {"parts[0].ghosts is 58; allowed: 0 to 57", [](Model& m) { m.parts[0].ghosts = 58; }},
    {"parts[0].body is 1; allowed: 0", [](Model& m) { m.parts[0].body = 1; }},
    {"parts[2].body is 7; allowed: 0 or 1", [](Model& m) { m.parts[2].body = 7; }},
    {"parts have 0 phyxels of 120", [](Model& m) { m.parts.clear(); }},
    // --- neighbours
    {"neighbourhood.support has 0 entries", [](Model& m) { m.neighbourhood.support.clear(); }},
    {"neighbourhood.support[2] is nan; allowed: >= 0, finite",
     [](Model& m) { m.neighbourhood.support[2] = nan_value; }},
    {"neighbourhood.neighbours.offsets has 0 entries for 121",
     [](Model& m) { m.neighbourhood.neighbours.offsets.clear(); }},
    {"neighbourhood.neighbours.offsets has 120 entries for 121",
     [](Model& m) { m.neighbourhood.neighbours.offsets.pop_back(); }},
    {"neighbourhood.neighbours.offsets are 0 to ",
     [](Model& m) { m.neighbourhood.neighbours.indices.pop_back(); }},
    {"neighbourhood.neighbours.offsets[9] is -5; allowed: at least ",
     [](Model& m) { m.neighbourhood.neighbours.offsets[9] = -5; }},
    {"neighbourhood.neighbours.indices[0] is -1; allowed: phyxels of the same body, 0 to 59",
     [](Model& m) { m.neighbourhood.neighbours.indices[0] = -1; }},
    {"is 60; allowed: phyxels of the same body, 0 to 59",
     [](Model& m) { m.neighbourhood.neighbours.indices[3] = 60; }},
    {"is 59; allowed: phyxels of the same body, 60 to 119",
     [](Model& m) { m.neighbourhood.neighbours.indices.back() = 59; }},
    {"neighbourhood.inverse_lists.offsets has 1 entries",
     [](Model& m) { m.neighbourhood.inverse_lists = {}; }},
    {"neighbourhood.inverse_lists.indices[0] is 120",
     [](Model& m) { m.neighbourhood.inverse_lists.indices[0] = 120; }},
    {"inverse_moment has 3 entries", [](Model& m) { m.inverse_moment.resize(3); }},
    {"inverse_moment[8] is [", [](Model& m) { m.inverse_moment[8].yz = infinity; }},
    {"moment_offset has 0 entries", [](Model& m) { m.moment_offset.clear(); }},
    {"moment_offset[9] is [", [](Model& m) { m.moment_offset[9].x = nan_value; }},
    // --- surfels
    {"surfels.normal has 7 entries for 8 surfels", [](Model& m) { m.surfels.normal.pop_back(); }},
    {"surfels.position[1] is [nan", [](Model& m) { m.surfels.position[1].x = nan_value; }},
    {"surfels.normal[2] is [0, nan, 1]", [](Model& m) { m.surfels.normal[2].y = nan_value; }},
    {"surfels.carriers.offsets has 1 entries for 9", [](Model& m) { m.surfels.carriers = {}; }},
    {"surfels.carriers.indices[0] is 120; allowed: 0 to 119",
     [](Model& m) { m.surfels.carriers.indices[0] = 120; }},
    {"surfels.triangle[1][2] is 8; allowed: 0 to 7",
     [](Model& m) { m.surfels.triangle[1][2] = 8; }},
    // --- boundary
    {"motions[0].phyxels[1] is 120; allowed: 0 to 119",
     [](Model& m) { m.motions[0].phyxels[1] = 120; }},
    {"motions[0].displacement is [nan", [](Model& m) { m.motions[0].displacement.x = nan_value; }},
    {"motions[0].rotation is [", [](Model& m) { m.motions[0].rotation.y = infinity; }},
    {"motions[0].about is [", [](Model& m) { m.motions[0].about.y = infinity; }},
    {"motions[0].duration is nan", [](Model& m) { m.motions[0].duration = nan_value; }},
    {"motions[0].velocity is [", [](Model& m) { m.motions[0].velocity.z = infinity; }},
    {"motions[0].amplitude is [", [](Model& m) { m.motions[0].amplitude.z = infinity; }},
    {"motions[0].frequency is inf", [](Model& m) { m.motions[0].frequency = infinity; }},
    {"loads[0].phyxels[0] is -3", [](Model& m) { m.loads[0].phyxels[0] = -3; }},
    {"loads[0].force has 1 entries for 2 phyxels", [](Model& m) { m.loads[0].force.pop_back(); }},
    {"loads[0].force[1] is [nan", [](Model& m) { m.loads[0].force[1].x = nan_value; }},
    {"loads[0].curve.points[0].factor is nan",
     [](Model& m) {
       m.loads[0].curve.points = {{0, nan_value}};
     }},
    {"loads[0].curve.points[1].time is 1 s; allowed: times that ascend",
     [](Model& m) {
       m.loads[0].curve.points = {{1, 0}, {1, 1}};
     }},
    {"gravity is [0, 0, inf]", [](Model& m) { m.gravity.z = infinity; }},
};
INSTANTIATE_TEST_SUITE_P(Faults, CheckModel, ::testing::ValuesIn(faults));

/// A device that finds the lists itself gets a model without any.
TEST(CheckModel, TakesModelsWhoseListsAreLeftToADevice) {
  EXPECT_NO_THROW(check_model(without_lists(full_model())));
  EXPECT_NO_THROW(check_model(without_lists(busy_model())));
  EXPECT_NO_THROW(check_model(Model{}));
}

}  // namespace
}  // namespace phyxel
