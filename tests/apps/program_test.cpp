/// The program as a user runs it: whole runs, exit codes, messages, signals and restarts.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <thread>

#include "phyxel/checkpoint.hpp"
#include "phyxel/recorder.hpp"
#include "support/beam_program.hpp"

namespace phyxel {
namespace {

namespace fs = std::filesystem;
using test::Outcome;
using test::text_of;
using ::testing::ContainsRegex;
using ::testing::HasSubstr;

using Program = test::BeamProgram;

TEST_F(Program, RunsASceneAndWritesWhatItSays) {
  write_beam();
  const Outcome outcome = run({"run", "beam.toml"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("phyxel-steps/s"));
  EXPECT_THAT(outcome.out, HasSubstr("omega_max"));
  EXPECT_THAT(outcome.out, HasSubstr("neo-hookean"));
  const auto series = read_series(folder_ / "out" / "phyxels.hdf.series");
  ASSERT_EQ(series.size(), 11u);  // 0.2 s at 50 a second, first and last included
  EXPECT_NEAR(series.back().time, 0.2, 1e-12);
  const FrameData first = read_frame(series.front().file), last = read_frame(series.back().file);
  double start = 0, end = 0;
  for (std::size_t i = 0; i < first.point.size(); ++i) {
    start = std::min(start, first.point[i].z);
    end = std::min(end, last.point[i].z);
  }
  EXPECT_LT(end, start - 0.005);  // the free end has dropped
  EXPECT_EQ(read_series(folder_ / "out" / "surface.hdf.series").size(), 11u);
  EXPECT_THAT(text_of(folder_ / "out" / "energy.csv"), HasSubstr("kinetic_energy"));
}

TEST_F(Program, KeepsAnEarlierTrajectoryUnlessForced) {
  write_beam("0.02");
  ASSERT_EQ(run({"run", "beam.toml"}).code, 0);
  const std::string before = text_of(folder_ / "out" / "energy.csv");
  const Outcome refused = run({"run", "beam.toml"});
  EXPECT_EQ(refused.code, 2);
  EXPECT_THAT(refused.err, HasSubstr("out"));
  EXPECT_THAT(refused.err, HasSubstr("--force"));
  EXPECT_EQ(text_of(folder_ / "out" / "energy.csv"), before);
  EXPECT_EQ(run({"run", "beam.toml", "--force"}).code, 0);
}

/// The state arrays of the checkpoint at the end of a run.
State final_state(const fs::path& directory) {
  const auto file = latest_checkpoint(directory);
  EXPECT_TRUE(file.has_value());
  return file ? read_checkpoint(*file).state : State{};
}

TEST_F(Program, StoppedByASignalAndResumedIsBitwiseTheWholeRun) {
  const struct {
    std::string precision;
    int signal;
  } cases[] = {{"float", SIGTERM}, {"double", SIGINT}, {"mixed", SIGTERM}};
  for (const auto& [precision, signal] : cases) {
    write_beam("1.5");
    const std::string whole = "whole_" + precision, parts = "parts_" + precision;
    ASSERT_EQ(run({"run", "beam.toml", "--out", whole, "--precision", precision}).code, 0);
    const Outcome stopped =
        interrupted({"run", "beam.toml", "--out", parts, "--precision", precision},
                    parts + "/phyxels_000003.hdf", signal);
    ASSERT_EQ(stopped.code, 75) << stopped.out << stopped.err;
    EXPECT_THAT(stopped.err, HasSubstr("--resume auto"));
    const State middle = final_state(folder_ / parts);
    const Outcome resumed =
        run({"run", "beam.toml", "--out", parts, "--precision", precision, "--resume", "auto"});
    ASSERT_EQ(resumed.code, 0) << resumed.err;
    EXPECT_THAT(resumed.out, HasSubstr("resumed"));
    const State one = final_state(folder_ / whole), two = final_state(folder_ / parts);
    EXPECT_LT(middle.step, two.step);
    EXPECT_EQ(one.step, two.step);
    EXPECT_TRUE(one.displacement == two.displacement) << precision;
    EXPECT_TRUE(one.velocity == two.velocity) << precision;
    // The outputs are the same too, to the byte where no date or path is involved.
    EXPECT_EQ(text_of(folder_ / whole / "energy.csv"), text_of(folder_ / parts / "energy.csv"));
    EXPECT_EQ(text_of(folder_ / whole / "phyxels.hdf.series"),
              text_of(folder_ / parts / "phyxels.hdf.series"));
  }
}

/// A signal during Newton's method, in a search for equilibrium or a long implicit step, leaves a
/// checkpoint and exit code 75, and a continued run has the same bits. No intermediate state is
/// reported as an equilibrium.
TEST_F(Program, StopsNewtonsMethodWithACheckpointAndGoesOn) {
  for (const std::string method : {"equilibrium", "implicit"}) {
    const std::string parts = "parts_" + method;
    write_beam("2");
    // Seconds of work.
    replace_in_beam("spacing = 0.05", PHYXEL_SANITIZED ? "spacing = 0.016" : "spacing = 0.008");
    replace_in_beam("[solver]", "[solver]\nmethod = \"" + method + "\"");
    replace_in_beam("frames_per_second = 50", "frames_per_second = 1");
    if (method == "implicit") replace_in_beam("end = 2", "end = 2\nstep = 1");
    const pid_t child = start({"run", "beam.toml", "--out", parts});
    wait_for(folder_ / parts / "phyxels_000000.hdf");
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    kill(child, SIGTERM);
    const Outcome stopped = finish(child);
    ASSERT_EQ(stopped.code, 75) << stopped.out << stopped.err;
    EXPECT_THAT(stopped.err, HasSubstr("of Newton's method"));
    EXPECT_THAT(stopped.err, HasSubstr("--resume auto continues"));
    EXPECT_THAT(stopped.err, HasSubstr("residual "));
    EXPECT_THAT(stopped.err, ::testing::Not(HasSubstr("at rest")));
    const State middle = final_state(folder_ / parts);
    EXPECT_EQ(middle.step, 0);
    if (method == "implicit") continue;  // a second one takes minutes under sanitizers
    const Outcome resumed = run({"run", "beam.toml", "--out", parts, "--resume", "auto"});
    ASSERT_EQ(resumed.code, 0) << resumed.err;
    const Outcome whole = run({"run", "beam.toml", "--out", "whole"});
    ASSERT_EQ(whole.code, 0) << whole.err;
    EXPECT_THAT(whole.err, HasSubstr("J at rest"));
    EXPECT_THAT(whole.err, ::testing::Not(HasSubstr("E = 0 J")));
    EXPECT_THAT(whole.err, ::testing::Not(HasSubstr("1.000/1 s")));
    EXPECT_TRUE(final_state(folder_ / parts).displacement ==
                final_state(folder_ / "whole").displacement);
  }
}

/// A very soft neo-Hookean beam stretches until the planned step would be unstable. The step is
/// halved, with a message and an entry in run.json, and a run resumed after that gives the same
/// bytes.
TEST_F(Program, HalvesTheStepOfABodyThatStiffens) {
  write_beam("0.6");
  replace_in_beam("[0.0, 0.0, -9.81]", "[30.0, 0.0, 0.0]");  // pulls it to twice its length
  replace_in_beam("young = 2e5", "young = 2e4\nlaw = \"neo-hookean\"");
  const Outcome whole = run({"run", "beam.toml", "--out", "whole"});
  ASSERT_EQ(whole.code, 0) << whole.err;
  EXPECT_THAT(whole.err, HasSubstr("the time step is halved from"));
  EXPECT_THAT(whole.err, HasSubstr("it began at phyxel "));
  const auto summary = nlohmann::json::parse(text_of(folder_ / "whole" / "run.json"));
  EXPECT_GE(summary["time_step_halvings"].get<int>(), 1);
  EXPECT_NEAR(summary["time_s"].get<double>(), 0.6, 1e-9);
  // Frames stay where they were: 0.6 s at 50 a second, first and last.
  EXPECT_EQ(read_series(folder_ / "whole" / "phyxels.hdf.series").size(), 31u);
  const Outcome stopped =
      interrupted({"run", "beam.toml", "--out", "parts"}, "parts/phyxels_000020.hdf", SIGTERM);
  ASSERT_TRUE(stopped.code == 75 || stopped.code == 0) << stopped.err;
  ASSERT_EQ(run({"run", "beam.toml", "--out", "parts", "--resume", "auto"}).code, 0);
  const State one = final_state(folder_ / "whole"), two = final_state(folder_ / "parts");
  EXPECT_EQ(one.dt, two.dt);
  EXPECT_EQ(one.step, two.step);
  EXPECT_TRUE(one.displacement == two.displacement);
  EXPECT_TRUE(one.velocity == two.velocity);
  EXPECT_EQ(text_of(folder_ / "whole" / "energy.csv"), text_of(folder_ / "parts" / "energy.csv"));
}

TEST_F(Program, ResumingAFinishedRunSaysSoAndChangesNothing) {
  write_beam("0.1");
  ASSERT_EQ(run({"run", "beam.toml"}).code, 0);
  const std::string log = text_of(folder_ / "out" / "energy.csv");
  for (const char* end : {"0.1", "0.05"}) {
    const Outcome again = run({"run", "beam.toml", "--resume", "auto", "--until", end});
    EXPECT_EQ(again.code, 0) << again.err;
    EXPECT_THAT(again.out, HasSubstr("nothing is left to do"));
    EXPECT_EQ(text_of(folder_ / "out" / "energy.csv"), log);
  }
  const Outcome further = run({"run", "beam.toml", "--resume", "auto", "--until", "0.2"});
  EXPECT_EQ(further.code, 0) << further.err;
  EXPECT_NEAR(read_series(folder_ / "out" / "phyxels.hdf.series").back().time, 0.2, 1e-12);
}

TEST_F(Program, WithoutAFrameRateOnlyTheLastFrameIsWritten) {
  write_beam("0.1");
  replace_in_beam("frames_per_second = 50", "frames_per_second = 0");
  ASSERT_EQ(run({"run", "beam.toml"}).code, 0);
  const auto series = read_series(folder_ / "out" / "phyxels.hdf.series");
  ASSERT_EQ(series.size(), 1u);
  EXPECT_NEAR(series.front().time, 0.1, 1e-12);
}

TEST_F(Program, RefusesToResumeWhatDoesNotFit) {
  write_beam("0.05");
  ASSERT_EQ(run({"run", "beam.toml"}).code, 0);
  Outcome outcome = run({"run", "beam.toml", "--resume", "auto", "--precision", "double"});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("float"));
  const auto checkpoint = latest_checkpoint(folder_ / "out");
  ASSERT_TRUE(checkpoint.has_value());
  const std::string log = text_of(folder_ / "out" / "energy.csv");
  const std::size_t frames = read_series(folder_ / "out" / "phyxels.hdf.series").size();
  std::string changed = text_of(folder_ / "beam.toml");
  changed.replace(changed.find("young = 2e5"), 11, "young = 3e5");
  write("stiffer.toml", changed);
  outcome = run({"run", "stiffer.toml", "--resume", checkpoint->string()});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("another model"));
  EXPECT_THAT(outcome.err, HasSubstr("body.material.young of body 1 (\"beam\"): 200000 then, "
                                     "300000 now"));
  // What no model knows: gravity, velocities, what frames have.
  const std::string scene = text_of(folder_ / "beam.toml");
  const std::pair<std::string, std::string> flips[] = {
      {"gravity = [0.0, 0.0, -9.81]", "gravity = [0.0, 0.0, 9.81]"},
      {"jitter = 0.1", "jitter = 0.1\nvelocity = [1, 0, 0]"},
      {"frames_per_second = 50", "frames_per_second = 50\nfields = [\"displacement\"]"}};
  const char* const names[] = {"gravity: [0, 0, -9.81] then, [0, 0, 9.81] now",
                               "body.velocity of body 1 (\"beam\"): [0, 0, 0] then, [1, 0, 0] now",
                               ("output.fields: [\"displacement\", \"velocity\"] then, "
                                "[\"displacement\"] now")};
  for (int k = 0; k < 3; ++k) {
    std::string other = scene;
    other.replace(other.find(flips[k].first), flips[k].first.size(), flips[k].second);
    write("other.toml", other);
    outcome = run({"run", "other.toml", "--resume", checkpoint->string(), "--until", "0.1"});
    EXPECT_EQ(outcome.code, 2);
    EXPECT_THAT(outcome.err, HasSubstr(names[k]));
  }
  // Cut short, and foreign.
  fs::copy_file(*checkpoint, folder_ / "cut.h5");
  fs::resize_file(folder_ / "cut.h5", fs::file_size(*checkpoint) / 2);
  EXPECT_EQ(run({"run", "beam.toml", "--resume", "cut.h5"}).code, 2);
  write("foreign.h5", "not a checkpoint");
  EXPECT_EQ(run({"run", "beam.toml", "--resume", "foreign.h5"}).code, 2);
  EXPECT_EQ(run({"run", "beam.toml", "--resume", "missing.h5"}).code, 2);
  // Nothing that the earlier run has left is touched.
  EXPECT_TRUE(fs::exists(*checkpoint));
  EXPECT_EQ(text_of(folder_ / "out" / "energy.csv"), log);
  EXPECT_EQ(read_series(folder_ / "out" / "phyxels.hdf.series").size(), frames);
}

TEST_F(Program, AnUnstableStepIsRefusedAndWhenForcedStopsWithTheLastGoodState) {
  write_beam("2");
  const Outcome refused = run({"run", "beam.toml", "--step", "0.02"});
  EXPECT_EQ(refused.code, 2);
  EXPECT_THAT(refused.err, HasSubstr("largest stable step"));
  EXPECT_FALSE(fs::exists(folder_ / "out" / "phyxels_000000.hdf"));
  const Outcome diverged = run({"run", "beam.toml", "--step", "0.02", "--unsafe-step"});
  EXPECT_EQ(diverged.code, 3) << diverged.out << diverged.err;
  EXPECT_THAT(diverged.err, HasSubstr("phyxel "));
  EXPECT_THAT(diverged.err, HasSubstr("t = "));
  EXPECT_THAT(diverged.err, HasSubstr("last good state"));
  const State good = final_state(folder_ / "out");
  for (const Vec3d& u : good.displacement) ASSERT_TRUE(is_finite(u));
}

TEST_F(Program, WrongInputEndsWithCode2AndNamesTheCulprit) {
  write_beam("0.02");
  write("empty.obj", "");
  write("flat.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  write("nan.obj", "v 0 0 nan\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n");
  write("ok.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n");
  write("kept.h5", "precious");
  write("thin.toml",
        "[time]\nend = 1\n[[body]]\nmesh = \"flat.obj\"\nphyxels = 9\n[body.material]\nyoung = "
        "1\npoisson = 0.3\ndensity = 1\n");
  write("bad.toml",
        "[time]\nend = 1\n[[body]]\nshape = \"dinno\"\n[body.material]\nyoung = 1\npoisson = "
        "0.3\ndensity = 1\n");
  write("broken.toml", "[time\nend = 1\n");
  const struct {
    std::vector<std::string> arguments;
    std::string message;
  } cases[] = {
      {{}, "phyxel: error: A subcommand is required; phyxel --help explains\n"},
      {{"frobnicate"}, "phyxel: error: frobnicate: unknown command; phyxel --help lists them\n"},
      {{"accuracy", "strap", "--across", "1"},
       "phyxel: error: --across 1: Value 1 not in range 2 to 200\n"},
      {{"run", "thin.toml"},
       "phyxel: error: thin.toml:3:1: body \"flat\": flat.obj: the surface encloses no volume: "},
      {{"run", "beam.toml", "--dry-run", "--step", "1"},
       "phyxel: error: beam.toml: time.step = 1 s is unstable"},
      {{"run", "missing.toml"}, "missing.toml: no such file"},
      {{"run", "."}, "error: .: is a folder; "},
      {{"run", "broken.toml"}, "broken.toml:1:6: not valid TOML"},
      {{"run", "bad.toml"},
       "bad.toml:4:9: key body.shape: \"dinno\" found (did you mean \"dino\"?)"},
      {{"run", "beam.toml", "--device", "gpu"}, "--device gpu: unknown device"},
      {{"run", "beam.toml", "--device", "cuda:x"}, "--device cuda:x: unknown device"},
      {{"run", "beam.toml", "--device", "cuda:1000"}, "--device cuda:1000: unknown device"},
      {{"run", "beam.toml", "--device", "cuda:99999999999999999999"}, "9999: unknown device"},
      {{"run", "beam.toml", "--precision", "half"}, "--precision half: unknown; allowed: float"},
      {{"run", "beam.toml", "--until", "-1"}, "--until -1: out of range: allowed > 0"},
      {{"run", "beam.toml", "--threads", "0"}, "--threads 0: out of range: allowed 1 to"},
      {{"run", "beam.toml", "--step", "nan"}, "--step nan: out of range: allowed > 0"},
      {{"run", "beam.toml", "--out", "/proc/phyxel"}, "/proc/phyxel: the output folder cannot"},
      {{"run", "beam.toml", "--out", "kept.h5"}, "kept.h5: the output folder cannot be created"},
      {{"sample", "missing.obj", "--phyxels", "10", "--out", "a.h5"}, "missing.obj: no such file"},
      {{"sample", "empty.obj", "--phyxels", "10", "--out", "a.h5"}, "empty.obj: the file is empty"},
      {{"sample", "nan.obj", "--phyxels", "10", "--out", "a.h5"},
       "nan.obj:1: the coordinate \"nan\""},
      {{"sample", "flat.obj", "--phyxels", "10", "--out", "a.h5"},
       "flat.obj: the surface encloses no"},
      {{"sample", "ok.obj", "--phyxels", "0", "--out", "a.h5"}, "--phyxels 0: out of range"},
      {{"sample", "ok.obj", "--phyxels", "-5", "--out", "a.h5"}, "--phyxels -5: out of range"},
      {{"sample", "ok.obj", "--phyxels", "2000000000", "--out", "a.h5"},
       "ok.obj: 2000000000 phyxels need about"},
      {{"sample", "ok.obj", "--phyxels", "10", "--out", "kept.h5"},
       "kept.h5: exists already and is kept; allowed: another file"},
      {{"info", "kept.h5"}, "kept.h5: not a file written by phyxel"},
      {{"render", "nowhere"}, "nowhere: no such file or folder"},
      {{"bench", "step", "--shape", "cow"}, "cow not in"},
      {{"export", "nowhere.hdf.series", "--single", "x.vtkhdf"},
       "nowhere.hdf.series: no such file"},
  };
  for (const auto& c : cases) {
    std::string line;
    for (const std::string& a : c.arguments) line += a + " ";
    const Outcome outcome = run(c.arguments);
    EXPECT_EQ(outcome.code, 2) << line << outcome.out << outcome.err;
    ASSERT_GE(c.message.size(), 7) << line << "would take any text";
    EXPECT_THAT(outcome.err, HasSubstr(c.message)) << line;
    EXPECT_FALSE(fs::exists(folder_ / "a.h5")) << line;
  }
  EXPECT_EQ(text_of(folder_ / "kept.h5"), "precious");
}

TEST_F(Program, TablesAndWhatWasWrittenAreJsonOnRequest) {
  const Outcome bench =
      run({"bench", "step", "--phyxels", "27,64", "--precision", "double", "--terms", "green",
           "--threads", "1", "--seconds", "0.01", "--repeat", "1", "--json", "--csv", "step.csv"});
  ASSERT_EQ(bench.code, 0) << bench.err;
  const auto table = nlohmann::json::parse(bench.out);
  ASSERT_EQ(table["rows"].size(), 2u);
  EXPECT_EQ(table["rows"][1]["phyxels"], 64);
  EXPECT_EQ(table["rows"][1]["terms"], "green");
  EXPECT_THAT(text_of(folder_ / "step.csv"),
              HasSubstr("# program: " + table["facts"]["program"].get<std::string>()));
  write_beam();
  ASSERT_EQ(run({"run", "beam.toml", "--quiet"}).code, 0);
  const Outcome drawn = run({"render", "out", "--count", "2", "--json"});
  ASSERT_EQ(drawn.code, 0) << drawn.err;
  const auto pictures = nlohmann::json::parse(drawn.out)["pictures"];
  ASSERT_EQ(pictures.size(), 2u);
  for (const std::string name : pictures) EXPECT_TRUE(fs::exists(folder_ / name)) << name;
  const Outcome gathered =
      run({"export", "out/phyxels.hdf.series", "--single", "one.vtkhdf", "--json"});
  ASSERT_EQ(gathered.code, 0) << gathered.err;
  EXPECT_EQ(nlohmann::json::parse(gathered.out)["bytes"], fs::file_size(folder_ / "one.vtkhdf"));
}

/// doctor reads the initial environment of its process, as the OpenMP runtime does.
TEST_F(Program, WaitingThreadsSleepSoonUnlessTheUserSaysOtherwise) {
  const auto policy = [&] {
    return nlohmann::json::parse(run({"doctor", "--json"}).out)["thread_policy"].get<std::string>();
  };
  const char* ours = std::getenv("OMP_WAIT_POLICY");
  const std::string kept = ours ? ours : "";
  unsetenv("OMP_WAIT_POLICY");
  EXPECT_EQ(policy(), "GOMP_SPINCOUNT=1000");
  if (ours) setenv("OMP_WAIT_POLICY", kept.c_str(), 1);
  environment_ = {{"OMP_WAIT_POLICY", "active"}};
  EXPECT_EQ(policy(), "OMP_WAIT_POLICY=active");
}

/// Run on a pseudo-terminal, where stderr and stdout are the same.
TEST_F(Program, ColoursAreForTerminalsOnly) {
  EXPECT_THAT(run({"run", "none.toml", "--dry-run"}).err, Not(HasSubstr("\033[")));
  write("on_terminal.sh", "exec script -qec \"$*\" /dev/null\n");
  launcher_ = {"/bin/sh", "on_terminal.sh"};
  environment_ = {{"TERM", "xterm"}, {"NO_COLOR", ""}};
  EXPECT_THAT(run({"run", "none.toml", "--dry-run"}).out, HasSubstr("\033[31merror: \033[0m"));
  environment_ = {{"TERM", "xterm"}, {"NO_COLOR", "1"}};
  EXPECT_THAT(run({"run", "none.toml", "--dry-run"}).out,
              AllOf(HasSubstr("error: none.toml"), Not(HasSubstr("\033["))));
  environment_ = {{"TERM", "dumb"}, {"NO_COLOR", ""}};
  EXPECT_THAT(run({"run", "none.toml", "--dry-run"}).out,
              AllOf(HasSubstr("error: none.toml"), Not(HasSubstr("\033["))));
}

TEST_F(Program, InfoCutsAScene) {
  write_beam();
  replace_in_beam("spacing = 0.05", "spacing = 0.025");  // six tiles
  const Outcome outcome = run({"info", "beam.toml", "--partition", "3", "--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto facts = nlohmann::json::parse(outcome.out);
  ASSERT_EQ(facts["plans"].size(), 3U);
  std::size_t phyxels = 0, ghosts = 0;
  for (const auto& plan : facts["plans"]) {
    phyxels += plan["phyxels"].get<std::size_t>();
    ghosts += plan["ghosts"].get<std::size_t>();
  }
  EXPECT_EQ(phyxels, facts["phyxels"].get<std::size_t>());
  for (const auto& cut : facts["cuts"]) {
    if (cut["cut"] != "tiles" || cut["partitioner"] != "metis") continue;
    EXPECT_EQ(ghosts, cut["ghosts"].get<std::size_t>());  // that of the plans shown
  }
  // Three numbers of displacement and nine of stress for every ghost.
  const auto& sent = facts["numbers sent a step"];
  EXPECT_EQ(sent["pair stresses"].get<std::size_t>(), 12 * ghosts);
  EXPECT_GT(sent["pair forces"], sent["pair stresses"]);
  EXPECT_LT(sent["summed forces"], sent["pair stresses"]);
  const Outcome table = run({"info", "beam.toml", "--partition", "3"});
  EXPECT_THAT(table.out, AllOf(HasSubstr("Tiles by metis"), HasSubstr("kB, with the same bits")));

  const Outcome unknown = run({"info", "beam.toml", "--partition", "3", "--partitioner", "rcb"});
  EXPECT_EQ(unknown.code, 2);
  EXPECT_THAT(unknown.err, HasSubstr("allowed: metis, curve, bisection"));
  const Outcome folder = run({"info", ".", "--partition", "3"});
  EXPECT_EQ(folder.code, 2);
  EXPECT_THAT(folder.err, HasSubstr("allowed here: a scene (.toml)"));
}

/// The test passes with and without GPUs, and in builds with and without CUDA.
TEST_F(Program, AGpuThatIsNotThereIsExitCode4AndAutoTakesTheCpu) {
  write_beam("0.01");
  environment_ = {{"CUDA_VISIBLE_DEVICES", ""}};
  const Outcome refused = run({"run", "beam.toml", "--device", "cuda"});
  EXPECT_EQ(refused.code, 4);
  EXPECT_THAT(refused.err, HasSubstr("CPU"));
  EXPECT_FALSE(fs::exists(folder_ / "out"));
  const Outcome automatic = run({"run", "beam.toml"});
  EXPECT_EQ(automatic.code, 0) << automatic.err;
  EXPECT_THAT(automatic.out, HasSubstr("cpu, float"));
}

TEST_F(Program, DryRunTellsThePlanOfTheRunAndWritesNothing) {
  write_beam();
  const Outcome dry = run({"run", "beam.toml", "--dry-run", "--json"});
  ASSERT_EQ(dry.code, 0) << dry.err;
  EXPECT_FALSE(fs::exists(folder_ / "out"));
  const Outcome real = run({"run", "beam.toml", "--json"});
  ASSERT_EQ(real.code, 0) << real.err;
  const auto plan = nlohmann::json::parse(dry.out), summary = nlohmann::json::parse(real.out);
  for (const char* key : {"steps", "time_step_s", "phyxels", "largest_stable_step_s"}) {
    EXPECT_EQ(plan[key], summary[key]) << key;
  }
  EXPECT_GT(plan["bytes"], 0);
  EXPECT_GT(plan["forecast_seconds"], 0.0);
  EXPECT_THAT(run({"run", "beam.toml", "--dry-run"}).out, HasSubstr("forecast"));
  // Beside an earlier trajectory, too, which stays.
  EXPECT_EQ(run({"run", "beam.toml", "--dry-run"}).code, 0);
  EXPECT_EQ(run({"run", "beam.toml"}).code, 2);
  EXPECT_TRUE(fs::exists(folder_ / "out" / "energy.csv"));
}

TEST_F(Program, SamplesAMeshAndRunsIt) {
  // An octahedron, refined by nothing: eight triangles are enough of a mesh.
  write("gem.obj",
        "v 1 0 0\nv -1 0 0\nv 0 1 0\nv 0 -1 0\nv 0 0 1\nv 0 0 -1\n"
        "f 1 3 5\nf 3 2 5\nf 2 4 5\nf 4 1 5\nf 3 1 6\nf 2 3 6\nf 4 2 6\nf 1 4 6\n");
  const Outcome sampled = run({"sample", "gem.obj", "--phyxels", "300", "--out", "gem.h5"});
  ASSERT_EQ(sampled.code, 0) << sampled.err;
  // A scene tells what sampling warns of.
  write("few.toml",
        "[time]\nend = 1\n[[body]]\nmesh = \"gem.obj\"\nphyxels = 9\n[body.material]\n"
        "young = 1e5\npoisson = 0.34\ndensity = 1000\n");
  EXPECT_THAT(run({"run", "few.toml", "--dry-run"}).out,
              HasSubstr("gem.obj: all phyxels lie inside: 9"));
  write("gem.toml", R"(
[time]
end = 0.02
[[body]]
file = "gem.h5"
spin = [0, 0, 2]
[body.material]
young = 1e5
poisson = 0.34
density = 1000
)");
  const Outcome outcome = run({"run", "gem.toml", "--out", "gem", "--precision", "double"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const FrameData frame = read_frame(folder_ / "gem" / "phyxels_000000.hdf");
  EXPECT_EQ(frame.point.size(), 300u);
  for (const Vec3d& p : frame.point) {
    // In the octahedron or, to a float's digits of a spacing, on it.
    EXPECT_LE(std::abs(p.x) + std::abs(p.y) + std::abs(p.z), 1.0 + 1e-7);
  }
}

}  // namespace
}  // namespace phyxel
