/// The models that the 2008 program takes, its refusals, and its limits on a GPU.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "cuda/paper_models.hpp"
#include "phyxel/error.hpp"
#include "phyxel/physics/hooke.hpp"
#include "support/clouds.hpp"
#include "support/paper_reference.hpp"

namespace phyxel::paper {
namespace {

using phyxel::testing::relative_error;
using ::testing::HasSubstr;

TEST(PaperGpu, TwoBodiesOfDifferentMaterialsTakeTurns) {
  if (no_gpu()) GTEST_SKIP() << "no CUDA device";
  const Model &bug = model_named("horn_bug"), &head = model_named("alien_head");
  const State bug_start = hanging_start(bug, "horn_bug"),
              head_start = hanging_start(head, "alien_head");
  const auto one = make_gpu_backend(bug), two = make_gpu_backend(head);
  Solver first(*one, bug_start), second(*two, head_start);
  for (int s = 0; s < 50; ++s) first.step(), second.step();
  const State bug_end = first.state(), head_end = second.state();
  const auto run_alone = [](const Model& model, const State& start) {
    const auto backend = make_gpu_backend(model);
    Solver solver(*backend, start);
    solver.step(50);
    return solver.state().displacement;
  };
  EXPECT_TRUE(bug_end.displacement == run_alone(bug, bug_start));
  EXPECT_TRUE(head_end.displacement == run_alone(head, head_start));
}

TEST(PaperGpu, ALaunchThatCudaRefusesIsNamed) {
  if (no_gpu()) GTEST_SKIP() << "no CUDA device";
  try {
    make_gpu_backend(model_named("dino"), {.block = 2048});
    FAIL() << "2048 threads a block are more than any GPU takes";
  } catch (const DeviceError& error) {
    EXPECT_THAT(error.what(), HasSubstr("precalcImutableValues<<<1, 2048>>>"));
    EXPECT_THAT(error.what(), HasSubstr("\"dino\", 575 phyxels"));
    EXPECT_THAT(error.what(), HasSubstr("cudaErrorInvalid"));
  }
}

TEST(PaperGpu, ADeviceThatIsNotThereIsNamed) {
  if (no_gpu()) {
    try {
      make_gpu_backend(model_named("dino"));
      FAIL();
    } catch (const DeviceError& error) {
      EXPECT_THAT(error.what(), HasSubstr("allowed"));
      EXPECT_EQ(error.code(), ExitCode::device_failed);
    }
    return;
  }
  try {
    make_gpu_backend(model_named("dino"), {.device = 99});
    FAIL();
  } catch (const DeviceError& error) {
    EXPECT_THAT(error.what(), HasSubstr("device 99"));
    EXPECT_THAT(error.what(), HasSubstr("allowed 0 to"));
  }
}

TEST(PaperGpu, EntriesBeyond31BitsOfTheMatrixAreFound) {
  if (no_gpu()) GTEST_SKIP() << "no CUDA device";
  const Model model = block_of(30000);  // 2.7e9 numbers
  use_cuda_device(0);
  if (cuda_free_memory() < std::size_t{12} << 30) GTEST_SKIP() << "under 12 GiB are free";
  std::vector<Vec3d> dense, csr;
  for (const ForceStore store : {ForceStore::dense, ForceStore::csr}) {
    const auto backend = make_gpu_backend(model, {.store = store});
    backend->upload(testing::state_of(deformation(model), 0));
    backend->internal_forces(store == ForceStore::dense ? dense : csr);
  }
  EXPECT_TRUE(dense == csr);
  EXPECT_GT(norm(dense.back()), 0);
}

TEST(PaperModel, SixteenBitsNameAtMost65535Phyxels) {
  const Model most = block_of(65535), more = block_of(65536);
  EXPECT_NO_THROW(check_paper_model(most));
  EXPECT_NO_THROW(make_sequential_backend<float>(most));
  try {
    make_gpu_backend(more);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("65536 phyxels"));
    EXPECT_THAT(error.what(), HasSubstr("allowed: at most 65535"));
  }
}

/// Indices of the last phyxel fit 16 bits.
TEST(PaperGpu, TheLargestBodyGetsTheForcesOfTheSequentialProgram) {
  if (no_gpu()) GTEST_SKIP() << "no CUDA device";
  const Model most = block_of(65535);
  const auto backend = make_gpu_backend(most, {.store = ForceStore::csr});
  const auto reference = make_sequential_backend<double>(most);
  std::vector<Vec3d> force, exact;
  for (PaperBackend* b : {backend.get(), reference.get()}) {
    b->upload(testing::state_of(deformation(most), 0));
    b->internal_forces(b == backend.get() ? force : exact);
  }
  EXPECT_LE(relative_error(force, exact), 130 * single);
}

TEST(PaperModel, RefusesWhatTheProgramOf2008CouldNotDo) {
  const auto refused = [](Scene scene, const char* why) {
    try {
      check_paper_model(paper_model(scene));
      FAIL() << why;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr(why));
      EXPECT_THAT(error.what(), HasSubstr("allowed"));
    }
  };
  EXPECT_NO_THROW(check_paper_model(paper_model(body_scene("horn_bug"))));
  refused(body_scene("horn_bug", 2), "2 bodies");
  Scene scene = body_scene("horn_bug");
  scene.bodies[0].volume_rule = VolumeRule::geometry;
  refused(scene, "geometric volumes");
  scene = body_scene("horn_bug");
  scene.bodies[0].material.damping = 1;
  refused(scene, "damping");
  scene = body_scene("horn_bug");
  scene.bodies[0].material.volume_stiffness = 1;
  refused(scene, "volume conservation");
  scene = body_scene("horn_bug");
  scene.bodies[0].neighbourhood = {.support = NeighbourhoodRule::Support::pairwise};
  refused(scene, "supports of pairs");
  scene = body_scene("horn_bug");
  scene.bodies[0].loads.push_back({.select = {.all = true}, .force = {1, 0, 0}});
  refused(scene, "loads");
  scene = body_scene("horn_bug");
  scene.bodies[0].fixed.clear();
  scene.bodies[0].motions.push_back({.select = {.region = "leg"}, .velocity = {1, 0, 0}});
  refused(scene, "prescribed motion");
  EXPECT_THROW(body_scene("dinosaur"), InputError);
}

TEST(PaperModel, TheTensorOfEquationFiveIsHooke) {
  const Material m{.young = 7, .poisson = 0.34, .density = 1};
  const std::vector<double> c = material_tensor(m);
  const Hooke<double> hooke{m.lame_lambda(), m.lame_mu()};
  for (int column = 0; column < 6; ++column) {
    double e[6] = {};
    e[column] = 1;
    const Sym3d s = hooke.stress({e[0], e[3], e[5], e[1], e[4], e[2]});
    const double expected[6] = {s.xx, s.yy, s.zz, s.xy, s.yz, s.xz};
    for (int row = 0; row < 6; ++row) EXPECT_NEAR(c[row * 6 + column], expected[row], 1e-14);
  }
}

TEST(PaperModel, KeepsAtMost32NeighboursAndCarriers) {
  for (const std::string& name : body_names()) {
    const Model& model = model_named(name);
    for (Index i = 0; i < model.size(); ++i) {
      EXPECT_LE(model.neighbourhood.neighbours.length(i), max_neighbours);
    }
    const Csr& carriers = model.surfels.carriers;
    for (Index s = 0; s < carriers.rows(); ++s) {
      ASSERT_LE(carriers.length(s), max_neighbours);
      ASSERT_GE(carriers.length(s), 1);
      // The nearest phyxel of all is among them.
      Index nearest = 0;
      for (Index i = 0; i < model.size(); ++i) {
        if (norm(model.position[i] - model.surfels.position[s]) <
            norm(model.position[nearest] - model.surfels.position[s])) {
          nearest = i;
        }
      }
      const auto row = carriers.row(s);
      ASSERT_TRUE(std::binary_search(row.begin(), row.end(), nearest)) << name << " " << s;
    }
    EXPECT_TRUE(model.degenerate.none()) << model.degenerate.describe();
  }
}

}  // namespace
}  // namespace phyxel::paper
