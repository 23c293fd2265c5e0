#include "report/run_files.hpp"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "files/atomic_file.hpp"
#include "outside_text.hpp"
#include "phyxel/error.hpp"
#include "phyxel/scene.hpp"

namespace phyxel::app {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

/// A row of numbers with seven digits; null for NaN and infinity.
Json few_digits(const std::vector<std::string>& cells) {
  Json row = Json::array();
  for (const std::string& cell : cells) {
    const double value = std::strtod(cell.c_str(), nullptr);
    if (std::isfinite(value)) {
      row.push_back(std::strtod(fmt::format("{:.7g}", value).c_str(), nullptr));
    } else {
      row.push_back(nullptr);
    }
  }
  return row;
}

}  // namespace

RunFiles::RunFiles(fs::path folder) : folder_(std::move(folder)) {
  const fs::path file = folder_ / "run.json";
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
  const fs::path file = folder_ / "energy.csv";
  if (!fs::exists(file)) return log;
  const CsvTable table = read_csv(file);
  log["columns"] = table.columns;
  // A chart cannot show more points than its width.
  const std::size_t step = 1 + table.rows.size() / 4000;
  for (std::size_t r = 0; r < table.rows.size(); r += step) {
    log["rows"].push_back(few_digits(table.rows[r]));
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
