/// A share that ranks have built together is what would be taken out of the whole, to the last bit.
#include "mpi/build_share.hpp"

#include <gmock/gmock.h>
#include <malloc.h>

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <map>

#include "build_cases.hpp"
#include "device.hpp"
#include "host_surveyor.hpp"
#include "mesh/distance_field.hpp"
#include "model/closing_areas.hpp"
#include "model/host_memory.hpp"
#include "partition/share.hpp"
#include "phyxel/backend.hpp"
#include "phyxel/solver.hpp"
#include "ranks.hpp"
#include "setup/closing.hpp"
#include "setup/survey.hpp"
#include "setup/tiling.hpp"

namespace phyxel {
namespace {

using test::world;
using ::testing::IsEmpty;

const testing::HostSurveyor surveyor;

struct Cut {
  const char* name;
  ShareOptions options;
  bool gpu = false;       ///< Gradients are closed by a GPU.
  bool searches = false;  ///< It also searches for neighbours.
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
  ShareOptions options = cut.options;
  if (cut.gpu && !cuda_devices().empty()) {
    static const std::unique_ptr<ShareSurveyor> on_gpu = cuda_share_surveyor(0);
    if (cut.searches) options.surveyor = on_gpu.get();
    options.close = cuda_closing_search();
  }
  return made[name] = c.clouds.empty() ? build_share(world(), c.scene, options)
                                       : build_share(world(), c.scene, c.clouds, options);
}

class BuiltShares : public ::testing::TestWithParam<std::tuple<BuildCase, Cut>> {
 protected:
  void SetUp() override {
    if (cut_.gpu && cuda_devices().empty()) GTEST_SKIP() << "no CUDA device";
    for (const BodyRequest& body : case_.scene.bodies) {
      if (searches_ && body.neighbourhood.max_neighbours) {
        GTEST_SKIP() << "devices do not choose the nearest";
      }
      needs_host_ |= (may_close(body) && !cut_.gpu) || !body.inclusions.empty();
    }
    for (const Walls& walls : whole_.walls) has_walls_ |= !walls.regions.empty();
    needs_host_ |= has_walls_;
  }
  const BuildCase& case_ = std::get<0>(GetParam());
  const Cut& cut_ = std::get<1>(GetParam());
  const bool searches_ = cut_.options.surveyor || cut_.searches;
  const Model& whole_ = whole_of(case_);
  const Model& here_ = built_of(case_, cut_).model;
  /// Whether lists are made on the host, whoever is to search.
  bool needs_host_ = false;
  bool has_walls_ = false;
};

template <class T>
std::vector<T> range(const std::vector<T>& values, Index begin, Index end) {
  return {values.begin() + begin, values.begin() + end};
}
template <class T>
bool same_bits(const std::vector<T>& a, const std::vector<T>& b) {
  if (a.empty() || b.empty()) return a.empty() == b.empty();
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0;
}

void expect_same_contact(const Model& here, const Model& expected) {
  EXPECT_EQ(here.obstacles.size(), expected.obstacles.size());
  EXPECT_EQ(here.contact.phyxels, expected.contact.phyxels);
  EXPECT_EQ(here.contact.offset, expected.contact.offset);
  const BodyContact &found = here.body_contact, &wanted = expected.body_contact;
  EXPECT_EQ(found.layer.phyxels, wanted.layer.phyxels);
  EXPECT_EQ(found.layer.offset, wanted.layer.offset);
  ASSERT_EQ(found.distances.size(), wanted.distances.size());
  for (std::size_t b = 0; b < wanted.distances.size(); ++b) {
    EXPECT_TRUE(same_bits(found.distances[b].arrays->fine, wanted.distances[b].arrays->fine));
  }
}

TEST_P(BuiltShares, AreWhatWouldBeTakenOutOfTheWhole) {
  // Who owns what, from all ranks: no assertion that ends one rank's test may stand before.
  std::vector<std::int64_t> owners(static_cast<std::size_t>(whole_.size()), 0), part_of(owners);
  for (Index i = 0; i < here_.size(); ++i) {
    if (!here_.owns(i)) continue;
    owners.at(here_.global_id(i)) = 1;
    part_of.at(here_.global_id(i)) = world().rank();
  }
  world().add(owners);
  world().add(part_of);
  ASSERT_THAT(owners, ::testing::Each(1));
  const PartHalo plan = make_part_halos(phyxel_graph(whole_), {part_of.begin(), part_of.end()},
                                        world().size())[world().rank()];
  const ModelShare made = share_of(whole_, plan, {part_of.begin(), part_of.end()});
  const Model& expected = made.model;
  const Share& share = *here_.share;

  EXPECT_EQ(share.global_count, made.share.global_count);
  ASSERT_EQ(share.global_id, made.share.global_id);
  EXPECT_EQ(share.owned, made.share.owned);
  EXPECT_TRUE(same_bits(here_.position, expected.position));
  const Neighbourhood &hood = here_.neighbourhood, &lists = expected.neighbourhood;
  EXPECT_EQ(hood.symmetric, lists.symmetric);
  EXPECT_EQ(hood.support, lists.support);
  const bool has_lists = !searches_ || needs_host_;
  if (has_lists) {
    EXPECT_EQ(hood.neighbours.offsets, lists.neighbours.offsets);
    EXPECT_EQ(hood.neighbours.indices, lists.neighbours.indices);
    EXPECT_EQ(hood.inverse_lists.offsets, lists.inverse_lists.offsets);
    EXPECT_EQ(hood.inverse_lists.indices, lists.inverse_lists.indices);
  } else {
    EXPECT_THAT(hood.neighbours.indices, IsEmpty());
  }
  ASSERT_EQ(here_.parts.size(), expected.parts.size());
  for (std::size_t p = 0; p < here_.parts.size(); ++p) {
    const Part &part = here_.parts[p], &other = expected.parts[p];
    EXPECT_EQ(part.begin, other.begin);
    EXPECT_EQ(part.end, other.end);
    EXPECT_EQ(part.ghosts, other.ghosts);
    EXPECT_EQ(part.surfel_begin, other.surfel_begin);
    EXPECT_EQ(part.surfel_end, other.surfel_end);
    const Index end = part.owned_end();
    const auto alike = [&](const auto& values, const auto& others) {
      return same_bits(range(values, part.begin, end), range(others, part.begin, end));
    };
    EXPECT_TRUE(alike(here_.mass, expected.mass));
    EXPECT_TRUE(alike(here_.volume, expected.volume));
    ASSERT_EQ(here_.closing.size(), expected.closing.size());
    EXPECT_TRUE(here_.closing.empty() || same_bits(here_.closing, expected.closing));
    EXPECT_EQ(part.material.young, whole_.parts[p].material.young);
    EXPECT_EQ(part.pair_length, other.pair_length);
    EXPECT_EQ(part.support_cubes, other.support_cubes);
    EXPECT_TRUE(!has_lists || alike(here_.inverse_moment, expected.inverse_moment));
    EXPECT_TRUE(!has_lists || alike(here_.moment_offset, expected.moment_offset));
  }
  EXPECT_EQ(share.global_surfel_id, made.share.global_surfel_id);
  EXPECT_EQ(here_.surfels.unreached, expected.surfels.unreached);
  EXPECT_TRUE(same_bits(here_.surfels.position, expected.surfels.position));
  EXPECT_TRUE(same_bits(here_.surfels.normal, expected.surfels.normal));
  EXPECT_EQ(here_.surfels.carriers.offsets, expected.surfels.carriers.offsets);
  EXPECT_EQ(here_.surfels.carriers.indices, expected.surfels.carriers.indices);
  ASSERT_EQ(here_.motions.size(), expected.motions.size());
  for (std::size_t m = 0; m < here_.motions.size(); ++m) {
    EXPECT_EQ(here_.motions[m].phyxels, expected.motions[m].phyxels);
    EXPECT_TRUE(here_.motions[m].velocity == expected.motions[m].velocity);
  }
  expect_same_contact(here_, expected);
  ASSERT_EQ(here_.loads.size(), expected.loads.size());
  for (std::size_t l = 0; l < here_.loads.size(); ++l) {
    const Load &load = here_.loads[l], &other = expected.loads[l];
    ASSERT_EQ(load.phyxels, other.phyxels);
    for (std::size_t k = 0; k < load.phyxels.size(); ++k) {
      if (here_.owns(load.phyxels[k])) {
        ASSERT_TRUE(load.force[k] == other.force[k]);
      }
    }
  }
}

/// What is told of a cut, of which each rank has seen a stretch, is what the whole graph says.
TEST_P(BuiltShares, TellTheQualityOfTheirCut) {
  std::vector<std::int64_t> part_of(static_cast<std::size_t>(whole_.size()), 0);
  for (Index i = 0; i < here_.size(); ++i) {
    if (here_.owns(i)) part_of.at(here_.global_id(i)) = world().rank();
  }
  world().add(part_of);
  const bool chosen = std::any_of(
      case_.scene.bodies.begin(), case_.scene.bodies.end(),
      [](const BodyRequest& body) { return body.neighbourhood.max_neighbours.has_value(); });
  // Where a phyxel chooses the nearest of all, where walls part neighbours, or where some phyxels
  // speak for all, it is an estimate.
  if (chosen || has_walls_ || whole_.size() > cut_.options.most_samples) return;
  const PartitionQuality told = built_of(case_, cut_).quality;
  const PartitionQuality expected = quality_of(
      phyxel_graph(whole_), std::vector<int>(part_of.begin(), part_of.end()), world().size());
  EXPECT_EQ(told.ghosts, expected.ghosts);
  EXPECT_EQ(told.most_ghosts, expected.most_ghosts);
  EXPECT_EQ(told.most_peers, expected.most_peers);
  EXPECT_EQ(told.empty, expected.empty);
  EXPECT_EQ(told.cut, expected.cut);
  // Ranks know who shares an edge, the whole also in which direction.
  if (whole_.neighbourhood.symmetric) {
    EXPECT_DOUBLE_EQ(told.imbalance, expected.imbalance);
  }
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
    EXPECT_EQ(part.body, whole.body);
    EXPECT_EQ(part.closure, whole.closure);
    EXPECT_EQ(part.farthest, whole.farthest);
    EXPECT_EQ(part.material.density, whole.material.density);
    EXPECT_EQ(part.kernel_volumes, whole.kernel_volumes);
    EXPECT_EQ(part.size, whole.size);
    EXPECT_EQ(part.surfels, whole.surfels);
    EXPECT_EQ(part.mass, whole.mass);
    EXPECT_EQ(part.volume, whole.volume);
    EXPECT_TRUE(part.centre == whole.centre && part.origin == whole.origin);
  }
  EXPECT_EQ(here_.global_count(), whole_.size());
  EXPECT_EQ(here_.global_surfel_count(), whole_.global_surfel_count());
  EXPECT_EQ(built_of(case_, cut_).digest, model_digest(whole_));
  EXPECT_EQ(built_of(case_, cut_).digest_before_4, model_digest_before_4(whole_));
  EXPECT_EQ(here_.degenerate.describe(), whole_.degenerate.describe());
  EXPECT_EQ(here_.warnings, whole_.warnings);
}

TEST_P(BuiltShares, KeepTilesWhole) {
  const std::vector<Index>& place = here_.share->place;
  if (cut_.options.tile == 0) {
    EXPECT_THAT(place, IsEmpty());
    return;
  }
  // A tile has one owner.
  std::vector<std::int64_t> owners(static_cast<std::size_t>(whole_.size() + cuda::tile_size), 0);
  for (Index i = 0; i < here_.size(); ++i) {
    if (here_.owns(i)) owners.at(place.at(i) / cuda::tile_size) = 1;
  }
  world().add(owners);
  EXPECT_LE(*std::max_element(owners.begin(), owners.end()), 1);
  EXPECT_EQ(place, values_of(*here_.share, cuda::make_tiling(whole_).place));
}

INSTANTIATE_TEST_SUITE_P(
    Bodies, BuiltShares,
    ::testing::Combine(
        ::testing::ValuesIn(build_cases()),
        ::testing::Values(Cut{"Metis", {{Partitioner::metis}, 0}},
                          Cut{"Coarse", {{Partitioner::metis}, 0, nullptr, 60, 400}},
                          Cut{"Curve", {{Partitioner::curve}, 0}},
                          Cut{"Groups", {{Partitioner::bisection}, cuda::tile_size, nullptr, 4}},
                          Cut{"Tiles", {{Partitioner::bisection}, cuda::tile_size}},
                          Cut{"Device", {{Partitioner::curve}, cuda::tile_size, &surveyor}},
                          Cut{"Gpu", {{Partitioner::curve}, cuda::tile_size}, true},
                          Cut{"GpuSearch", {{Partitioner::curve}, cuda::tile_size}, true, true})),
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
  std::vector<BodyRequest> wrong(14, shape("beam", 0.2));
  wrong[0].fixed.push_back({.select = {.region = "z*"}});
  wrong[1].fixed.push_back({.select = {.box = Selection::Box{{7, 7, 7}, {8, 8, 8}}}});
  wrong[2].loads.push_back({.select = {.indices = std::vector<Index>{3, 99999}}});
  wrong[3].fixed.push_back({.select = {.region = "x-"}});
  wrong[3].fixed.push_back({.select = {.indices = std::vector<Index>{0}}});
  wrong[4].source.shape.spacing = 50;
  wrong[5].closure = 1e-3;  // of a body without a surface
  wrong[5].source.shape.surface = false;
  wrong[6].inclusions.push_back({.select = {.box = Selection::Box{{7, 7, 7}, {8, 8, 8}}}});
  wrong[6].inclusions[0].material = testing::rubber();
  for (std::size_t k = 8; k < wrong.size(); ++k) {
    wrong[k].inclusions.push_back({.select = {.region = "x-"}, .material = testing::rubber()});
    wrong[k].inclusions[0].select.where = "test";
  }
  wrong[8].inclusions[0].select.region = "nowhere";
  wrong[9].inclusions[0].select = {.all = true};
  wrong[10].inclusions[0].select = {.indices = std::vector<Index>{99999}, .where = "test"};
  // By the numbers of the cloud, which has its inclusion at its start.
  wrong[11].fixed.push_back({.select = {.region = "x-"}});
  wrong[11].fixed.push_back({.select = {.indices = std::vector<Index>{0}}});
  wrong[12].loads.push_back({.select = {.indices = std::vector<Index>{3, 99999}}});
  wrong[13] = shape("sphere", 0.2);  // whose volumes would have to change too far
  wrong[13].source.shape.jitter = 0.5;
  wrong[13].neighbourhood.nearest = 4;
  wrong[13].closure = 1e-12;
  wrong[7].material.density = 1e-320;  // which a mass cannot be told from 0 by
  for (const BodyRequest& body : wrong) {
    Scene scene{.bodies = {body}};
    const std::string expected = words_of([&] { build_model(scene); });
    const std::string said = words_of([&] { build_share(world(), scene, {}); });
    EXPECT_THAT(expected, ::testing::Not(IsEmpty()));
    EXPECT_THAT(said, ::testing::HasSubstr(expected));
    // Behind other bodies, too.
    scene.bodies.insert(scene.bodies.begin(), 3, shape("block", 0.3));
    EXPECT_THAT(words_of([&] { build_share(world(), scene, {}); }), ::testing::HasSubstr(expected));
    // Of which one holds phyxels of its own.
    scene.bodies[1].fixed.push_back({.select = {.region = "x-"}});
    scene.bodies[1].loads.push_back({.select = {.region = "x+"}, .force = {1, 0, 0}});
    EXPECT_THAT(words_of([&] { build_share(world(), scene, {}); }), ::testing::HasSubstr(expected));
  }
  EXPECT_THAT(
      words_of([&] { build_model({.bodies = {wrong[13]}}); }),
      ::testing::ContainsRegex("phyxel [0-9]+ would have to change its volume by -?[0-9]+%"));
  // No volume, by the kernel: all in one place.
  Cloud heap;
  heap.position.assign(20, Vec3d{1, 1, 1});
  EXPECT_THAT(words_of([&] { build_share(world(), plain(), {heap}, {}); }),
              ::testing::HasSubstr("of body \"body\" has a mass of"));
  const std::vector<Cloud> one{testing::lattice(5, 5, 5, 0.1)};
  EXPECT_EQ(words_of([&] { build_share(world(), plain(2), one, {}); }),
            words_of([&] { build_model(plain(2), one); }));
  // Clouds that do not fit, before a rank takes its piece.
  for (const auto change : {+[](Cloud& c) { c.volume.resize(3); },
                            +[](Cloud& c) {
                              c.regions["end"] = {3, 125};
                            },
                            +[](Cloud& c) { c.surface.position.resize(2); }}) {
    Cloud wrong_cloud = one[0];
    change(wrong_cloud);
    const std::string expected = words_of([&] { build_model(plain(), std::vector{wrong_cloud}); });
    EXPECT_THAT(expected, ::testing::HasSubstr("body \"body\""));
    EXPECT_THAT(words_of([&] { build_share(world(), plain(), {wrong_cloud}, {}); }),
                ::testing::HasSubstr(expected));
  }
  if (world().size() == 1) return;
  // Not the same file for all.
  const std::vector<Cloud> own{testing::lattice(5 + world().rank(), 5, 5, 0.1)};
  EXPECT_THAT(words_of([&] { build_share(world(), plain(), own, {}); }),
              ::testing::HasSubstr("different bodies"));
}

/// A backend counts what is exchanged in steps, and nothing of the set-up, which exchanges ghosts
/// to close gradients.
TEST(BuiltShare, HasSentNothingBeforeTheFirstStep) {
  Scene scene{.bodies = {shape("beam", 0.1)}};
  scene.bodies[0].closure = 1e-2;
  const Model share = build_share(world(), scene, {}).model;
  const auto backend = make_cpu_backend(share, Precision::double_, 1);
  const auto sent = [&] { return backend->exchanges()->traffic.bytes_sent; };
  EXPECT_EQ(sent(), 0);
  backend->upload(initial_state(share, scene, 1e-6));
  backend->step(0, 1e-6);
  const std::int64_t of_one = sent();
  EXPECT_EQ(of_one > 0, !share.share->halo->peers.empty());
  backend->step(1, 1e-6, 3);
  EXPECT_EQ(sent(), 4 * of_one);
}

#if !PHYXEL_SANITIZED  // whose memory holds more than the program's

/// A share is refused before it is built if it would not fit: a rank asks for about as much memory
/// as it then takes at most, whatever the number of ranks.
class MemoryOfBuiltShare : public ::testing::TestWithParam<double> {};
INSTANTIATE_TEST_SUITE_P(Closure, MemoryOfBuiltShare, ::testing::Values(0, 1e-2));

TEST_P(MemoryOfBuiltShare, IsWhatItAsksFor) {
  Scene scene{.bodies = {shape("beam", 0.05)}};  // 24,000 phyxels: tens of MB
  scene.bodies[0].neighbourhood.nearest = 20;
  scene.bodies[0].closure = GetParam();
  // Few groups, as bodies have that are large enough to fill a machine.
  const ShareOptions options{{Partitioner::metis}, 0, nullptr, 60, 400};
  malloc_trim(0);
  const MemoryGrowth growth;
  const Index phyxels = build_share(world(), scene, options).model.global_count();
  const auto taken =
      static_cast<double>(world().largest(static_cast<std::int64_t>(growth.largest())));
  ASSERT_GT(taken, 100.0 * phyxels / world().size());  // positions, lists and moments alone

  const double usable = usable_memory();
  share_host_memory(1);
  const double host = usable_memory();
  const auto built_in = [&](double memory) {
    share_host_memory(static_cast<int>(std::lround(host / memory)));
    std::string refusal;
    try {
      build_share(world(), scene, options);
    } catch (const Error& error) {
      refusal = error.what();
    }
    share_host_memory(static_cast<int>(std::lround(host / usable)));
    return refusal;
  };
  // What ghosts take depends on the cut, and what lists take on the neighbourhood: 0.85 to 1.6
  // times as much as is taken here was asked for on one to three ranks.
  EXPECT_THAT(built_in(0.7 * taken), ::testing::HasSubstr("the scene: 24000 phyxels need about"));
  EXPECT_EQ(built_in(2.1 * taken), "");
}

#endif

}  // namespace
}  // namespace phyxel
