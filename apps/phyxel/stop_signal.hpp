/// Signals that stop a run, as flags that the time loop reads between steps.
#pragma once

namespace phyxel::app {

/// Scope in which signals are caught. INT, TERM, USR2, HUP (unless ignored, as under nohup), XCPU
/// and PIPE request a stop; a second one ends the program at once. USR1 requests a checkpoint.
/// Writes beyond the limit of the file size fail instead of ending the program (XFSZ). Until
/// `work_begins`, a request to stop ends the program with exit code 75, and no file has been
/// changed.
class StopSignal {
 public:
  /// @param speaks true if this process prints a message
  explicit StopSignal(bool speaks);
  ~StopSignal();
  StopSignal(const StopSignal&) = delete;
  StopSignal& operator=(const StopSignal&) = delete;

  static void work_begins();
  static int stop_requested();         ///< The signal that requested a stop, or 0.
  static bool checkpoint_requested();  ///< True once per request.
};

}  // namespace phyxel::app
