#include "colour_range.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace phyxel::app {
namespace {

/// A percentile of some values, which are reordered. @param share 0 to 1
double percentile(std::vector<double>& values, double share) {
  const auto place =
      values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), place, values.end());
  return *place;
}

void keep_finite(std::vector<double>& values) {
  std::erase_if(values, [](double value) { return !std::isfinite(value); });
}

}  // namespace

double ColourRange::share_of(double value) const {
  const double share = logarithmic  ? std::log(value / low) / std::log(high / low)
                       : high > low ? (value - low) / (high - low)
                                    : 0;
  return share > 0 ? std::min(share, 1.0) : 0;  // NaN is not above 0
}

ColourRange linear_range(std::vector<double> values) {
  keep_finite(values);
  if (values.empty()) return {};
  const double low = percentile(values, 0.01);
  return {low, percentile(values, 0.99)};
}

ColourRange logarithmic_range(std::vector<double> values) {
  constexpr double widest = 1e3, narrowest = 10;
  const ColourRange none{0, 0};
  keep_finite(values);
  if (std::any_of(values.begin(), values.end(), [](double value) { return value < 0; })) {
    return none;
  }
  std::erase(values, 0.0);
  if (values.empty()) return none;
  const double high = percentile(values, 0.99);
  const double low = std::max(percentile(values, 0.05), high / widest);
  return high > narrowest * low ? ColourRange{low, high, true} : none;
}

bool prefers_logarithm(std::vector<double> values) {
  if (!logarithmic_range(values).logarithmic) return false;
  const ColourRange linear = linear_range(values);
  keep_finite(values);
  return linear.share_of(percentile(values, 0.75)) < 0.2;
}

ColourRange colour_range(std::vector<double> values, Scale scale) {
  const bool wanted =
      scale == Scale::automatic ? prefers_logarithm(values) : scale == Scale::logarithmic;
  const ColourRange range = wanted ? logarithmic_range(values) : ColourRange{};
  return range.logarithmic ? range : linear_range(std::move(values));
}

std::vector<double> ticks_of(const ColourRange& range, int most) {
  std::vector<double> ticks;
  if (!(range.high > range.low) || !std::isfinite(range.high - range.low)) return ticks;
  if (range.logarithmic) {
    for (const std::vector<double>& multiples : {std::vector<double>{1}, {1, 2, 5}}) {
      ticks.clear();
      const int first = static_cast<int>(std::floor(std::log10(range.low)));
      const int last = static_cast<int>(std::ceil(std::log10(range.high)));
      for (int power = first; power <= last; ++power) {
        for (const double by : multiples) {
          const double tick = by * std::pow(10, power);
          if (tick >= range.low && tick <= range.high) ticks.push_back(tick);
        }
      }
      if (ticks.size() >= 2) break;
    }
    return ticks;
  }
  const double raw = (range.high - range.low) / most,
               unit = std::pow(10, std::floor(std::log10(raw)));
  double step = 10 * unit;
  for (const double by : {5.0, 2.0, 1.0}) {
    if (by * unit >= raw * (1 - 1e-9)) step = by * unit;
  }
  const double first = std::ceil(range.low / step - 1e-9);
  for (int k = 0; (first + k) * step <= range.high + 1e-9 * step && k <= most; ++k) {
    ticks.push_back((first + k) * step);
  }
  return ticks;
}

std::string short_number(double value) {
  std::string text = fmt::format("{:.3g}", value == 0 ? 0.0 : value);  // no -0
  const std::size_t e = text.find('e');
  if (e == std::string::npos) return text;
  return fmt::format("{}e{}", text.substr(0, e), std::stoi(text.substr(e + 1)));
}

}  // namespace phyxel::app
