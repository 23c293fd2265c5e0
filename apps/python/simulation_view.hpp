/// A live view of a simulation of Python's.
#pragma once

#include <exception>
#include <memory>
#include <string>
#include <thread>

#include "view/live_scene.hpp"
#include "view/session.hpp"

namespace phyxel::python {

/// A server of the page and a thread that steps a scene, which it has taken over. It needs no lock
/// of Python's.
class SimulationView {
 public:
  /// @param steps the scene as it steps now @param builder builds it anew with changed values
  /// @throws InputError for a search for equilibrium, or a port that is taken
  SimulationView(app::ViewOptions options, Scene scene, std::shared_ptr<app::BuiltScene> steps,
                 app::SceneBuilder builder)
      : options_(std::move(options)),
        live_(std::move(scene), std::move(steps), std::move(builder)),
        session_(options_, live_) {}
  ~SimulationView() { stop(); }
  SimulationView(const SimulationView&) = delete;
  SimulationView& operator=(const SimulationView&) = delete;

  /// Begins to serve and to step. @param around what runs each turn, on the view's thread
  void start(app::Session::Around around) {
    thread_ = std::thread([this, around = std::move(around)] {
      try {
        session_.run(around);
      } catch (...) {
        failure_ = std::current_exception();
      }
    });
  }
  /// Ends the thread, after the present turn.
  void stop() {
    session_.stop();
    if (thread_.joinable()) thread_.join();
  }
  /// Leaves the scene so that it can go on without the view. Call `stop` before.
  /// @throws Error that has ended the thread, or DivergedError
  void finish() {
    if (failure_) std::rethrow_exception(failure_);
    live_.finish();
  }

  /// What is viewed.
  const app::LiveScene& live() const { return live_; }
  /// The page's address.
  std::string address() const { return session_.address(); }

 private:
  const app::ViewOptions options_;
  app::LiveScene live_;
  app::Session session_;
  std::thread thread_;
  std::exception_ptr failure_;
};

}  // namespace phyxel::python
