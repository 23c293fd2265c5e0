/// Wall-clock time.
#pragma once

#include <chrono>

namespace phyxel::app {

using Clock = std::chrono::steady_clock;

inline double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

}  // namespace phyxel::app
