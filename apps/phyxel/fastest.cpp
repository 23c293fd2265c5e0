#include "fastest.hpp"

#include <algorithm>
#include <cmath>

namespace phyxel::app {

std::vector<double> lasting_errors(std::span<const Measured> family) {
  std::vector<double> errors(family.size());
  double largest = 0;
  for (std::size_t k = family.size(); k-- > 0;) {
    const double error = std::abs(family[k].error);
    largest = std::isfinite(error) ? std::max(largest, error) : HUGE_VAL;
    errors[k] = largest;
  }
  return errors;
}

std::optional<Reached> reach(std::span<const Measured> family, double level) {
  const std::vector<double> errors = lasting_errors(family);
  const auto found =
      std::find_if(errors.begin(), errors.end(), [&](double error) { return error <= level; });
  const auto k = static_cast<std::size_t>(found - errors.begin());
  if (k + 1 >= family.size()) return std::nullopt;
  const Measured& fine = family[k];
  if (k == 0 || !std::isfinite(errors[k - 1]) || !(errors[k] > 0)) {
    return Reached{static_cast<double>(fine.across), fine.seconds};
  }
  const Measured& coarse = family[k - 1];
  const double share = std::log(errors[k - 1] / level) / std::log(errors[k - 1] / errors[k]);
  const auto between = [&](double from, double to) { return from * std::pow(to / from, share); };
  return Reached{between(coarse.across, fine.across), between(coarse.seconds, fine.seconds)};
}

}  // namespace phyxel::app
