/// How a load changes with time.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

namespace phyxel {

/// The factor of a load as a function of time: linear between its points, constant before the first
/// and after the last.
struct LoadCurve {
  /// A point of the curve.
  struct Point {
    double time = 0;    ///< [s]
    double factor = 0;  ///< Of the force or pressure of the load.
    bool operator==(const Point&) const = default;
  };
  std::vector<Point> points;  ///< Their times ascend strictly; no points: a factor of 1.

  /// Largest number of points.
  static constexpr std::size_t most_points = 1000;

  /// Returns the curve of a load of a scene: through its points if it has any, else linear growth
  /// from 0 to 1 over the time `ramp` [s]; a ramp of 0 is a factor of 1.
  static LoadCurve of(double ramp, const std::vector<Point>& points) {
    if (!points.empty()) return {points};
    return ramp > 0 ? LoadCurve{{{0, 0}, {ramp, 1}}} : LoadCurve{};
  }
  /// Returns the factor at a time [s], which may be infinite.
  double at(double time) const {
    if (points.empty()) return 1;
    const auto next = std::upper_bound(points.begin(), points.end(), time,
                                       [](double t, const Point& point) { return t < point.time; });
    if (next == points.begin()) return next->factor;
    const Point before = *(next - 1);
    if (next == points.end()) return before.factor;
    return before.factor +
           (next->factor - before.factor) * ((time - before.time) / (next->time - before.time));
  }
  /// Returns the smallest and the largest factor.
  std::pair<double, double> extremes() const {
    if (points.empty()) return {1, 1};
    const auto [low, high] =
        std::minmax_element(points.begin(), points.end(),
                            [](const Point& a, const Point& b) { return a.factor < b.factor; });
    return {low->factor, high->factor};
  }
  /// True if the factor is the same at all times.
  bool is_constant() const {
    const auto [low, high] = extremes();
    return low == high;
  }
  /// Returns the largest size of the factor.
  double largest() const {
    const auto [low, high] = extremes();
    return std::max(std::abs(low), std::abs(high));
  }
  /// Returns the time [s] in which the steepest piece would pass from the smallest to the largest
  /// factor: the duration of a ramp. Infinite for a constant factor.
  double shortest_rise() const {
    const auto [low, high] = extremes();
    double shortest = HUGE_VAL;
    for (std::size_t k = 1; k < points.size(); ++k) {
      const double change = std::abs(points[k].factor - points[k - 1].factor);
      if (!(change > 0)) continue;
      shortest = std::min(shortest, (high - low) / change * (points[k].time - points[k - 1].time));
    }
    return shortest;
  }
  bool operator==(const LoadCurve&) const = default;
};

}  // namespace phyxel
