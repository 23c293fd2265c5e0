/// Sessions of a live view on several ranks under mpirun.
#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>
#include <sstream>

#include "mpirun.hpp"
#include "phyxel/checkpoint.hpp"
#include "session.hpp"

namespace phyxel {
namespace {

using test::Outcome;

TEST_F(Mpirun, RepeatsASessionOnAnyNumberOfRanks) {
  write("scene.toml", test::session_scene());
  write("session.jsonl", app::text_of(test::session()));
  const auto replayed = [&](int ranks) {
    const std::string out = "out" + std::to_string(ranks);
    const Outcome outcome = run_on(
        ranks, {"view", "scene.toml", "--replay", "session.jsonl", "--headless", "--out", out});
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    std::vector<State> states;
    for (const char* folder : {"saved_0001", "saved_0002"}) {
      states.push_back(
          read_checkpoint(latest_checkpoint(folder_ / out / folder).value_or("none")).state);
    }
    return states;
  };
  const std::vector<State> alone = replayed(0);
  for (const int ranks : {2, 3}) {
    const std::vector<State> together = replayed(ranks);
    for (std::size_t k = 0; k < alone.size(); ++k) {
      EXPECT_TRUE(together[k].displacement == alone[k].displacement) << ranks << " ranks, " << k;
      EXPECT_TRUE(together[k].velocity == alone[k].velocity) << ranks << " ranks, " << k;
    }
  }
}

#ifdef PHYXEL_HAVE_VIEW

/// The processor time of the children of a process so far [s].
double seconds_of_children(pid_t parent) {
  double ticks = 0;
  for (const auto& process : std::filesystem::directory_iterator("/proc")) {
    const std::string name = process.path().filename();
    if (name.find_first_not_of("0123456789") != std::string::npos) continue;
    std::ifstream file(process.path() / "stat");
    std::string text((std::istreambuf_iterator<char>(file)), {});
    const std::size_t name_end = text.rfind(')');
    if (name_end == std::string::npos) continue;
    std::istringstream fields(text.substr(name_end + 1));
    std::string state, skipped;
    pid_t of = 0;
    fields >> state >> of;
    if (of != parent) continue;
    for (int k = 5; k <= 13; ++k) fields >> skipped;  // utime is the 14th field of proc(5)
    double user = 0, system = 0;
    fields >> user >> system;
    ticks += user + system;
  }
  return ticks / static_cast<double>(sysconf(_SC_CLK_TCK));
}

// Ranks that wait in a collective call of MPI would take a core each.
TEST_F(Mpirun, SleepsWhileAViewIsPaused) {
  write("scene.toml", test::session_scene());
  use_ranks(3);
  const pid_t child = start({"view", "scene.toml", "--paused", "--port", "0"});
  ASSERT_TRUE(comes_true(
      [&] { return test::text_of(folder_ / "stdout.txt").find("token") != std::string::npos; }));
  const double before = seconds_of_children(child);
  EXPECT_GT(before, 0);
  constexpr double waited = 2;
  std::this_thread::sleep_for(std::chrono::duration<double>(waited));
  // Three ranks that sleep took 4% of the time of one core where this was measured; those that spin
  // take all cores, or what other work leaves of them.
  EXPECT_LT(seconds_of_children(child) - before, 0.25 * waited);
  kill(child, SIGUSR2);  // mpirun passes it on
  EXPECT_EQ(finish(child).code, 0);
}

#endif

}  // namespace
}  // namespace phyxel
