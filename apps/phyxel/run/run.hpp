/// A run of a scene: the implementation of `phyxel run`.
#pragma once

#include <filesystem>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "device_option.hpp"
#include "file_writer.hpp"
#include "mpi/watchdog.hpp"
#include "phyxel/held_overlaps.hpp"
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
  std::string profile;  // file of the timeline, or ""
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

/// Returns `work()`, which either succeeds or fails on all ranks; the failure of a GPU ends all
/// ranks.
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

/// A run from its plan to its summary, on one or several ranks. All ranks step; the first one
/// prints and writes. Files are written on a separate thread, during stepping if a core is free.
/// HDF5 is not thread-safe: after the constructor only that thread uses it until all files are
/// written. A rank holds its values of at most two frames (one being written and one queued) and
/// its last good state, often that of the latter.
class Run {
 public:
  explicit Run(const RunOptions& options);

  /// Prints the plan and a forecast from a few steps. Writes no files.
  void rehearse();

  /// Steps to the end and writes the output; completes the files of a finished run.
  void execute();

 private:
  // Steps between checks, frequent enough to stop a blow-up early; or, if a check is expensive,
  // this many times its cost.
  static constexpr std::int64_t watch_interval = 250;
  static constexpr double watch_share = 50;

  const Model& model() const { return shared_.here(); }

  void step_to_end();
  void take_steps(StabilityWatch& watch, const Watchdog& watchdog, Progress& progress);
  /// True if the output folder has no run.json, as when a run stopped before writing it.
  bool summary_is_missing() const;
  void draw_and_sum_up();

  /// Forecast of the time of all steps [s]; unset for a search for equilibrium.
  std::optional<double> forecast();

  /// The first entries of a summary or plan in JSON.
  nlohmann::ordered_json identity() const;

  bool steps_explicitly() const { return scene_.solver.method == Method::verlet; }
  double end_time() const { return static_cast<double>(plan_.steps) * plan_.dt; }
  /// True on the rank that prints and writes.
  static bool leads() { return ranks().rank() == 0; }
  /// Number of steps after which ranks agree on signals; 1 for one rank.
  std::int64_t agree_interval() const;
  static bool anyone(bool here);

  /// Time without progress after which the watchdog reports a rank [s].
  static double watchdog_seconds();

  /// Takes steps, after adapting the step size to the stiffness.
  void take_step(Progress& progress);
  /// Makes Newton's method show its progress, serve the file writer, and react to signals.
  void watch_newton(Progress& progress);
  void show_progress(Progress& progress, const Diagnostics& now) const;
  /// Writes the state of an interrupted search. @returns the run's last message
  std::string stopped_in_search(const InterruptedError& error, Progress& progress);

  /// Writes the last good state. @returns the error with a note about it
  std::string with_last_good_state(const char* error, Progress& progress);

  double speed() const {
    return static_cast<double>(solver_.steps() - first_step_) /
           std::max(1e-9, seconds_since(loop_start_));
  }

  /// Finds the checkpoint before the model is built, so that a wrong --resume or output folder
  /// fails at once.
  std::optional<CheckpointReader> find_checkpoint();

  /// The checkpoint without arrays, sent by the first rank; other ranks may not see its folder.
  std::optional<Checkpoint> checkpoint_for_all();

  /// The state of the checkpoint, or the state at rest.
  State first_state();

  /// Number of phyxels whose values are sent to the first rank at a time; tests set fewer.
  static Index stretch_length();

  void check_resumed() const;

  /// All readings at the present state. Collective.
  Readings read_off();

  std::shared_ptr<const GoodState> good_state(const Diagnostics& now) const;

  /// True if a core is free for the writer. Threads that occupy all cores synchronise twice a step,
  /// and would lose more to a writer that interrupts them than concurrent writing saves.
  bool core_is_left() const;

  void hand_over(std::shared_ptr<const Moment> moment, FileWriter::Job job);

  static std::shared_ptr<Moment> moment_of(const std::shared_ptr<const GoodState>& good);

  /// Copies the values of a frame from the backend, and queues the frame.
  void write_frame(const std::shared_ptr<const GoodState>& good);

  /// Queues a checkpoint of the last good state, after the frames queued before.
  void write_state();

  void say_plan() const;

  /// Prints that the run had been finished; no error, so that job scripts may resume until done.
  void say_finished_already() const;

  /// Time of each stage [s], in the order of the run.
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
  /// Prints what obstacles do at the end, and have done.
  void say_contacts() const;
  void say_rigid_bodies() const;
  /// Prints the reactions at the end.
  void say_reactions() const;
  /// Prints what probes read at the end.
  void say_probes() const;
  /// Prints pressures and volumes of gases at the end.
  void say_gases() const;

  const RunOptions& options_;
  StopSignal signals_{ranks().rank() == 0};  // first, to catch signals during set-up
  Clock::time_point start_ = Clock::now();
  TimeSpent spent_;
  Scene scene_;
  ChosenDevice device_;
  // The checkpoint's file, and whether an earlier trajectory may be replaced; on the first rank.
  std::filesystem::path resumed_from_;
  bool replace_ = false;
  std::optional<Continuation> continuation_;
  std::optional<CheckpointReader> checkpoint_reader_;  // on the first rank, until the state is read
  std::optional<Checkpoint> begin_;                    // the checkpoint without arrays
  SharedModel shared_;
  std::unique_ptr<Backend> backend_;
  std::unique_ptr<const Recovery> recovery_;  // of gradients for output; null if there is none
  OutputFields fields_;
  Probes probes_;
  StepPlan plan_;
  BoundarySize boundary_;  // of the whole model
  std::vector<SupportRange> supports_;
  Solver solver_;
  StepControl control_;
  std::int64_t first_step_ = 0;
  int halvings_told_ = plan_.halvings;  // largest number of halvings printed so far
  Diagnostics start_diagnostics_, now_;
  /// Depth of the deepest phyxel in each obstacle at the frames of this run [m].
  std::vector<double> deepest_;
  std::vector<double> deepest_shares_;     // the same as shares of supports
  HeldOverlaps held_;                      // of bodies held as wholes, the deepest ones of frames
  Readings readings_;                      // of the start, or the last frame
  std::optional<Recorder> recorder_;       // on the first rank
  std::string transport_;                  // transport between ranks
  std::vector<int> gpus_;                  // GPU of each rank
  std::shared_ptr<const GoodState> good_;  // last good state
  Watched watched_;                        // for checkpoints: start and frames
  double peak_energy_ = 0;                 // largest energy of the checked states [J]
  double setup_seconds_ = 0, step_seconds_ = 0, loop_seconds_ = 0;  // loop includes output
  Clock::time_point loop_start_;
  std::filesystem::path checkpoint_;
  std::vector<std::filesystem::path> pictures_;
  // Last, since it must be destroyed first: its jobs use the recorder.
  FileWriter writer_{shared_, stretch_length()};
};

}  // namespace phyxel::app
