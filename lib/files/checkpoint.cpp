#include "phyxel/checkpoint.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "files/hdf5_file.hpp"
#include "files/sealed_file.hpp"
#include "phyxel/error.hpp"

namespace phyxel {
namespace {

namespace fs = std::filesystem;

constexpr const char* kind = "checkpoint";
constexpr std::int64_t version = 1;
constexpr std::size_t kept = 2;

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

void check_finite(const Hdf5Reader& in, const char* path, const std::vector<Vec3d>& values) {
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!is_finite(values[i])) in.refuse(fmt::format("{} is not finite in row {}", path, i));
  }
}

}  // namespace

fs::path write_checkpoint(const fs::path& directory, const State& state,
                          const CheckpointInfo& info) {
  Hdf5Writer out;
  out.group("/phyxel");
  out.attribute("/phyxel", "version", version);
  out.attribute("/phyxel", "program", info.program);
  out.attribute("/phyxel", "precision", std::string(precision_name(info.precision)));
  out.attribute("/phyxel", "model_digest", fmt::format("{:016x}", info.model_digest));
  out.attribute("/phyxel", "total_energy", info.total_energy);
  out.attribute("/phyxel", "initial_energy", info.initial_energy);
  out.attribute("/phyxel", "frames_written", info.frames_written);
  out.attribute("/phyxel", "units", std::string("m, m/s, s, J"));
  out.text("/phyxel/scene", info.scene_text);
  out.group("/state");
  out.attribute("/state", "step", state.step);
  out.attribute("/state", "time", state.time);
  out.attribute("/state", "dt", state.dt);
  const bool as_float = info.precision == Precision::single;
  out.vectors("/state/displacement", state.displacement, as_float);
  out.vectors("/state/velocity", state.velocity, as_float);

  const fs::path file = directory / fmt::format("{}{:09d}{}", prefix, state.step, suffix);
  write_sealed(file, kind, out.image(), Durable::yes);
  // Only now may others go: those beyond the last two, and those of a future that this run left
  // behind when it went back to an earlier checkpoint.
  std::size_t seen = 0;
  std::error_code ignored;
  for (const auto& [step, other] : checkpoints_in(directory)) {
    if (step > state.step || ++seen > kept) fs::remove(other, ignored);
  }
  return file;
}

Checkpoint read_checkpoint(const fs::path& file) {
  check_seal(file, kind);
  const Hdf5Reader in(file);
  Checkpoint checkpoint;
  CheckpointInfo& info = checkpoint.info;
  info.version = static_cast<int>(in.integer_attribute("/phyxel", "version"));
  if (info.version != version) {
    in.refuse(
        fmt::format("format version {}; this program reads version {}", info.version, version));
  }
  info.program = in.text_attribute("/phyxel", "program");
  const std::string precision = in.text_attribute("/phyxel", "precision");
  const auto known = precision_named(precision);
  if (!known) in.refuse(fmt::format("unknown precision \"{}\"", precision));
  info.precision = *known;
  const std::string digest = in.text_attribute("/phyxel", "model_digest");
  const auto [end, error] =
      std::from_chars(digest.data(), digest.data() + digest.size(), info.model_digest, 16);
  if (error != std::errc() || end != digest.data() + digest.size())
    in.refuse("model_digest is not a number");
  info.total_energy = in.number_attribute("/phyxel", "total_energy");
  info.initial_energy = in.number_attribute("/phyxel", "initial_energy");
  info.frames_written = in.integer_attribute("/phyxel", "frames_written");
  info.scene_text = in.text("/phyxel/scene");

  State& state = checkpoint.state;
  state.step = in.integer_attribute("/state", "step");
  state.time = in.number_attribute("/state", "time");
  state.dt = in.number_attribute("/state", "dt");
  state.displacement = in.vectors("/state/displacement");
  state.velocity = in.vectors("/state/velocity");
  if (state.step < 0 || info.frames_written < 0)
    in.refuse("counts a negative number of steps or frames");
  if (!(state.dt > 0) || !std::isfinite(state.dt) || !std::isfinite(state.time)) {
    in.refuse(
        fmt::format("dt = {} s at t = {} s; allowed: dt > 0, both finite", state.dt, state.time));
  }
  if (state.velocity.size() != state.displacement.size()) {
    in.refuse(fmt::format("/state/velocity has {} rows, /state/displacement {}",
                          state.velocity.size(), state.displacement.size()));
  }
  check_finite(in, "/state/displacement", state.displacement);
  check_finite(in, "/state/velocity", state.velocity);
  return checkpoint;
}

std::optional<fs::path> latest_checkpoint(const fs::path& directory, std::string* warning) {
  for (const auto& [step, file] : checkpoints_in(directory)) {
    try {
      check_seal(file, kind);
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
