#include "stop_signal.hpp"

#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstring>
#include <initializer_list>

#include "phyxel/error.hpp"
#include "terminal.hpp"

namespace phyxel::app {
namespace {

// Atomic, since any thread may receive a signal.
std::atomic<int> stop = 0;
std::atomic<bool> checkpoint = false;
std::atomic<bool> at_work = false;  // true while the loop over steps handles requests to stop
std::atomic<bool> says = true;
std::atomic<bool> on_terminal = false;
static_assert(std::atomic<int>::is_always_lock_free && std::atomic<bool>::is_always_lock_free);

constexpr auto to_stop = {SIGINT, SIGTERM, SIGUSR2, SIGHUP, SIGXCPU, SIGPIPE};

/// Ends the program during set-up, before any file has been changed.
[[noreturn]] void leave() {
  constexpr const char* words =
      "phyxel: error: stopped by a signal during set-up: nothing was written or changed\n";
  constexpr const char* clear = "\r\x1b[K";  // clears the line of the present stage
  if (says) {
    [[maybe_unused]] ssize_t written = 0;
    if (on_terminal) written = ::write(STDERR_FILENO, clear, std::strlen(clear));
    written = ::write(STDERR_FILENO, words, std::strlen(words));
  }
  ::_exit(static_cast<int>(ExitCode::stopped));
}

void ask_to_stop(int signal) {
  if (!at_work) leave();
  if (stop != 0 && signal != SIGPIPE) {  // a second signal does not wait for the end of the step
    std::signal(signal, SIG_DFL);
    std::raise(signal);
  }
  stop = signal;
}

void ask_for_checkpoint(int) { checkpoint = true; }

void handle(int signal, void (*handler)(int)) {
  struct sigaction action = {};
  action.sa_handler = handler;
  sigemptyset(&action.sa_mask);
  action.sa_flags = SA_RESTART;  // writes in progress must not fail
  sigaction(signal, &action, nullptr);
}

/// True if the parent process has set a signal to be ignored, as nohup does.
bool is_ignored(int signal) {
  struct sigaction action = {};
  return sigaction(signal, nullptr, &action) == 0 && action.sa_handler == SIG_IGN;
}

}  // namespace

StopSignal::StopSignal(bool speaks) {
  stop = 0;
  checkpoint = false;
  at_work = false;
  says = speaks;
  on_terminal = is_terminal(stderr);
  for (const int signal : to_stop) {
    if (!is_ignored(signal)) handle(signal, ask_to_stop);
  }
  handle(SIGUSR1, ask_for_checkpoint);
  handle(SIGXFSZ, SIG_IGN);  // the write that hits the limit fails with an error
}

StopSignal::~StopSignal() {
  for (const int signal : to_stop) {
    if (!is_ignored(signal)) handle(signal, SIG_DFL);
  }
  handle(SIGUSR1, SIG_DFL);
}

void StopSignal::work_begins() { at_work = true; }

int StopSignal::stop_requested() { return stop; }

bool StopSignal::checkpoint_requested() { return checkpoint.exchange(false); }

}  // namespace phyxel::app
