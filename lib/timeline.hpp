/// What this program does when: for `phyxel run --profile`. Costs a comparison where nobody asks.
#pragma once

#include <chrono>
#include <vector>

namespace phyxel {

class Timeline {
 public:
  struct Span {
    const char* what;
    double start, seconds;  ///< [s], from the start of the record.
    bool aside;             ///< On another thread than the one that started it.
    double peak_memory;     ///< Of the program, when the span ended [bytes].
  };
  /// Enough for a look; what comes later is counted only.
  static constexpr std::size_t most_spans = 200'000;

  /// From now on spans are recorded.
  static void start();
  static bool is_on() { return on_; }
  static void add(const char* what, std::chrono::steady_clock::time_point since);
  static std::vector<Span> spans();
  /// Spans that found no room.
  static std::size_t left_out();

 private:
  static bool on_;
};

/// A span, from here to the end of the block. @param what lives as long as the program
class Phase {
 public:
  explicit Phase(const char* what) : what_(Timeline::is_on() ? what : nullptr) {
    if (what_) since_ = std::chrono::steady_clock::now();
  }
  ~Phase() {
    if (what_) Timeline::add(what_, since_);
  }
  Phase(const Phase&) = delete;
  Phase& operator=(const Phase&) = delete;

 private:
  const char* what_;
  std::chrono::steady_clock::time_point since_;
};

}  // namespace phyxel
