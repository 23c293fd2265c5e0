/// Ranges of numbers that colours span: robust against outliers, linear or logarithmic.
#pragma once

#include <string>
#include <vector>

namespace phyxel::app {

/// Scale of colours. `automatic` is logarithmic for fields whose values crowd at the low end.
enum class Scale { automatic, linear, logarithmic };

/// A range of a field's values, and how colours are spread over it.
struct ColourRange {
  double low = 0, high = 1;  ///< In the unit of the field; `low` > 0 if logarithmic.
  bool logarithmic = false;

  /// Position of a value in the range, clipped to [0, 1]; 0 for NaN.
  double share_of(double value) const;
};

/// The range from the 1st to the 99th percentile; 0 to 1 for no values. Values that are not finite
/// are ignored.
ColourRange linear_range(std::vector<double> values);

/// The range from the 5th percentile of the positive values to the 99th, at most three decades.
/// Empty ranges (`low` = `high` = 0) are returned for fields with negative values, or that span no
/// more than a decade.
ColourRange logarithmic_range(std::vector<double> values);

/// True if three quarters of the values lie in the lowest fifth of their linear range, so that a
/// linear scale would show most of them in one colour, and a logarithmic range exists.
bool prefers_logarithm(std::vector<double> values);

/// The range of a field by a scale; linear where a logarithmic range does not exist.
ColourRange colour_range(std::vector<double> values, Scale scale);

/// Round numbers within a range: multiples of 1, 2 or 5 times a power of ten, or for logarithmic
/// ranges powers of ten, with their multiples by 2 and 5 if there are fewer than two.
/// @param most largest number of ticks of a linear range
std::vector<double> ticks_of(const ColourRange& range, int most);

/// A number with three digits, in the shortest notation: 1.66e5, 0.25.
std::string short_number(double value);

}  // namespace phyxel::app
