/// The loop of a live view: requests, steps, frames.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "setup.hpp"
#include "stopwatch.hpp"
#include "view/live_picture.hpp"
#include "view/live_scene.hpp"
#include "view/recording.hpp"
#include "view/server.hpp"

namespace phyxel::app {

struct ViewOptions {
  Overrides overrides;
  CutOptions cut;
  std::string host = "127.0.0.1";
  int port = 8080;
  double pace = 1;        ///< Seconds simulated a second.
  bool paused = false;    ///< True to wait for "play".
  bool headless = false;  ///< True to replay a session without a page.
  std::string replay;     ///< File of a session, or "".
  bool prints = true;     ///< True to print the address, and what is saved.
  std::string farewell = "The program has ended.";  ///< What the page shows in the end.
};

/// A live view from its set-up to its end. All ranks step; the first one serves the page, decides
/// on the next turn, which it sends to all.
class Session {
 public:
  /// Runs one turn: calls its argument once.
  using Around = std::function<void(const std::function<void()>&)>;

  /// @param options,live must outlive the session
  /// @throws InputError for a port that is taken, or a recording of another run
  Session(const ViewOptions& options, LiveScene& live);
  /// Runs until `stop`, until a signal comes (`StopSignal`) or, without a page, until the recording
  /// ends. @param around what runs each turn, which changes the scene
  void run(const Around& around = [](const auto& turn) { turn(); });
  /// Requests the end, from any thread.
  void stop() { stops_ = true; }
  /// The page's address.
  std::string address() const { return server_->address(); }

 private:
  /// The next actions of all ranks.
  struct Turn {
    std::vector<Request> acts;
    std::int64_t steps = 0;
    std::int32_t field = -1;  // of the frame
    bool look = false, frame = false, end = false;
  };
  Turn decided();
  Turn agreed(Turn turn) const;
  void take(const Turn& turn);

  // On the first rank:
  void read_messages();
  void obey(const Request& request);
  void add_acts(Turn& turn);
  /// Counts the pace from now.
  void restart_clock();
  std::int64_t steps_of_a_turn() const;
  std::int64_t steps_due();
  void tell_state();
  void tell(const std::string& message);
  void tell_energies();

  // On all ranks:
  void act(const Request& request);
  void save();
  void diverged(const std::string& why);
  std::filesystem::path next_folder() const;

  const ViewOptions& options_;
  LiveScene& live_;
  std::atomic<bool> stops_ = false;
  std::optional<LivePicture> picture_;
  std::optional<ViewServer> server_;
  Recording recording_;
  std::deque<Recorded> to_replay_;
  std::vector<Request> waiting_;  // acts of the page
  bool playing_, broken_ = false;
  double pace_;
  std::optional<double> until_;   // time at which it pauses [s]
  std::int64_t asked_steps_ = 0;  // by the page, while the scene rests
  std::int32_t field_ = -1;       // place of the shown field; -1: colours of bodies
  std::uint32_t frames_ = 0;
  std::size_t joins_ = 0;
  std::int64_t shown_at_ = -1, looked_at_ = -1;  // steps taken at the last frame and look
  bool changed_ = true;                          // since the last frame
  double seconds_per_step_ = 0;
  Clock::time_point last_frame_, last_look_, since_;  // since: of the pace
  double since_time_ = 0;                             // simulated then [s]
  double speed_time_ = 0;                             // simulated at the last look [s]
  double look_pause_ = 0, frame_pause_ = 0;           // until the next ones [s]
};

}  // namespace phyxel::app
