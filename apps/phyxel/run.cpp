/// phyxel run: a scene, simulated, written and drawn.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <omp.h>
#include <unistd.h>

#include <cstdlib>
#include <nlohmann/json.hpp>

#include "command.hpp"
#include "device_option.hpp"
#include "file_writer.hpp"
#include "mpi/watchdog.hpp"
#include "phyxel/phyxel.hpp"
#include "picture.hpp"
#include "profile.hpp"
#include "program_ranks.hpp"
#include "progress.hpp"
#include "setup.hpp"
#include "stop_signal.hpp"
#include "stopwatch.hpp"
#include "terminal.hpp"
#include "timeline.hpp"
#include "version.hpp"

namespace phyxel::app {
namespace {

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

/// Where a run's seconds go, in the order of their first ones; spans of its profile, too.
class TimeSpent {
 public:
  template <class Work>
  auto timed(const char* what, Work&& work) {
    const Timing timing(*this, what);
    return work();
  }
  const std::vector<std::pair<std::string, double>>& all() const { return seconds_; }

 private:
  class Timing {
   public:
    Timing(TimeSpent& sum, const char* what) : phase_(what), sum_(sum), what_(what) {}
    ~Timing() { sum_.of(what_) += seconds_since(start_); }
    Timing(const Timing&) = delete;
    Timing& operator=(const Timing&) = delete;

   private:
    Phase phase_;
    TimeSpent& sum_;
    const char* what_;
    Clock::time_point start_ = Clock::now();
  };
  double& of(std::string_view what) {
    for (auto& [known, seconds] : seconds_) {
      if (known == what) return seconds;
    }
    return seconds_.emplace_back(what, 0).second;
  }

  std::vector<std::pair<std::string, double>> seconds_;
};

/// One run from its plan to its summary, on one rank or on several: all step, and the first one
/// speaks and writes. Files are written on a thread of their own, while stepping goes on if a core
/// is left for that. HDF5 is not made for threads: after the constructor that thread alone uses it,
/// until all is written. A rank holds its values of at most two frames, the one being written and
/// one that waits, and its last good state, which often is that of the latter.
class Run {
 public:
  explicit Run(const RunOptions& options)
      : options_(options),
        scene_(ranks().agreed([&] { return scene_with(options.overrides); })),
        device_(choose_device(scene_.solver.device, "device")),
        begin_(checkpoint_for_all()),
        shared_(spent_.timed(
            "model", [&] { return SharedModel(all_ranks(), scene_, device_, options_.cut); })),
        backend_(spent_.timed("backend",
                              [&] {
                                return shared_.make_backend(scene_.solver.precision,
                                                            scene_.solver.threads,
                                                            options_.transport);
                              })),
        plan_(alike([&] {
          return spent_.timed("time step", [&] {
            return plan_steps(scene_, model(), *backend_, options.overrides.unsafe_step);
          });
        })),
        solver_(model(), *backend_, first_state(), scene_.solver.method),
        first_step_(solver_.steps()),
        start_diagnostics_(diagnose(model(), *backend_, solver_.now())) {
    // Last, because it replaces what an earlier run has left: all that could be refused, or find no
    // memory, has been tried by now.
    ranks().together([&] {
      if (!leads() || options_.dry_run) return;
      recorder_.emplace(model(), scene_, options.force,
                        begin_ ? std::optional(begin_->info.frames_written) : std::nullopt);
    });
    if (const auto exchanges = backend_->exchanges()) transport_ = exchanges->transport;
    if (device_.gpu) gpus_ = ranks().gathered(std::span<const int>(&device_.gpu->index, 1));
    const BoundarySize boundary = boundary_size(model());
    boundary_ = {ranks().sum(boundary.moved), ranks().sum(boundary.loaded)};
    setup_seconds_ = seconds_since(start_);
  }

  /// The plan, and how long it would take: a few steps tell. Writes nothing.
  void rehearse() {
    say_plan();
    const std::vector<ArrayBytes> memory = backend_->memory();
    std::int64_t bytes = 0;
    for (const ArrayBytes& array : memory) bytes += static_cast<std::int64_t>(array.bytes);
    bytes = ranks().sum(bytes);
    const std::optional<double> seconds = forecast();
    if (!leads()) return;
    const double phyxels = std::max(1, model().whole_size());
    if (options_.json) {
      nlohmann::ordered_json j = identity();
      j["time_step_s"] = plan_.dt;
      j["largest_stable_step_s"] = plan_.limit.largest_step;
      j["omega_max_rad_s"] = plan_.limit.omega_max;
      j["end_s"] = end_time();
      j["steps"] = plan_.steps;
      j["steps_per_frame"] = plan_.steps_per_frame;
      j["setup_seconds"] = setup_seconds_;
      j["bytes"] = bytes;
      if (seconds) j["forecast_seconds"] = *seconds;
      j["warnings"] = model().warnings;
      fmt::print("{}\n", j.dump(2));
      return;
    }
    if (options_.quiet) return;
    if (ranks().size() == 1) {
      for (const ArrayBytes& array : memory) {
        fmt::print("  memory      {:>12} bytes, {:6.1f} per phyxel: {}\n", array.bytes,
                   static_cast<double>(array.bytes) / phyxels, array.name);
      }
    } else {
      fmt::print("  memory      {:>12} bytes, {:6.1f} per phyxel: all ranks'\n", bytes,
                 static_cast<double>(bytes) / phyxels);
    }
    if (seconds) fmt::print("  forecast    {:.3g} s for the steps alone\n", *seconds);
  }

  void execute() {
    Backend& backend = *backend_;
    Solver& solver = solver_;
    say_plan();
    if (begin_ && solver.steps() >= plan_.steps) {
      say_finished_already();
      return;
    }

    Diagnostics now = start_diagnostics_;
    initial_energy_ = begin_ ? begin_->info.initial_energy : now.total_energy();
    peak_energy_ = now.kinetic_energy + now.elastic_energy();
    StabilityWatch watch = alike([&] { return StabilityWatch(model(), now); });
    good_ = good_state(now);
    // Without a rate only the last frame is wanted.
    if (!begin_ && scene_.output.frames_per_second > 0) write_frame(good_);

    StopSignal signals;
    const Watchdog watchdog(ranks(), watchdog_seconds());
    Progress progress(end_time(), options_.quiet || options_.json || !leads() ? nullptr : stderr,
                      {.phyxels = model().whole_size()});
    loop_start_ = Clock::now();
    auto last_checkpoint = Clock::now();
    try {
      auto stepping_since = Clock::now();
      double look_seconds = 0;
      while (solver.steps() < plan_.steps) {
        watchdog.beat(solver.steps());
        solver.step();
        const bool last = solver.steps() == plan_.steps;
        const bool frame = last || solver.steps() % plan_.steps_per_frame == 0;
        progress.update(solver.time(), solver.steps(), speed(), now.total_energy());
        writer_.serve();
        if (!frame && solver.steps() % agree_interval() != 0) continue;
        const Phase agreeing("agreeing, looking, writing");
        const bool stop = anyone(StopSignal::stop_requested() != 0);
        const bool due = anyone(StopSignal::checkpoint_requested() ||
                                (scene_.output.checkpoint_every > 0 &&
                                 seconds_since(last_checkpoint) > scene_.output.checkpoint_every));
        const bool watched = solver.steps() % watch_interval == 0 &&
                             anyone(seconds_since(stepping_since) > watch_share * look_seconds);
        if (!frame && !stop && !due && !watched) continue;

        backend.wait();
        step_seconds_ += seconds_since(stepping_since);
        if (frame) writer_.wait_for_room();
        const auto look_start = Clock::now();
        now = spent_.timed("energies", [&] { return diagnose(model(), backend, solver.now()); });
        watch.check(now);
        peak_energy_ = std::max(peak_energy_, now.kinetic_energy + now.elastic_energy());
        auto good = good_state(now);
        look_seconds = seconds_since(look_start);
        if (frame) write_frame(good);
        // Only now: a checkpoint of a state counts its frame as written, so that comes first.
        good_ = std::move(good);
        if (last || stop || due) {
          write_state();
          last_checkpoint = Clock::now();
        }
        if (stop && !last) {
          writer_.finish();
          progress.finish();
          const auto signal = ranks().largest(std::int64_t{StopSignal::stop_requested()});
          throw AgreedError(ExitCode::stopped,
                            fmt::format("stopped by signal {} at t = {:g} s (step {}); the "
                                        "checkpoint is written, --resume auto continues",
                                        signal, solver.time(), solver.steps()));
        }
        stepping_since = Clock::now();
      }
    } catch (const DivergedError& error) {  // on all ranks
      throw AgreedError(error.code(), with_last_good_state(error.what(), progress));
    } catch (const DeviceError& error) {  // on this one
      if (ranks().size() > 1) throw;
      throw DeviceError(with_last_good_state(error.what(), progress));
    } catch (const std::bad_alloc&) {
      if (ranks().size() > 1) throw;
      throw Error(ExitCode::bad_input, with_last_good_state("out of memory", progress));
    }
    writer_.finish();
    progress.finish();
    loop_seconds_ = seconds_since(loop_start_);
    ranks().together([&] {
      if (leads() && scene_.render.pictures && !options_.no_pictures) {
        pictures_ = spent_.timed("pictures", [&] {
          return render_directory(recorder_->directory(), scene_.render, true);
        });
      }
    });
    std::int64_t bytes = 0;
    for (const ArrayBytes& array : backend_->memory())
      bytes += static_cast<std::int64_t>(array.bytes);
    bytes = ranks().sum(bytes);
    const Traffic traffic = most_traffic(*backend_);
    ranks().together([&] {
      if (!leads()) return;
      const nlohmann::ordered_json summary = summary_of(now, bytes, traffic);
      // Names of files need not be UTF-8.
      const std::string text =
          summary.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
      recorder_->write_summary(text);
      if (options_.json) {
        fmt::print("{}", text);
      } else {
        say_summary(now, bytes, traffic);
      }
    });
  }

 private:
  // Often enough to stop a blow-up early; where looking takes long, after that many times as long.
  static constexpr std::int64_t watch_interval = 250;
  static constexpr double watch_share = 50;

  const Model& model() const { return shared_.here(); }

  /// Of all steps [s]; none for a search for equilibrium, whose length nobody knows.
  std::optional<double> forecast() {
    if (scene_.solver.method == Method::equilibrium) return std::nullopt;
    const auto timed = [&](std::int64_t steps) {
      const auto start = Clock::now();
      for (std::int64_t k = 0; k < steps; ++k) solver_.step();
      backend_->wait();
      return std::max(1e-9, seconds_since(start)) / static_cast<double>(steps);
    };
    const double first = timed(2);
    // As many on all ranks.
    const auto more = ranks().largest(static_cast<std::int64_t>(std::min(1000.0, 0.2 / first)));
    return (more > 2 ? timed(more) : first) * static_cast<double>(plan_.steps);
  }

  /// What a summary or a plan in JSON begins with.
  nlohmann::ordered_json identity() const {
    const Index phyxels = model().whole_size();
    return {{"program", program_version()},
            {"scene", scene_.file.string()},
            {"title", scene_.title},
            {"device", backend_->name()},
            {"ranks", ranks().size()},
            {"phyxels", phyxels},
            {"surfels", model().whole_surfels()},
            {"neighbours_per_phyxel", static_cast<double>(model().pairs()) / std::max(1, phyxels)},
            {"method", method_name(scene_.solver.method)}};
  }

  bool steps_explicitly() const { return scene_.solver.method == Method::verlet; }
  double end_time() const { return static_cast<double>(plan_.steps) * plan_.dt; }
  /// Whether this rank speaks and writes.
  static bool leads() { return ranks().rank() == 0; }
  /// Ranks ask each other now and then, and one alone itself after every step.
  static std::int64_t agree_interval() { return ranks().size() > 1 ? 10 : 1; }
  static bool anyone(bool here) { return ranks().largest(std::int64_t{here}) != 0; }

  /// How long a rank may stay where it is before it is named.
  static double watchdog_seconds() {
    const char* said = std::getenv("PHYXEL_WATCHDOG_SECONDS");
    return said ? std::atof(said) : 60;
  }

  /// Writes it, and says so.
  std::string with_last_good_state(const char* error, Progress& progress) {
    progress.finish();
    try {
      write_state();
      writer_.finish();
    } catch (const Error& writing) {
      // What this rank alone knows of must end all.
      if (ranks().size() > 1 && !dynamic_cast<const AgreedError*>(&writing)) throw;
      return fmt::format("{}; the last good state could not be written: {}", error, writing.what());
    }
    return fmt::format("{}; the last good state, at t = {:g} s, is {}", error, good_->state.time,
                       checkpoint_.string());
  }

  double speed() const {
    return static_cast<double>(solver_.steps() - first_step_) /
           std::max(1e-9, seconds_since(loop_start_));
  }

  /// Before the model is built, so that a wrong --resume or output folder costs no time.
  std::optional<CheckpointReader> find_checkpoint() const {
    if (!options_.dry_run) {
      check_output_folder(scene_.output.directory, options_.force || !options_.resume.empty());
    }
    if (options_.resume.empty()) return std::nullopt;
    std::filesystem::path file = options_.resume;
    if (options_.resume == "auto") {
      std::string warning;
      const auto latest = latest_checkpoint(scene_.output.directory, &warning);
      if (!warning.empty()) fmt::print(stderr, "phyxel: {}{}\n", warning_word(), warning);
      if (!latest) return std::nullopt;
      file = *latest;
    }
    CheckpointReader checkpoint(file);
    const Precision precision = checkpoint.info().precision;
    if (precision != scene_.solver.precision) {
      throw InputError(
          fmt::format("{}: written by a run in {}, this one is in {}: allowed --precision {}",
                      file.string(), precision_name(precision),
                      precision_name(scene_.solver.precision), precision_name(precision)));
    }
    const Method method = checkpoint.info().method;
    if (method != scene_.solver.method) {
      throw InputError(
          fmt::format("{}: written by the method \"{}\", this run's is \"{}\": allowed --method {}",
                      file.string(), method_name(method), method_name(scene_.solver.method),
                      method_name(method)));
    }
    return checkpoint;
  }

  /// What it says, without arrays; the first rank's, the others may not see its folder.
  std::optional<Checkpoint> checkpoint_for_all() {
    require_alike(std::hash<std::string>{}(scene_.text), "scenes");
    std::optional<Checkpoint> found;
    ranks().together([&] {
      if (!leads()) return;
      checkpoint_reader_ = find_checkpoint();
      if (checkpoint_reader_) {
        found = {checkpoint_reader_->state(0, 0), checkpoint_reader_->info()};
      }
    });
    if (ranks().size() == 1) return found;
    if (ranks().broadcast(std::vector<char>{found.has_value()}).front() == 0) return std::nullopt;
    if (!found) found.emplace();
    const auto share = [](auto& value) { value = ranks().broadcast(std::vector{value}).front(); };
    share(found->info.model_digest);
    share(found->info.initial_energy);
    share(found->info.frames_written);
    State& state = found->state;
    share(state.step);
    share(state.time);
    share(state.dt);
    return found;
  }

  /// The checkpoint's, or that of rest.
  State first_state() {
    if (!begin_) {
      return ranks().agreed([&] { return initial_state(model(), scene_, plan_.dt); });
    }
    ranks().together([&] { check_resumed(); });
    const CheckpointReader* const reader = checkpoint_reader_ ? &*checkpoint_reader_ : nullptr;
    State state = shared_.state_of(reader, stretch_length());
    checkpoint_reader_.reset();
    return state;
  }

  /// Phyxels of which values are brought to the first rank at a time: fewer, in tests.
  static Index stretch_length() {
    const char* said = std::getenv("PHYXEL_STRETCH");
    const Index length = said ? std::max(1, std::atoi(said)) : Stretches::usual_length;
    return ranks().broadcast(std::vector{length}).front();
  }

  void check_resumed() const {
    const bool as_many =
        !checkpoint_reader_ || checkpoint_reader_->phyxels() == model().whole_size();
    if (begin_->info.model_digest != shared_.digest() || !as_many) {
      throw InputError(
          fmt::format("{}: the checkpoint belongs to another model: bodies, materials, "
                      "neighbourhoods, loads and "
                      "fixed phyxels must be those of the run that wrote it",
                      options_.resume));
    }
    if (begin_->state.dt != plan_.dt) {
      throw InputError(
          fmt::format("{}: the checkpoint was written with a time step of {:.17g} s, this run "
                      "would take {:.17g} s; "
                      "leave time.step, time.safety and output.frames_per_second as they were",
                      options_.resume, begin_->state.dt, plan_.dt));
    }
  }

  std::shared_ptr<const GoodState> good_state(const Diagnostics& now) const {
    return std::make_shared<const GoodState>(GoodState{solver_.state(), now});
  }

  /// Whether one is left for the writer. Threads that step on all of them wait for one another
  /// twice a step, and lose more to a writer that comes between than writing beside them saves.
  bool core_is_left() const {
    if (device_.gpu) return true;
    const int threads = backend_->threads();  // of each rank alike
    return threads < omp_get_num_procs() &&
           threads * ranks().host_size() < sysconf(_SC_NPROCESSORS_ONLN);
  }

  void hand_over(std::shared_ptr<const Moment> moment, FileWriter::Job job) {
    writer_.submit(std::move(moment), std::move(job));
    // The first rank's, which writes.
    if (ranks().broadcast(std::vector<char>{core_is_left()}).front() == 0) writer_.finish();
  }

  static std::shared_ptr<Moment> moment_of(const std::shared_ptr<const GoodState>& good) {
    auto moment = std::make_shared<Moment>();
    moment->state = std::shared_ptr<const State>(good, &good->state);
    moment->frame.state = &good->state;
    moment->frame.diagnostics = good->diagnostics;
    return moment;
  }

  /// Takes what the frame needs from the backend now; it is written in the background.
  void write_frame(const std::shared_ptr<const GoodState>& good) {
    const Phase phase("frame");
    const auto moment = moment_of(good);
    Frame& frame = moment->frame;
    if (scene_.output.surface && model().whole_surfels() > 0) {
      backend_->advect_surfels(moment->surfels);
      frame.surfels = &moment->surfels;
      moment->optional.push_back(Quantity::surfel_position);
    }
    const auto wanted = [&](const char* field, Quantity quantity) {
      if (!scene_.output.wants(field)) return false;
      moment->optional.push_back(quantity);
      return true;
    };
    const bool von_mises = wanted("von_mises", Quantity::von_mises);
    const bool volume_ratio = wanted("volume_ratio", Quantity::volume_ratio);
    if (von_mises || volume_ratio) {
      stress_fields(model(), *backend_, von_mises ? &frame.von_mises : nullptr,
                    volume_ratio ? &frame.volume_ratio : nullptr);
    }
    hand_over(moment, [this, diagnostics = good->diagnostics](Stretches& values) {
      const Phase writing("writing a frame");
      recorder_->write(diagnostics, values);
    });
  }

  /// The last good one, in the background, after the frames handed over before.
  void write_state() {
    hand_over(moment_of(good_), [this, good = good_](Stretches& values) {
      const Phase writing("writing a checkpoint");
      CheckpointInfo info;
      info.program = program_version();
      info.precision = scene_.solver.precision;
      info.method = scene_.solver.method;
      info.scene_text = scene_.text;
      info.model_digest = shared_.digest();
      info.total_energy = good->diagnostics.total_energy();
      info.initial_energy = initial_energy_;
      info.frames_written = recorder_->frames_written();
      checkpoint_ =
          write_checkpoint(recorder_->directory(), good->state, info, model().whole_size(), values);
    });
  }

  void say_plan() const {
    if (options_.json || options_.quiet || !leads()) return;
    fmt::print("{}: {}\n", program_version(),
               scene_.title.empty() ? scene_.file.string() : scene_.title);
    fmt::print("{}", describe_model(scene_, model(), boundary_));
    fmt::print("  device      {}\n", backend_->name());
    if (ranks().size() > 1) {
      const SharedModel::Shares& shares = shared_.shares();
      fmt::print(
          "  ranks       {} ranks, cut by {}: {} to {} phyxels each, at most {} ghosts; {} "
          "exchanged through {}\n",
          ranks().size(), shared_.partitioner(), shares.fewest, shares.most, shares.most_ghosts,
          options_.cut.rings == 1 ? "displacements and stresses" : "displacements of two rings",
          transport_);
      if (!gpus_.empty()) fmt::print("  gpus        {}, by rank\n", fmt::join(gpus_, ", "));
    }
    fmt::print("  time step   {}\n", plan_.why);
    fmt::print(
        "  plan        {} steps to t = {:g} s, a frame every {} steps; set-up took {:.2f} s\n",
        plan_.steps, end_time(), plan_.steps_per_frame, setup_seconds_);
    if (begin_) fmt::print("  resumed     at t = {:g} s (step {})\n", solver_.time(), first_step_);
    std::fflush(stdout);
  }

  /// Not an error: a job script that resumes until it is done ends here.
  void say_finished_already() const {
    if (!leads()) return;
    const std::string message = fmt::format(
        "the checkpoint is at t = {:g} s, the run ends at {:g} s: nothing is left to do",
        solver_.time(), end_time());
    if (options_.json) {
      fmt::print(
          "{}\n",
          nlohmann::ordered_json{{"program", program_version()}, {"finished", message}}.dump(2));
    } else {
      fmt::print("  finished    {}\n", message);
    }
  }

  /// Where the seconds went, in the order of the run.
  nlohmann::ordered_json timing() const {
    nlohmann::ordered_json timing;
    double energies = 0, pictures = 0, others = 0;
    for (const auto& [what, seconds] : spent_.all()) {
      if (what == "energies") {
        energies = seconds;
      } else if (what == "pictures") {
        pictures = seconds;
      } else {
        timing[what] = seconds;
        others += seconds;
      }
    }
    timing["rest of the set-up"] = std::max(0.0, setup_seconds_ - others);
    timing["steps"] = step_seconds_;
    timing["energies"] = energies;
    timing["frames and checkpoints"] = std::max(0.0, loop_seconds_ - step_seconds_ - energies);
    if (!pictures_.empty()) timing["pictures"] = pictures;
    return timing;
  }

  double energy_drift(const Diagnostics& now) const {
    return (now.total_energy() - initial_energy_) / std::max(peak_energy_, 1e-300);
  }
  static double force_balance(const Diagnostics& now) {
    return norm(now.internal_force) / std::max(now.force_scale, 1e-300);
  }
  static double torque_balance(const Diagnostics& now) {
    return norm(now.internal_torque) / std::max(now.torque_scale, 1e-300);
  }
  double steps_taken() const { return static_cast<double>(solver_.steps() - first_step_); }

  nlohmann::ordered_json summary_of(const Diagnostics& now, std::int64_t bytes,
                                    const Traffic& traffic) const {
    const double steps = steps_taken();
    const Index phyxels = model().whole_size();
    nlohmann::ordered_json j = identity();
    j.update({{"time_s", now.time},
              {"steps", solver_.steps()},
              {"time_step_s", plan_.dt},
              {"largest_stable_step_s", plan_.limit.largest_step},
              {"omega_max_rad_s", plan_.limit.omega_max},
              {"force_evaluations", solver_.work().evaluations},
              {"newton_steps", solver_.work().newton_steps},
              {"newton_residual", solver_.work().residual},
              {"setup_seconds", setup_seconds_},
              {"loop_seconds", loop_seconds_},
              {"step_seconds", step_seconds_},
              {"seconds", timing()},
              {"steps_per_second", steps / step_seconds_},
              {"phyxel_steps_per_second", steps * phyxels / step_seconds_},
              {"bytes", bytes},
              {"transport", transport_},
              {"gpus", gpus_},
              {"exchange_bytes", traffic.bytes_sent},
              {"exchange_seconds", traffic.seconds},
              {"energy_j", now.total_energy()},
              {"energy_drift", energy_drift(now)},
              {"conservative", is_conservative(model())},
              {"internal_force_balance", force_balance(now)},
              {"internal_torque_balance", torque_balance(now)},
              {"inverted_phyxels", now.inverted},
              {"warnings", model().warnings},
              {"frames", recorder_->frames_written()},
              {"directory", recorder_->directory().string()},
              {"checkpoint", checkpoint_.string()}});
    return j;
  }

  void say_summary(const Diagnostics& now, std::int64_t bytes, const Traffic& traffic) const {
    const double steps = steps_taken();
    const Index phyxels = model().whole_size();
    fmt::print(
        "  speed       {:.4g} steps/s, {:.4g} phyxel-steps/s; {:.2f} s for the steps, {:.2f} s "
        "with "
        "output; {:.0f} bytes per phyxel\n",
        steps / step_seconds_, steps * phyxels / step_seconds_, step_seconds_, loop_seconds_,
        static_cast<double>(bytes) / std::max(1, phyxels));
    if (ranks().size() > 1) {
      fmt::print(
          "  exchange    at most {:.3g} kB a step and rank; {:.1f}% of the seconds above for "
          "packing "
          "and waiting\n",
          1e-3 * static_cast<double>(traffic.bytes_sent) / steps,
          100 * traffic.seconds / loop_seconds_);
    }
    if (!steps_explicitly()) {
      const SolverWork work = solver_.work();
      fmt::print(
          "  newton      {} steps of Newton's method, {} evaluations of the forces; residual "
          "{:.1e} "
          "of what acts\n",
          work.newton_steps, work.evaluations, work.residual);
    }
    if (scene_.solver.method == Method::equilibrium) {
      fmt::print("  energy      {:.6g} J at rest, {:.4g} J of it elastic\n", now.total_energy(),
                 now.elastic_energy());
    } else if (is_conservative(model())) {
      fmt::print("  energy      drift {:+.2e} of the largest kinetic + elastic energy, {:.4g} J\n",
                 energy_drift(now), peak_energy_);
    } else {
      fmt::print(
          "  energy      {:.6g} J, not conserved in this scene (damping, motion or growing load)\n",
          now.total_energy());
    }
    fmt::print("  momentum    internal forces sum to {:.1e} of their size, torques to {:.1e}\n",
               force_balance(now), torque_balance(now));
    if (now.inverted > 0) {
      fmt::print(
          "  warning     {} phyxels are inside out (det F <= 0) at the end; a finer time step will "
          "not "
          "cure that: volume_stiffness or a stiffer material may\n",
          now.inverted);
    }
    fmt::print("  written     {} frames: ", recorder_->frames_written());
    const auto files = recorder_->files();
    for (std::size_t f = 0; f < files.size(); ++f)
      fmt::print("{}{}", f ? ", " : "", files[f].string());
    fmt::print("\n              {} (checkpoint)\n", checkpoint_.string());
    if (!pictures_.empty()) {
      fmt::print("              {} pictures: {} ... {}\n", pictures_.size(),
                 pictures_.front().string(), pictures_.back().string());
    }
  }

  const RunOptions& options_;
  Clock::time_point start_ = Clock::now();
  TimeSpent spent_;
  Scene scene_;
  ChosenDevice device_;
  std::optional<CheckpointReader> checkpoint_reader_;  // on the first rank, until its state is read
  std::optional<Checkpoint> begin_;                    // without arrays
  SharedModel shared_;
  std::unique_ptr<Backend> backend_;
  StepPlan plan_;
  BoundarySize boundary_;  // of the whole
  Solver solver_;
  std::int64_t first_step_ = 0;
  Diagnostics start_diagnostics_;
  std::optional<Recorder> recorder_;       // on the first rank
  std::string transport_;                  // between ranks
  std::vector<int> gpus_;                  // of the ranks
  std::shared_ptr<const GoodState> good_;  // the last one
  double initial_energy_ = 0, peak_energy_ = 0;
  double setup_seconds_ = 0, step_seconds_ = 0, loop_seconds_ = 0;  // steps alone; with output
  Clock::time_point loop_start_;
  std::filesystem::path checkpoint_;
  std::vector<std::filesystem::path> pictures_;
  // Last: it ends first, and its jobs use the recorder.
  FileWriter writer_{shared_, stretch_length()};
};

void run(const RunOptions& options) {
  if (options.dry_run) {
    Run(options).rehearse();
    return;
  }
  if (options.profile.empty()) {
    Run(options).execute();
    return;
  }
  start_profile(options.profile, options.force);
  try {
    Run(options).execute();
  } catch (const AgreedError&) {  // on all ranks, e.g. after a signal
    write_profile(options.profile);
    throw;
  }
  write_profile(options.profile);
}

}  // namespace

void add_run(CLI::App& program) {
  CLI::App* command =
      program.add_subcommand("run", "Simulate a scene, write its trajectory and pictures");
  auto options = std::make_shared<RunOptions>();
  add_overrides(*command, options->overrides);
  command->add_option(
      "--resume", options->resume,
      "Continue from a checkpoint file, or from the newest in the output folder (auto)");
  command
      ->add_option(
          "--partitioner", options->cut.partitioner,
          "How mpirun's ranks cut the bodies: metis, curve, bisection, or auto, the best of "
          "the three")
      ->check(CLI::IsMember(partitioner_choices()));
  command
      ->add_option("--ghost-rings", options->cut.rings,
                   "1: ranks exchange displacements and stresses; 2: displacements of two "
                   "rings of neighbours, and stresses between are found twice")
      ->check(CLI::Range(1, 2));
  command
      ->add_option("--transport", options->transport,
                   "How ranks' GPUs exchange: direct (stores into each other's memory), nccl, mpi "
                   "(a CUDA-aware one), host (MPI through the host's memory), or auto")
      ->check(CLI::IsMember(transport_names()));
  command->add_flag("--force", options->force,
                    "Replace an earlier trajectory in the output folder");
  command->add_flag("--no-pictures", options->no_pictures,
                    "Leave out the pictures the scene asks for");
  command->add_flag("--quiet", options->quiet, "No progress, no plan; only the summary");
  command->add_flag("--json", options->json, "The summary as JSON, nothing else on stdout");
  command->add_flag("--dry-run", options->dry_run,
                    "Only the plan: step, memory, device, ranks, forecast; as phyxel check does");
  command->add_option("--profile", options->profile,
                      "Write what each rank does when to this file, for a trace viewer "
                      "(chrome://tracing, ui.perfetto.dev)");
  command->footer(
      "Examples:\n"
      "  phyxel run examples/dino/scene.toml --out out/dino\n"
      "  phyxel run scene.toml --precision double --until 0.5 --force\n"
      "  phyxel run scene.toml --dry-run\n"
      "  phyxel run scene.toml --resume auto\n"
      "  mpirun -n 8 phyxel run scene.toml");
  command->callback([options] { run(*options); });
}

void add_check(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "check", "Read a scene, build its model and print the plan: time step, memory, forecast");
  auto options = std::make_shared<RunOptions>();
  options->dry_run = true;
  add_overrides(*command, options->overrides);
  command->add_flag("--json", options->json, "The plan as JSON, nothing else on stdout");
  command->footer(
      "Examples:\n"
      "  phyxel check examples/dino/scene.toml\n"
      "  phyxel check scene.toml --device cpu --precision double --json\n"
      "  mpirun -n 8 phyxel check scene.toml");
  command->callback([options] { run(*options); });
}

}  // namespace phyxel::app
