/// Time of a run, by stage.
#pragma once

#include <string_view>
#include <utility>
#include <vector>

#include "stopwatch.hpp"
#include "timeline.hpp"

namespace phyxel::app {

/// Accumulated time of stages, in the order of their first occurrence. Stages also are spans of the
/// profile.
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

}  // namespace phyxel::app
