/// Continuation of a run from a checkpoint.
#include <fmt/format.h>

#include <cmath>
#include <cstdlib>

#include "files/trajectory_folder.hpp"
#include "run/run.hpp"
#include "terminal.hpp"

namespace phyxel::app {

namespace {

/// Number of halvings that lead from the planned step to `step`; unset if none does.
std::optional<int> halvings_between(double planned, double step) {
  for (int k = 0; k <= StepControl::most_halvings; ++k) {
    if (std::ldexp(planned, -k) == step) return k;
  }
  return std::nullopt;
}

}  // namespace

std::optional<CheckpointReader> Run::find_checkpoint() {
  const std::filesystem::path& folder = scene_.output.directory;
  std::filesystem::path file = options_.resume;
  if (options_.resume == "auto") {
    std::string warning;
    const auto latest = latest_checkpoint(folder, &warning);
    if (!warning.empty()) fmt::print(stderr, "phyxel: {}{}\n", warning_word(), warning);
    file = latest.value_or(std::filesystem::path());
  }
  if (file.empty()) {
    // A run that was stopped before its first checkpoint begins again.
    replace_ = options_.force || (options_.resume == "auto" && holds_only_a_start(folder, scene_));
    if (!options_.dry_run) check_output_folder(folder, replace_);
    return std::nullopt;
  }
  replace_ = options_.force;
  CheckpointReader checkpoint(file);
  resumed_from_ = file;
  continuation_ = {checkpoint.info().frames_written, checkpoint.state(0, 0).time,
                   checkpoint.info().watched.start_energy, file};
  if (!options_.dry_run) check_continuation(folder, *continuation_, options_.force);
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

std::optional<Checkpoint> Run::checkpoint_for_all() {
  require_alike(std::hash<std::string>{}(scene_.text), "scenes");
  // Options override the scene.
  require_alike(std::hash<std::string>{}(fmt::format(
                    "{:a} {:a} {:a} {:a} {} {} {}", scene_.time.end, scene_.time.step.value_or(0),
                    scene_.time.safety, scene_.output.frames_per_second,
                    precision_name(scene_.solver.precision), method_name(scene_.solver.method),
                    options_.resume)),
                "options (--until, --step, --precision, --method, --resume)");
  std::optional<Checkpoint> found;
  ranks().collectively([&] {
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
  share(found->info.version);
  share(found->info.model_digest);
  share(found->info.watched);
  share(found->info.frames_written);
  State& state = found->state;
  share(state.step);
  share(state.time);
  share(state.dt);
  return found;
}

State Run::first_state() {
  if (!begin_) {
    return ranks().agreed([&] { return initial_state(model(), scene_, plan_.dt); });
  }
  ranks().collectively([&] { check_resumed(); });
  plan_.halve(*halvings_between(plan_.dt, begin_->state.dt));
  const CheckpointReader* const reader = checkpoint_reader_ ? &*checkpoint_reader_ : nullptr;
  State state = shared_.state_of(reader, stretch_length());
  checkpoint_reader_.reset();
  return state;
}

Index Run::stretch_length() {
  const char* said = std::getenv("PHYXEL_STRETCH");
  const Index length = said ? std::max(1, std::atoi(said)) : ChunkedSource::usual_length;
  return ranks().broadcast(std::vector{length}).front();
}

void Run::check_resumed() const {
  // The first rank has read the checkpoint; version 2 has no parameters.
  if (checkpoint_reader_ && checkpoint_reader_->info().version > 2) {
    const std::string differences =
        parameter_differences(checkpoint_reader_->info().parameters, scene_parameters(scene_));
    if (!differences.empty()) {
      throw InputError(fmt::format(
          "{}: the checkpoint belongs to another model or run; allowed: the values of the run that "
          "wrote it\n{}",
          options_.resume, differences));
    }
  }
  const bool as_many =
      !checkpoint_reader_ || checkpoint_reader_->phyxels() == model().global_count();
  if (!shared_.wrote(begin_->info) || !as_many) {
    throw InputError(
        fmt::format("{}: the checkpoint belongs to another model: bodies (what body.mesh, "
                    "body.file and body.cloud hold, too), materials, neighbourhoods, loads and "
                    "fixed phyxels must be those of the run that wrote it",
                    options_.resume));
  }
  if (!halvings_between(plan_.dt, begin_->state.dt)) {
    throw InputError(
        fmt::format("{}: the checkpoint was written with a time step of {:.17g} s, this run "
                    "would take {:.17g} s; "
                    "leave time.step, time.safety and output.frames_per_second as they were",
                    options_.resume, begin_->state.dt, plan_.dt));
  }
}

}  // namespace phyxel::app
