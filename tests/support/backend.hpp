/// The backend under test: that of the CPU, or in programs built with PHYXEL_TEST_CUDA that of the
/// GPU. Without a GPU these programs skip all their tests.
#pragma once

#include "phyxel/backend.hpp"

#if defined(PHYXEL_TEST_CUDA)
#include <gtest/gtest.h>

#include "device.hpp"
#include "solver/cuda_backend.hpp"
#endif

namespace phyxel::testing {

/// Makes the backend under test. @param threads threads of the CPU
inline std::unique_ptr<Backend> make_test_backend(const Model& model, Precision precision,
                                                  [[maybe_unused]] int threads = 0) {
#if defined(PHYXEL_TEST_CUDA)
  return make_cuda_backend(model, precision);
#else
  return make_cpu_backend(model, precision, threads);
#endif
}

#if defined(PHYXEL_TEST_CUDA)
/// Skips all tests of a program for GPUs if there is no GPU.
class NeedsDevice : public ::testing::Environment {
 public:
  void SetUp() override {
    if (cuda_devices().empty()) GTEST_SKIP() << "no CUDA device";
  }
};
inline const auto* const needs_device = ::testing::AddGlobalTestEnvironment(new NeedsDevice);
#endif

}  // namespace phyxel::testing
