#include "files/trajectory_folder.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <string_view>

#include "files/atomic_file.hpp"
#include "files/sealed_file.hpp"
#include "phyxel/checkpoint.hpp"
#include "phyxel/error.hpp"

namespace phyxel {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t largest_log = std::size_t{1} << 30;

/// The column of the time in the logs of frames, after that of steps, whose size may change.
constexpr std::size_t column_of_time = 1;

/// True for the name of a file of a trajectory, finished or temporary.
bool is_trajectory_name(std::string_view name) {
  if (name.ends_with(".tmp")) name.remove_suffix(4);
  for (const char* one :
       {"phyxels.hdf.series", "surface.hdf.series", log_name, reactions_name, gas_name,
        contacts_name, rigid_name, fragments_name, probes_name, summary_name}) {
    if (name == one) return true;
  }
  const auto numbered = [name](std::string_view prefix, std::string_view suffix) {
    if (!name.starts_with(prefix) || !name.ends_with(suffix)) return false;
    if (name.size() <= prefix.size() + suffix.size()) return false;
    const auto digits = name.substr(prefix.size(), name.size() - prefix.size() - suffix.size());
    return digits.find_first_not_of("0123456789") == std::string_view::npos;
  };
  return numbered("phyxels_", ".hdf") || numbered("surface_", ".hdf") ||
         numbered("checkpoint_", ".h5");
}

/// The number in the name of a frame; -1 if there is none.
std::int64_t number_of(const fs::path& file) {
  const std::string name = file.stem().string();
  const std::size_t at = name.rfind('_') + 1;
  std::int64_t number = -1;
  const auto [end, error] = std::from_chars(name.data() + at, name.data() + name.size(), number);
  return error == std::errc() && end == name.data() + name.size() ? number : -1;
}

/// A column of a line of the log; "" if there is none.
std::string_view cell(std::string_view line, std::size_t column) {
  for (; column > 0; --column) {
    const std::size_t comma = line.find(',');
    if (comma == std::string_view::npos) return {};
    line.remove_prefix(comma + 1);
  }
  return line.substr(0, line.find(','));
}

/// The number in a text; NaN if there is none.
double number_in(std::string_view text) {
  double value = std::nan("");
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size() ? value : std::nan("");
}

}  // namespace

fs::path frame_file(const fs::path& directory, const char* family, std::int64_t number) {
  return directory / fmt::format("{}_{:06d}.hdf", family, number);
}

std::string series_name(const char* family) { return fmt::format("{}.hdf.series", family); }

std::vector<fs::path> trajectory_files(const fs::path& directory) {
  std::vector<fs::path> found;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(directory, error)) {
    if (is_trajectory_name(entry.path().filename().string())) found.push_back(entry.path());
  }
  std::sort(found.begin(), found.end());
  return found;
}

bool has_frames(const fs::path& directory) {
  const std::vector<fs::path> files = trajectory_files(directory);
  return std::any_of(files.begin(), files.end(), [](const fs::path& file) {
    return file.extension() != ".h5" && file.extension() != ".tmp";
  });
}

bool is_in_folder(const fs::path& file, const fs::path& directory) {
  if (file.empty()) return true;
  std::error_code error;
  const fs::path folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
  return fs::equivalent(folder, directory, error);
}

void check_output_folder(const fs::path& directory, bool may_exist) {
  if (!may_exist) {
    const auto found = trajectory_files(directory);
    if (!found.empty()) {
      throw InputError(
          fmt::format("{}: holds an earlier trajectory ({}), which is kept; --force replaces "
                      "it, --resume auto continues it, --out names another folder",
                      directory.string(), found.front().filename().string()));
    }
  }
  make_writable_folder(directory);
}

void check_continuation(const fs::path& directory, const Continuation& point, bool overwrite) {
  if (!is_in_folder(point.checkpoint, directory)) {
    const auto found = trajectory_files(directory);
    if (!found.empty() && !overwrite) {
      throw InputError(fmt::format(
          "{}: holds a trajectory ({}) to which {} does not belong; it is kept; allowed: "
          "another folder (--out), the checkpoint's own, or --force to replace it",
          directory.string(), found.front().filename().string(), point.checkpoint.string()));
    }
  } else if (has_frames(directory) && !fs::exists(directory / log_name)) {
    throw InputError(
        fmt::format("{}: {} is missing beside the frames of a run, which are kept; allowed: put it "
                    "back, or go on in another folder (--resume CHECKPOINT --out FOLDER)",
                    directory.string(), log_name));
  }
  make_writable_folder(directory);
}

bool holds_only_a_start(const fs::path& directory, const Scene& scene) {
  for (const fs::path& file : trajectory_files(directory)) {
    const std::string name = file.filename().string();
    if (file.extension() == ".h5" || name == summary_name) return false;
    if (file.extension() == ".hdf" && number_of(file) != 0) return false;
    if (file.extension() != ".hdf") continue;
    try {
      if (read_frame(file, true).scene != scene.text) return false;
    } catch (const InputError&) {
      return false;  // the file belongs to no known run
    }
  }
  const fs::path log = directory / log_name;
  if (!fs::exists(log)) return true;
  const std::string text = read_text_file(log, largest_log);
  return std::count(text.begin(), text.end(), '\n') <= 2;
}

namespace {
/// The whole lines of a text.
std::vector<std::string_view> lines_of(const std::string& text) {
  std::vector<std::string_view> lines;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = text.find('\n', begin);
    if (end == std::string::npos) break;  // an incomplete last line
    lines.emplace_back(text.data() + begin, end - begin);
    begin = end + 1;
  }
  return lines;
}
}  // namespace

std::string FrameLog::kept(double last_time) const {
  if (!fs::exists(file_)) return {};
  const std::string text = read_text_file(file_, largest_log);
  const std::vector<std::string_view> lines = lines_of(text);
  const std::string_view wanted(header_.data(), header_.size() - 1);  // without the line's end
  if (lines.empty() || lines[0] != wanted) {
    throw InputError(
        fmt::format("{}: begins with \"{}\", needed is \"{}\": it belongs to another run, or was "
                    "changed; it is "
                    "kept; allowed: another folder (--resume CHECKPOINT --out FOLDER)",
                    file_.string(), lines.empty() ? std::string_view() : lines[0], wanted));
  }
  std::string kept;
  double reached = -1;
  for (std::size_t l = 1; l < lines.size(); ++l) {
    const double time = number_in(cell(lines[l], column_of_time));
    if (!(time <= last_time)) break;
    reached = time;
    kept.append(lines[l]).push_back('\n');
  }
  // A log that had been removed begins again where the run went on.
  const bool begins_later =
      lines.size() > 1 && number_in(cell(lines[1], column_of_time)) > last_time;
  if (reached < last_time && !begins_later) {
    throw InputError(fmt::format(
        "{}: ends at t = {:g} s, and {} goes on to t = {:g} s: lines are missing; it is kept; "
        "allowed: put them back, remove the file, or go on in another folder (--resume CHECKPOINT "
        "--out "
        "FOLDER)",
        file_.string(), std::max(reached, 0.0), log_name, last_time));
  }
  return kept;
}

void FrameLog::create(const std::string& lines) {
  const std::string text = header_ + lines;
  write_whole_file(file_, text, Durable::no);
  size_ = text.size();
}

void FrameLog::append(const std::string& lines) {
  replace_tail(file_, size_, lines);
  size_ += lines.size();
}

KeptLog kept_log(const fs::path& file, const Continuation& point) {
  const std::string text = read_text_file(file, largest_log);
  const auto refuse = [&](const std::string& why) {
    throw InputError(fmt::format(
        "{}: {}: it belongs to another run, or was changed; it is kept; allowed: another "
        "folder (--resume CHECKPOINT --out FOLDER), or an earlier checkpoint",
        file.string(), why));
  };
  const std::vector<std::string_view> lines = lines_of(text);
  if (lines.empty()) refuse("has no header");
  // A run that was continued in another folder has the frames since then only.
  std::int64_t kept = 0;
  for (std::size_t l = 1; l < lines.size(); ++l) {
    if (!(number_in(cell(lines[l], column_of_time)) <= point.time)) break;
    kept = static_cast<std::int64_t>(l);
  }
  kept = std::min(kept, point.frames);
  if (lines.size() > 1 && cell(lines[1], 0) == "0" && kept < point.frames) {
    refuse(fmt::format("has {} frames where the checkpoint counts {}", kept, point.frames));
  }
  if (kept > 0 && cell(lines[1], 0) == "0" && !std::isnan(point.initial_energy)) {
    std::size_t column = 0;
    while (!cell(lines[0], column).empty() && !cell(lines[0], column).starts_with("total_energy")) {
      ++column;
    }
    const double begins = number_in(cell(lines[1], column));
    if (begins != point.initial_energy) {
      refuse(fmt::format("begins with an energy of {:.17g} J, the checkpoint's run with {:.17g} J",
                         begins, point.initial_energy));
    }
  }
  const std::string_view last = lines[static_cast<std::size_t>(kept)];
  return {text.substr(0, static_cast<std::size_t>(last.data() + last.size() + 1 - text.data())),
          kept, kept > 0 ? number_in(cell(last, column_of_time)) : -1};
}

KeptSeries kept_series(const fs::path& directory, const char* family, std::int64_t frames,
                       std::int64_t logged) {
  const fs::path file = directory / series_name(family);
  KeptSeries kept;
  for (const SeriesEntry& entry : read_series(file)) {
    const std::int64_t number = number_of(entry.file);
    if (number < 0) {
      throw InputError(fmt::format("{}: lists {}, which is not a frame of a run", file.string(),
                                   entry.file.filename().string()));
    }
    if (number >= frames) {
      kept.later.push_back(frame_file(directory, family, number));
      continue;
    }
    check_size(entry.file);
    kept.entries.push_back(entry);
  }
  if (static_cast<std::int64_t>(kept.entries.size()) != logged) {
    throw InputError(fmt::format(
        "{}: has {} frames where {} and the checkpoint have {}; allowed: another folder "
        "(--resume CHECKPOINT --out FOLDER), or an earlier checkpoint",
        file.string(), kept.entries.size(), log_name, logged));
  }
  return kept;
}

}  // namespace phyxel
