/// Other programs, run as child processes without a shell.
#pragma once

#include <sys/types.h>

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace phyxel::app {

/// The file of a program on PATH; empty if there is none.
std::filesystem::path program_on_path(const char* name);

/// A temporary folder that only this user can access, removed with its files at the end.
class PrivateFolder {
 public:
  PrivateFolder();
  ~PrivateFolder();
  PrivateFolder(const PrivateFolder&) = delete;
  PrivateFolder& operator=(const PrivateFolder&) = delete;
  std::filesystem::path file(const char* name) const { return path_ / name; }

 private:
  std::filesystem::path path_;
};

/// A program, its arguments, and the files that take what it writes.
struct ChildRequest {
  std::filesystem::path program;
  std::vector<std::string> arguments;
  std::filesystem::path output, errors;  ///< Of standard output and error; empty: discarded.
  bool fed = false;                      ///< True if `Child::feed` writes its standard input.
};

/// A running program. A child that nobody has waited for is killed.
class Child {
 public:
  /// Starts the program. @throws OutputError if it cannot be started
  explicit Child(const ChildRequest& request);
  ~Child();
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  /// Writes to the standard input of the child. @returns false if the child has closed it
  bool feed(std::span<const std::byte> bytes);
  /// Ends the child's standard input and waits for its end. @returns true if it ended with code 0
  bool wait();

 private:
  void close_input();

  pid_t id_ = -1;  // -1 once it has been waited for
  int input_ = -1;
};

}  // namespace phyxel::app
