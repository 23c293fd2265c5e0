/// SIGINT, SIGTERM and SIGUSR1/2 as flags that the time loop reads between steps.
#pragma once

namespace phyxel::app {

/// Catches signals while it lives: INT, TERM and USR2 ask to stop (a second one ends the program at
/// once), USR1 asks for a checkpoint.
class StopSignal {
 public:
  StopSignal();
  ~StopSignal();
  StopSignal(const StopSignal&) = delete;
  StopSignal& operator=(const StopSignal&) = delete;

  static int stop_requested();         ///< The signal's number, or 0.
  static bool checkpoint_requested();  ///< True once per request.
};

}  // namespace phyxel::app
