/// Stages of a set-up: each is told by its name, grows from 0 to 1, and may be abandoned.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <omp.h>

#include <stdexcept>
#include <thread>

#include "phyxel/device.hpp"
#include "phyxel/mesh.hpp"
#include "phyxel/model.hpp"
#include "phyxel/progress.hpp"
#include "phyxel/solver.hpp"
#include "stage.hpp"
#include "support/folder.hpp"

namespace phyxel {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::IsSupersetOf;

/// A cube as a mesh, with closed gradients: every stage that one rank has.
const char* const cube =
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nv 0 0 1\nv 1 0 1\nv 0 1 1\nv 1 1 1\n"
    "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";

/// What an observer has heard: shares of one stage after the other.
struct Heard {
  std::vector<std::string> names;
  std::vector<std::vector<double>> shares;
  StageObserver observer() {
    return [this](std::string_view stage, double share) {
      if (share == 0) {
        names.emplace_back(stage);
        shares.emplace_back();
      }
      ASSERT_FALSE(names.empty());
      EXPECT_EQ(stage, names.back());
      shares.back().push_back(share);
    };
  }
  /// Returns the names of the stages that reported progress between their begin and their end.
  std::vector<std::string> with_progress() const {
    std::vector<std::string> stages;
    for (std::size_t s = 0; s < names.size(); ++s) {
      if (shares[s].size() > 2) stages.push_back(names[s]);
    }
    return stages;
  }
};

class Stages : public test::Folder {
 protected:
  /// Sets up what `phyxel run --dry-run` does.
  static void set_up(const Scene& scene) {
    const Model model = build_model(scene);
    step_limit(model, 1);
  }
  Scene scene() const {
    write("cube.obj", cube);
    return read_scene(write("scene.toml", R"(
[time]
end = 1
[[body]]
mesh = "cube.obj"
phyxels = 300
closure = 1e-3
material = { young = 1e5, poisson = 0.3, density = 1000 }
)"));
  }
};

TEST_F(Stages, EachIsToldFromItsBeginningToItsEnd) {
  Heard heard;
  {
    const ObserveStages observing(heard.observer());
    set_up(scene());
  }
  EXPECT_THAT(heard.names,
              ElementsAre("reading the mesh", "inspecting the surface", "filling the surface",
                          "phyxels on the surface", "placing phyxels", "evening out distances",
                          "volumes of phyxels", "distances between phyxels", "neighbours",
                          "phyxels near the surface", "moments", "phyxels near the surface",
                          "closed gradients", "largest time step"));
  for (std::size_t s = 0; s < heard.names.size(); ++s) {
    const std::vector<double>& shares = heard.shares[s];
    EXPECT_EQ(shares.front(), 0) << heard.names[s];
    EXPECT_EQ(shares.back(), 1) << heard.names[s];
    for (std::size_t k = 1; k < shares.size(); ++k) EXPECT_GT(shares[k], shares[k - 1]);
  }
  // These stages report from the observer's thread alone.
  EXPECT_THAT(heard.with_progress(),
              IsSupersetOf({"phyxels on the surface", "evening out distances", "closed gradients",
                            "largest time step"}));

  const std::size_t before = heard.names.size();
  set_up(scene());  // nobody listens any more
  EXPECT_EQ(heard.names.size(), before);
}

TEST_F(Stages, ThatTakeLongTellHowFarTheyAre) {
  // On several threads, the observer's thread may happen to end no part of a parallel loop.
  const int before = omp_get_max_threads();
  omp_set_num_threads(1);
  Heard heard;
  {
    const ObserveStages observing(heard.observer());
    set_up(scene());
  }
  omp_set_num_threads(before);
  EXPECT_THAT(heard.with_progress(),
              ElementsAre("filling the surface", "phyxels on the surface", "evening out distances",
                          "volumes of phyxels", "closed gradients", "largest time step"));
}

TEST_F(Stages, TheInnermostObserverOfAThreadHears) {
  Heard outer, inner;
  const ObserveStages observing(outer.observer());
  std::thread([&] { set_up(scene()); }).join();
  EXPECT_THAT(outer.names, IsEmpty());
  {
    const ObserveStages within(inner.observer());
    in_stage("one", [] {});
  }
  in_stage("two", [] {});
  EXPECT_THAT(inner.names, ElementsAre("one"));
  EXPECT_THAT(outer.names, ElementsAre("two"));
  const ObserveStages nobody{StageObserver()};
  in_stage("three", [] {});
  EXPECT_THAT(outer.names, ElementsAre("two"));
}

/// Wherever it comes, from parallel loops too, the observer's exception reaches the caller.
TEST_F(Stages, AnObserverThatThrowsEndsTheSetUp) {
  const Scene request = scene();
  for (const std::string stage :
       {"reading the mesh", "phyxels on the surface", "volumes of phyxels", "evening out distances",
        "closed gradients", "largest time step"}) {
    bool over = false;
    const ObserveStages observing([&](std::string_view name, double share) {
      EXPECT_FALSE(over) << "heard more after its exception: " << name;
      if (name == stage && (share > 0 || stage == "reading the mesh")) {
        over = true;
        throw std::runtime_error(stage);
      }
    });
    try {
      set_up(request);
      ADD_FAILURE() << stage << " went on";
    } catch (const std::runtime_error& error) {
      EXPECT_EQ(error.what(), stage);
    }
  }
}

TEST(Stage, CountsPartsOnAnyNumberOfThreads) {
  std::vector<double> shares;
  const auto caller = std::this_thread::get_id();
  const ObserveStages observing([&](std::string_view, double share) {
    if (std::this_thread::get_id() == caller) return shares.push_back(share);
    ADD_FAILURE() << "heard on another thread";
  });
  Stage stage("loop");
  stage.reach(0.5);
  stage.expect(100);
#pragma omp parallel for schedule(static) num_threads(3)
  for (int k = 0; k < 100; ++k) stage.count();
  stage.finish();
  ASSERT_GE(shares.size(), 3u);  // the beginning, a half, the end, and what the first thread counts
  EXPECT_TRUE(std::is_sorted(shares.begin(), shares.end()));
  EXPECT_EQ(shares[1], 0.5);
  EXPECT_EQ(shares.back(), 1);
}

}  // namespace
}  // namespace phyxel
