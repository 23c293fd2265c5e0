/// Colours of pictures that show a field of the frames.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "colour.hpp"
#include "colour_range.hpp"
#include "phyxel/recorder.hpp"
#include "rasteriser.hpp"
#include "report/replay_data.hpp"

namespace phyxel::app {

/// A field that colours show, and the range of values that they span.
struct Colouring {
  std::string field;  ///< A name in `colour_fields`.
  ColourRange range;
  Carriers carriers;  ///< Of surfels, which take fields that their frames lack from phyxels.
};

/// Names of the fields of a frame that colours can show: numbers and vectors, whose lengths are
/// shown; "speed" is that of the velocity.
std::vector<std::string> colour_fields(const FrameData& frame);

/// The name by which frames store a field that colours show.
std::string stored_name(const std::string& field);

/// A field's name with its unit.
std::string field_title(const std::string& field);

/// The names of the numbers in a frame that a page shows beside displacement, speed, stress and
/// volume ratio: what materials remember but for components of tensors, broken shares, marks of the
/// boundary.
std::vector<std::string> other_numbers(const FrameData& frame);

/// The unit of a field; "" of a number without one.
std::string unit_of(const std::string& field);

/// A field's value at each point of a frame; unset if the frame lacks it.
std::optional<std::vector<double>> field_values(const FrameData& frame, const std::string& field);

/// The values at the points of a picture, which are those of a surface, or else of phyxels. A frame
/// that lacks the field has none. @param surface,phyxels null if there is none
std::vector<double> shown_values(const FrameData* surface, const FrameData* phyxels,
                                 const Colouring& colouring);

/// A field's values at places inside a body: means over the phyxels around each, with the weights
/// of carriers. @param reach distance at which a phyxel has no weight [m]
/// @returns shape [places]; none if the frame lacks the field
std::vector<double> inner_values(const FrameData& phyxels, Index body, const std::string& field,
                                 const std::vector<Vec3d>& places, double reach);

/// The colour of a value in viridis, by its position in the range.
Colour field_colour(double value, const Colouring& colouring);

/// Draws a bar with the colours, ticks at round numbers of their range, and the field's name and
/// unit into a corner.
void draw_colour_bar(Image& image, const Colouring& colouring);

}  // namespace phyxel::app
