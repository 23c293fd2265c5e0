/// Timeline of spans for `phyxel run --profile`. If it is not started, a span costs a comparison.
#pragma once

#include <chrono>
#include <utility>
#include <vector>

namespace phyxel {

class Timeline {
 public:
  struct Span {
    const char* what;
    double start, seconds;  ///< [s], from the start of the record.
    bool aside;             ///< True on a thread other than the one that started the record.
    double peak_memory;     ///< Peak memory of the program at the end of the span [bytes].
  };
  /// Largest number of recorded spans; further ones are only counted.
  static constexpr std::size_t most_spans = 200'000;

  /// Starts recording.
  static void start();
  static bool is_on() { return on_; }
  static void add(const char* what, std::chrono::steady_clock::time_point since);
  static std::vector<Span> spans();
  /// Number of spans that were not recorded.
  static std::size_t left_out();

 private:
  static bool on_;
};

/// A span from its construction to its end, or else to the end of its block.
class Phase {
 public:
  explicit Phase(const char* what) : what_(Timeline::is_on() ? what : nullptr) {
    if (what_) since_ = std::chrono::steady_clock::now();
  }
  ~Phase() { end(); }
  /// Begins the next span, where one span follows another.
  void next(const char* what) {
    end();
    if (!Timeline::is_on()) return;
    what_ = what;
    since_ = std::chrono::steady_clock::now();
  }
  void end() {
    if (what_) Timeline::add(std::exchange(what_, nullptr), since_);
  }
  Phase(const Phase&) = delete;
  Phase& operator=(const Phase&) = delete;

 private:
  const char* what_;
  std::chrono::steady_clock::time_point since_;
};

}  // namespace phyxel
