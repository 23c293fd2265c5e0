#include "child_process.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <sstream>
#include <utility>

#include "phyxel/error.hpp"

namespace phyxel::app {
namespace {

namespace fs = std::filesystem;

/// Ends a wait for a child. @returns its status
int status_of(pid_t child) {
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return status;
}

/// What a new process does with its files before it starts.
class FileActions {
 public:
  FileActions() { posix_spawn_file_actions_init(&actions_); }
  ~FileActions() { posix_spawn_file_actions_destroy(&actions_); }
  FileActions(const FileActions&) = delete;
  FileActions& operator=(const FileActions&) = delete;
  void open(int to, const fs::path& file, int flags) {
    posix_spawn_file_actions_addopen(&actions_, to, file.c_str(), flags, 0600);
  }
  void duplicate(int from, int to) { posix_spawn_file_actions_adddup2(&actions_, from, to); }
  const posix_spawn_file_actions_t* get() const { return &actions_; }

 private:
  posix_spawn_file_actions_t actions_;
};

}  // namespace

fs::path program_on_path(const char* name) {
  const char* path = std::getenv("PATH");
  std::istringstream folders(path ? path : "");
  for (std::string folder; std::getline(folders, folder, ':');) {
    fs::path program = fs::path(folder) / name;
    if (access(program.c_str(), X_OK) == 0 && fs::is_regular_file(program)) return program;
  }
  return {};
}

PrivateFolder::PrivateFolder() {
  std::string name = (fs::temp_directory_path() / "phyxel_XXXXXX").string();
  if (!mkdtemp(name.data())) {
    throw OutputError(fmt::format("{}: cannot be created: {}", name, std::strerror(errno)));
  }
  path_ = name;
}

PrivateFolder::~PrivateFolder() {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

Child::Child(const ChildRequest& request) {
  FileActions actions;
  int ends[2] = {-1, -1};
  // Unlike a pipe, a socket reports a child that has ended without a signal.
  if (request.fed && socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) {
    throw OutputError(
        fmt::format("{}: cannot be started: {}", request.program.string(), std::strerror(errno)));
  }
  input_ = ends[0];
  if (request.fed) {
    actions.duplicate(ends[1], STDIN_FILENO);
  } else {
    actions.open(STDIN_FILENO, "/dev/null", O_RDONLY);
  }
  for (const auto& [to, file] :
       {std::pair(STDOUT_FILENO, &request.output), std::pair(STDERR_FILENO, &request.errors)}) {
    actions.open(to, file->empty() ? fs::path("/dev/null") : *file, O_WRONLY | O_CREAT | O_TRUNC);
  }
  std::vector<std::string> words{request.program.string()};
  words.insert(words.end(), request.arguments.begin(), request.arguments.end());
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  const int failed = posix_spawn(&id_, argv[0], actions.get(), nullptr, argv.data(), environ);
  if (request.fed) ::close(ends[1]);
  if (failed == 0) return;
  id_ = -1;
  close_input();
  throw OutputError(fmt::format("{}: cannot be started: {}", words[0], std::strerror(failed)));
}

Child::~Child() {
  close_input();
  if (id_ < 0) return;
  kill(id_, SIGKILL);
  status_of(id_);
}

void Child::close_input() {
  if (input_ >= 0) ::close(std::exchange(input_, -1));
}

bool Child::feed(std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t sent = send(input_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (sent < 0 && errno == EINTR) continue;
    if (sent < 0) return false;
    bytes = bytes.subspan(static_cast<std::size_t>(sent));
  }
  return true;
}

bool Child::wait() {
  close_input();
  const int status = status_of(std::exchange(id_, -1));
  return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

}  // namespace phyxel::app
