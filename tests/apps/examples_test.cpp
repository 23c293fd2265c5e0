/// `phyxel examples`: the list, and copies that run.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "support/program.hpp"

namespace phyxel {
namespace {

namespace fs = std::filesystem;
using test::Outcome;
using test::text_of;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::StartsWith;

class Examples : public test::Program {
 protected:
  nlohmann::json json_of(const std::vector<std::string>& arguments) const {
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    return nlohmann::json::parse(outcome.out, nullptr, false);
  }
  nlohmann::json list() const { return json_of({"examples", "--json"})["examples"]; }
  /// The files of a folder of the test, by name.
  std::vector<std::string> files_in(const std::string& folder) const {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(folder_ / folder)) {
      names.push_back(entry.path().filename());
    }
    std::sort(names.begin(), names.end());
    return names;
  }
};

TEST_F(Examples, AreListedWithASentenceEach) {
  const std::string table = run({"examples"}).out;
  std::set<std::string> names;
  for (const auto& example : list()) {
    const std::string name = example["name"], sentence = example["sentence"];
    names.insert(name);
    EXPECT_THAT(sentence, ::testing::EndsWith(sentence.find('?') < sentence.size() ? "?" : "."));
    EXPECT_THAT(example["command"].get<std::string>(), HasSubstr(name));
    EXPECT_THAT(table, HasSubstr("  " + name + " "));
    EXPECT_THAT(table, HasSubstr(sentence + "\n"));
  }
  std::set<std::string> folders;
  for (const auto& entry : fs::directory_iterator(fs::path(PHYXEL_SOURCE_DIR) / "examples")) {
    if (entry.path().filename() != "python") folders.insert(entry.path().filename());
  }
  for (const auto& entry :
       fs::directory_iterator(fs::path(PHYXEL_SOURCE_DIR) / "examples/python")) {
    if (entry.path().extension() == ".py") folders.insert(entry.path().stem());
  }
  EXPECT_EQ(names, folders);
}

TEST_F(Examples, AreCopiedWithAllTheirFilesByteByByte) {
  for (const auto& example : list()) {
    const std::string name = example["name"];
    const auto copied = json_of({"examples", "copy", name, "--json"});
    EXPECT_EQ(copied["folder"], name);
    EXPECT_EQ(copied["command"], example["command"]);
    const bool script = example["kind"] == "python";
    const fs::path source = fs::path(PHYXEL_SOURCE_DIR) / "examples" / (script ? "python" : name);
    std::size_t files = 0;
    for (const auto& entry : fs::directory_iterator(source)) {
      const fs::path file = entry.path().filename();
      if (!entry.is_regular_file() || (script && file.stem() != name)) continue;
      EXPECT_TRUE(text_of(entry.path()) == text_of(folder_ / name / file)) << name << " " << file;
      ++files;
    }
    EXPECT_EQ(files_in(name).size(), files) << name;
    EXPECT_EQ(copied["files"].size(), files) << name;
  }
}

TEST_F(Examples, ThatWereCopiedRunByTheCommandThatIsPrinted) {
  const Outcome copied = run({"examples", "copy", "plate_hole", "--to", "my folder/plate"});
  ASSERT_EQ(copied.code, 0) << copied.err;
  EXPECT_EQ(copied.out,
            "my folder/plate/scene.toml\nmy folder/plate/quarter_plate.obj\n"
            "Run it: phyxel run 'my folder/plate/scene.toml'\n");
  const Outcome plan = run({"run", "my folder/plate/scene.toml", "--dry-run"});
  EXPECT_EQ(plan.code, 0) << plan.err;
  EXPECT_EQ(json_of({"examples", "copy", "cluster", "--json"})["command"],
            "mpirun -n 4 phyxel run cluster/scene.toml");
  EXPECT_EQ(json_of({"examples", "copy", "step_loop", "--json"})["command"],
            "cmake -S step_loop -B step_loop/build && cmake --build step_loop/build");
  EXPECT_EQ(json_of({"examples", "copy", "own_loop", "--json"})["command"],
            "python3 own_loop/own_loop.py");
}

/// The last file of an example is there already: none of the others is written.
TEST_F(Examples, ReplaceNothingUnlessForced) {
  write("clap/horseshoe.obj", "mine");
  const Outcome refused = run({"examples", "copy", "clap"});
  EXPECT_EQ(refused.code, 2);
  EXPECT_THAT(refused.err, StartsWith("phyxel: error: clap/horseshoe.obj: exists already"));
  EXPECT_THAT(refused.err, HasSubstr("--force"));
  EXPECT_THAT(files_in("clap"), ElementsAre("horseshoe.obj"));
  EXPECT_EQ(text_of(folder_ / "clap/horseshoe.obj"), "mine");
  write("clap/notes.txt", "mine");
  EXPECT_EQ(run({"examples", "copy", "clap", "--force"}).code, 0);
  EXPECT_THAT(files_in("clap"), ElementsAre("horseshoe.obj", "notes.txt", "scene.toml"));
  EXPECT_THAT(text_of(folder_ / "clap/horseshoe.obj"), HasSubstr("\nv "));
  EXPECT_EQ(text_of(folder_ / "clap/notes.txt"), "mine");
  write("taken", "mine");
  const Outcome file = run({"examples", "copy", "clap", "--to", "taken", "--force"});
  EXPECT_EQ(file.code, 2);
  EXPECT_THAT(file.err, StartsWith("phyxel: error: --to taken: is a file; allowed: a folder"));
  EXPECT_EQ(text_of(folder_ / "taken"), "mine");
}

TEST_F(Examples, ThatThereAreNoneOfAreAnsweredWithTheNearest) {
  const Outcome outcome = run({"examples", "copy", "skitles"});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err, StartsWith("phyxel: error: examples copy skitles: unknown (did you mean "
                                      "\"skittles\"?); allowed: alien_head, "));
  EXPECT_FALSE(fs::exists(folder_ / "skitles"));
  EXPECT_THAT(run({"examples", "cpoy", "dino"}).err, HasSubstr("did you mean \"copy\""));
  EXPECT_EQ(run({"examples", "copy"}).code, 2);
}

}  // namespace
}  // namespace phyxel
