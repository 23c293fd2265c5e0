/// The files beside a trajectory that describe its run: run.json, energy.csv and contacts.csv.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "csv.hpp"

namespace phyxel::app {

/// The summary and the energy log of a run.
class RunFiles {
 public:
  /// Reads run.json, if the run has finished. @throws InputError if it is not a summary
  explicit RunFiles(std::filesystem::path folder);

  /// The scene file that the summary names; "scene.toml" without one.
  std::string scene_file() const { return summary_.value("scene", std::string("scene.toml")); }
  /// Facts for the page. @param program the program that wrote the frames
  Facts facts(const std::string& program) const;
  /// The warnings of the summary.
  std::vector<std::string> warnings() const;
  /// Pairs of stage and time [s].
  nlohmann::ordered_json timing() const;
  /// Columns and rows of the energy log, with at most 4000 rows; empty without one. Of a run with
  /// contact, three columns more divide contact_loss: friction_heat and impact_loss, which are sums
  /// over the log of contacts, and other_contact_loss, the rest.
  nlohmann::ordered_json log() const;

 private:
  std::filesystem::path folder_;
  nlohmann::ordered_json summary_ = nlohmann::ordered_json::object();
};

}  // namespace phyxel::app
