/// Cases that pass, skip and fail, run by tests/suite/skips_test.py only.
#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>

#include "support/skips.hpp"

namespace {

/// An environment that skips all cases, as that of the tests on a GPU.
class SkipsAll : public ::testing::Environment {
  void SetUp() override {
    if (std::getenv("SAMPLE_SKIPS_ALL")) GTEST_SKIP() << "no CUDA device";
  }
};
const auto* const skips_all = ::testing::AddGlobalTestEnvironment(new SkipsAll);

TEST(Sample, Passes) {}

TEST(Sample, Skips) { GTEST_SKIP() << "no CUDA device"; }

TEST(Sample, FailsThoughItSpeaksOfSkips) {
  std::printf("[  SKIPPED ] Sample.Skips: no CUDA device\n");
  FAIL() << "[  SKIPPED ] no CUDA device";
}

TEST(Sample, NeedsATool) { PHYXEL_NEEDS_TOOL(std::getenv("SAMPLE_HAS_TOOL") != nullptr, "fish"); }

}  // namespace
