/// Closed gradients that a GPU finds are those of the CPU, to the last bit.
#include <gtest/gtest.h>

#include <cstring>

#include "device.hpp"
#include "model/device_setup.hpp"
#include "mpi/build_cases.hpp"
#include "setup/closing.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;

template <class T>
bool same_bits(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() &&
         (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0);
}

/// Expects a scene's model to be the same, whichever device closes its gradients.
/// @returns the model
Model expect_same(const Scene& scene, const std::vector<Cloud>& clouds) {
  const DeviceSetup setup{{}, cuda_closing_search()};
  const auto built = [&](const DeviceSetup& by) {
    return clouds.empty() ? build_model(scene, by) : build_model(scene, clouds, by);
  };
  Model host = built({});
  const Model gpu = built(setup);
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
  return host;
}

class ClosingByGpu : public ::testing::Test {
 protected:
  void SetUp() override {
    if (cuda_devices().empty()) GTEST_SKIP() << "no CUDA device";
  }
};

TEST_F(ClosingByGpu, EqualsTheCpusInEveryKindOfBody) {
  int closed_bodies = 0;
  for (const BuildCase& c : build_cases()) {
    SCOPED_TRACE(c.name);
    closed_bodies += !expect_same(c.scene, c.clouds).closing.empty();
  }
  EXPECT_GE(closed_bodies, 4);
}

/// A tolerance that the irregular phyxels alone do not reach, so that all get unknowns.
TEST_F(ClosingByGpu, EqualsTheCpusAtATightTolerance) {
  Scene scene = plain();
  scene.bodies[0] = shape("beam", 0.12);
  scene.bodies[0].closure = 1e-8;
  scene.bodies[0].source.shape.jitter = 0.1;
  EXPECT_FALSE(expect_same(scene, {}).closing.empty());
}

/// Many bodies, each of which ends its search after a number of iterations of its own.
TEST_F(ClosingByGpu, EqualsTheCpusInManyBodies) {
  Scene scene = plain(40);
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    scene.bodies[b] = shape("block", 0.15 + 0.002 * static_cast<double>(b));
    scene.bodies[b].source.shape.jitter = 0.05 + 0.005 * static_cast<double>(b);
    scene.bodies[b].closure = b % 3 == 0 ? 1e-2 : 1e-4;
  }
  EXPECT_FALSE(expect_same(scene, {}).closing.empty());
}

}  // namespace
}  // namespace phyxel
