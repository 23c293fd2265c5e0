/// phyxel_studies problems: descriptions of the measured problems, for the pages in docs/.
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "accuracy/accuracy.hpp"
#include "accuracy/hard_cases.hpp"
#include "accuracy_studies.hpp"
#include "cantilever.hpp"
#include "law_scenes.hpp"
#include "outside_text.hpp"
#include "phyxel/law_table.hpp"
#include "pictures.hpp"
#include "studies.hpp"

namespace phyxel::studies {
namespace {

using Json = nlohmann::ordered_json;

/// Six digits: the result does not depend on the last bits of a compiler's arithmetic.
double rounded(double value) { return std::stod(fmt::format("{:.6g}", value)); }

Json problems() {
  Json cases = Json::array(), hard = Json::array(), studies = Json::array(),
       pictures = Json::array(), first = Json::array();
  for (const app::AccuracyCase& c : app::accuracy_cases()) {
    cases.push_back({{"name", c.name}, {"what", c.what}, {"across", c.across}, {"group", c.group}});
  }
  for (const app::HardCase& c : app::hard_cases()) {
    hard.push_back({{"name", c.name}, {"what", c.what}, {"tolerance", rounded(c.tolerance)}});
  }
  for (const Study& s : accuracy_studies()) {
    studies.push_back({{"name", s.name},
                       {"what", s.what},
                       {"x", s.x},
                       {"x_label", s.x_label},
                       {"by_time", s.by_time}});
  }
  for (const FirstScene& s : first_scenes({})) {
    first.push_back({{"name", s.name}, {"what", s.what}});
  }
  for (const AccuracyPicture& p : accuracy_pictures()) {
    pictures.push_back({{"file", p.file}, {"what", p.what}});
  }
  const double known = app::known_deflection();
  return {{"default_factor", NeighbourhoodRule{}.factor},
          {"cantilever",
           {{"heights_long", rounded(app::cantilever_length / app::cantilever_height)},
            {"poisson", app::cantilever_material.poisson},
            {"deflection_by_length", rounded(known / app::cantilever_length)},
            {"settled", app::cantilever_settled},
            {"known_by_timoshenko", rounded(known / app::timoshenko_deflection())}}},
          {"cases", cases},
          {"studies", studies},
          {"hard", hard},
          {"default_law", usual_law},
          {"first_scenes", first},
          {"pictures", pictures}};
}

}  // namespace

void add_problems(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "problems", "Print descriptions of the measured problems as JSON, for bench/pages");
  command->footer(
      "Example:\n"
      "  phyxel_studies problems > bench/pages/problems.json");
  command->callback([] { fmt::print("{}\n", app::json_text(problems())); });
}

}  // namespace phyxel::studies
