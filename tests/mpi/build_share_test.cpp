/// A share that ranks have built together is what would be taken out of the whole, to the last bit.
#include "mpi/build_share.hpp"

#include <gmock/gmock.h>

#include <cstring>
#include <map>

#include "../partition/bodies.hpp"
#include "partition/share.hpp"
#include "ranks.hpp"
#include "setup/tiling.hpp"

namespace phyxel {
namespace {

using test::world;
using ::testing::ElementsAreArray;
using ::testing::IsEmpty;

struct BuildCase {
  const char* name;
  Scene scene;
  std::vector<Cloud> clouds;  ///< Empty: from the scene's sources.
};
void PrintTo(const BuildCase& c, std::ostream* out) { *out << c.name; }

BodyRequest shape(const char* name, double spacing) {
  BodyRequest body;
  body.name = name;
  body.where = "test";
  body.source.shape.name = name;
  body.source.shape.spacing = spacing;
  body.source.shape.size = {3, 1, 1};
  body.source.shape.radius = 1;
  body.source.shape.jitter = 0.2;
  body.material = testing::rubber();
  return body;
}

BuildCase beam() {
  BodyRequest body = shape("beam", 0.09);
  body.rotation = {10, 20, 30};
  body.scale = 1.5;
  body.translation = {1, 2, 3};
  body.fixed.push_back({.select = {.region = "x-"}});
  body.motions.push_back(
      {.select = {.indices = std::vector<Index>{7, 1500, 2000}}, .velocity = {0.1, 0, 0}});
  body.loads.push_back({.select = {.region = "x+"}, .force = {3, 0, 1}, .ramp = 0.01});
  body.loads.push_back({.select = {.ball = Selection::Ball{{1, 2, 3}, 2}}, .force = {0, 0.1, 0}});
  body.loads.push_back({.select = {.all = true}, .force_density = {0, 0, 2}});
  return {"Beam", {.bodies = {body}}, {}};
}
/// One of each shape and rule.
BuildCase rules() {
  BuildCase c{"Rules", {}, {}};
  c.scene.bodies = {shape("sphere", 0.17), shape("cylinder", 0.2), shape("block", 0.21),
                    shape("horn_bug", 0), shape("beam", 0.16)};
  c.scene.bodies[0].neighbourhood.support = NeighbourhoodRule::Support::adaptive;
  c.scene.bodies[0].volume_rule = VolumeRule::kernel;
  c.scene.bodies[1].neighbourhood.max_neighbours = 20;
  c.scene.bodies[1].source.shape.length = 2;
  c.scene.bodies[2].neighbourhood.radius = 0.4;
  c.scene.bodies[2].volume_rule = VolumeRule::kernel;
  c.scene.bodies[2].neighbourhood.nearest = 30;
  c.scene.bodies[3].fixed.push_back({.select = {.indices = std::vector<Index>{0, 1, 100}}});
  c.scene.bodies[4].neighbourhood.nearest = 100;
  return c;
}
Scene plain(std::size_t bodies = 1) {
  Scene scene = testing::one_body();
  scene.bodies.resize(bodies, scene.bodies[0]);
  return scene;
}
BuildCase small() {
  return {"Small",
          plain(4),
          {testing::lattice(5, 1, 1, 0.1), testing::lattice(1, 1, 1, 0.1),
           testing::lattice(2, 1, 1, 0.1), testing::lattice(20, 12, 9, 0.1, 0.3)}};
}
/// Flat, and some twice at one place.
BuildCase degenerate() {
  Cloud sheet = testing::lattice(30, 20, 1, 0.1);
  for (const Index i : {3, 50, 420}) {
    sheet.position.push_back(sheet.position[i]);
    sheet.volume.push_back(sheet.volume[i]);
  }
  return {"Degenerate", plain(), {sheet}};
}
/// Two lumps, the spacing of one ten times the other's, with surfels, some of them far away.
BuildCase lumps() {
  Cloud cloud = testing::lattice(14, 14, 14, 0.1, 0.2);
  for (const Vec3d& p : testing::lattice(6, 6, 6, 1, 0.2).position) {
    cloud.position.push_back(p + Vec3d{40, 0, 0});
    cloud.volume.push_back(1);
  }
  for (int k = 0; k < 300; ++k) {
    cloud.surface.position.push_back({0.15 * k, 0.6 + 0.001 * k, 0.7});
    cloud.surface.normal.push_back({0, 0, 1});
  }
  return {"Lumps", plain(), {cloud}};
}

const std::vector<BuildCase>& build_cases() {
  static const std::vector<BuildCase> cases{beam(), rules(), small(), degenerate(), lumps()};
  return cases;
}

struct Cut {
  const char* name;
  ShareOptions options;
};
void PrintTo(const Cut& c, std::ostream* out) { *out << c.name; }

/// Built once for all tests.
const Model& whole_of(const BuildCase& c) {
  static std::map<std::string, Model> made;
  const auto found = made.find(c.name);
  if (found != made.end()) return found->second;
  return made[c.name] = c.clouds.empty() ? build_model(c.scene) : build_model(c.scene, c.clouds);
}
const BuiltShare& built_of(const BuildCase& c, const Cut& cut) {
  static std::map<std::string, BuiltShare> made;
  const std::string name = std::string(c.name) + cut.name;
  const auto found = made.find(name);
  if (found != made.end()) return found->second;
  return made[name] = c.clouds.empty() ? build_share(world(), c.scene, cut.options)
                                       : build_share(world(), c.scene, c.clouds, cut.options);
}

class BuiltShares : public ::testing::TestWithParam<std::tuple<BuildCase, Cut>> {
 protected:
  std::vector<Index> numbers(std::span<const Index> phyxels) const {
    std::vector<Index> numbers;
    for (const Index i : phyxels) numbers.push_back(here_.number(i));
    std::sort(numbers.begin(), numbers.end());
    return numbers;
  }

  const BuildCase& case_ = std::get<0>(GetParam());
  const Cut& cut_ = std::get<1>(GetParam());
  const Model& whole_ = whole_of(case_);
  const Model& here_ = built_of(case_, cut_).model;
};

TEST_P(BuiltShares, HavePhyxelsAndListsOfTheWhole) {
  ASSERT_EQ(here_.whole_size(), whole_.size());
  const Neighbourhood &whole = whole_.neighbourhood, &hood = here_.neighbourhood;
  ASSERT_EQ(hood.symmetric, whole.symmetric);
  std::vector<std::int64_t> owners(static_cast<std::size_t>(whole_.size()), 0);
  for (const Part& part : here_.parts) {
    for (Index i = part.begin; i < part.end; ++i) {
      const Index n = here_.number(i);
      ASSERT_TRUE(here_.position[i] == whole_.position[n]) << n;
      ASSERT_EQ(hood.support[i], whole.support[n]) << n;
      // Stresses of the inner ring are found here.
      const bool has_row = i < part.end - part.far_ghosts;
      if (has_row) {
        ASSERT_THAT(numbers(hood.neighbours.row(i)), ElementsAreArray(whole.neighbours.row(n)));
        ASSERT_EQ(here_.volume[i], whole_.volume[n]) << n;
        ASSERT_EQ(std::memcmp(&here_.inverse_moment[i], &whole_.inverse_moment[n], sizeof(Sym3d)),
                  0)
            << n;
        ASSERT_TRUE(here_.moment_offset[i] == whole_.moment_offset[n]) << n;
      }
      ASSERT_EQ(here_.owns(i), i < part.owned_end());
      if (!here_.owns(i)) continue;
      ++owners[n];
      ASSERT_EQ(here_.mass[i], whole_.mass[n]) << n;
      ASSERT_THAT(numbers(hood.inverse().row(i)), ElementsAreArray(whole.inverse().row(n)));
    }
  }
  world().add(owners);
  EXPECT_THAT(owners, ::testing::Each(1));
}

TEST_P(BuiltShares, KnowOfTheWhole) {
  ASSERT_EQ(here_.parts.size(), whole_.parts.size());
  for (std::size_t p = 0; p < here_.parts.size(); ++p) {
    const Part &part = here_.parts[p], &whole = whole_.parts[p];
    EXPECT_EQ(part.name, whole.name);
    EXPECT_EQ(part.neighbourhood, whole.neighbourhood);
    EXPECT_EQ(part.lists.pairs, whole.lists.pairs);
    EXPECT_EQ(part.lists.fewest, whole.lists.fewest);
    EXPECT_EQ(part.lists.most, whole.lists.most);
    EXPECT_EQ(part.kernel_volumes, whole.kernel_volumes);
    EXPECT_EQ(part.size, whole.size);
    EXPECT_EQ(part.mass, whole.mass);
    EXPECT_EQ(part.volume, whole.volume);
    EXPECT_TRUE(part.centre == whole.centre && part.origin == whole.origin);
  }
  EXPECT_EQ(model_digest(here_), model_digest(whole_));
  EXPECT_EQ(here_.degenerate.describe(), whole_.degenerate.describe());
  EXPECT_EQ(here_.warnings, whole_.warnings);
  EXPECT_EQ(here_.share->rings, cut_.options.rings);
}

TEST_P(BuiltShares, AreHeldAndLoadedAsTheWhole) {
  ASSERT_EQ(here_.motions.size(), whole_.motions.size());
  ASSERT_EQ(here_.loads.size(), whole_.loads.size());
  std::map<Index, Index> at;
  for (Index i = 0; i < here_.size(); ++i) at[here_.number(i)] = i;
  for (std::size_t m = 0; m < whole_.motions.size(); ++m) {
    std::vector<Index> expected;
    for (const Index n : whole_.motions[m].phyxels) {
      if (at.contains(n)) expected.push_back(n);
    }
    EXPECT_THAT(numbers(here_.motions[m].phyxels), ElementsAreArray(expected));
    EXPECT_TRUE(here_.motions[m].velocity == whole_.motions[m].velocity);
  }
  for (std::size_t l = 0; l < whole_.loads.size(); ++l) {
    const Load &whole = whole_.loads[l], &load = here_.loads[l];
    std::map<Index, Vec3d> force;
    for (std::size_t k = 0; k < load.phyxels.size(); ++k) {
      force[here_.number(load.phyxels[k])] = load.force[k];
    }
    std::size_t found = 0;
    for (std::size_t k = 0; k < whole.phyxels.size(); ++k) {
      const Index n = whole.phyxels[k];
      if (!at.contains(n)) continue;
      ++found;
      ASSERT_TRUE(force.contains(n)) << n;
      if (here_.owns(at[n])) {
        EXPECT_TRUE(force[n] == whole.force[k]) << n;
      }
    }
    EXPECT_EQ(found, load.phyxels.size());
  }
}

TEST_P(BuiltShares, CarryEachSurfelOnce) {
  const auto surfels = static_cast<std::int64_t>(whole_.surfels.position.size());
  const std::vector<Index>& number = here_.share->surfel_number;
  ASSERT_EQ(number.size(), here_.surfels.position.size());
  EXPECT_EQ(world().sum(static_cast<std::int64_t>(number.size())), surfels);
  EXPECT_EQ(here_.surfels.unreached, whole_.surfels.unreached);
  for (std::size_t s = 0; s < number.size(); ++s) {
    const auto row = here_.surfels.carriers.row(static_cast<Index>(s));
    ASSERT_THAT(numbers(row), ElementsAreArray(whole_.surfels.carriers.row(number[s])));
    ASSERT_TRUE(here_.owns(row.front()));
    ASSERT_TRUE(here_.surfels.position[s] == whole_.surfels.position[number[s]]);
  }
}

TEST_P(BuiltShares, KeepTilesWhole) {
  const std::vector<Index>& place = here_.share->place;
  if (cut_.options.tile == 0) {
    EXPECT_THAT(place, IsEmpty());
    return;
  }
  const std::vector<Index> whole = cuda::make_tiling(whole_).place;
  std::vector<std::int64_t> owned_in(static_cast<std::size_t>(whole_.size() + 256), 0);
  for (Index i = 0; i < here_.size(); ++i) {
    ASSERT_EQ(place[i], whole[here_.number(i)]) << i;
  }
  // A tile has one owner.
  for (Index i = 0; i < here_.size(); ++i) {
    if (here_.owns(i)) owned_in[place[i] / cuda::tile_size] = 1;
  }
  world().add(owned_in);
  EXPECT_LE(*std::max_element(owned_in.begin(), owned_in.end()), 1);
}

INSTANTIATE_TEST_SUITE_P(
    Bodies, BuiltShares,
    ::testing::Combine(::testing::ValuesIn(build_cases()),
                       ::testing::Values(Cut{"Metis", {{Partitioner::metis}, 1, 0}},
                                         Cut{"Coarse", {{Partitioner::metis}, 1, 0, 60, 400}},
                                         Cut{"Curve", {{Partitioner::curve}, 2, 0}},
                                         Cut{"Tiles",
                                             {{Partitioner::bisection}, 1, cuda::tile_size}})),
    [](const auto& test) {
      return std::string(std::get<0>(test.param).name) + std::get<1>(test.param).name;
    });

/// What is refused is refused by all ranks, in the words of one rank.
TEST(BuiltShare, RefusesWhatOneRankWould) {
  const auto words_of = [](const auto& make) -> std::string {
    try {
      make();
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  std::vector<BodyRequest> wrong(5, shape("beam", 0.2));
  wrong[0].fixed.push_back({.select = {.region = "z*"}});
  wrong[1].fixed.push_back({.select = {.box = Selection::Box{{7, 7, 7}, {8, 8, 8}}}});
  wrong[2].loads.push_back({.select = {.indices = std::vector<Index>{3, 99999}}});
  wrong[3].fixed.push_back({.select = {.region = "x-"}});
  wrong[3].fixed.push_back({.select = {.indices = std::vector<Index>{0}}});
  wrong[4].source.shape.spacing = 50;
  for (const BodyRequest& body : wrong) {
    Scene scene{.bodies = {body}};
    const std::string expected = words_of([&] { build_model(scene); });
    const std::string said = words_of([&] { build_share(world(), scene, {}); });
    EXPECT_THAT(expected, ::testing::Not(IsEmpty()));
    EXPECT_THAT(said, ::testing::HasSubstr(expected));
  }
}

}  // namespace
}  // namespace phyxel
