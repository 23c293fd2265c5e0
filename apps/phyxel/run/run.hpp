/// One run of a scene: the class behind `phyxel run` and `phyxel check`.
#pragma once

#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "device_option.hpp"
#include "file_writer.hpp"
#include "mpi/watchdog.hpp"
#include "phyxel/phyxel.hpp"
#include "program_ranks.hpp"
#include "progress.hpp"
#include "run/time_spent.hpp"
#include "setup.hpp"
#include "stop_signal.hpp"

namespace phyxel::app {

struct RunOptions {
  Overrides overrides;
  CutOptions cut;
  std::string transport = "auto";
  std::string profile;  // a file, or ""
  std::string resume;   // "", "auto" or a checkpoint file
  bool force = false;
  bool no_pictures = false;
  bool quiet = false;
  bool json = false;
  bool dry_run = false;
};

/// A state that passed the watch.
struct GoodState {
  State state;
  Diagnostics diagnostics;
  Watched watched;
};

/// `work()`, which does the same on every rank and fails on all of them, if it does; unless a GPU
/// fails, which ends all.
template <class Work>
auto alike(Work&& work) {
  try {
    return work();
  } catch (const DeviceError&) {  // of this rank's GPU
    throw;
  } catch (const Error& error) {
    throw AgreedError(error.code(), error.what());
  }
}

/// One run from its plan to its summary, on one rank or on several: all step, and the first one
/// speaks and writes. Files are written on a thread of their own, while stepping goes on if a core
/// is left for that. HDF5 is not made for threads: after the constructor that thread alone uses it,
/// until all is written. A rank holds its values of at most two frames, the one being written and
/// one that waits, and its last good state, which often is that of the latter.
class Run {
 public:
  explicit Run(const RunOptions& options);

  /// The plan, and how long it would take: a few steps tell. Writes nothing.
  void rehearse();

  /// Steps to the end and writes everything; or what is missing of a run that was finished.
  void execute();

 private:
  // Often enough to stop a blow-up early; where looking takes long, after that many times as long.
  static constexpr std::int64_t watch_interval = 250;
  static constexpr double watch_share = 50;

  const Model& model() const { return shared_.here(); }

  void step_to_end();
  void take_steps(StabilityWatch& watch, const Watchdog& watchdog, Progress& progress);
  /// Whether the output folder lacks run.json, as after an end before it was written.
  bool summary_is_missing() const;
  void draw_and_sum_up();

  /// Of all steps [s]; none for a search for equilibrium, whose length nobody knows.
  std::optional<double> forecast();

  /// What a summary or a plan in JSON begins with.
  nlohmann::ordered_json identity() const;

  bool steps_explicitly() const { return scene_.solver.method == Method::verlet; }
  double end_time() const { return static_cast<double>(plan_.steps) * plan_.dt; }
  /// Whether this rank speaks and writes.
  static bool leads() { return ranks().rank() == 0; }
  /// Ranks ask each other now and then, and one alone itself after every step.
  std::int64_t agree_interval() const;
  static bool anyone(bool here);

  /// How long a rank may stay where it is before it is named.
  static double watchdog_seconds();

  /// One step, after a look at whether it has to be shorter or may be longer.
  void take_step(Progress& progress);
  /// Has Newton's method show how far it has come, serve files, and hear signals.
  void watch_newton(Progress& progress);
  void show_progress(Progress& progress, const Diagnostics& now) const;
  /// Writes the state that an interrupted search has left. @returns the message of the run's end
  std::string stopped_in_search(const InterruptedError& error, Progress& progress);

  /// Writes it, and says so.
  std::string with_last_good_state(const char* error, Progress& progress);

  double speed() const {
    return static_cast<double>(solver_.steps() - first_step_) /
           std::max(1e-9, seconds_since(loop_start_));
  }

  /// Before the model is built, so that a wrong --resume or output folder costs no time.
  std::optional<CheckpointReader> find_checkpoint();

  /// What it says, without arrays; the first rank's, the others may not see its folder.
  std::optional<Checkpoint> checkpoint_for_all();

  /// The checkpoint's, or that of rest.
  State first_state();

  /// Phyxels of which values are brought to the first rank at a time: fewer, in tests.
  static Index stretch_length();

  void check_resumed() const;

  std::shared_ptr<const GoodState> good_state(const Diagnostics& now) const;

  /// Whether one is left for the writer. Threads that step on all of them wait for one another
  /// twice a step, and lose more to a writer that comes between than writing beside them saves.
  bool core_is_left() const;

  void hand_over(std::shared_ptr<const Moment> moment, FileWriter::Job job);

  static std::shared_ptr<Moment> moment_of(const std::shared_ptr<const GoodState>& good);

  /// Takes what the frame needs from the backend now; it is written in the background.
  void write_frame(const std::shared_ptr<const GoodState>& good);

  /// The last good one, in the background, after the frames handed over before.
  void write_state();

  void say_plan() const;

  /// Not an error: a job script that resumes until it is done ends here.
  void say_finished_already() const;

  /// Where the seconds went, in the order of the run.
  nlohmann::ordered_json timing() const;

  double energy_drift(const Diagnostics& now) const;
  static double force_balance(const Diagnostics& now);
  static double torque_balance(const Diagnostics& now);
  double steps_taken() const { return static_cast<double>(solver_.steps() - first_step_); }

  /// Warnings about the final state of a run, beside the model's.
  std::vector<std::string> warnings_of(const Diagnostics& now) const;
  nlohmann::ordered_json summary_of(const Diagnostics& now, std::int64_t bytes,
                                    const Traffic& traffic) const;

  void say_summary(const Diagnostics& now, std::int64_t bytes, const Traffic& traffic) const;

  const RunOptions& options_;
  StopSignal signals_{ranks().rank() == 0};  // first, to hear those that come during set-up
  Clock::time_point start_ = Clock::now();
  TimeSpent spent_;
  Scene scene_;
  ChosenDevice device_;
  // Found with the checkpoint, on the first rank: its file, and whether an earlier trajectory may
  // be replaced.
  std::filesystem::path resumed_from_;
  bool replace_ = false;
  std::optional<Continuation> continuation_;
  std::optional<CheckpointReader> checkpoint_reader_;  // on the first rank, until its state is read
  std::optional<Checkpoint> begin_;                    // without arrays
  SharedModel shared_;
  std::unique_ptr<Backend> backend_;
  StepPlan plan_;
  BoundarySize boundary_;  // of the whole
  Solver solver_;
  StepControl control_;
  std::int64_t first_step_ = 0;
  int halvings_told_ = plan_.halvings;  // of the planned step, the most so far
  Diagnostics start_diagnostics_, now_;
  std::optional<Recorder> recorder_;       // on the first rank
  std::string transport_;                  // between ranks
  std::vector<int> gpus_;                  // of the ranks
  std::shared_ptr<const GoodState> good_;  // the last one
  Watched watched_;                        // for checkpoints: start and frames
  double peak_energy_ = 0;                 // of all states looked at
  double setup_seconds_ = 0, step_seconds_ = 0, loop_seconds_ = 0;  // steps alone; with output
  Clock::time_point loop_start_;
  std::filesystem::path checkpoint_;
  std::vector<std::filesystem::path> pictures_;
  // Last: it ends first, and its jobs use the recorder.
  FileWriter writer_{shared_, stretch_length()};
};

}  // namespace phyxel::app
