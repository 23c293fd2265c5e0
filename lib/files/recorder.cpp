#include "phyxel/recorder.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string_view>

#include "files/atomic_file.hpp"
#include "files/frame_file.hpp"
#include "phyxel/error.hpp"

namespace phyxel {
namespace {

namespace fs = std::filesystem;

constexpr const char* log_name = "energy.csv";
constexpr const char* summary_name = "run.json";
constexpr std::size_t largest_log = std::size_t{1} << 30;

fs::path frame_file(const fs::path& directory, const char* family, std::int64_t number) {
  return directory / fmt::format("{}_{:06d}.hdf", family, number);
}

/// Whether a name is one of ours, finished or temporary.
bool is_trajectory_name(std::string_view name) {
  if (name.ends_with(".tmp")) name.remove_suffix(4);
  for (const char* one : {"phyxels.hdf.series", "surface.hdf.series", log_name, summary_name}) {
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

/// Everything in the folder that belongs to a trajectory.
std::vector<fs::path> trajectory_files(const fs::path& directory) {
  std::vector<fs::path> found;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(directory, error)) {
    if (is_trajectory_name(entry.path().filename().string())) found.push_back(entry.path());
  }
  std::sort(found.begin(), found.end());
  return found;
}

std::string log_header() {
  std::string header = "step";
  for (const DiagnosticColumn& column : diagnostic_columns()) {
    header += fmt::format(",{} [{}]", column.name, column.unit);
  }
  return header + "\n";
}

std::string log_line(const Diagnostics& now) {
  std::string line = std::to_string(now.step);
  for (const DiagnosticColumn& column : diagnostic_columns()) {
    line += fmt::format(",{:.17g}", column.value(now));
  }
  return line + "\n";
}

/// The first `lines` lines of a text. @throws InputError if it has fewer.
std::string first_lines(const fs::path& file, std::int64_t lines) {
  const std::string text = read_text_file(file, largest_log);
  std::size_t end = 0;
  for (std::int64_t line = 0; line < lines; ++line) {
    end = text.find('\n', end);
    if (end == std::string::npos) {
      throw InputError(fmt::format("{}: has {} lines where the checkpoint expects {}",
                                   file.string(), line, lines));
    }
    ++end;
  }
  return text.substr(0, end);
}

std::string size_in_words(double bytes) {
  return bytes < 1e9 ? fmt::format("{:.3g} MB", bytes / 1e6)
                     : fmt::format("{:.3g} GB", bytes / 1e9);
}

}  // namespace

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

std::span<const double> values_of(const Model& model, const Frame& frame, Quantity quantity) {
  const auto flat = [](const std::vector<Vec3d>& vectors) -> std::span<const double> {
    if (vectors.empty()) return {};
    return {&vectors.front().x, 3 * vectors.size()};
  };
  switch (quantity) {
    case Quantity::position:
      return flat(model.position);
    case Quantity::mass:
      return model.mass;
    case Quantity::volume:
      return model.volume;
    case Quantity::displacement:
      return flat(frame.state->displacement);
    case Quantity::velocity:
      return flat(frame.state->velocity);
    case Quantity::von_mises:
      return frame.von_mises;
    case Quantity::volume_ratio:
      return frame.volume_ratio;
    case Quantity::surfel_position:
      if (frame.surfels) return flat(frame.surfels->position);
      break;
    case Quantity::surfel_normal:
      if (frame.surfels) return flat(frame.surfels->normal);
      break;
  }
  return {};
}

bool FrameStretches::has(Quantity quantity) const {
  return !values_of(model_, frame_, quantity).empty();
}

std::span<const double> FrameStretches::values(Quantity quantity, Index begin, Index end) {
  const std::size_t width = width_of(quantity);
  return values_of(model_, frame_, quantity)
      .subspan(width * static_cast<std::size_t>(begin),
               width * static_cast<std::size_t>(end - begin));
}

Recorder::Recorder(const Model& model, const Scene& scene, bool overwrite,
                   std::optional<std::int64_t> resume_after)
    : model_(model),
      scene_(scene),
      directory_(scene.output.directory),
      writes_phyxels_(scene.output.phyxels),
      writes_surface_(scene.output.surface && model.whole_surfels() > 0) {
  check_output_folder(directory_, overwrite || resume_after);
  if (resume_after) remove_unfinished();
  check_space(resume_after.value_or(0));
  if (resume_after) {
    continue_after(*resume_after);
  } else {
    begin_anew();
  }
}

void Recorder::remove_unfinished() const {
  for (const fs::path& file : trajectory_files(directory_)) {
    std::error_code ignored;
    if (file.extension() == ".tmp") fs::remove(file, ignored);
  }
}

void Recorder::check_space(std::int64_t frames_before) const {
  const double scalar = scene_.solver.precision == Precision::single ? 4 : 8;
  const auto count = [](std::size_t n) { return static_cast<double>(n); };
  double frame = 20e3;  // seal, HDF5's own structure, metadata
  const double phyxels = model_.whole_size();
  if (writes_phyxels_)
    frame += phyxels * (3 * scalar * (1 + count(scene_.output.fields.size())) + 8);
  if (writes_surface_) {
    // A closed surface has twice as many triangles as corners.
    frame += model_.whole_surfels() * (3 * (scalar + 4) + 2 * 33);
  }
  const double frames = scene_.output.frames_per_second > 0
                            ? std::floor(scene_.time.end * scene_.output.frames_per_second) + 1
                            : 1;
  const double checkpoints = 3 * phyxels * 6 * scalar;  // two, and a third while it is written
  const double needed =
      std::max(0.0, frames - count(static_cast<std::size_t>(frames_before))) * frame + checkpoints;
  std::error_code error;
  double available = static_cast<double>(fs::space(directory_, error).available);
  if (error) return;
  for (const fs::path& file : trajectory_files(directory_)) {
    const auto size = fs::file_size(file, error);
    if (!error && frames_before == 0) available += static_cast<double>(size);  // will be replaced
  }
  if (needed > available) {
    throw InputError(
        fmt::format("{}: about {} are needed for {} frames and the checkpoints, {} are free; "
                    "allowed: fewer frames "
                    "(output.frames_per_second), fewer fields, or another folder (--out)",
                    directory_.string(), size_in_words(needed), frames, size_in_words(available)));
  }
}

void Recorder::begin_anew() {
  for (const fs::path& file : trajectory_files(directory_)) {
    std::error_code error;
    if (!fs::remove(file, error) && error) {
      throw InputError(fmt::format("{}: cannot be replaced: {}", file.string(), error.message()));
    }
  }
  if (writes_phyxels_) phyxels_.create(directory_ / "phyxels.hdf.series", {});
  if (writes_surface_) surface_.create(directory_ / "surface.hdf.series", {});
  write_whole_file(directory_ / log_name, log_header(), Durable::no);
  log_size_ = log_header().size();
}

void Recorder::continue_after(std::int64_t frames) {
  if (!fs::exists(directory_ / log_name)) {  // resumed into a folder of its own
    begin_anew();
    frames_ = frames;
    return;
  }
  const auto keep = [&](bool writes, const char* family, SeriesFile& series) {
    if (!writes) return;
    const fs::path file = directory_ / fmt::format("{}.hdf.series", family);
    std::vector<SeriesEntry> entries = read_series(file);
    if (entries.size() < static_cast<std::size_t>(frames)) {
      throw InputError(
          fmt::format("{}: has {} frames where the checkpoint expects {}; allowed: another "
                      "folder (--out), or an earlier checkpoint",
                      file.string(), entries.size(), frames));
    }
    for (std::size_t e = static_cast<std::size_t>(frames); e < entries.size(); ++e) {
      std::error_code ignored;
      fs::remove(frame_file(directory_, family, static_cast<std::int64_t>(e)), ignored);
    }
    entries.resize(static_cast<std::size_t>(frames));
    series.create(file, entries);
  };
  const std::string log = first_lines(directory_ / log_name, frames + 1);
  std::error_code ignored;
  fs::remove(directory_ / summary_name, ignored);  // of what is no longer the end
  keep(writes_phyxels_, "phyxels", phyxels_);
  keep(writes_surface_, "surface", surface_);
  write_whole_file(directory_ / log_name, log, Durable::no);
  log_size_ = log.size();
  frames_ = frames;
}

void Recorder::write(const Frame& frame) {
  FrameStretches values(model_, frame);
  write(frame.diagnostics, values);
}

void Recorder::write(const Diagnostics& diagnostics, Stretches& values) {
  const double time = diagnostics.time;
  if (writes_phyxels_) {
    const fs::path file = frame_file(directory_, "phyxels", frames_);
    write_phyxel_frame(file, model_, scene_, diagnostics, values);
    phyxels_.append({file, time});
  }
  if (writes_surface_ && values.has(Quantity::surfel_position)) {
    const fs::path file = frame_file(directory_, "surface", frames_);
    write_surface_frame(file, model_, scene_, diagnostics, values);
    surface_.append({file, time});
  }
  const std::string line = log_line(diagnostics);
  replace_tail(directory_ / log_name, log_size_, line);
  log_size_ += line.size();
  ++frames_;
}

void Recorder::write_summary(const std::string& text) const {
  write_whole_file(directory_ / summary_name, text, Durable::no);
}

std::vector<fs::path> Recorder::files() const {
  std::vector<fs::path> files;
  if (writes_phyxels_) files.push_back(phyxels_.file());
  if (writes_surface_) files.push_back(surface_.file());
  files.push_back(directory_ / log_name);
  return files;
}

}  // namespace phyxel
