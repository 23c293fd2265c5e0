/// Signals that end a run, as flags that the time loop reads between steps.
#pragma once

namespace phyxel::app {

/// Catches signals while it lives. INT, TERM, USR2, HUP (unless ignored, as under nohup), XCPU and
/// PIPE ask to stop; a second one ends the program at once. USR1 asks for a checkpoint. Writes
/// beyond a limit of the file size fail instead of ending the program (XFSZ). Until `work_begins`,
/// a request to stop ends the program with exit code 75: no file has been touched.
class StopSignal {
 public:
  /// @param speaks whether this process says so
  explicit StopSignal(bool speaks);
  ~StopSignal();
  StopSignal(const StopSignal&) = delete;
  StopSignal& operator=(const StopSignal&) = delete;

  static void work_begins();
  static int stop_requested();         ///< The signal's number, or 0.
  static bool checkpoint_requested();  ///< True once per request.
};

}  // namespace phyxel::app
