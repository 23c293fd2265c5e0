/// Reports of skipped tests: a skipped case is written to a file that scripts/test.sh summarises, a
/// program that skips all its cases ends with CTest's exit code for skips, and in CI a missing tool
/// is a failure.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <string>
#include <string_view>

namespace phyxel::test {

/// The exit code of a skipped test (`SKIP_RETURN_CODE` in cmake/PhyxelOptions.cmake).
constexpr int skipped_exit_code = 77;

/// True in continuous integration: `CI` is set to anything but "", "0" and "false".
inline bool in_ci() {
  const char* const set = std::getenv("CI");
  const std::string_view ci = set ? set : "";
  return !ci.empty() && ci != "0" && ci != "false";
}

/// Adds a line "name, tab, reason" to the file that the environment variable `PHYXEL_SKIPS` names;
/// does nothing without it.
inline void count_skip(const std::string& name, std::string reason) {
  const char* const file = std::getenv("PHYXEL_SKIPS");
  if (!file) return;
  while (!reason.empty() && reason.back() == '\n') reason.pop_back();
  for (char& c : reason) {
    if (c == '\n' || c == '\t') c = ' ';
  }
  std::ofstream(file, std::ios::app) << name + '\t' + reason + '\n' << std::flush;
}

/// The reason of a test's skip; empty if it was not skipped.
inline std::string skip_reason(const ::testing::TestResult& result) {
  for (int i = 0; i < result.total_part_count(); ++i) {
    const ::testing::TestPartResult& part = result.GetTestPartResult(i);
    if (part.skipped()) return part.message();
  }
  return "";
}

/// Counts every skipped case and returns the exit code of a test program whose `RUN_ALL_TESTS` has
/// returned `failed`. A failure is reported as one whatever was skipped. A skip in an environment's
/// `SetUp` skips all cases.
///
/// @param counts false on ranks other than the first, which have the same skips
inline int exit_code_of(int failed, bool counts = true) {
  const ::testing::UnitTest& all = *::testing::UnitTest::GetInstance();
  const bool none_ran = all.ad_hoc_test_result().Skipped();
  int chosen = 0, skipped = 0;
  for (int s = 0; s < all.total_test_suite_count(); ++s) {
    const ::testing::TestSuite& suite = *all.GetTestSuite(s);
    for (int t = 0; t < suite.total_test_count(); ++t) {
      const ::testing::TestInfo& test = *suite.GetTestInfo(t);
      if (!test.should_run()) continue;
      ++chosen;
      if (!none_ran && !test.result()->Skipped()) continue;
      ++skipped;
      if (counts) {
        count_skip(std::string(suite.name()) + "." + test.name(),
                   skip_reason(none_ran ? all.ad_hoc_test_result() : *test.result()));
      }
    }
  }
  if (failed != 0) return failed;
  return chosen > 0 && skipped == chosen ? skipped_exit_code : 0;
}

}  // namespace phyxel::test

/// Skips a test if a tool is missing; in CI the test fails.
#define PHYXEL_NEEDS_TOOL(there, tool)                                                   \
  do {                                                                                   \
    if (there) break;                                                                    \
    if (::phyxel::test::in_ci()) FAIL() << "missing tool: " << (tool) << " (CI is set)"; \
    GTEST_SKIP() << "missing tool: " << (tool);                                          \
  } while (false)
