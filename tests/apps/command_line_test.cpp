/// Messages for wrong command lines, and for files of a wrong kind.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>

#include "support/program.hpp"

namespace phyxel {
namespace {

namespace fs = std::filesystem;
using test::Outcome;
using ::testing::AnyOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

class CommandLine : public test::Program {};

/// The message is one line that begins with the typed word and suggests the nearest valid one.
TEST_F(CommandLine, UnknownCommandsAndOptionsAreAnsweredWithTheNearest) {
  const struct {
    std::vector<std::string> arguments;
    std::string first, nearest;
  } cases[] = {
      {{"rnu", "x.toml"}, "rnu", "did you mean \"run\""},  // two letters swapped
      {{"rum", "x.toml"}, "rum", "did you mean \"run\""},
      {{"RUN", "x.toml"}, "RUN", "did you mean \"run\""},
      {{"sampel", "x.obj"}, "sampel", "did you mean \"sample\""},
      {{"bench", "stop"}, "stop", "did you mean \"step\""},
      {{"help"}, "help", "did you mean \"--help\""},
      {{"version"}, "version", "did you mean \"--version\""},
      {{"-V"}, "-V", "did you mean \"--version\""},
      {{"run", "-V"}, "-V", "\"phyxel\" has --version"},
      {{"--verison"}, "--verison", "did you mean \"--version\""},
      {{"--colour"}, "--colour", "NO_COLOR=1 turns them off"},
      {{"report", "out", "--color"}, "--color", "NO_COLOR=1 turns them off"},
      {{"run", "x.toml", "--ot", "a"}, "--ot", "did you mean \"--out\""},
      {{"run", "x.toml", "--ot=a"}, "--ot", "did you mean \"--out\""},
      {{"run", "x.toml", "--Until", "1"}, "--Until", "did you mean \"--until\""},
      {{"run", "x.toml", "-o", "a"}, "-o", "did you mean \"--out\""},
      {{"run", "x.toml", "--forse"}, "--forse", "did you mean \"--force\""},
      {{"run", "x.toml", "--orbit", "9"}, "--orbit", "\"phyxel render\" has --orbit"},
      {{"run", "x.toml", "y.toml"}, "y.toml", "one argument too many"},
  };
  for (const auto& c : cases) {
    const Outcome outcome = run(c.arguments);
    EXPECT_EQ(outcome.code, 2) << c.first;
    EXPECT_THAT(outcome.err, StartsWith("phyxel: error: " + c.first + ": "));
    EXPECT_THAT(outcome.err, HasSubstr(c.nearest));
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
    EXPECT_EQ(outcome.out, "");
  }
  // -h prints help whatever follows it.
  const Outcome help = run({"-help"});
  EXPECT_EQ(help.code, 0);
  EXPECT_THAT(help.out, HasSubstr("Usage: phyxel"));
}

TEST_F(CommandLine, OptionsAreQuotedAsTheyWereTyped) {
  EXPECT_THAT(run({"run", "x.toml", "--until=abc"}).err,
              StartsWith("phyxel: error: --until=abc: cannot be read; allowed: FLOAT\n"));
  EXPECT_THAT(run({"run", "x.toml", "--until", "abc"}).err,
              StartsWith("phyxel: error: --until abc: cannot be read; allowed: FLOAT\n"));
  EXPECT_THAT(
      run({"info", "x.toml", "--partition=0"}).err,
      // CLI11's messages differ between its versions.
      AnyOf(StartsWith("phyxel: error: --partition=0: Value 0 not in range 1 to 100000\n"),
            StartsWith("phyxel: error: --partition=0: Value 0 not in range [1 - 100000]\n")));
  EXPECT_THAT(run({"run", "x.toml", "--until"}).err, StartsWith("phyxel: error: --until: "));
}

/// Each command with a file argument is given one file of each kind. For a wrong kind, and only
/// then, the message names the kind, the command that takes it, and the allowed kinds.
TEST_F(CommandLine, FilesOfAnotherKindAreToldApart) {
  write("cow.OBJ", "v 0 0 0\n");
  write("scene.toml", "");
  write("x.h5", "phyxel sealed file 1\n");
  write("x.csv", "a,b\n1,2\n");
  write("x.hdf.series", "{}");
  fs::create_directory(folder_ / "out");
  const std::map<std::string, std::string> kinds = {
      {"cow.OBJ", "is a mesh; \"phyxel sample cow.OBJ"},
      {"scene.toml", "is a scene; \"phyxel run scene.toml\""},
      {"x.h5", "is an HDF5 file (a body, frame or checkpoint); \"phyxel info x.h5\""},
      {"x.csv", "is a table"},
      {"x.hdf.series", "is a series of frames; \"phyxel render x.hdf.series\""},
      {"out", "is a folder; \"phyxel info out\""}};
  const struct {
    std::vector<std::string> before, after;
    std::set<std::string> takes;
    std::string allowed;
  } commands[] = {
      {{"run"}, {}, {"scene.toml"}, "a scene (.toml)"},
      {{"sample"}, {"--phyxels", "9", "--out", "b.h5"}, {"cow.OBJ"}, "a mesh (.obj, .ply, .stl)"},
      {{"render"},
       {},
       {"x.h5", "x.hdf.series", "out"},
       "a run's folder, a series (.series), an HDF5"},
      {{"export"}, {"--single", "one.hdf"}, {"x.hdf.series"}, "a series (.series)"},
      {{"export"},
       {"--format", "glb"},
       {"x.hdf.series", "out"},
       "a run's folder, a series (.series)"},
      {{"export"}, {"--format", "paraview"}, {"out"}, "a run's folder"},
      {{"report"},
       {"--out", "r.html"},
       {"x.h5", "x.hdf.series", "out"},
       "a run's folder, a series (.series), an HDF5 file of phyxel"},
      {{"info"},
       {},
       {"x.h5", "x.hdf.series", "out", "scene.toml", "cow.OBJ"},
       "a run's folder, a scene (.toml), a mesh (.obj, .ply, .stl), a series (.series), an HDF5"},
      {{"info"}, {"--partition", "2"}, {"scene.toml"}, "a scene (.toml)"},
  };
  for (const auto& command : commands) {
    for (const auto& [file, words] : kinds) {
      std::vector<std::string> arguments = command.before;
      arguments.push_back(file);
      arguments.insert(arguments.end(), command.after.begin(), command.after.end());
      const Outcome outcome = run(arguments);
      SCOPED_TRACE(command.before[0] + " " + file + ": " + outcome.err);
      if (command.takes.contains(file)) {
        EXPECT_THAT(outcome.err, Not(HasSubstr("allowed here")));
        continue;
      }
      EXPECT_EQ(outcome.code, 2);
      EXPECT_THAT(outcome.err, StartsWith("phyxel: error: " + file + ": " + words));
      EXPECT_THAT(outcome.err, HasSubstr("; allowed here: " + command.allowed));
    }
  }
}

}  // namespace
}  // namespace phyxel
