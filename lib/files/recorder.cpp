#include "phyxel/recorder.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string_view>

#include "files/atomic_file.hpp"
#include "files/frame_file.hpp"
#include "files/trajectory_folder.hpp"
#include "phyxel/error.hpp"
#include "phyxel/history.hpp"
#include "phyxel/probes.hpp"
#include "phyxel/reactions.hpp"

namespace phyxel {
namespace {

namespace fs = std::filesystem;

/// The first line of a log. @param first its first columns
template <class Columns>
std::string header_of(std::string first, const Columns& columns) {
  for (const auto& column : columns) {
    first += fmt::format(",{}", column.name);
    if (*column.unit != '\0') first += fmt::format(" [{}]", column.unit);
  }
  return first + "\n";
}

std::string log_header() { return header_of("step", diagnostic_columns()); }

std::string log_line(const Diagnostics& now) {
  std::string line = std::to_string(now.step);
  for (const DiagnosticColumn& column : diagnostic_columns()) {
    line += fmt::format(",{:.17g}", column.value(now));
  }
  return line + "\n";
}

/// A text as a cell of a CSV file (RFC 4180).
std::string cell_of(const std::string& text) {
  if (text.find_first_of(",\"\n\r") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

/// The lines of a log at one instant. A number that is not known leaves its cell empty.
/// @param cells cells(row): what follows step and time in the line of a row
template <class Row, class Columns, class Cells>
std::string lines_of(const Diagnostics& now, const std::vector<Row>& rows, const Columns& columns,
                     Cells&& cells) {
  std::string lines;
  for (const Row& row : rows) {
    lines += fmt::format("{},{:.17g},{}", now.step, now.time, cells(row));
    for (const auto& column : columns) {
      const double value = column.value(row);
      lines += std::isnan(value) ? "," : fmt::format(",{:.17g}", value);
    }
    lines += '\n';
  }
  return lines;
}

/// @throws InputError if an array of a frame does not fit the model
void check_frame(const Model& model, const Frame& frame) {
  if (!frame.state) throw InputError("frame: state is null; allowed: the state of the model");
  const auto check = [](const std::string& name, std::size_t found, Index wanted, bool may_lack) {
    if (found == static_cast<std::size_t>(wanted) || (may_lack && found == 0)) return;
    throw InputError(fmt::format("frame: {} has {} entries; allowed: {}{}", name, found, wanted,
                                 may_lack ? " or none" : ""));
  };
  const State& state = *frame.state;
  check("displacement", state.displacement.size(), model.size(), false);
  check("velocity", state.velocity.size(), model.size(), false);
  for (const HistoryColumn& column : state.history) {
    check(fmt::format("history \"{}\"", column.name), column.values.size(), model.size(), false);
  }
  const std::size_t columns = history_columns(model).size();
  if (!state.history.empty() && state.history.size() != columns) {
    throw InputError(fmt::format("frame: {} columns of history; allowed: {} or none",
                                 state.history.size(), columns));
  }
  for (const PointField& field : point_fields()) {
    const auto found = frame.fields.find(field.quantity);
    if (found == frame.fields.end()) continue;
    const auto width = static_cast<Index>(width_of(field.quantity));
    check(field.name, found->second.size(), width * model.size(), true);
  }
  const auto surfels = static_cast<Index>(model.surfels.position.size());
  for (const auto& [quantity, values] : frame.fields) {
    if (!is_on_surface(quantity)) continue;
    check("a field of surfels", values.size(), static_cast<Index>(width_of(quantity)) * surfels,
          true);
  }
  if (!frame.surfels) return;
  check("surfels.position", frame.surfels->position.size(), surfels, false);
  check("surfels.normal", frame.surfels->normal.size(), surfels, false);
}

std::string size_in_words(double bytes) {
  return bytes < 1e9 ? fmt::format("{:.3g} MB", bytes / 1e6)
                     : fmt::format("{:.3g} GB", bytes / 1e9);
}

}  // namespace

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
    case Quantity::surfel_position:
      if (frame.surfels) return flat(frame.surfels->position);
      break;
    case Quantity::surfel_normal:
      if (frame.surfels) return flat(frame.surfels->normal);
      break;
    default:
      if (const auto found = frame.fields.find(quantity); found != frame.fields.end()) {
        return found->second;
      }
      if (is_history(quantity) && history_column(quantity) < frame.state->history.size()) {
        return frame.state->history[history_column(quantity)].values;
      }
  }
  return {};
}

bool FrameSource::has(Quantity quantity) const {
  return !values_of(model_, frame_, quantity).empty();
}

std::span<const double> FrameSource::values(Quantity quantity, Index begin, Index end) {
  const std::size_t width = width_of(quantity);
  const std::span<const double> all = values_of(model_, frame_, quantity);
  if (begin < 0 || end < begin || width * static_cast<std::size_t>(end) > all.size()) {
    throw InputError(
        fmt::format("frame: rows {} to {} of an array of {} asked for; allowed: 0 to {}", begin,
                    end, all.size() / width, all.size() / width));
  }
  return all.subspan(width * static_cast<std::size_t>(begin),
                     width * static_cast<std::size_t>(end - begin));
}

Recorder::Recorder(const Model& model, const Scene& scene, bool overwrite,
                   const std::optional<Continuation>& point)
    : model_(model),
      scene_(scene),
      directory_(scene.output.directory),
      writes_phyxels_(scene.output.phyxels),
      writes_surface_(scene.output.surface && model.global_surfel_count() > 0) {
  if (!model.motions.empty()) {
    reactions_.emplace(directory_ / reactions_name,
                       header_of("step,time [s],body,set", reaction_columns()));
  }
  if (!model.probes.empty()) {
    probes_.emplace(directory_ / probes_name,
                    header_of("step,time [s],probe,point", probe_columns()));
  }
  if (has_gas(model)) {
    gases_.emplace(directory_ / gas_name, header_of("step,time [s],body,set", gas_columns()));
  }
  if (!model.obstacles.empty() || model.body_contact.acts()) {
    contacts_.emplace(directory_ / contacts_name,
                      header_of("step,time [s],obstacle,shape", contact_columns()));
  }
  const auto is_free = [](const Obstacle& obstacle) { return obstacle.free.has_value(); };
  if (std::any_of(model.obstacles.begin(), model.obstacles.end(), is_free)) {
    rigid_.emplace(directory_ / rigid_name,
                   header_of("step,time [s],obstacle,shape", rigid_columns()));
  }
  if (model.fracture.acts()) {
    fragments_.emplace(directory_ / fragments_name,
                       header_of("step,time [s],body,fragment", fragment_columns()));
  }
  if (point) {
    check_continuation(directory_, *point, overwrite);
    remove_unfinished();
  } else {
    check_output_folder(directory_, overwrite);
  }
  check_space(point ? point->frames : 0);
  if (point) {
    continue_after(*point, overwrite);
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
  double frame = 20e3;  // seal, HDF5 structure, metadata
  const double phyxels = model_.global_count();
  const auto position = [&](Points points) {  // at rest; motion may need doubles later
    return floats_hold_positions(model_, 0, points) ? scalar : 8;
  };
  if (writes_phyxels_) {
    frame += phyxels *
             (3 * position(Points::phyxels) + 3 * scalar * count(scene_.output.fields.size()) + 8);
  }
  if (writes_surface_) {
    // A closed surface has twice as many triangles as vertices. Masses and volumes are not on it.
    const auto& fields = scene_.output.fields;
    const auto held = std::count_if(fields.begin(), fields.end(), [](const std::string& name) {
      return name != "mass" && name != "volume";
    });
    frame += model_.global_surfel_count() * (3 * (position(Points::surfels) + 4) +
                                             3 * scalar * static_cast<double>(held) + 2 * 33);
  }
  const double frames = scene_.output.frames_per_second > 0
                            ? std::floor(scene_.time.end * scene_.output.frames_per_second) + 1
                            : 1;
  const double checkpoints = 3 * phyxels * 6 * scalar;  // two, and one more being written
  const double needed =
      std::max(0.0, frames - count(static_cast<std::size_t>(frames_before))) * frame + checkpoints;
  std::error_code error;
  double available = static_cast<double>(fs::space(directory_, error).available);
  if (error) return;
  for (const fs::path& file : trajectory_files(directory_)) {
    const auto size = fs::file_size(file, error);
    if (!error && frames_before == 0) available += static_cast<double>(size);  // to be replaced
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
  create_files();
}

void Recorder::create_files() {
  if (writes_phyxels_) phyxels_.create(directory_ / "phyxels.hdf.series", {});
  if (writes_surface_) surface_.create(directory_ / "surface.hdf.series", {});
  write_whole_file(directory_ / log_name, log_header(), Durable::no);
  log_size_ = log_header().size();
  for (FrameLog* log : logs()) log->create();
}

std::vector<FrameLog*> Recorder::logs() {
  std::vector<FrameLog*> all;
  for (std::optional<FrameLog>* log :
       {&reactions_, &probes_, &gases_, &contacts_, &rigid_, &fragments_}) {
    if (*log) all.push_back(&**log);
  }
  return all;
}

void Recorder::continue_after(const Continuation& point, bool overwrite) {
  frames_ = point.frames;
  if (!is_in_folder(point.checkpoint, directory_)) {
    // `check_continuation` has made sure that the folder has no trajectory, or one to be replaced.
    return overwrite ? begin_anew() : create_files();
  }
  if (!has_frames(directory_)) return create_files();
  const KeptLog log = kept_log(directory_ / log_name, point);
  std::vector<std::pair<SeriesFile*, std::vector<SeriesEntry>>> kept;
  std::vector<fs::path> later;
  const auto keep = [&](bool writes, const char* family, SeriesFile& series) {
    if (!writes) return;
    KeptSeries found = kept_series(directory_, family, point.frames, log.frames);
    later.insert(later.end(), found.later.begin(), found.later.end());
    kept.emplace_back(&series, std::move(found.entries));
  };
  keep(writes_phyxels_, "phyxels", phyxels_);
  keep(writes_surface_, "surface", surface_);
  std::vector<std::string> kept_lines;
  for (const FrameLog* one : logs()) kept_lines.push_back(one->kept(log.last_time));
  // No check follows, so that the folder is cut back as a whole or not at all.
  std::error_code ignored;
  fs::remove(directory_ / summary_name, ignored);  // it describes the end of the earlier run
  for (const fs::path& file : later) fs::remove(file, ignored);
  for (auto& [series, entries] : kept) {
    series->create(directory_ / series_name(series == &phyxels_ ? "phyxels" : "surface"), entries);
  }
  write_whole_file(directory_ / log_name, log.text, Durable::no);
  log_size_ = log.text.size();
  for (std::size_t k = 0; k < kept_lines.size(); ++k) logs()[k]->create(kept_lines[k]);
}

void Recorder::write(const Frame& frame) {
  check_frame(model_, frame);
  FrameSource values(model_, frame);
  write(frame.diagnostics, values, frame.readings);
}

void Recorder::write(const Diagnostics& diagnostics, ChunkedSource& values,
                     const Readings& readings) {
  const double time = diagnostics.time;
  if (writes_phyxels_) {
    const fs::path file = frame_file(directory_, "phyxels", frames_);
    write_phyxel_frame(file, model_, scene_, diagnostics, values);
    unsynced_.push_back(file);
    phyxels_.append({file, time});
  }
  if (writes_surface_ && values.has(Quantity::surfel_position)) {
    const fs::path file = frame_file(directory_, "surface", frames_);
    write_surface_frame(file, model_, scene_, diagnostics, values);
    unsynced_.push_back(file);
    surface_.append({file, time});
  }
  if (reactions_ && !readings.reactions.empty()) {
    reactions_->append(
        lines_of(diagnostics, readings.reactions, reaction_columns(),
                 [](const Reaction& r) { return cell_of(r.body) + "," + cell_of(r.set); }));
  }
  if (probes_ && !readings.probes.empty()) {
    probes_->append(
        lines_of(diagnostics, readings.probes, probe_columns(), [](const ProbeReading& r) {
          return fmt::format("{},{}", cell_of(r.probe), r.number + 1);
        }));
  }
  if (gases_ && !readings.gases.empty()) {
    gases_->append(lines_of(diagnostics, readings.gases, gas_columns(), [](const GasReading& r) {
      return cell_of(r.body) + "," + cell_of(r.set);
    }));
  }
  if (contacts_ && !readings.contacts.empty()) {
    contacts_->append(lines_of(
        diagnostics, readings.contacts, contact_columns(),
        [](const ContactReading& r) { return cell_of(r.obstacle) + "," + cell_of(r.shape); }));
  }
  if (rigid_ && !readings.rigid.empty()) {
    rigid_->append(lines_of(
        diagnostics, readings.rigid, rigid_columns(),
        [](const RigidReading& r) { return cell_of(r.obstacle) + "," + cell_of(r.shape); }));
  }
  if (fragments_ && !readings.fragments.empty()) {
    fragments_->append(lines_of(
        diagnostics, readings.fragments, fragment_columns(),
        [](const FragmentReading& r) { return fmt::format("{},{}", cell_of(r.body), r.number); }));
  }
  const std::string line = log_line(diagnostics);
  replace_tail(directory_ / log_name, log_size_, line);
  log_size_ += line.size();
  ++frames_;
}

void Recorder::sync() {
  for (const fs::path& file : unsynced_) sync_file(file);
  unsynced_.clear();
  for (const fs::path& file : files()) sync_file(file);
  sync_file(directory_);
}

void Recorder::write_summary(const std::string& text) const {
  write_whole_file(directory_ / summary_name, text, Durable::no);
}

std::vector<fs::path> Recorder::files() const {
  std::vector<fs::path> files;
  if (writes_phyxels_) files.push_back(phyxels_.file());
  if (writes_surface_) files.push_back(surface_.file());
  files.push_back(directory_ / log_name);
  for (const std::optional<FrameLog>* log :
       {&reactions_, &probes_, &gases_, &contacts_, &rigid_, &fragments_}) {
    if (*log) files.push_back((*log)->file());
  }
  return files;
}

}  // namespace phyxel
