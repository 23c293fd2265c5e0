#include "picture.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "files/atomic_file.hpp"
#include "phyxel/error.hpp"
#include "png_file.hpp"
#include "sort_unique.hpp"

namespace phyxel::app {
namespace {

namespace fs = std::filesystem;

/// Where one moment of the trajectory is on disk; either path may be empty.
struct Shot {
  fs::path surface, phyxels;
  double time = 0;
};

struct Trajectory {
  std::vector<Shot> shots;
  bool series = true;  // else a single frame file
};

bool is_series(const fs::path& file) { return file.extension() == ".series"; }

/// Surface and phyxel frames of equal time, one shot each.
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

/// A series or a frame of its own is a surface if it has triangles.
std::vector<Shot> only_family(const std::vector<SeriesEntry>& entries,
                              const PictureRequest& request, const fs::path& input) {
  if (entries.empty()) return {};
  const bool surface = !read_frame(entries.front().file).triangle.empty();
  if (surface ? !request.surface : !request.phyxels) {
    throw InputError(fmt::format("{}: holds {} only, which the options leave out", input.string(),
                                 surface ? "a surface" : "phyxels"));
  }
  return surface ? pair_by_time(entries, {}) : pair_by_time({}, entries);
}

Trajectory find_trajectory(const fs::path& input, const PictureRequest& request) {
  if (!fs::exists(input)) {
    throw InputError(fmt::format("{}: no such file or folder", input.string()));
  }
  Trajectory trajectory;
  if (fs::is_directory(input)) {
    const fs::path surface = input / "surface.hdf.series", phyxels = input / "phyxels.hdf.series";
    const bool has_surface = fs::exists(surface), has_phyxels = fs::exists(phyxels);
    if (!has_surface && !has_phyxels) {
      throw InputError(fmt::format(
          "{}: holds no trajectory: neither surface.hdf.series nor phyxels.hdf.series is there",
          input.string()));
    }
    if (!(has_surface && request.surface) && !(has_phyxels && request.phyxels)) {
      throw InputError(fmt::format("{}: holds {} only, which the options leave out", input.string(),
                                   has_surface ? "a surface" : "phyxels"));
    }
    using Entries = std::vector<SeriesEntry>;
    trajectory.shots =
        pair_by_time(has_surface && request.surface ? read_series(surface) : Entries{},
                     has_phyxels && request.phyxels ? read_series(phyxels) : Entries{});
  } else if (is_series(input)) {
    trajectory.shots = only_family(read_series(input), request, input);
  } else {
    trajectory.series = false;
    trajectory.shots = only_family({{input, read_frame(input).time}}, request, input);
  }
  if (trajectory.shots.empty()) throw InputError(fmt::format("{}: holds no frame", input.string()));
  return trajectory;
}

std::optional<FrameData> read_if_any(const fs::path& file) {
  if (file.empty()) return std::nullopt;
  return read_frame(file);
}

/// Enough decimals to tell two frames apart, at least 2.
int time_decimals(const std::vector<Shot>& shots) {
  double interval = 1;
  for (std::size_t k = 1; k < shots.size(); ++k) {
    const double step = shots[k].time - shots[k - 1].time;
    if (step > 0) interval = std::min(interval, step);
  }
  return std::clamp(static_cast<int>(std::ceil(-std::log10(interval) - 1e-9)), 2, 9);
}

/// Looks at every frame, so that the camera holds for the whole motion.
Setting set_stage(const std::vector<Shot>& shots, const PictureRequest& request) {
  Setting setting;
  setting.up = request.up;
  setting.time_decimals = time_decimals(shots);
  CameraFit fit(request.width, request.height, request.view, request.up);
  for (const Shot& shot : shots) {
    for (const fs::path& file : {shot.surface, shot.phyxels}) {
      if (const auto frame = read_if_any(file)) fit.include(frame->point);
    }
  }
  if (fit.empty()) throw InputError("the frames hold no point with finite coordinates");
  const auto phyxels = read_if_any(shots.front().phyxels);
  if (phyxels) setting.spacing = typical_spacing(phyxels->point);
  setting.camera = fit.camera();
  setting.extent = fit.extent();
  return setting;
}

bool is_picture_name(const std::string& name) {
  if (name.rfind("frame_", 0) != 0 || !name.ends_with(".png") || name.size() < 16) return false;
  const std::string number = name.substr(6, name.size() - 10);
  return std::all_of(number.begin(), number.end(), [](char c) { return c >= '0' && c <= '9'; });
}

}  // namespace

std::vector<std::size_t> choose_frames(const FrameChoice& choice, std::size_t available) {
  const auto n = static_cast<std::int64_t>(available);
  if (choice.count < 0 || choice.every < 0) {
    throw InputError(fmt::format("{} frames, every {}: allowed are positive numbers", choice.count,
                                 choice.every));
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
    if (n > 0) chosen.push_back(available - 1);  // the end of a motion tells the most
  } else if (choice.count > 0) {
    const std::int64_t count = std::min(choice.count, n);
    for (std::int64_t k = 0; k < count; ++k) {
      // k (n - 1) / (count - 1), rounded; count is 1 only if there is a single frame.
      const std::int64_t gaps = std::max<std::int64_t>(1, count - 1);
      chosen.push_back(static_cast<std::size_t>((2 * k * (n - 1) + gaps) / (2 * gaps)));
    }
  } else {
    const std::int64_t step = std::max<std::int64_t>(1, choice.every);
    for (std::int64_t k = 0; k < n; k += step) chosen.push_back(static_cast<std::size_t>(k));
  }
  return chosen;
}

std::vector<fs::path> render(const fs::path& input, const fs::path& folder,
                             const PictureRequest& request, bool overwrite) {
  const Trajectory trajectory = find_trajectory(input, request);
  const auto chosen = choose_frames(request.choice, trajectory.shots.size());
  std::vector<fs::path> files;
  for (const std::size_t k : chosen) {
    files.push_back(folder / (trajectory.series ? fmt::format("frame_{:06d}.png", k)
                                                : input.stem().string() + ".png"));
    if (!overwrite && fs::exists(files.back())) {
      throw InputError(fmt::format("{}: exists and is kept; allowed: another folder, or --force",
                                   files.back().string()));
    }
  }
  const Setting setting = set_stage(trajectory.shots, request);
  make_writable_folder(folder);
  for (std::size_t k = 0; k < chosen.size(); ++k) {
    const Shot& shot = trajectory.shots[chosen[k]];
    const auto surface = read_if_any(shot.surface), phyxels = read_if_any(shot.phyxels);
    write_png(files[k],
              draw_picture(surface ? &*surface : nullptr, phyxels ? &*phyxels : nullptr, setting));
  }
  return files;
}

std::vector<fs::path> render_directory(const fs::path& out, const RenderRequest& request,
                                       bool overwrite) {
  PictureRequest pictures;
  pictures.width = request.width;
  pictures.height = request.height;
  pictures.view = request.view;
  pictures.up = request.up;
  pictures.choice.count = request.count;
  const fs::path folder = out / "pictures";
  if (overwrite && fs::is_directory(folder)) {
    std::vector<fs::path> stale;
    for (const auto& entry : fs::directory_iterator(folder)) {
      if (is_picture_name(entry.path().filename().string())) stale.push_back(entry.path());
    }
    for (const fs::path& file : stale) fs::remove(file);
  }
  return render(out, folder, pictures, overwrite);
}

}  // namespace phyxel::app
