/// The numbers of a replay as its page stores them: quantised points and fields.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "colour_range.hpp"
#include "phyxel/types.hpp"

namespace phyxel::app {

/// The phyxels that colour each surfel and their weights in 255ths, shape [surfels, each].
struct Carriers {
  static constexpr std::size_t each = 4;
  std::vector<std::uint32_t> phyxel;
  std::vector<std::uint8_t> weight;
};

/// Distance within which phyxels are carriers, from the distance between them [m].
double carrier_reach(double spacing);

/// The weight of a carrier, but for a common factor. @param q distance over reach
double carrier_weight(double q);

/// The nearest phyxels of each surfel within `reach` [m]; the nearest one if there are none.
Carriers carriers_of(const std::vector<Vec3d>& surfels, const std::vector<Vec3d>& phyxels,
                     double reach);

/// A range of numbers, divided into 65,535 steps.
struct Span {
  static constexpr double steps = 65535;
  double low = std::numeric_limits<double>::infinity(), high = -low;
  /// Extends the range to a number; NaN and infinity are ignored.
  void include(double value);
  double width() const { return high > low ? high - low : 1; }  ///< Length of the range, not 0.
  /// The step of a number; 0 for NaN and infinity.
  std::uint16_t step_of(double value) const;
};

/// A shown frame: points of both families, and fields of the phyxels, or of the surfels if there
/// are no phyxels.
struct Instance {
  double time = 0;                          ///< [s]
  std::vector<Vec3d> surfels, phyxels;      ///< Positions [m].
  std::vector<std::vector<double>> fields;  ///< Shape [fields, points].
};

/// The points that are farthest in 26 directions, which suffice to fit a camera.
class Outermost {
 public:
  void include(Vec3d p);
  const std::array<Vec3d, 27>& points() const { return found_; }

 private:
  static Vec3d direction(std::size_t k);
  std::array<Vec3d, 27> found_{};
  std::array<double, 27> farthest_ = [] {
    std::array<double, 27> none{};
    none.fill(-std::numeric_limits<double>::infinity());
    return none;
  }();
};

/// The ranges of all points and fields of a replay.
struct Extent {
  Span box[3];               ///< Ranges of x, y and z [m].
  std::vector<Span> ranges;  ///< Range of each field.
  double radius = 0;         ///< Half the diagonal of the box [m].

  /// Centre of the box [m].
  Vec3d centre() const {
    const auto middle = [](const Span& side) { return side.low + side.width() / 2; };
    return {middle(box[0]), middle(box[1]), middle(box[2])};
  }
};
Extent extent_of(const std::vector<Instance>& instances);

/// A sample of a field's finite values over all frames, at most about a million.
std::vector<double> sample_of(const std::vector<Instance>& instances, std::size_t field);

/// How lively the colours of a field are: the mean of their positions in the range times the
/// standard deviation, at most 1/4; near 0 if all points have one colour.
double liveliness(const std::vector<double>& values, const ColourRange& range);

/// The frame and the field that a page opens with.
struct Opening {
  std::size_t frame = 0, field = 0;
};

/// Chooses the liveliest frame of a field. The field is the first of stress, speed and displacement
/// whose liveliest frame is lively enough, or else the liveliest field.
/// @param names,ranges shape [fields]
Opening opening_of(const std::vector<Instance>& instances, const std::vector<std::string>& names,
                   const std::vector<ColourRange>& ranges);

/// The numbers of a frame: points of surfels and phyxels, then fields.
std::vector<std::uint16_t> quantised(const Instance& instance, const Extent& extent);

}  // namespace phyxel::app
