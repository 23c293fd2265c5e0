#include "trajectory_options.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>

#include "phyxel/error.hpp"

namespace phyxel::app {

ColourRequest ColourOptions::request() const {
  ColourRequest made{.field = field};
  if (scale == "linear") made.scale = Scale::linear;
  if (scale == "log") made.scale = Scale::logarithmic;
  if (range.empty()) return made;
  if (range.size() != 2 || !(range[0] < range[1])) {
    throw InputError(
        fmt::format("--range {}: allowed: two numbers, the lower one first, as in "
                    "--range 0,5e4",
                    fmt::join(range, ",")));
  }
  made.range = {range[0], range[1]};
  if (made.scale == Scale::logarithmic && !(range[0] > 0)) {
    throw InputError(fmt::format("--range {} with --scale log: allowed: positive numbers",
                                 fmt::join(range, ",")));
  }
  return made;
}

void add_colour_options(CLI::App& command, ColourOptions& options) {
  auto* colour = command.add_option(
      "--colour,--color", options.field,
      "Field of the frames that colours show, with a bar in pictures: displacement, speed, "
      "von_mises, ...");
  command
      .add_option("--range", options.range,
                  "Range of the colours: low,high (default: that of 98% of the values of the "
                  "chosen frames, or of 94% on a logarithmic scale)")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->needs(colour);
  command
      .add_option("--scale", options.scale,
                  "Scale of the colours: auto (logarithmic if most values crowd at the low end), "
                  "linear or log")
      ->check(CLI::IsMember({"auto", "linear", "log"}))
      ->capture_default_str()
      ->needs(colour);
}

void add_frame_options(CLI::App& command, FrameChoice& choice) {
  constexpr std::int64_t most_frames = 1'000'000'000;
  auto* frames = command
                     .add_option("--frames", choice.frames,
                                 "Frames, comma separated, from 0; -1 is the last (default: all)")
                     ->delimiter(',')
                     ->allow_extra_args(false);
  auto* count = command
                    .add_option("--count", choice.count,
                                "Number of frames, evenly spaced, first and last included")
                    ->check(CLI::Range(std::int64_t{1}, most_frames))
                    ->excludes(frames);
  command.add_option("--every", choice.every, "Interval of frames: 10 takes every tenth")
      ->check(CLI::Range(std::int64_t{1}, most_frames))
      ->excludes(frames)
      ->excludes(count);
}

}  // namespace phyxel::app
