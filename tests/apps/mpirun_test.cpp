/// The program on several ranks under mpirun: one result, one message, no hang.
#include "mpirun.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>

#include "device.hpp"
#include "phyxel/checkpoint.hpp"

namespace phyxel {
namespace {

namespace fs = std::filesystem;
using test::Outcome;
using test::text_of;
using ::testing::HasSubstr;
using ::testing::Not;

/// Each rank restarts itself with a shorter spin of waiting threads, as the environment that its
/// OpenMP runtime has read shows.
TEST_F(Mpirun, WaitingThreadsOfEachRankSleepSoon) {
#ifdef __clang__
  GTEST_SKIP() << "LLVM's OpenMP runtime waits as it will";
#endif
  write_scene();
  const char* ours = std::getenv("OMP_WAIT_POLICY");
  const std::string kept = ours ? ours : "";
  unsetenv("OMP_WAIT_POLICY");
  use_ranks(2);
  environment_.emplace_back("OMP_DISPLAY_ENV", "VERBOSE");
  const Outcome outcome = run({"run", "scene.toml", "--dry-run"});
  if (ours) setenv("OMP_WAIT_POLICY", kept.c_str(), 1);
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto said = [&](const std::string& what) {
    int times = 0;
    for (auto at = outcome.err.find(what); at != std::string::npos;
         at = outcome.err.find(what, at + 1)) {
      ++times;
    }
    return times;
  };
  EXPECT_EQ(said("GOMP_SPINCOUNT = '"), 4) << outcome.err;
  EXPECT_EQ(said("GOMP_SPINCOUNT = '1000'"), 2) << outcome.err;
}

/// A beam is stretched by two thirds and comes back: its steps are halved and doubled again
/// at the same ones on any number of ranks, and after a stop among the halved ones.
TEST_F(Mpirun, HalvesAndDoublesStepsAlikeOnAllRanks) {
  write("swing.toml", R"([time]
end = 10.6
step = "adaptive"
[solver]
threads = 1
device = "cpu"
[output]
frames_per_second = 1
[[body]]
name = "beam"
shape = "beam"
size = [0.6, 0.2, 0.2]
jitter = 0.1
spacing = 0.05
[body.material]
young = 2e4
poisson = 0.3
density = 1000
law = "neo-hookean"
[[body.fixed]]
region = "x-"
[[body.motion]]
region = "x+"
amplitude = [0.4, 0, 0]
frequency = 0.05
)");
  const Outcome alone = run_on(0, {"run", "swing.toml", "--out", "alone"});
  ASSERT_EQ(alone.code, 0) << alone.err;
  EXPECT_THAT(alone.out, HasSubstr("because a body stiffened, doubled once"));
  expect_same_on_ranks("swing.toml");
  ASSERT_EQ(run_on(3, {"run", "swing.toml", "--out", "parts", "--until", "6"}).code, 0);
  const State middle = read_checkpoint(latest_checkpoint(folder_ / "parts").value()).state;
  const auto end = [&](const char* folder) {
    return read_checkpoint(latest_checkpoint(folder_ / folder).value()).state;
  };
  EXPECT_EQ(middle.dt, end("alone").dt / 2);
  ASSERT_EQ(run_on(2, {"run", "swing.toml", "--out", "parts", "--resume", "auto"}).code, 0);
  EXPECT_EQ(end("parts").step, end("alone").step);
  EXPECT_TRUE(end("parts").looks == end("alone").looks);
  EXPECT_TRUE(end("parts").displacement == end("alone").displacement);
  EXPECT_TRUE(end("parts").velocity == end("alone").velocity);
}

/// The steps of a body that stiffens are halved at the same step on any number of ranks. A search
/// for equilibrium has the same bits, also after all ranks were stopped by a signal to one of them.
TEST_F(Mpirun, HalvesStepsAndStopsSearchesAlikeOnAllRanks) {
  const auto scene = [&](const std::string& method, const std::string& spacing) {
    write("soft.toml",
          "gravity = [30.0, 0.0, 0.0]\n[time]\nend = 0.6\n[solver]\nthreads = 1\n"
          "device = \"cpu\"\nmethod = \"" +
              method + R"("
[output]
frames_per_second = 20
[[body]]
name = "beam"
shape = "beam"
size = [0.6, 0.2, 0.2]
jitter = 0.1
spacing = )" + spacing +
              R"(
[body.material]
young = 2e4
poisson = 0.3
density = 1000
law = "neo-hookean"
[[body.fixed]]
region = "x-"
)");
  };
  scene("verlet", "0.05");
  const Outcome alone = run_on(0, {"run", "soft.toml", "--out", "alone"});
  ASSERT_EQ(alone.code, 0) << alone.err;
  EXPECT_THAT(alone.err, HasSubstr("the time step is halved"));
  const Outcome three = run_on(3, {"run", "soft.toml", "--out", "three"});
  ASSERT_EQ(three.code, 0) << three.err;
  expect_same_files("alone", "three");

  scene("equilibrium", "0.015");  // the search takes a second, and the signal comes long before
  const Outcome rest = run_on(0, {"run", "soft.toml", "--out", "rest"});
  ASSERT_EQ(rest.code, 0) << rest.err;
  use_ranks(2);
  const Outcome stopped = interrupted({"run", "soft.toml", "--out", "parts"},
                                      "parts/phyxels_000000.hdf", SIGUSR2);  // mpirun passes it on
  ASSERT_EQ(stopped.code, 75) << stopped.out << stopped.err;
  const Outcome resumed = run_on(2, {"run", "soft.toml", "--out", "parts", "--resume", "auto"});
  ASSERT_EQ(resumed.code, 0) << resumed.err;
  const auto end_of = [&](const char* folder) {
    return read_checkpoint(latest_checkpoint(folder_ / folder).value()).state.displacement;
  };
  EXPECT_TRUE(end_of("rest") == end_of("parts"));
  // Energies include pairs across the cut.
  EXPECT_EQ(text_of(folder_ / "rest" / "energy.csv"), text_of(folder_ / "parts" / "energy.csv"));

  scene("implicit", "0.05");
  const std::vector<std::string> few{"run", "soft.toml", "--step", "0.05", "--until", "0.1"};
  const auto into = [&](const char* folder) {
    std::vector<std::string> words = few;
    words.insert(words.end(), {"--out", folder});
    return words;
  };
  ASSERT_EQ(run_on(0, into("one")).code, 0);
  ASSERT_EQ(run_on(2, into("two")).code, 0);
  EXPECT_TRUE(end_of("one") == end_of("two"));
  EXPECT_EQ(text_of(folder_ / "one" / "energy.csv"), text_of(folder_ / "two" / "energy.csv"));
}

TEST_F(Mpirun, WritesTheSameBytesOnAnyNumberOfRanks) {
  write_scene();
  const Outcome alone = run_on(0, {"run", "scene.toml", "--out", "alone"});
  ASSERT_EQ(alone.code, 0) << alone.err;
  const struct {
    int ranks;
    const char *partitioner, *stretch;
  } cases[] = {{1, "metis", "7"},
               {2, "metis", "97"},
               {2, "curve", "1000000"},
               {3, "bisection", "1000000"},
               {3, "metis", "97"}};
  for (const auto& c : cases) {
    const std::string out = std::string(c.partitioner) + std::to_string(c.ranks);
    use_ranks(c.ranks);
    environment_.emplace_back("PHYXEL_STRETCH", c.stretch);
    const Outcome outcome =
        run({"run", "scene.toml", "--out", out, "--partitioner", c.partitioner});
    ASSERT_EQ(outcome.code, 0) << outcome.out << outcome.err;
    if (c.ranks > 1) {
      EXPECT_THAT(outcome.out, HasSubstr(std::to_string(c.ranks) + " ranks, cut by"));
    }
    expect_same_files("alone", out);
  }
}

TEST_F(Mpirun, GpusWriteTheSameBytesOnAnyNumberOfRanks) {
  if (cuda_devices().empty()) GTEST_SKIP() << "no CUDA device";
  write_scene();
  ASSERT_EQ(run_on(0, {"run", "scene.toml", "--device", "cuda", "--out", "alone"}).code, 0);
  for (const int count : {2, 3}) {
    for (const std::string transport : {"direct", "host"}) {
      const std::string out = transport + std::to_string(count);
      const Outcome outcome = run_on(
          count, {"run", "scene.toml", "--device", "cuda", "--out", out, "--transport", transport});
      ASSERT_EQ(outcome.code, 0) << outcome.out << outcome.err;
      EXPECT_THAT(outcome.out, HasSubstr(transport == "host" ? "MPI" : "CUDA IPC"));
      expect_same_files("alone", out);
    }
  }
}

TEST_F(Mpirun, DoctorListsTheRanksOnce) {
  const Outcome outcome = run_on(2, {"doctor", "--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto found = nlohmann::json::parse(outcome.out);
  EXPECT_EQ(found["ranks"].size(), 2u);
  EXPECT_EQ(found["gpus"].empty(), cuda_devices().empty());
  EXPECT_EQ(found["device"] == "cpu", cuda_devices().empty());
  EXPECT_NE(found["transport"], "none: one rank");
  EXPECT_THAT(found["mpi"].get<std::string>(), HasSubstr("MPI"));
  const auto alone = nlohmann::json::parse(run_on(0, {"doctor", "--json"}).out);
  EXPECT_EQ(alone["ranks"].size(), 1u);
  EXPECT_EQ(alone["transport"], "none: one rank");
  // Ranks of one host share its memory.
  EXPECT_EQ(alone["memory_bytes"].get<double>(), 2 * found["memory_bytes"].get<double>());
}

/// A plan has the spans of its set-up, and no trajectory.
TEST_F(Mpirun, ProfileOfAPlanHasTheSetUp) {
  write_scene("0.03");
  const Outcome outcome = run_on(0, {"run", "scene.toml", "--dry-run", "--profile", "trace.json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(text_of(folder_ / "trace.json"),
              AllOf(HasSubstr("neighbours"), Not(HasSubstr("writing"))));
}

/// Each rank's spans lie within its own time and include steps; files belong to another thread.
TEST_F(Mpirun, ProfileTellsWhatEachRankDoesWhen) {
  write_scene("0.03");
  const std::vector<std::string> command{"run", "scene.toml", "--quiet", "--profile", "trace.json"};
  const Outcome outcome = run_on(2, command);
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  struct Sum {
    double seconds = 0, end = 0;
  };
  std::map<int, std::map<std::string, Sum>> spans;  // [rank][what]
  const auto trace = nlohmann::json::parse(text_of(folder_ / "trace.json"));
  for (const auto& event : trace["traceEvents"]) {
    if (event["ph"] != "X") continue;
    const bool file = event["name"].get<std::string>().starts_with("writing");
    EXPECT_EQ(event["tid"], file ? 1 : 0);
    Sum& sum = spans[event["pid"]][event["name"]];
    EXPECT_GE(event["ts"].get<double>(), 0);
    sum.seconds += event["dur"].get<double>();
    sum.end = std::max(sum.end, event["ts"].get<double>() + event["dur"].get<double>());
  }
  ASSERT_EQ(spans.size(), 2u);
  for (auto& [rank, of_rank] : spans) {
    for (const char* what : {"model", "stresses", "forces, motion", "waiting for other ranks"}) {
      EXPECT_GT(of_rank[what].seconds, 0) << what;
    }
    EXPECT_LE(of_rank["model"].end, of_rank["forces, motion"].end);
    EXPECT_LE(of_rank["stresses"].seconds, of_rank["stresses"].end);
    EXPECT_EQ(of_rank["writing a frame"].seconds > 0, rank == 0);
  }
  const Outcome again = run_on(2, command);
  EXPECT_EQ(again.code, 2);
  EXPECT_THAT(
      again.err,
      HasSubstr("trace.json: exists already and is kept; allowed: another file, or --force"));
}

/// The plan of two ranks is that of one, and no file is written.
TEST_F(Mpirun, DryRunPrintsThePlanOnce) {
  write_scene();
  const Outcome one = run_on(0, {"run", "scene.toml", "--dry-run", "--json"});
  const Outcome two = run_on(2, {"run", "scene.toml", "--dry-run", "--json"});
  ASSERT_EQ(two.code, 0) << two.err;
  const auto alone = nlohmann::json::parse(one.out), shared = nlohmann::json::parse(two.out);
  for (const char* key : {"phyxels", "surfels", "steps", "time_step_s", "neighbours_per_phyxel"}) {
    EXPECT_EQ(shared[key], alone[key]) << key;
  }
  EXPECT_EQ(shared["ranks"], 2);
  EXPECT_GT(shared["forecast_seconds"], 0.0);
  EXPECT_THAT(run_on(2, {"run", "scene.toml", "--dry-run"}).out, HasSubstr("all ranks'"));
  EXPECT_FALSE(fs::exists(folder_ / "out"));
}

/// All ranks judge a resumed run by the state at the start of the run: this body flies at five
/// times the wave speed, which only the first speed in the checkpoint shows.
TEST_F(Mpirun, AFastBodyGoesOnOnAllRanks) {
  write("scene.toml", R"(
[time]
end = 0.05
[output]
directory = "out"
frames_per_second = 100
[[body]]
name = "bullet"
shape = "beam"
size = [0.4, 0.2, 0.2]
spacing = 0.1
velocity = [50, 0, 0]
[body.material]
young = 1e5
poisson = 0
density = 1000
)");
  ASSERT_EQ(run_on(2, {"run", "scene.toml", "--device", "cpu"}).code, 0);
  const Outcome outcome =
      run_on(2, {"run", "scene.toml", "--device", "cpu", "--until", "0.1", "--resume", "auto"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("written     11 frames"));
}

TEST_F(Mpirun, StopsAndGoesOnOnOtherRanks) {
  write_scene("1.5");
  const std::vector<std::string> arguments{"run", "scene.toml", "--out"};
  const auto with = [&](const std::string& out, std::vector<std::string> more = {}) {
    std::vector<std::string> all = arguments;
    all.push_back(out);
    all.insert(all.end(), more.begin(), more.end());
    return all;
  };
  ASSERT_EQ(run_on(0, with("alone")).code, 0);
  use_ranks(2);
  const pid_t child = start(with("parts"));
  wait_for("parts/phyxels_000003.hdf");
  kill(child, SIGUSR2);  // mpirun hands it on, where it follows SIGTERM by SIGKILL
  const Outcome stopped = finish(child);
  EXPECT_EQ(stopped.code, 75) << stopped.out << stopped.err;
  EXPECT_EQ(count_of("--resume auto", stopped.err), 1) << stopped.err;
  ASSERT_EQ(run_on(3, with("parts", {"--resume", "auto"})).code, 0);
  const auto whole = latest_checkpoint(folder_ / "alone"),
             parts = latest_checkpoint(folder_ / "parts");
  ASSERT_TRUE(whole && parts);
  const State a = read_checkpoint(*whole).state, b = read_checkpoint(*parts).state;
  EXPECT_EQ(a.step, b.step);
  EXPECT_TRUE(a.displacement == b.displacement);
  EXPECT_TRUE(a.velocity == b.velocity);
  EXPECT_EQ(text_of(folder_ / "alone" / "energy.csv"), text_of(folder_ / "parts" / "energy.csv"));
}

/// A checkpoint of three ranks is read on two, on one, and on three ranks, in short chunks.
TEST_F(Mpirun, CheckpointsGoOnOnOtherRanksToTheByte) {
  write_scene();
  for (const char* precision : {"float", "double"}) {
    const std::string alone = std::string("alone_") + precision;
    const auto run_to = [&](int ranks, const std::string& out, const char* end, bool resumes) {
      use_ranks(ranks);
      environment_.emplace_back("PHYXEL_STRETCH", "101");
      std::vector<std::string> arguments{"run",   "scene.toml", "--precision", precision,
                                         "--out", out,          "--until",     end};
      if (resumes) arguments.insert(arguments.end(), {"--resume", "auto"});
      const Outcome outcome = run(arguments);
      ASSERT_EQ(outcome.code, 0) << outcome.out << outcome.err;
    };
    run_to(0, alone, "0.05", false);
    run_to(0, alone, "0.1", true);
    for (const int ranks : {0, 2, 3}) {
      const std::string out = precision + std::to_string(ranks);
      run_to(3, out, "0.05", false);
      run_to(ranks, out, "0.1", true);
      expect_same_files(alone, out);
    }
  }
}

TEST_F(Mpirun, MoreRanksThanPhyxelsIsOneAnswer) {
  write("scene.toml", R"(
gravity = [0.0, 0.0, -9.81]
[time]
end = 0.05
[output]
directory = "out"
frames_per_second = 200
[[body]]
name = "stick"
shape = "beam"
size = [0.2, 0.1, 0.1]
spacing = 0.1
[body.material]
young = 2e5
poisson = 0.3
density = 1000
)");
  ASSERT_EQ(run_on(0, {"run", "scene.toml", "--device", "cpu", "--out", "alone"}).code, 0);
  const Outcome outcome = run_on(3, {"run", "scene.toml", "--device", "cpu", "--out", "three"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  expect_same_files("alone", "three");
}

}  // namespace
}  // namespace phyxel
