/// A fixture that runs the program in a temporary folder, as a user would.
#pragma once

#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <thread>

#include "support/folder.hpp"

namespace phyxel::test {

struct Outcome {
  int code = -1;
  std::string out, err;
};

class Program : public Folder {
 protected:
  /// Starts the program in the test's folder; its output goes to files.
  pid_t start(const std::vector<std::string>& arguments) const {
    const pid_t child = fork();
    if (child != 0) return child;
    if (chdir(folder_.c_str()) != 0) _exit(99);
    if (!freopen("stdout.txt", "w", stdout) || !freopen("stderr.txt", "w", stderr)) _exit(99);
    for (const auto& [name, value] : environment_) setenv(name.c_str(), value.c_str(), 1);
    std::vector<std::string> words = launcher_;
    words.push_back(PHYXEL_PROGRAM);
    words.insert(words.end(), arguments.begin(), arguments.end());
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    execv(argv[0], argv.data());
    _exit(99);
  }
  Outcome finish(pid_t child) const {
    int status = 0;
    waitpid(child, &status, 0);
    return {WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status),
            text_of(folder_ / "stdout.txt"), text_of(folder_ / "stderr.txt")};
  }
  Outcome run(const std::vector<std::string>& arguments) const { return finish(start(arguments)); }

  /// True once a child has ended, which `finish` still is for.
  static bool has_ended(pid_t child) {
    siginfo_t info{};
    return waitid(P_PID, static_cast<id_t>(child), &info, WEXITED | WNOHANG | WNOWAIT) == 0 &&
           info.si_pid == child;
  }

  /// Waits until a condition holds. Two minutes are a hundred times what a machine with other work
  /// needs.
  template <class Condition>
  static bool comes_true(const Condition& condition) {
    constexpr int polls = 24000;
    for (int poll = 0; poll < polls && !condition(); ++poll) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    return condition();
  }

  /// Waits until a file appears in the test's folder.
  void wait_for(const std::string& file) const {
    EXPECT_TRUE(comes_true([&] { return std::filesystem::exists(folder_ / file); }));
  }

  /// Starts the program, and sends it a signal once it has written a file.
  Outcome interrupted(const std::vector<std::string>& arguments, const std::string& file,
                      int signal) const {
    const pid_t child = start(arguments);
    wait_for(file);
    kill(child, signal);
    return finish(child);
  }

  /// Command that launches the program, e.g. mpirun and its options; empty if there is none.
  std::vector<std::string> launcher_;
  /// Variables (name, value) added to the environment of the test.
  std::vector<std::pair<std::string, std::string>> environment_;
};

}  // namespace phyxel::test
