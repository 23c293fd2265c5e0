#include "report/run_files.hpp"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "files/atomic_file.hpp"
#include "files/trajectory_folder.hpp"
#include "outside_text.hpp"
#include "phyxel/error.hpp"
#include "phyxel/scene.hpp"
#include "report/contact_losses.hpp"

namespace phyxel::app {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

/// A number with seven digits; null for NaN and infinity.
Json few_digits(double value) {
  if (!std::isfinite(value)) return nullptr;
  return std::strtod(fmt::format("{:.7g}", value).c_str(), nullptr);
}

/// The losses in contact of an energy log, divided by their causes.
class LossColumns {
 public:
  LossColumns(const CsvTable& log, const fs::path& folder) : log_(log) {
    if (!log.has("time [s]") || !log.has(total)) return;  // written by an old program
    const fs::path file = folder / contacts_name;
    if (fs::exists(file)) losses_ = read_contact_losses(file);
    present_ = !losses_.empty();
    for (std::size_t r = 0; r < log.rows.size() && !present_; ++r) present_ = lost(r) != 0;
  }
  /// True if bodies of the run touch each other or obstacles.
  bool present() const { return present_; }
  static std::vector<std::string> names() {
    return {"friction_heat [J]", "impact_loss [J]", "other_contact_loss [J]"};
  }
  /// The values of a row of the log [J].
  std::vector<double> values(std::size_t row) const {
    const auto found = losses_.find(log_.text(row, "time [s]"));
    const auto [heat, impact] = found == losses_.end() ? ContactLosses{} : found->second;
    const double other = lost(row) - heat - impact;
    const double rounding = 1e-12 * (std::abs(heat) + std::abs(impact));
    return {heat, impact, std::abs(other) > rounding ? other : 0};
  }

 private:
  static constexpr const char* total = "contact_loss [J]";
  double lost(std::size_t row) const { return std::strtod(log_.text(row, total).c_str(), nullptr); }

  const CsvTable& log_;
  std::unordered_map<std::string, ContactLosses> losses_;
  bool present_ = false;
};

}  // namespace

RunFiles::RunFiles(fs::path folder) : folder_(std::move(folder)) {
  const fs::path file = folder_ / summary_name;
  if (!fs::exists(file)) return;
  try {
    summary_ = Json::parse(read_text_file(file, std::size_t{1} << 24));
  } catch (const Json::exception& error) {
    throw InputError(fmt::format("{}: is not JSON: {}", file.string(), error.what()));
  }
  if (!summary_.is_object()) {
    throw InputError(fmt::format("{}: is not a summary of a run", file.string()));
  }
}

std::vector<std::string> RunFiles::warnings() const {
  std::vector<std::string> warnings;
  if (summary_.contains("warnings")) {
    for (const auto& warning : summary_["warnings"]) warnings.push_back(warning);
  }
  if (summary_.value("inverted_phyxels", 0) > 0) {
    warnings.push_back(fmt::format("{} phyxels are inside out at the end.",
                                   summary_["inverted_phyxels"].get<int>()));
  }
  return warnings;
}

Json RunFiles::timing() const {
  Json timing = Json::array();
  if (summary_.contains("seconds")) {
    for (const auto& [what, seconds] : summary_["seconds"].items()) {
      timing.push_back({what, seconds});
    }
  }
  return timing;
}

Json RunFiles::log() const {
  Json log{{"columns", Json::array()}, {"rows", Json::array()}};
  const fs::path file = folder_ / log_name;
  if (!fs::exists(file)) return log;
  const CsvTable table = read_csv(file);
  log["columns"] = table.columns;
  const LossColumns losses(table, folder_);
  if (losses.present()) {
    for (const std::string& name : LossColumns::names()) log["columns"].push_back(name);
  }
  // A chart cannot show more points than its width.
  const std::size_t step = 1 + table.rows.size() / 4000;
  for (std::size_t r = 0; r < table.rows.size(); r += step) {
    Json row = Json::array();
    for (const std::string& cell : table.rows[r]) {
      row.push_back(few_digits(std::strtod(cell.c_str(), nullptr)));
    }
    if (losses.present()) {
      for (const double value : losses.values(r)) row.push_back(few_digits(value));
    }
    log["rows"].push_back(std::move(row));
  }
  return log;
}

Facts RunFiles::facts(const std::string& program) const {
  Facts facts;
  const auto add = [&](const char* name, const char* key, auto&& words) {
    if (summary_.contains(key) && !summary_[key].is_null()) {
      facts.emplace_back(name, words(summary_[key]));
    }
  };
  const auto text = [](const Json& value) {
    return value.is_string() ? value.get<std::string>() : json_text(value, -1);
  };
  const auto number = [](const char* unit) {
    return [unit](const Json& value) { return fmt::format("{:.4g}{}", value.get<double>(), unit); };
  };
  add("scene", "scene", text);
  add("device", "device", text);
  add("ranks", "ranks", text);
  add("method", "method", text);
  add("neighbours of a phyxel", "neighbours_per_phyxel", number(""));
  add("steps", "steps", text);
  add("time step", "time_step_s", number(" s"));
  if (summary_.value("method", "") == method_name(Method::verlet)) {
    add("largest stable step", "largest_stable_step_s", number(" s"));
  }
  add("speed", "phyxel_steps_per_second", number(" phyxel-steps/s"));
  add("memory", "bytes",
      [](const Json& value) { return fmt::format("{:.4g} MB", value.get<double>() / 1e6); });
  if (summary_.value("conservative", false)) {
    add("drift of energy", "energy_drift", number(" of the largest kinetic + elastic energy"));
  }
  add("internal forces sum to", "internal_force_balance", number(" of their size"));
  add("their torques to", "internal_torque_balance", number(" of theirs"));
  if (summary_.empty()) {
    facts.emplace_back("program", program);
    facts.emplace_back("",
                       "No run.json: the run was stopped, is under way, or was not phyxel run.");
  }
  return facts;
}

}  // namespace phyxel::app
