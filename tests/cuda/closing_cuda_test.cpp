/// Closed gradients that a GPU finds are those of the CPU, to the last bit.
#include <gtest/gtest.h>

#include <cstring>

#include "device.hpp"
#include "model/assembly.hpp"
#include "model/device_setup.hpp"
#include "mpi/build_cases.hpp"
#include "setup/closing.hpp"
#include "setup/survey.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;

template <class T>
bool same_bits(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() &&
         (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0);
}

Model built(const Scene& scene, const std::vector<Cloud>& clouds, const DeviceSetup& by) {
  return clouds.empty() ? build_model(scene, by) : build_model(scene, clouds, by);
}

void expect_same(const Model& gpu, const Model& host) {
  EXPECT_TRUE(same_bits(gpu.closing, host.closing));
  EXPECT_TRUE(same_bits(gpu.volume, host.volume));
  EXPECT_TRUE(same_bits(gpu.mass, host.mass));
  EXPECT_EQ(gpu.warnings, host.warnings);
  EXPECT_EQ(gpu.loads.size(), host.loads.size());
  for (std::size_t l = 0; l < gpu.loads.size(); ++l) {
    EXPECT_TRUE(same_bits(gpu.loads[l].force, host.loads[l].force)) << l;
  }
  for (std::size_t p = 0; p < gpu.parts.size(); ++p) {
    EXPECT_EQ(gpu.parts[p].volume, host.parts[p].volume) << p;
    EXPECT_EQ(gpu.parts[p].closure, host.parts[p].closure) << p;
  }
}

/// What tests have seen.
struct Seen {
  int closed = 0, searched = 0;  ///< Closed models, and those without lists on the host.
};

/// Expects a scene's model to be the same, whichever device closes its gradients, from lists of the
/// host or of its own.
void expect_same(const Scene& scene, const std::vector<Cloud>& clouds, Seen& seen) {
  const Model host = built(scene, clouds, {});
  if (host.closing.empty()) return;
  ++seen.closed;
  expect_same(built(scene, clouds, {{}, cuda_closing_search()}), host);
  if (!can_survey_on_cuda(scene) || host.has_inclusions()) return;
  for (std::size_t b = 0; b < clouds.size(); ++b) {
    if (needs_lists_on_host(scene.bodies[b], clouds[b])) return;
  }
  const Model gpu = built(scene, clouds, {cuda_surveyor(), cuda_closing_search()});
  EXPECT_FALSE(gpu.has_lists());
  expect_same(gpu, host);
  ++seen.searched;
}

class ClosingByGpu : public ::testing::Test {
 protected:
  void SetUp() override {
    if (cuda_devices().empty()) GTEST_SKIP() << "no CUDA device";
  }
};

TEST_F(ClosingByGpu, EqualsTheCpusInEveryKindOfBody) {
  Seen seen;
  for (const BuildCase& c : build_cases()) {
    SCOPED_TRACE(c.name);
    expect_same(c.scene, c.clouds, seen);
  }
  EXPECT_GE(seen.closed, 4);
  EXPECT_GE(seen.searched, 2);
}

/// A tolerance that the irregular phyxels alone do not reach, so that all get unknowns.
TEST_F(ClosingByGpu, EqualsTheCpusAtATightTolerance) {
  Scene scene = plain();
  scene.bodies[0] = shape("beam", 0.12);
  scene.bodies[0].closure = 1e-8;
  scene.bodies[0].source.shape.jitter = 0.1;
  Seen seen;
  expect_same(scene, {}, seen);
  EXPECT_EQ(seen.searched, 1);
}

/// Many bodies, each of which ends its search after a number of iterations of its own.
TEST_F(ClosingByGpu, EqualsTheCpusInManyBodies) {
  Scene scene = plain(40);
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    scene.bodies[b] = shape("block", 0.15 + 0.002 * static_cast<double>(b));
    scene.bodies[b].source.shape.jitter = 0.05 + 0.005 * static_cast<double>(b);
    scene.bodies[b].closure = b % 3 == 0 ? 1e-2 : 1e-4;
  }
  Seen seen;
  expect_same(scene, {}, seen);
  EXPECT_EQ(seen.searched, 1);
}

}  // namespace
}  // namespace phyxel
