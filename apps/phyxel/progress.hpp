/// How far a run has come: one line redrawn in place on a terminal, a plain line every few seconds
/// elsewhere.
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

/// What a progress line shows and how. What is not set is found out from the stream and the
/// environment.
struct ProgressStyle {
  std::int64_t phyxels = 0;       ///< If positive, phyxel-steps/s are shown beside steps/s.
  std::optional<bool> terminal;   ///< A terminal that can redraw; else plain lines.
  std::optional<int> columns;     ///< Width of the terminal.
  std::function<double()> clock;  ///< Wall-clock seconds from any origin.
  /// Seconds between two lines that are no terminal's; unset: those of the environment's
  /// PHYXEL_PROGRESS_SECONDS, for tests, or 5.
  std::optional<double> line_interval;
  /// Load and cores of the host; a load above the cores is shown.
  std::function<std::optional<HostLoad>()> load;
};

class Progress {
 public:
  /// @param end_time simulated time at which the run ends [s].
  /// @param stream null: silent.
  Progress(double end_time, std::FILE* stream, const ProgressStyle& style = {});
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// Cheap enough for every step: shows at most 10 lines a second on a terminal, one every 5
  /// seconds elsewhere. @param time simulated [s]. @param energy total [J].
  void update(double time, std::int64_t step, double steps_per_second, double energy);

  /// The same with parts of the caller's own, the most wanted first.
  void update(std::vector<std::string> parts);

  /// A stage of a set-up: drawn at once on a terminal, and taken away at its end (`share` 1), so
  /// that set-up leaves nothing there; elsewhere a line if the last one is old enough, so that a
  /// short one leaves nothing either.
  void stage(std::string_view name, double share);

  /// A line that stays, above what is redrawn.
  void say(const std::string& line);

  /// Shows the last update and ends the line; later calls do nothing.
  void finish();

 private:
  std::vector<std::string> parts() const;
  /// What the parts of a line begin with: the bar, on a terminal, and the percentage.
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
  bool pending_ = false;  // the last update has not been shown
  bool drawn_ = false;    // a line on the terminal is not yet ended
  double time_ = 0, steps_per_second_ = 0, energy_ = 0;
  std::int64_t step_ = 0;
  std::vector<std::string> given_;  // of the caller's own, if the last update had them
  std::string stage_;
  double stage_start_ = 0;
};

/// Shows the stages of all that this thread sets up while it lives.
class SetupProgress {
 public:
  /// @param stream null: silent
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
