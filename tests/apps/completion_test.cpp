/// Completion in shells, and the help of each command.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <regex>
#include <sstream>

#include "support/program.hpp"
#include "support/skips.hpp"

namespace phyxel {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::IsSupersetOf;

class Completion : public test::Program {
 protected:
  /// The shell's suggestions for the last of these words.
  std::vector<std::string> offered(const std::vector<std::string>& typed) const {
    const test::Outcome outcome = run(typed);
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    std::istringstream text(outcome.out);
    std::vector<std::string> words;
    // fish adds a description after a tab.
    for (std::string line; std::getline(text, line);)
      words.push_back(line.substr(0, line.find('\t')));
    return words;
  }
  bool there_is(const char* shell) const {
    return std::system((std::string("command -v ") + shell + " >/dev/null").c_str()) == 0;
  }
  void expect_what_is_offered() const {
    EXPECT_THAT(offered({"doc"}), ElementsAre("doctor"));
    EXPECT_THAT(offered({"bench", "st"}), ElementsAre("step"));
    EXPECT_THAT(offered({"run", "--st"}), ElementsAre("--step"));
    EXPECT_THAT(offered({"accuracy", "hard", "--pre"}), ElementsAre("--precision"));
    EXPECT_THAT(offered({"render", "--"}), IsSupersetOf({"--frames", "--view", "--help"}));
    EXPECT_THAT(offered({"sample", "--frames"}), IsEmpty());
    EXPECT_THAT(offered({"examples", "copy", "bin"}), ElementsAre("bin_of_dinos"));
  }
};

TEST_F(Completion, BashOffersCommandsAndTheirOptions) {
  write("complete.sh",
        "eval \"$(\"$1\" completion bash)\"\n"
        "COMP_WORDS=(phyxel \"${@:2}\"); COMP_CWORD=$(($# - 1)); _phyxel\n"
        "for word in \"${COMPREPLY[@]}\"; do echo \"$word\"; done\n");
  launcher_ = {"/bin/bash", "complete.sh"};
  expect_what_is_offered();
}

TEST_F(Completion, FishOffersCommandsAndTheirOptions) {
  PHYXEL_NEEDS_TOOL(there_is("fish"), "fish");
  write("complete.fish",
        "$argv[1] completion fish | source\n"
        "complete -C \"phyxel $argv[2..]\"\n");
  launcher_ = {"/usr/bin/env", "fish", "complete.fish"};
  expect_what_is_offered();
}

TEST_F(Completion, ZshTakesTheScript) {
  PHYXEL_NEEDS_TOOL(there_is("zsh"), "zsh");
  write("complete.zsh",
        "autoload -U compinit && compinit -u -D\n"
        "eval \"$($1 completion zsh)\"\n"
        "echo $_comps[phyxel]\n");
  launcher_ = {"/usr/bin/env", "zsh", "-f", "complete.zsh"};
  EXPECT_THAT(run({}).out, HasSubstr("_phyxel"));
}

TEST_F(Completion, OtherShellsAreRefused) {
  const test::Outcome outcome = run({"completion", "csh"});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("bash"));
}

class Help : public test::Program {
 protected:
  /// The commands without the program itself, e.g. "bench step", from the script for bash.
  std::vector<std::string> commands() const {
    const std::string script = run({"completion", "bash"}).out;
    const std::regex one("\"([a-z ]+)\"\\) options");
    std::vector<std::string> paths;
    for (std::sregex_iterator it(script.begin(), script.end(), one), end; it != end; ++it) {
      paths.push_back((*it)[1]);
    }
    return paths;
  }
  std::string help_of(const std::string& path) const {
    std::istringstream text(path + " --help");
    std::vector<std::string> words;
    for (std::string word; text >> word;) words.push_back(word);
    return run(words).out;
  }
};

TEST_F(Help, HasExamplesForEveryCommandOfOptionsThatThereAre) {
  const std::vector<std::string> paths = commands();
  EXPECT_GE(paths.size(), 15u);  // the program, its commands and their subcommands
  for (const std::string& path : paths) {
    SCOPED_TRACE(path);
    const std::string help = help_of(path);
    const std::size_t examples = help.find("Example");
    ASSERT_NE(examples, std::string::npos);
    EXPECT_THAT(help.substr(examples), HasSubstr("phyxel " + path));
    std::istringstream lines(help.substr(examples));
    for (std::string line; std::getline(lines, line);) {
      const bool of_a_part = std::any_of(paths.begin(), paths.end(), [&](const std::string& other) {
        return other.size() > path.size() && line.find("phyxel " + other) != std::string::npos;
      });
      if (of_a_part) continue;
      std::istringstream words(line);
      for (std::string word; words >> word;) {
        if (word.rfind("--", 0) != 0) continue;
        EXPECT_THAT(help.substr(0, examples), HasSubstr("  " + word));
      }
    }
  }
}

}  // namespace
}  // namespace phyxel
