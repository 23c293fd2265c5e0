/// Set-up, the loop over steps, and the rehearsal.
#include "run/run.hpp"

#include <fmt/format.h>

#include <cstdlib>
#include <nlohmann/json.hpp>

#include "files/trajectory_folder.hpp"
#include "mpi/watchdog.hpp"
#include "outside_text.hpp"
#include "picture.hpp"
#include "stop_signal.hpp"

namespace phyxel::app {

namespace fs = std::filesystem;

Run::Run(const RunOptions& options)
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
      recovery_(spent_.timed("backend", [&] { return recovery_for(scene_.output, model()); })),
      fields_(model(), scene_.output),
      probes_(alike([&] { return Probes(model()); })),
      plan_(alike([&] {
        return spent_.timed("time step", [&] {
          return plan_steps(scene_, model(), *backend_, options.overrides.unsafe_step);
        });
      })),
      solver_(model(), *backend_, first_state(), scene_.solver.method),
      control_(model(), *backend_, plan_),
      first_step_(solver_.steps()),
      start_diagnostics_(diagnose(model(), *backend_, solver_)) {
  StopSignal::work_begins();
  // Last, since it replaces the files of an earlier run: everything that could fail has been done.
  ranks().collectively([&] {
    if (!leads() || options_.dry_run) return;
    const std::filesystem::path& folder = scene_.output.directory;
    // A finished run with a summary is left unchanged.
    if (begin_ && solver_.steps() >= plan_.steps && fs::exists(folder / summary_name)) return;
    recorder_.emplace(model(), scene_, replace_, continuation_);
  });
  if (const auto exchanges = backend_->exchanges()) transport_ = exchanges->transport;
  if (device_.gpu) gpus_ = ranks().gathered(std::span<const int>(&device_.gpu->index, 1));
  supports_ = support_ranges(model());
  const BoundarySize boundary = boundary_size(model());
  boundary_ = {ranks().sum(boundary.moved), ranks().sum(boundary.loaded),
               ranks().sum(boundary.touching), ranks().sum(boundary.touching_bodies)};
  setup_seconds_ = seconds_since(start_);
}

void Run::rehearse() {
  say_plan();
  const std::vector<ArrayBytes> memory = backend_->memory();
  std::int64_t bytes = 0;
  for (const ArrayBytes& array : memory) bytes += static_cast<std::int64_t>(array.bytes);
  bytes = ranks().sum(bytes);
  const std::optional<double> seconds = forecast();
  if (!leads()) return;
  const double phyxels = std::max(1, model().global_count());
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
    fmt::print("{}\n", json_text(j));
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

void Run::execute() {
  say_plan();
  const bool finished = begin_ && solver_.steps() >= plan_.steps;
  if (finished && !summary_is_missing()) return say_finished_already();
  now_ = start_diagnostics_;
  watched_ =
      begin_ ? begin_->info.watched
             : Watched{now_.total_energy(), now_.largest_speed, now_.kinetic_and_elastic_energy()};
  peak_energy_ = std::max(watched_.peak_energy, now_.kinetic_and_elastic_energy());
  readings_ = read_off();
  if (finished) checkpoint_ = resumed_from_;
  if (!finished) step_to_end();
  draw_and_sum_up();
}

void Run::step_to_end() {
  StabilityWatch watch = alike([&] { return StabilityWatch(model(), now_, watched_); });
  watched_.start_speed = watch.watched().start_speed;  // a checkpoint of version 2 has none
  good_ = good_state(now_);
  if (!begin_) {
    // Without a frame rate only the last frame is written.
    if (scene_.output.frames_per_second > 0) write_frame(good_);
    // The first checkpoint lets a run continue however early it stops.
    if (scene_.solver.method != Method::equilibrium) write_state();
  }
  Watchdog watchdog(ranks(), watchdog_seconds());
  Progress progress(end_time(), options_.quiet || options_.json || !leads() ? nullptr : stderr,
                    {.phyxels = model().global_count()});
  watch_newton(progress);
  loop_start_ = Clock::now();
  try {
    take_steps(watch, watchdog, progress);
  } catch (const InterruptedError& error) {  // on all ranks
    throw AgreedError(error.code(), stopped_in_search(error, progress));
  } catch (const DivergedError& error) {  // on all ranks
    throw AgreedError(error.code(), with_last_good_state(error.what(), progress));
  } catch (const DeviceError& error) {  // on this rank
    if (ranks().size() > 1) throw;
    throw DeviceError(with_last_good_state(error.what(), progress));
  } catch (const std::bad_alloc&) {
    if (ranks().size() > 1) throw;
    throw Error(ExitCode::bad_input, with_last_good_state("out of memory", progress));
  }
  writer_.finish();
  watchdog.close();
  progress.finish();
  loop_seconds_ = seconds_since(loop_start_);
}

void Run::take_steps(StabilityWatch& watch, const Watchdog& watchdog, Progress& progress) {
  auto last_checkpoint = Clock::now(), stepping_since = last_checkpoint;
  double look_seconds = 0;
  while (solver_.steps() < plan_.steps) {
    watchdog.beat(solver_.steps());
    take_step(progress);
    const bool last = solver_.steps() == plan_.steps;
    const bool frame = last || solver_.steps() % plan_.steps_per_frame == 0;
    if (scene_.solver.method != Method::equilibrium) show_progress(progress, now_);
    writer_.serve();
    if (!frame && solver_.steps() % agree_interval() != 0) continue;
    const Phase agreeing("agreeing, looking, writing");
    const bool stop = anyone(StopSignal::stop_requested() != 0);
    const bool due = anyone(StopSignal::checkpoint_requested() ||
                            (scene_.output.checkpoint_every > 0 &&
                             seconds_since(last_checkpoint) > scene_.output.checkpoint_every));
    const bool watched = solver_.steps() % watch_interval == 0 &&
                         anyone(seconds_since(stepping_since) > watch_share * look_seconds);
    if (!frame && !stop && !due && !watched) continue;

    backend_->wait();
    step_seconds_ += seconds_since(stepping_since);
    if (frame) writer_.wait_for_room();
    const auto look_start = Clock::now();
    now_ = spent_.timed("energies", [&] { return diagnose(model(), *backend_, solver_); });
    if (frame) readings_ = read_off();
    watch.check(now_, &control_);
    control_.see(solver_);
    show_progress(progress, now_);
    peak_energy_ = watch.watched().peak_energy;
    if (frame)
      watched_.peak_energy = std::max(watched_.peak_energy, now_.kinetic_and_elastic_energy());
    auto good = good_state(now_);
    look_seconds = seconds_since(look_start);
    if (frame) write_frame(good);
    // After the frame: the checkpoint of a state counts its frame as written.
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
                                    signal, solver_.time(), solver_.steps()));
    }
    stepping_since = Clock::now();
  }
}

Readings Run::read_off() {
  return spent_.timed("energies", [&] {
    Readings found{
        find_reactions(model(), *backend_, solver_),    probes_.read(*backend_, recovery_.get()),
        read_gases(model(), *backend_, solver_),        find_contacts(model(), *backend_, solver_),
        read_rigid_bodies(model(), *backend_, solver_), read_fragments(model(), *backend_)};
    held_.keep_wholes(find_held_overlaps(model(), solver_, backend_->rigid_states()));
    deepest_.resize(found.contacts.size());
    deepest_shares_.resize(found.contacts.size());
    for (std::size_t k = 0; k < deepest_.size(); ++k) {
      deepest_[k] = std::max(deepest_[k], found.contacts[k].depth);
      deepest_shares_[k] = std::max(deepest_shares_[k], found.contacts[k].depth_share);
    }
    return found;
  });
}

bool Run::summary_is_missing() const {
  const bool here = leads() && !std::filesystem::exists(scene_.output.directory / summary_name);
  return anyone(here);
}

void Run::draw_and_sum_up() {
  ranks().collectively([&] {
    if (leads() && scene_.render.pictures && !options_.no_pictures) {
      pictures_ = spent_.timed(
          "pictures", [&] { return render_directory(recorder_->directory(), scene_, true); });
    }
  });
  std::int64_t bytes = 0;
  for (const ArrayBytes& array : backend_->memory())
    bytes += static_cast<std::int64_t>(array.bytes);
  bytes = ranks().sum(bytes);
  const Traffic traffic = most_traffic(*backend_);
  ranks().collectively([&] {
    if (!leads()) return;
    const nlohmann::ordered_json summary = summary_of(now_, bytes, traffic);
    const std::string text = json_text(summary) + "\n";
    recorder_->write_summary(text);
    if (options_.json) {
      fmt::print("{}", text);
    } else {
      say_summary(now_, bytes, traffic);
    }
  });
}

std::optional<double> Run::forecast() {
  if (scene_.solver.method == Method::equilibrium) return std::nullopt;
  const auto timed = [&](std::int64_t steps) {
    const auto start = Clock::now();
    solver_.step(static_cast<int>(steps));
    backend_->wait();
    return std::max(1e-9, seconds_since(start)) / static_cast<double>(steps);
  };
  const double first = timed(2);
  // All ranks must take the same number of steps.
  const auto more = ranks().largest(static_cast<std::int64_t>(std::min(1000.0, 0.2 / first)));
  return (more > 2 ? timed(more) : first) * static_cast<double>(plan_.steps);
}

std::int64_t Run::agree_interval() const {
  // Ranks meet seldom; a device has many steps between two calls anyway.
  return ranks().size() > 1 && backend_->best_steps() == 1 ? 10 : 1;
}

bool Run::anyone(bool here) { return ranks().largest(std::int64_t{here}) != 0; }

double Run::watchdog_seconds() {
  const char* said = std::getenv("PHYXEL_WATCHDOG_SECONDS");
  return said ? std::atof(said) : 60;
}

}  // namespace phyxel::app
