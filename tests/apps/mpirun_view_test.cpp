/// Sessions of a live view on several ranks under mpirun.
#include <gtest/gtest.h>

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

}  // namespace
}  // namespace phyxel
