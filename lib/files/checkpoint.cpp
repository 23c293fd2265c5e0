#include "phyxel/checkpoint.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>

#include "exact_sum.hpp"
#include "files/frame_file.hpp"
#include "files/hdf5_file.hpp"
#include "files/looks_group.hpp"
#include "files/sealed_file.hpp"
#include "phyxel/error.hpp"

namespace phyxel {
namespace {

namespace fs = std::filesystem;

constexpr const char* kind = "checkpoint";
constexpr std::int64_t version = 4;         // with history
constexpr std::int64_t oldest_version = 2;  // without parameters
constexpr std::size_t kept = 2;
// Phyxels whose values are looked at together.
constexpr Index looked_at_together = 1 << 20;

constexpr const char* prefix = "checkpoint_";
constexpr const char* suffix = ".h5";

/// The step in a checkpoint's name, or nothing for another file.
std::optional<std::int64_t> step_of(const fs::path& file) {
  const std::string name = file.filename().string();
  const std::string_view middle =
      std::string_view(name).substr(std::min(name.size(), std::string_view(prefix).size()));
  if (name.rfind(prefix, 0) != 0 || !middle.ends_with(suffix)) return std::nullopt;
  const std::string_view digits = middle.substr(0, middle.size() - std::string_view(suffix).size());
  std::int64_t step = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), step);
  if (error != std::errc() || end != digits.data() + digits.size() || step < 0) return std::nullopt;
  return step;
}

/// Checkpoints of a folder, the newest first.
std::vector<std::pair<std::int64_t, fs::path>> checkpoints_in(const fs::path& directory) {
  std::vector<std::pair<std::int64_t, fs::path>> found;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(directory, error)) {
    if (const auto step = step_of(entry.path())) found.emplace_back(*step, entry.path());
  }
  std::sort(found.rbegin(), found.rend());
  return found;
}

/// One line for each, the name and the value with a tab between: neither has such characters.
std::string text_of(const std::vector<Parameter>& parameters) {
  std::string text;
  for (const Parameter& p : parameters) text += p.name + '\t' + p.value + '\n';
  return text;
}

std::vector<Parameter> parameters_in(const Hdf5Reader& in, const std::string& text) {
  std::vector<Parameter> parameters;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = text.find('\n', begin), tab = text.find('\t', begin);
    if (end == std::string::npos || tab == std::string::npos || tab > end) {
      in.refuse(fmt::format("line {} of /phyxel/parameters is no name, tab and value",
                            parameters.size() + 1));
    }
    parameters.push_back({text.substr(begin, tab - begin), text.substr(tab + 1, end - tab - 1)});
    begin = end + 1;
  }
  return parameters;
}

template <class T>
void check_finite(const Hdf5Reader& in, const std::string& path, const std::vector<T>& values,
                  Index first) {
  using phyxel::is_finite;
  using std::isfinite;
  for (std::size_t i = 0; i < values.size(); ++i) {
    bool finite = false;
    if constexpr (std::is_same_v<T, double>) {
      finite = isfinite(values[i]);
    } else {
      finite = is_finite(values[i]);
    }
    if (!finite) {
      in.refuse(
          fmt::format("{} is not finite in row {}", path, i + static_cast<std::size_t>(first)));
    }
  }
}

constexpr const char* rigid_path = "/state/rigid";

/// The states of free rigid bodies; none in files without any.
std::vector<RigidState> rigid_in(const Hdf5Reader& in) {
  std::vector<RigidState> states;
  if (!in.has(rigid_path)) return states;
  const std::vector<double> numbers = in.array<double>(rigid_path, RigidState::count);
  check_finite(in, rigid_path, numbers, 0);
  for (std::size_t k = 0; k < numbers.size(); k += RigidState::count) {
    states.push_back(RigidState::from(&numbers[k]));
  }
  return states;
}

constexpr const char* broken_path = "/state/broken";

/// The broken pairs; none in files without any.
std::vector<PhyxelPair> broken_in(const Hdf5Reader& in, std::size_t phyxels) {
  std::vector<PhyxelPair> pairs;
  if (!in.has(broken_path)) return pairs;
  const std::vector<Index> ids = in.array<Index>(broken_path, 2);
  for (std::size_t k = 0; k < ids.size(); k += 2) {
    const PhyxelPair pair{ids[k], ids[k + 1]};
    const bool fits = pair[0] >= 0 && pair[0] < pair[1] &&
                      static_cast<std::size_t>(pair[1]) < phyxels &&
                      (pairs.empty() || pairs.back() < pair);
    if (!fits) {
      in.refuse(
          fmt::format("{} has the pair {}, {} in row {}; allowed: ascending pairs of two of "
                      "{} phyxels, the smaller number first",
                      broken_path, pair[0], pair[1], k / 2, phyxels));
    }
    pairs.push_back(pair);
  }
  return pairs;
}

constexpr const char* worn_path = "/state/worn";
constexpr const char* carried_path = "/state/worn_carried";

/// The worn phyxels; none in files without any.
std::vector<WornPhyxel> worn_in(const Hdf5Reader& in, std::size_t phyxels) {
  std::vector<WornPhyxel> worn;
  if (!in.has(worn_path)) return worn;
  const std::vector<Index> ids = in.array<Index>(worn_path);
  const std::vector<double> carried = in.array<double>(carried_path);
  if (carried.size() != ids.size()) {
    in.refuse(fmt::format("{} has {} values; allowed: {}, as {} has", carried_path, carried.size(),
                          ids.size(), worn_path));
  }
  for (std::size_t k = 0; k < ids.size(); ++k) {
    const bool fits = ids[k] >= 0 && static_cast<std::size_t>(ids[k]) < phyxels &&
                      (worn.empty() || worn.back().phyxel < ids[k]) && carried[k] >= 0 &&
                      carried[k] < 1;
    if (!fits) {
      in.refuse(
          fmt::format("{} and {} have phyxel {} with {} in row {}; allowed: ascending numbers "
                      "of {} phyxels, with shares from 0 to below 1",
                      worn_path, carried_path, ids[k], carried[k], k, phyxels));
    }
    worn.push_back({ids[k], carried[k]});
  }
  return worn;
}

std::string history_path(const std::string& column) { return "/state/history/" + column; }

/// The lines of a text.
std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    lines.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return lines;
}

/// The words of exact sums (`State::step_sums`) in decimal digits, a line for each sum.
std::string text_of_work(std::span<const std::int64_t> words) {
  std::string text;
  for (std::size_t k = 0; k < words.size(); ++k) {
    text += std::to_string(words[k]);
    text += (k + 1) % ExactSum::words == 0 ? '\n' : ' ';
  }
  return text;
}

/// The words in such a text.
std::vector<std::int64_t> work_in(const Hdf5Reader& in, const std::string& text) {
  std::vector<std::int64_t> words;
  for (const std::string& line : lines_of(text)) {
    const char* at = line.data();
    const char* const end = at + line.size();
    for (int k = 0; k < ExactSum::words; ++k) {
      const auto [next, error] = std::from_chars(at, end, words.emplace_back());
      const bool last = k + 1 == ExactSum::words;
      if (error != std::errc() || (last ? next != end : next == end || *next != ' ')) {
        in.refuse(fmt::format("line {} of /state/support_work does not have {} whole numbers",
                              words.size() / ExactSum::words + 1, int{ExactSum::words}));
      }
      at = last ? next : next + 1;
    }
  }
  return words;
}

}  // namespace

fs::path write_checkpoint(const fs::path& directory, const State& state,
                          const CheckpointInfo& info) {
  const auto check = [&](const std::string& name, std::size_t found) {
    if (found == state.displacement.size()) return;
    throw InputError(
        fmt::format("state of a checkpoint: {} has {} entries; allowed: {}, as many as "
                    "displacements",
                    name, found, state.displacement.size()));
  };
  check("velocity", state.velocity.size());
  for (const HistoryColumn& column : state.history) {
    check(fmt::format("history \"{}\"", column.name), column.values.size());
  }
  const Model none;
  Frame frame;
  frame.state = &state;
  FrameSource values(none, frame);
  return write_checkpoint(directory, state, info, static_cast<Index>(state.displacement.size()),
                          values);
}

fs::path write_checkpoint(const fs::path& directory, const State& state, const CheckpointInfo& info,
                          Index phyxels, ChunkedSource& values) {
  Hdf5Writer out;
  out.group("/phyxel");
  out.attribute("/phyxel", "version", version);
  out.attribute("/phyxel", "program", info.program);
  out.attribute("/phyxel", "precision", std::string(precision_name(info.precision)));
  out.attribute("/phyxel", "method", std::string(method_name(info.method)));
  out.attribute("/phyxel", "model_digest", fmt::format("{:016x}", info.model_digest));
  out.attribute("/phyxel", "total_energy", info.total_energy);
  out.attribute("/phyxel", "initial_energy", info.watched.start_energy);
  out.attribute("/phyxel", "initial_speed", info.watched.start_speed);
  out.attribute("/phyxel", "peak_energy", info.watched.peak_energy);
  out.attribute("/phyxel", "frames_written", info.frames_written);
  out.attribute("/phyxel", "units", std::string("m, m/s, s, J"));
  out.text("/phyxel/scene", info.scene_text);
  out.text("/phyxel/parameters", text_of(info.parameters));
  out.group("/state");
  out.attribute("/state", "step", state.step);
  out.attribute("/state", "time", state.time);
  out.attribute("/state", "dt", state.dt);
  write_looks(out, state.looks);
  const bool as_float = info.precision == Precision::single;
  write_later(out, {"/state/displacement", as_float, phyxels, {Quantity::displacement}}, values);
  write_later(out, {"/state/velocity", as_float, phyxels, {Quantity::velocity}}, values);
  // Laws remember in the precision of the work, which is float in mixed runs.
  out.attribute("/state", "history_interval", state.history_interval);
  std::string columns;
  for (std::size_t k = 0; k < state.history.size(); ++k) {
    const std::string& name = state.history[k].name;
    columns += name + '\n';
    if (k == 0) out.group("/state/history");
    write_later(
        out,
        {history_path(name), info.precision != Precision::double_, phyxels, {history_quantity(k)}},
        values);
  }
  if (!columns.empty()) out.text("/state/history_columns", columns);

  if (!state.step_sums.empty()) {
    out.text("/state/support_work", text_of_work(state.step_sums));
  }
  if (!state.rigid.empty()) {
    std::vector<double> numbers;
    for (const RigidState& body : state.rigid) {
      const auto of_body = body.numbers();
      numbers.insert(numbers.end(), of_body.begin(), of_body.end());
    }
    out.array<double>(rigid_path, numbers, RigidState::count);
  }
  if (!state.broken.empty()) {
    std::vector<Index> ids;
    for (const PhyxelPair& pair : state.broken) ids.insert(ids.end(), pair.begin(), pair.end());
    out.array<Index>(broken_path, ids, 2);
  }
  if (!state.worn.empty()) {
    std::vector<Index> ids;
    std::vector<double> carried;
    for (const WornPhyxel& of_state : state.worn) {
      ids.push_back(of_state.phyxel);
      carried.push_back(of_state.carried);
    }
    out.array<Index>(worn_path, ids);
    out.array<double>(carried_path, carried);
  }

  fs::path file = directory / fmt::format("{}{:09d}{}", prefix, state.step, suffix);
  write_sealed(file, kind, out.content(), Durable::yes);
  // Only now may others go: those beyond the last two, and those of a future that this run left
  // behind when it went back to an earlier checkpoint.
  std::size_t seen = 0;
  std::error_code ignored;
  for (const auto& [step, other] : checkpoints_in(directory)) {
    if (step > state.step || ++seen > kept) fs::remove(other, ignored);
  }
  return file;
}

CheckpointReader::CheckpointReader(const fs::path& file) {
  check_seal(file, kind);
  file_ = std::make_unique<const Hdf5Reader>(file);
  const Hdf5Reader& in = *file_;
  info_.version = static_cast<int>(in.integer_attribute("/phyxel", "version"));
  if (info_.version < oldest_version || info_.version > version) {
    in.refuse(fmt::format("format version {}; this program reads versions {} to {}", info_.version,
                          oldest_version, version));
  }
  info_.program = in.text_attribute("/phyxel", "program");
  const std::string precision = in.text_attribute("/phyxel", "precision");
  const auto known = precision_named(precision);
  if (!known) in.refuse(fmt::format("unknown precision \"{}\"", precision));
  info_.precision = *known;
  const std::string method = in.text_attribute("/phyxel", "method");
  const auto known_method = method_named(method);
  if (!known_method) in.refuse(fmt::format("unknown method \"{}\"", method));
  info_.method = *known_method;
  const std::string digest = in.text_attribute("/phyxel", "model_digest");
  const auto [end, error] =
      std::from_chars(digest.data(), digest.data() + digest.size(), info_.model_digest, 16);
  if (error != std::errc() || end != digest.data() + digest.size())
    in.refuse("model_digest is not a number");
  info_.total_energy = in.number_attribute("/phyxel", "total_energy");
  info_.watched.start_energy = in.number_attribute("/phyxel", "initial_energy");
  info_.watched.start_speed = std::numeric_limits<double>::quiet_NaN();
  if (info_.version > 2) {
    info_.watched.start_speed = in.number_attribute("/phyxel", "initial_speed");
    info_.watched.peak_energy = in.number_attribute("/phyxel", "peak_energy");
    if (!(info_.watched.start_speed >= 0) || !(info_.watched.peak_energy >= 0)) {
      in.refuse(fmt::format("initial_speed = {}, peak_energy = {}; allowed: 0 and more",
                            info_.watched.start_speed, info_.watched.peak_energy));
    }
  }
  info_.frames_written = in.integer_attribute("/phyxel", "frames_written");
  info_.scene_text = in.text("/phyxel/scene");
  if (info_.version > 2) info_.parameters = parameters_in(in, in.text("/phyxel/parameters"));

  state_.step = in.integer_attribute("/state", "step");
  state_.time = in.number_attribute("/state", "time");
  state_.dt = in.number_attribute("/state", "dt");
  if (std::min(state_.step, info_.frames_written) < 0 ||
      std::max(state_.step, info_.frames_written) > most_counted) {
    in.refuse(fmt::format("counts {} steps and {} frames; allowed: 0 to {}", state_.step,
                          info_.frames_written, most_counted));
  }
  if (info_.version > 2) state_.looks = read_looks(in);
  if (!(state_.dt > 0) || !std::isfinite(state_.dt) || !std::isfinite(state_.time)) {
    in.refuse(
        fmt::format("dt = {} s at t = {} s; allowed: dt > 0, both finite", state_.dt, state_.time));
  }
  const std::size_t rows = in.shape("/state/displacement").rows;
  if (info_.version > 3) {
    state_.history_interval = in.number_attribute("/state", "history_interval");
    if (!(state_.history_interval >= 0) || !std::isfinite(state_.history_interval)) {
      in.refuse(fmt::format("history_interval = {} s; allowed: 0 and more, finite",
                            state_.history_interval));
    }
    state_.step_sums = work_in(in, in.text("/state/support_work"));
    state_.rigid = rigid_in(in);
    state_.broken = broken_in(in, rows);
    state_.worn = worn_in(in, rows);
    for (std::string& name : lines_of(in.text("/state/history_columns"))) {
      const std::string path = history_path(name);
      if (const std::size_t other = in.shape(path).rows; other != rows) {
        in.refuse(fmt::format("{} has {} rows, /state/displacement {}", path, other, rows));
      }
      state_.history.push_back({std::move(name), {}});
    }
  }
  if (const std::size_t other = in.shape("/state/velocity").rows; other != rows) {
    in.refuse(fmt::format("/state/velocity has {} rows, /state/displacement {}", other, rows));
  }
  if (rows > static_cast<std::size_t>(std::numeric_limits<Index>::max())) {
    in.refuse(fmt::format("/state/displacement has {} rows; allowed at most {}", rows,
                          std::numeric_limits<Index>::max()));
  }
  phyxels_ = static_cast<Index>(rows);
}
CheckpointReader::~CheckpointReader() = default;
CheckpointReader::CheckpointReader(CheckpointReader&&) noexcept = default;
CheckpointReader& CheckpointReader::operator=(CheckpointReader&&) noexcept = default;

State CheckpointReader::state(Index begin, Index end) const {
  State state = state_;
  const auto read = [&](const std::string& path) {
    std::vector<Vec3d> values =
        file_->vectors(path, static_cast<std::size_t>(begin), static_cast<std::size_t>(end));
    check_finite(*file_, path, values, begin);
    return values;
  };
  state.displacement = read("/state/displacement");
  state.velocity = read("/state/velocity");
  for (HistoryColumn& column : state.history) {
    const std::string path = history_path(column.name);
    column.values =
        file_->numbers(path, static_cast<std::size_t>(begin), static_cast<std::size_t>(end));
    check_finite(*file_, path, column.values, begin);
  }
  return state;
}

Checkpoint read_checkpoint(const fs::path& file) {
  const CheckpointReader reader(file);
  return {reader.state(0, reader.phyxels()), reader.info()};
}

std::optional<fs::path> latest_checkpoint(const fs::path& directory, std::string* warning) {
  for (const auto& [step, file] : checkpoints_in(directory)) {
    try {
      const CheckpointReader reader(file);
      for (Index begin = 0; begin < reader.phyxels();) {  // the values, too, which may be refused
        const Index end = begin + std::min(looked_at_together, reader.phyxels() - begin);
        reader.state(begin, end);
        begin = end;
      }
      return file;
    } catch (const InputError& error) {
      if (warning)
        *warning +=
            fmt::format("{}{}; taking an earlier one", warning->empty() ? "" : "; ", error.what());
    }
  }
  return std::nullopt;
}

}  // namespace phyxel
