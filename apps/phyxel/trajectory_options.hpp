/// Options that the commands which show or export trajectories share.
#pragma once

#include <string>
#include <vector>

#include "cli_forward.hpp"
#include "field_colours.hpp"

namespace phyxel::app {

/// The values of the options --colour, --range and --scale.
struct ColourOptions {
  std::string field;
  std::vector<double> range;
  std::string scale = "auto";

  /// The request for colours; its field is empty without --colour.
  /// @throws InputError for a range that is none
  ColourRequest request() const;
};

/// Adds --colour, --range and --scale to a command.
void add_colour_options(CLI::App& command, ColourOptions& options);

/// Adds --frames, --count and --every, which exclude each other, to a command.
void add_frame_options(CLI::App& command, FrameChoice& choice);

}  // namespace phyxel::app
