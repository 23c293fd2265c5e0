/// Progress of a run: a line redrawn in place on a terminal, or a plain line every few seconds.
#pragma once

#include <cstdint>
#include <cstdio>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "phyxel/progress.hpp"
#include "thread_policy.hpp"

namespace phyxel::app {

/// Style of a progress line. Unset members are derived from the stream and the environment.
struct ProgressStyle {
  std::int64_t phyxels = 0;       ///< If positive, phyxel-steps/s are shown beside steps/s.
  std::optional<bool> terminal;   ///< True for a terminal that can redraw lines.
  std::optional<int> columns;     ///< Width of the terminal.
  std::function<double()> clock;  ///< Wall-clock time from any origin [s].
  /// Time between plain lines [s]; if unset, PHYXEL_PROGRESS_SECONDS of the environment (for
  /// tests), or 5.
  std::optional<double> line_interval;
  /// Load and cores of the host; a load above the number of cores is shown.
  std::function<std::optional<HostLoad>()> load;
};

class Progress {
 public:
  /// @param end_time simulated time at the end of the run [s]
  /// @param stream output stream; null for no output
  Progress(double end_time, std::FILE* stream, const ProgressStyle& style = {});
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// Updates the progress, in each step: at most 10 lines a second on a terminal, or one in 5
  /// seconds elsewhere. @param time simulated time [s] @param energy total energy [J]
  void update(double time, std::int64_t step, double steps_per_second, double energy);

  /// Updates the line with the caller's parts, in the order of importance.
  void update(std::vector<std::string> parts);

  /// Shows a stage of set-up. A terminal shows it at once, and clears it at the end (`share` 1);
  /// elsewhere a line is printed if the last one is old enough, so that short stages print none.
  void stage(std::string_view name, double share);

  /// Prints a permanent line above the redrawn one.
  void say(const std::string& line);

  /// Shows the last update and ends the line. Later calls do nothing.
  void finish();

 private:
  std::vector<std::string> parts() const;
  /// The first parts of a line: the bar, on a terminal, and the percentage.
  std::vector<std::string> share_parts(double share) const;
  void show();
  void take_away();
  void show_if_due();

  double end_time_;
  std::FILE* stream_;
  std::int64_t phyxels_;
  bool terminal_ = false;
  double line_interval_;
  int columns_ = 80;
  std::function<double()> clock_;
  std::function<std::optional<HostLoad>()> load_;
  double last_shown_ = 0;
  bool pending_ = false;  // true if the last update has not been shown
  bool drawn_ = false;    // true if a line on the terminal has not been ended
  double time_ = 0, steps_per_second_ = 0, energy_ = 0;
  std::int64_t step_ = 0;
  std::vector<std::string> given_;  // the caller's parts of the last update, if any
  std::string stage_;
  double stage_start_ = 0;
};

/// Scope in which stages of set-up on this thread are shown.
class SetupProgress {
 public:
  /// @param stream output stream; null for no output
  explicit SetupProgress(std::FILE* stream, const ProgressStyle& style = {})
      : progress_(1, stream, style),
        observing_(stream ? StageObserver([this](std::string_view name, double share) {
          progress_.stage(name, share);
        })
                          : StageObserver()) {}

 private:
  Progress progress_;
  ObserveStages observing_;
};

}  // namespace phyxel::app
