/// All pairs: laws, terms, boundaries, devices, precisions and methods in every combination of two,
/// on the ranks that run this program.
#include <gmock/gmock.h>

#include <algorithm>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "device.hpp"
#include "partition/share.hpp"
#include "phyxel/error.hpp"
#include "phyxel/shared_model.hpp"
#include "ranks.hpp"
#include "solver/cuda_backend.hpp"
#include "support/pairs/combinations.hpp"
#include "support/pairs/conditions.hpp"
#include "support/pairs/physics.hpp"
#include "support/pairs/refusals.hpp"
#include "support/pairs/scene.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;
using test::all_ranks;
using test::world;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// The device of a row on this rank.
ChosenDevice device_of(const Combination& row) {
  return choose_device(all_ranks(), row.on_gpu() ? "cuda" : "cpu");
}

/// The backend of a row. @param path of a GPU
std::unique_ptr<Backend> backend_of(const Combination& row, const Model& model,
                                    const ChosenDevice& device, CudaPath path) {
  if (!device.gpu) return make_cpu_backend(model, row.working_precision(), 1);
  return make_cuda_backend(model, row.working_precision(), device.gpu->index, path);
}

/// True if the shared memory of a GPU holds the body of a row. A block needs up to 130 kB in float
/// and mixed precision, and up to 222 kB in double, of which compute capabilities 9 and 10 have 232
/// kB; with adaptive supports, whose two passes have lists of their own, 268 kB and more in double.
bool fits_shared_memory(const Combination& row, const Device& gpu) {
  if (!row.is(precision, "double")) return true;
  return (gpu.major == 9 || gpu.major == 10) && !row.is(supports, "adaptive supports");
}

/// The body of a row stays in residence on one rank if nothing changes from step to step and shared
/// memory holds it; otherwise steps are launches over tiles.
void expect_path(const Combination& row, const Device& gpu, const Backend& backend) {
  const bool changes = row.is(boundary, "rollers") || row.is(boundary, "moved") ||
                       row.is(boundary, "growing loads") || row.is(boundary, "pressure");
  const bool is_resident = backend.name().find("resident") != std::string::npos;
  EXPECT_EQ(is_resident, world().size() == 1 && !changes && fits_shared_memory(row, gpu))
      << backend.name() << ": " << backend.path_reason();
}

class Pairs : public ::testing::TestWithParam<Combination> {
 protected:
  void SetUp() override {
    const bool found = world().smallest(std::int64_t{!cuda_devices().empty()}) == 1;
    if (row_.on_gpu() && !found) GTEST_SKIP() << "no CUDA device";
  }
  const Combination& row_ = GetParam();
};

/// The values of phyxels that this rank owns.
template <class T>
std::vector<T> owned_values(const Model& here, const std::vector<T>& values) {
  std::vector<T> own;
  for (Index i = 0; i < here.size(); ++i) {
    if (here.owns(i)) own.push_back(values[i]);
  }
  return own;
}

/// The course of a share has the bits of that of the whole model.
void expect_same_bits(const Model& here, const Course& whole, const Course& share) {
  const auto expect_same = [&](const auto& all, const auto& own, const char* what) {
    const auto expected = here.share ? values_of(*here.share, all) : all;
    EXPECT_TRUE(owned_values(here, expected) == owned_values(here, own)) << what;
  };
  expect_same(whole.after.displacement, share.after.displacement, "displacement");
  expect_same(whole.after.velocity, share.after.velocity, "velocity");
  expect_same(whole.force, share.force, "force");
  EXPECT_EQ(whole.after.history.size(), share.after.history.size());
  for (std::size_t k = 0; k < std::min(whole.after.history.size(), share.after.history.size());
       ++k) {
    expect_same(whole.after.history[k].values, share.after.history[k].values,
                whole.after.history[k].name.c_str());
  }
  const Diagnostics &d = whole.energies, &e = share.energies;
  EXPECT_EQ(d.total_energy(), e.total_energy());
  EXPECT_EQ(d.momentum, e.momentum);
  EXPECT_EQ(d.internal_torque, e.internal_torque);
  ASSERT_EQ(whole.reactions.size(), share.reactions.size());
  for (std::size_t k = 0; k < whole.reactions.size(); ++k) {
    const Reaction &r = whole.reactions[k], &s = share.reactions[k];
    EXPECT_EQ(r.centre, s.centre);
    EXPECT_EQ(r.force, s.force);
    EXPECT_EQ(r.torque, s.torque);
    EXPECT_TRUE(r.work == s.work || (std::isnan(r.work) && std::isnan(s.work))) << r.set;
  }
}

/// A row on all ranks has the bits of one rank; on one rank of a GPU, those of launches over tiles.
/// The first rank checks the physics of the whole model.
TEST_P(Pairs, AreComputed) {
  const Scene scene = scene_of(row_);
  const ChosenDevice device = device_of(row_);
  const Model whole = build_model(scene);
  const double dt = (row_.is(method, "implicit") ? 1.5 : 0.3) * step_limit(whole, 1).largest_step;
  const State start = start_of(row_, scene, whole, dt);
  const std::vector<Vec3d> external = external_forces_of(row_, whole);
  const auto alone = backend_of(row_, whole, device, CudaPath::launches);
  const Course course = course_of(row_, whole, *alone, start, external);

  if (world().size() > 1 || row_.on_gpu()) {
    const SharedModel shared(all_ranks(), scene, device);
    const Model& here = shared.here();
    EXPECT_EQ(shared.digest(), model_digest(whole));
    const auto of_share = [&](const auto& values) {
      return here.share && !values.empty() ? values_of(*here.share, values) : values;
    };
    State start_here = start;
    start_here.displacement = of_share(start.displacement);
    start_here.velocity = of_share(start.velocity);
    const bool resident = row_.is(testing::device, in_residence);
    const auto backend =
        backend_of(row_, here, device, resident ? CudaPath::automatic : CudaPath::launches);
    if (resident) expect_path(row_, *device.gpu, *backend);
    expect_same_bits(here, course, course_of(row_, here, *backend, start_here, of_share(external)));
    world().barrier();  // before memory that other ranks store into is released
  }
  if (all_ranks().leads()) Physics(row_, whole, course, external).check();
}

std::string name_of(const ::testing::TestParamInfo<Combination>& test) {
  return test_name(test.param);
}
INSTANTIATE_TEST_SUITE_P(Cpu, Pairs, ::testing::ValuesIn(rows_on(on_cpu)), name_of);
INSTANTIATE_TEST_SUITE_P(GpuByTiles, Pairs, ::testing::ValuesIn(rows_on(by_tiles)), name_of);
INSTANTIATE_TEST_SUITE_P(GpuInResidence, Pairs, ::testing::ValuesIn(rows_on(in_residence)),
                         name_of);

/// Values of a row that a device refuses together, or not.
bool refuses(int device_level, const std::vector<std::pair<int, int>>& values) {
  for (const auto& [f, a] : values) {
    if (refusal_of_pair({testing::device, device_level, f, a})) return true;
    for (const auto& [g, b] : values) {
      if (f < g && refusal_of_pair({f, a, g, b})) return true;
    }
  }
  return false;
}

/// On each device every pair of values, and every value with each precision of each method, occurs
/// in a row or is refused, and never both.
TEST(PairsOfAllRows, AreCoveredOrRefused) {
  std::vector<std::string> wrong;
  for (const std::string& name : factors()[testing::device].values) {
    const std::vector<Combination> rows = rows_on(name);
    const int here = level_of(testing::device, name);
    const auto look_at = [&](const std::vector<std::pair<int, int>>& values) {
      const bool is_covered = std::any_of(rows.begin(), rows.end(), [&](const Combination& row) {
        return std::all_of(values.begin(), values.end(), [&](const auto& value) {
          return row.levels[value.first] == value.second;
        });
      });
      if (is_covered != refuses(here, values)) return;
      std::string words = name;
      for (const auto& [factor, level] : values) words += ", " + value_name(factor, level);
      wrong.push_back(words);
    };
    for (const LevelPair& pair : all_pairs(level_counts())) {
      if (pair.first == testing::device) {
        if (pair.first_level == here) look_at({{pair.second, pair.second_level}});
        continue;
      }
      look_at({{pair.first, pair.first_level}, {pair.second, pair.second_level}});
      if (pair.first == precision || pair.second != precision) continue;
      for (int m = 0; m < level_counts()[method]; ++m) {
        look_at({{pair.first, pair.first_level}, {precision, pair.second_level}, {method, m}});
      }
    }
    for (const Combination& row : rows) EXPECT_EQ(row.levels[testing::device], here);
  }
  EXPECT_THAT(wrong, IsEmpty());
}

/// The error of what all ranks do; "computed" if there is none.
template <class Work>
std::string error_of(Work&& work) {
  try {
    work();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::bad_input) << error.what();
    return error.what();
  }
  return "computed";
}

void expect_refused(const std::string& message, const std::vector<std::string>& words) {
  for (const std::string& part : words) EXPECT_THAT(message, HasSubstr(part));
}
/// The words of a refusal with the values of a row.
std::vector<std::string> words_for(const Combination& row, std::vector<std::string> words) {
  for (std::string& part : words) {
    for (const Factor factor : {precision, method}) {
      const std::string name = std::string("{") + factors()[factor].name + "}";
      const std::size_t at = part.find(name);
      if (at != std::string::npos) part.replace(at, name.size(), row.value(factor));
    }
  }
  return words;
}

/// Every pair of the list of refusals is refused, with plain values of all other factors.
TEST(RefusedPairs, NameKeyValueAndWhatIsAllowed) {
  int refused = 0;
  for (const LevelPair& pair : all_pairs(level_counts())) {
    const Refusal* const refusal = refusal_of_pair(pair);
    if (!refusal) continue;
    Combination row{Levels(factor_count, 0)};
    row.levels[pair.first] = pair.first_level;
    row.levels[pair.second] = pair.second_level;
    if (row.on_gpu() && cuda_version() == "no CUDA") continue;  // which refuses every model
    SCOPED_TRACE(describe(pair));
    const std::string message = error_of([&] {
      Scene scene = scene_of(row);
      scene.time.step = 1e-3;
      if (row.on_gpu()) {
        make_cuda_backend(build_model(scene), row.working_precision());
        return;
      }
      compute(all_ranks(), scene, make_cloud(scene.bodies[0]));
    });
    expect_refused(message, words_for(row, refusal->words));
    ++refused;
  }
  EXPECT_EQ(refused, cuda_version() == "no CUDA" ? 10 : 14);
}

class RefusedConditions : public ::testing::TestWithParam<Condition> {};

TEST_P(RefusedConditions, NameKeyValueAndWhatIsAllowed) {
  Scene scene = resting_beam();
  scene.time.step = 1e-3;
  Cloud beam = make_cloud(scene.bodies[0]);
  EXPECT_EQ(error_of([&] { compute(all_ranks(), scene, beam); }), "computed");
  GetParam().change(scene, beam);
  expect_refused(error_of([&] { compute(all_ranks(), scene, beam); }), GetParam().words);
}
INSTANTIATE_TEST_SUITE_P(Scenes, RefusedConditions, ::testing::ValuesIn(conditions()),
                         [](const auto& test) { return std::string(test.param.name); });

/// The table of docs/combinations.md has all refusals, and no other.
TEST(Refusals, AreListedInOnePlace) {
  std::ifstream page(PHYXEL_SOURCE_DIR "/docs/combinations.md");
  std::string found;
  for (std::string line; std::getline(page, line);) {
    if (line.rfind("| ", 0) == 0) found += line + '\n';
  }
  std::string expected = "| combination | the error says | reason |\n| --- | --- | --- |\n";
  for (const Refusal& r : refusals()) expected += table_line(r.what, r.words, r.reason) + '\n';
  for (const Condition& c : conditions()) {
    expected += table_line(c.what, c.words, c.reason) + '\n';
  }
  EXPECT_EQ(found, expected) << expected;
}

}  // namespace
}  // namespace phyxel
