#include "view/session.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <system_error>

#include "device_option.hpp"
#include "file_writer.hpp"
#include "files/atomic_file.hpp"
#include "outside_text.hpp"
#include "phyxel/error.hpp"
#include "program_ranks.hpp"
#include "stop_signal.hpp"
#include "version.hpp"
#include "view/live_page.hpp"

namespace phyxel::app {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

/// Time of a turn, after which requests are read again [s]; times between frames and between looks.
constexpr double turn_seconds = 0.012, frame_seconds = 1.0 / 60, look_seconds = 0.1,
                 most_look_pause = 2;
/// Largest share of the time that looks at energies take, and that frames do.
constexpr double look_share = 0.1, frame_share = 0.2;
/// Largest size of a recorded session [bytes].
constexpr std::size_t most_of_session = std::size_t{1} << 28;

Recording recording_in(const ViewOptions& options) {
  if (options.replay.empty()) return {};
  return ranks().agreed([&] {
    return parse_recording(read_text_file(options.replay, most_of_session), options.replay);
  });
}

/// Sets that follow each other become one, since each of them makes the model anew.
void add_merged(std::vector<Request>& acts, const Request& act) {
  if (act.kind == RequestKind::set && !acts.empty() && acts.back().kind == RequestKind::set) {
    acts.back().settings.take(act.settings);
  } else if (act.kind == RequestKind::move && !acts.empty() &&
             acts.back().kind == RequestKind::move) {
    acts.back() = act;
  } else {
    acts.push_back(act);
  }
}

}  // namespace

Session::Session(const ViewOptions& options, LiveScene& live)
    : options_(options),
      live_(live),
      playing_(!options.paused),
      pace_(options.pace),
      until_(options.overrides.until) {
  const Scene& scene = live_.scene();
  if (fs::exists(scene.output.directory) && !fs::is_directory(scene.output.directory)) {
    throw InputError(fmt::format("{}: no folder; allowed: a folder for what is saved",
                                 scene.output.directory.string()));
  }
  recording_.program = program_version();
  recording_.of = {live_.shared().digest(), precision_name(scene.solver.precision),
                   method_name(scene.solver.method), live_.solver().dt(), scene_parameters(scene)};
  if (!options.replay.empty()) {
    const Recording read = recording_in(options);
    if (const std::string others = differences(read.of, recording_.of); !others.empty()) {
      throw AgreedError(ExitCode::bad_input,
                        fmt::format("{}: recorded in another run:\n{}", options.replay, others));
    }
    to_replay_.assign(read.acts.begin(), read.acts.end());
  }
  if (!options.headless) {
    picture_.emplace(live_);
    ranks().collectively([&] {
      if (!all_ranks().leads()) return;
      const std::string about =
          fmt::format("{}, steps of {:.3g} s", live_.backend().name(), live_.solver().dt());
      server_.emplace(options.host, options.port, live_page(live_, *picture_, about));
      if (!options.prints) return;
      fmt::print("{}\n", server_->address());
      std::fflush(stdout);
    });
  }
}

void Session::run(const Around& around) {
  since_ = last_look_ = last_frame_ = Clock::now();
  for (bool rests = false;;) {
    const Turn decision = all_ranks().leads() ? decided() : Turn();
    // While nothing happens, the first rank sleeps until messages come, and so do others.
    if (rests) ranks().wait_asleep();
    const Turn turn = agreed(decision);
    rests = turn.steps == 0 && turn.acts.empty();
    if (turn.end) break;
    around([&] { take(turn); });
  }
  // Only the first rank knows what is left.
  const std::int64_t left = ranks().sum(
      all_ranks().leads() ? static_cast<std::int64_t>(to_replay_.size()) : std::int64_t{0});
  if (options_.headless && left > 0) {
    throw AgreedError(ExitCode::stopped,
                      fmt::format("stopped by a signal at t = {:g} s; {} acts are left",
                                  live_.solver().time(), left));
  }
  tell(options_.farewell);
}

Session::Turn Session::agreed(Turn turn) const {
  if (ranks().size() == 1) return turn;
  std::string text;
  if (all_ranks().leads()) {
    Json json{turn.steps, turn.field, turn.look, turn.frame, turn.end};
    for (const Request& act : turn.acts) json.push_back(json_of(act));
    text = json_text(json, -1);
  }
  const std::vector<char> sent = ranks().broadcast(std::vector<char>(text.begin(), text.end()));
  const Json json = Json::parse(sent.begin(), sent.end());
  Turn all{{},
           json[0].get<std::int64_t>(),
           json[1].get<std::int32_t>(),
           json[2].get<bool>(),
           json[3].get<bool>(),
           json[4].get<bool>()};
  for (std::size_t k = 5; k < json.size(); ++k) all.acts.push_back(parse_request(json[k].dump()));
  return all;
}

Session::Turn Session::decided() {
  Turn turn;
  turn.end =
      stops_ || StopSignal::stop_requested() != 0 || (options_.headless && to_replay_.empty());
  if (turn.end) return turn;
  if (server_) {
    read_messages();
    if (server_->joins() != joins_) {
      joins_ = server_->joins();
      changed_ = true;
      tell_state();
    }
  }
  if (until_ && live_.solver().time() >= *until_) {
    until_.reset();
    Request pause;
    pause.kind = RequestKind::pause;
    obey(pause);
    tell(fmt::format("Paused at t = {:g} s (--until).", live_.solver().time()));
  }
  add_acts(turn);
  const bool moves = options_.headless || (playing_ && !broken_ && server_->watchers() > 0);
  turn.steps = moves ? steps_due() : std::min(asked_steps_, steps_of_a_turn());
  if (!moves) asked_steps_ -= turn.steps;
  if (broken_) turn.steps = 0;
  if (!to_replay_.empty()) {
    turn.steps = std::min(turn.steps, to_replay_.front().step - live_.taken());
  }
  if (!server_) return turn;
  const bool news = changed_ || live_.taken() + turn.steps != shown_at_ || !turn.acts.empty();
  turn.field = field_;
  turn.frame = news && server_->wants_frame() && seconds_since(last_frame_) > frame_pause_;
  turn.look = live_.taken() + turn.steps != looked_at_ && seconds_since(last_look_) > look_pause_;
  if (turn.steps == 0 && turn.acts.empty() && !turn.frame) {
    server_->wait_for_message(std::chrono::milliseconds(4));
  }
  return turn;
}

void Session::read_messages() {
  for (const std::string& message : server_->take_messages()) {
    try {
      obey(parse_request(message));
    } catch (const InputError& error) {
      tell(error.what());
    }
  }
}

void Session::obey(const Request& request) {
  if (is_act(request.kind)) {
    if (!to_replay_.empty()) {
      if (request.kind != RequestKind::move && request.kind != RequestKind::drop) {
        tell("A recorded session is replayed; what it does cannot be changed until it ends.");
      }
      return;
    }
    return add_merged(waiting_, request);
  }
  switch (request.kind) {
    case RequestKind::play:
    case RequestKind::pause:
      playing_ = request.kind == RequestKind::play;
      restart_clock();
      break;
    case RequestKind::step:
      playing_ = false;
      asked_steps_ += static_cast<std::int64_t>(request.number);
      break;
    case RequestKind::pace:
      pace_ = request.number;
      restart_clock();
      break;
    default: {
      const std::vector<LiveField>& fields = picture_->fields();
      const auto found = std::find_if(fields.begin(), fields.end(), [&](const LiveField& field) {
        return field.name == request.field;
      });
      if (found == fields.end() && request.field != "bodies") {
        throw InputError(fmt::format("request: field = \"{}\": unknown", request.field));
      }
      field_ = found == fields.end() ? -1 : static_cast<std::int32_t>(found - fields.begin());
      changed_ = true;
    }
  }
  tell_state();
}

void Session::add_acts(Turn& turn) {
  while (!to_replay_.empty() && to_replay_.front().step <= live_.taken()) {
    turn.acts.push_back(to_replay_.front().act);
    to_replay_.pop_front();
  }
  turn.acts.insert(turn.acts.end(), waiting_.begin(), waiting_.end());
  waiting_.clear();
}

void Session::restart_clock() {
  since_ = Clock::now();
  since_time_ = live_.solver().time();
}

std::int64_t Session::steps_of_a_turn() const {
  constexpr double most = 1e6;
  const double room = seconds_per_step_ > 0 ? turn_seconds / seconds_per_step_ : 1;
  return static_cast<std::int64_t>(std::clamp(room, 1.0, most));
}

std::int64_t Session::steps_due() {
  if (options_.headless) return steps_of_a_turn();
  const auto room = static_cast<double>(steps_of_a_turn());
  const double behind = pace_ * seconds_since(since_) - (live_.solver().time() - since_time_);
  const double due = behind / live_.solver().dt();
  if (due > room) {  // what the machine cannot do is not made up for later
    since_ = Clock::now();
    since_time_ = live_.solver().time() + room * live_.solver().dt();
  }
  return static_cast<std::int64_t>(std::clamp(std::floor(due), 0.0, room));
}

void Session::take(const Turn& turn) {
  for (const Request& request : turn.acts) act(request);
  if (turn.steps > 0) {
    const auto start = Clock::now();
    try {
      live_.advance(turn.steps);
    } catch (const DivergedError& error) {
      diverged(error.what());
    }
    live_.backend().wait();
    const double now = seconds_since(start) / static_cast<double>(turn.steps);
    seconds_per_step_ = seconds_per_step_ > 0 ? 0.8 * seconds_per_step_ + 0.2 * now : now;
  }
  if (turn.look && !broken_) {
    const auto start = Clock::now();
    try {
      live_.look();
    } catch (const DivergedError& error) {
      diverged(error.what());
    }
    if (server_) tell_energies();
    looked_at_ = live_.taken();
    look_pause_ = std::clamp(seconds_since(start) / look_share, look_seconds, most_look_pause);
    last_look_ = Clock::now();
  }
  if (turn.frame) {
    const auto start = Clock::now();
    const auto frame = picture_->frame(live_, turn.field, ++frames_);
    if (server_) server_->send_frame(frame);
    shown_at_ = live_.taken();
    changed_ = false;
    last_frame_ = Clock::now();
    // What rests has time for frames.
    const double share = turn.steps > 0 ? frame_share : 1;
    frame_pause_ = std::max(frame_seconds, seconds_since(start) * (1 / share - 1));
  }
}

void Session::act(const Request& request) {
  const std::int64_t step = live_.taken();
  try {
    if (request.kind == RequestKind::save) {
      recording_.acts.push_back({step, request});
      save();
    } else {
      live_.apply(request);
      recording_.acts.push_back({step, request});
    }
  } catch (const DeviceError&) {
    throw;
  } catch (const Error& error) {  // on all ranks
    if (options_.headless) {      // it was not refused when it was recorded
      throw AgreedError(error.code(), fmt::format("{}: {}", options_.replay, error.what()));
    }
    tell(error.what());
  }
  if (request.kind == RequestKind::reset || request.kind == RequestKind::set) {
    broken_ = false;
    restart_clock();
    speed_time_ = live_.solver().time();
    looked_at_ = -1;
    seconds_per_step_ = 0;
    tell_state();
  }
  changed_ = true;
}

fs::path Session::next_folder() const {
  for (int k = 1;; ++k) {
    fs::path folder = live_.scene().output.directory / fmt::format("saved_{:04}", k);
    std::error_code error;
    fs::create_directories(folder.parent_path(), error);
    if (fs::create_directory(folder, error)) return folder;
    if (error) {
      throw OutputError(fmt::format("{}: cannot be made: {}", folder.string(), error.message()));
    }
  }
}

void Session::save() {
  const Diagnostics now = live_.look();
  auto moment = std::make_shared<Moment>();
  const auto state = std::make_shared<const State>(live_.solver().state());
  moment->state = state;
  moment->frame.state = state.get();
  fs::path folder, checkpoint;
  ranks().collectively([&] {
    if (all_ranks().leads()) folder = next_folder();
  });
  FileWriter writer(live_.shared(), ChunkedSource::usual_length);
  writer.submit(moment, [&](ChunkedSource& values) {
    CheckpointInfo info;
    info.program = program_version();
    info.precision = live_.scene().solver.precision;
    info.method = live_.scene().solver.method;
    info.scene_text = live_.scene().text;
    info.model_digest = live_.shared().digest();
    info.parameters = scene_parameters(live_.scene());
    info.total_energy = now.total_energy();
    info.watched = {now.total_energy(), now.largest_speed, now.kinetic_and_elastic_energy()};
    checkpoint = write_checkpoint(folder, *state, info, live_.model().global_count(), values);
    if (!live_.began_with_scene()) return;  // nothing could repeat it
    write_whole_file(folder / "session.jsonl", text_of(recording_), Durable::yes);
  });
  writer.finish();
  if (!live_.began_with_scene()) return tell(fmt::format("Saved: {}.", checkpoint.string()));
  if (all_ranks().leads() && options_.prints) {
    fmt::print("saved {} and session.jsonl beside it\n", checkpoint.string());
    std::fflush(stdout);
  }
  const char* const use = live_.settings() == Settings{}
                              ? "phyxel run SCENE --resume continues from it"
                              : "a run continues from it if its scene is changed likewise";
  tell(
      fmt::format("Saved: {} ({}), and session.jsonl beside it (phyxel view SCENE --replay shows "
                  "it again).",
                  checkpoint.string(), use));
}

void Session::diverged(const std::string& why) {
  broken_ = true;
  playing_ = false;
  tell(why + " (Reset begins anew.)");
  tell_state();
  if (options_.headless) throw DivergedError(why);
}

void Session::tell(const std::string& message) {
  if (server_) server_->send_text(json_text(Json{{"message", message}}, -1));
}

void Session::tell_state() {
  if (!server_) return;
  const Scene& scene = live_.scene();
  Json state{{"playing", playing_}, {"pace", pace_}, {"field", field_}};
  state["settings"]["gravity"] = {scene.gravity.x, scene.gravity.y, scene.gravity.z};
  const Settings& set = live_.settings();
  if (set.stiffness) state["settings"]["stiffness"] = *set.stiffness;
  if (set.damping) state["settings"]["damping"] = *set.damping;
  if (set.friction) state["settings"]["friction"] = *set.friction;
  server_->send_text(json_text(state, -1));
}

void Session::tell_energies() {
  const Diagnostics& now = live_.now();
  const double passed = seconds_since(last_look_);
  Json message;
  message["plot"] = {{"time", now.time},
                     {"energy",
                      {{"kinetic", now.kinetic_energy},
                       {"elastic", now.elastic_energy()},
                       {"gravity", now.gravity_energy},
                       {"loads", now.load_energy},
                       {"contact", now.contact_energy + now.contact_loss},
                       {"plastic", now.plastic_work},
                       {"viscous", now.viscous_work},
                       {"fracture", now.fracture_energy},
                       {"total", now.total_energy()}}},
                     {"work", live_.hand_work()}};
  if (passed > 0) message["speed"] = std::max(0.0, now.time - speed_time_) / passed;
  speed_time_ = now.time;
  server_->send_text(json_text(message, -1));
}

}  // namespace phyxel::app
