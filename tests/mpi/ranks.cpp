/// main() of the tests on several ranks: each rank runs all tests, and the first one prints. The
/// program fails if any rank does.
#include "ranks.hpp"

#include <gtest/gtest.h>

#include <optional>

#include "support/skips.hpp"

namespace phyxel::test {
namespace {

std::optional<Ranks> the_ranks;

/// Output of the other ranks: failures only.
class OnlyFailures : public ::testing::EmptyTestEventListener {
  void OnTestPartResult(const ::testing::TestPartResult& result) override {
    if (!result.failed()) return;
    std::fprintf(stderr, "rank %d: %s:%d: %s\n", world().rank(),
                 result.file_name() ? result.file_name() : "", result.line_number(),
                 result.summary());
  }
};

/// Aborts on an exception from a test, for which the other ranks would wait for ever.
class EndsAllAtExceptions : public ::testing::EmptyTestEventListener {
  void OnTestPartResult(const ::testing::TestPartResult& result) override {
    if (result.failed() && !result.file_name()) world().abort(ExitCode{1});
  }
};

}  // namespace

const Ranks& all_ranks() { return *the_ranks; }
const MpiCommunicator& world() { return all_ranks().communicator(); }

}  // namespace phyxel::test

int main(int argc, char** argv) {
  using namespace phyxel::test;
  ::testing::InitGoogleTest(&argc, argv);
  the_ranks.emplace(argc, argv);
  auto& listeners = ::testing::UnitTest::GetInstance()->listeners();
  if (world().rank() > 0) {
    delete listeners.Release(listeners.default_result_printer());
    listeners.Append(new OnlyFailures);
  }
  if (world().size() > 1) listeners.Append(new EndsAllAtExceptions);
  const int failed = static_cast<int>(world().largest(static_cast<std::int64_t>(RUN_ALL_TESTS())));
  const int own_code = exit_code_of(failed, world().rank() == 0);
  // The program is skipped if no rank has run a case.
  const int code = static_cast<int>(world().smallest(static_cast<std::int64_t>(own_code)));
  the_ranks->close();
  return code;
}
