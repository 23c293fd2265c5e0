#include "trajectory.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "kind.hpp"
#include "phyxel/error.hpp"
#include "sort_unique.hpp"

namespace phyxel::app {
namespace {

namespace fs = std::filesystem;

bool is_series(const fs::path& file) { return kind_of(file) == Kind::series; }

/// Pairs of surface and phyxel frames of equal time.
std::vector<Shot> pair_by_time(const std::vector<SeriesEntry>& surface,
                               const std::vector<SeriesEntry>& phyxels) {
  std::vector<Shot> shots;
  if (surface.empty()) {
    for (const SeriesEntry& entry : phyxels) shots.push_back({{}, entry.file, entry.time});
    return shots;
  }
  auto next = phyxels.begin();
  for (const SeriesEntry& entry : surface) {
    Shot shot{entry.file, {}, entry.time};
    const double rounding = 1e-9 * std::max(1.0, std::abs(entry.time));
    while (next != phyxels.end() && next->time < entry.time - rounding) ++next;
    if (next != phyxels.end() && next->time <= entry.time + rounding) shot.phyxels = next->file;
    shots.push_back(shot);
  }
  return shots;
}

/// Shots of a single series or frame, which is a surface if it has triangles.
std::vector<Shot> only_family(const std::vector<SeriesEntry>& entries, Families wanted,
                              const fs::path& input) {
  if (entries.empty()) return {};
  const bool surface = !read_frame(entries.front().file).triangle.empty();
  if (surface ? !wanted.surface : !wanted.phyxels) {
    throw InputError(fmt::format("{}: holds {} only, which the options leave out", input.string(),
                                 surface ? "a surface" : "phyxels"));
  }
  return surface ? pair_by_time(entries, {}) : pair_by_time({}, entries);
}

}  // namespace

Trajectory find_trajectory(const fs::path& input, Families wanted) {
  if (!fs::exists(input)) {
    throw InputError(fmt::format("{}: no such file or folder", input.string()));
  }
  expect_kind(input, {Kind::folder, Kind::series, Kind::hdf5});
  Trajectory trajectory;
  if (fs::is_directory(input)) {
    const fs::path surface = input / "surface.hdf.series", phyxels = input / "phyxels.hdf.series";
    const bool has_surface = fs::exists(surface), has_phyxels = fs::exists(phyxels);
    if (!has_surface && !has_phyxels) {
      throw InputError(fmt::format(
          "{}: has no trajectory: neither surface.hdf.series nor phyxels.hdf.series exists",
          input.string()));
    }
    if (!(has_surface && wanted.surface) && !(has_phyxels && wanted.phyxels)) {
      throw InputError(fmt::format("{}: holds {} only, which the options leave out", input.string(),
                                   has_surface ? "a surface" : "phyxels"));
    }
    using Entries = std::vector<SeriesEntry>;
    trajectory.shots =
        pair_by_time(has_surface && wanted.surface ? read_series(surface) : Entries{},
                     has_phyxels && wanted.phyxels ? read_series(phyxels) : Entries{});
  } else if (is_series(input)) {
    trajectory.shots = only_family(read_series(input), wanted, input);
  } else {
    trajectory.series = false;
    trajectory.shots = only_family({{input, read_frame(input).time}}, wanted, input);
  }
  if (trajectory.shots.empty()) throw InputError(fmt::format("{}: has no frame", input.string()));
  return trajectory;
}

std::optional<FrameData> read_if_any(const fs::path& file, bool fields) {
  if (file.empty()) return std::nullopt;
  return read_frame(file, fields);
}

int time_decimals(const std::vector<Shot>& shots) {
  double interval = 1;
  for (std::size_t k = 1; k < shots.size(); ++k) {
    const double step = shots[k].time - shots[k - 1].time;
    if (step > 0) interval = std::min(interval, step);
  }
  return std::clamp(static_cast<int>(std::ceil(-std::log10(interval) - 1e-9)), 2, 9);
}

std::vector<std::size_t> choose_frames(const FrameChoice& choice, std::size_t available) {
  const auto n = static_cast<std::int64_t>(available);
  if (choice.count < 0 || choice.every < 0) {
    throw InputError(
        fmt::format("{} frames, every {}; allowed: positive numbers", choice.count, choice.every));
  }
  std::vector<std::size_t> chosen;
  if (!choice.frames.empty()) {
    for (const std::int64_t frame : choice.frames) {
      if (frame < -n || frame >= n) {
        throw InputError(
            fmt::format("frame {}: there are {}; allowed: {} to {}", frame, n, -n, n - 1));
      }
      chosen.push_back(static_cast<std::size_t>(frame < 0 ? frame + n : frame));
    }
    sort_unique(chosen);
  } else if (choice.count == 1) {
    if (n > 0) chosen.push_back(available - 1);  // a single frame is the last one
  } else if (choice.count > 0) {
    const std::int64_t count = std::min(choice.count, n);
    for (std::int64_t k = 0; k < count; ++k) {
      // k (n - 1) / (count - 1), rounded; count is 1 only with a single frame.
      const std::int64_t gaps = std::max<std::int64_t>(1, count - 1);
      chosen.push_back(static_cast<std::size_t>((2 * k * (n - 1) + gaps) / (2 * gaps)));
    }
  } else {
    const std::int64_t step = std::max<std::int64_t>(1, choice.every);
    for (std::int64_t k = 0; k < n; k += step) chosen.push_back(static_cast<std::size_t>(k));
  }
  return chosen;
}

}  // namespace phyxel::app
