#include "stop_signal.hpp"

#include <atomic>
#include <csignal>
#include <initializer_list>

namespace phyxel::app {
namespace {

// Atomic, because a signal may come to any thread of the program.
std::atomic<int> stop = 0;
std::atomic<bool> checkpoint = false;
static_assert(std::atomic<int>::is_always_lock_free && std::atomic<bool>::is_always_lock_free);

void ask_to_stop(int signal) {
  if (stop != 0) {  // asked twice: do not wait for the end of the step
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
  action.sa_flags = SA_RESTART;  // a write under way is not to fail for it
  sigaction(signal, &action, nullptr);
}

}  // namespace

StopSignal::StopSignal() {
  stop = 0;
  checkpoint = false;
  for (const int signal : {SIGINT, SIGTERM, SIGUSR2}) handle(signal, ask_to_stop);
  handle(SIGUSR1, ask_for_checkpoint);
}

StopSignal::~StopSignal() {
  for (const int signal : {SIGINT, SIGTERM, SIGUSR1, SIGUSR2}) handle(signal, SIG_DFL);
}

int StopSignal::stop_requested() { return stop; }

bool StopSignal::checkpoint_requested() { return checkpoint.exchange(false); }

}  // namespace phyxel::app
