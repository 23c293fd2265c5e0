/// The chart of energies of the pages of phyxel report: contact is part of it, and its curves sum
/// to the total energy.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "support/page.hpp"
#include "support/program.hpp"
#include "support/skips.hpp"

namespace phyxel {
namespace {

using nlohmann::json;
using test::between;
using test::data_of;
using test::Outcome;
using test::text_of;
using ::testing::ElementsAre;
using ::testing::IsSupersetOf;

/// The columns of the energy log that curves show, by their labels.
const std::map<std::string, std::string> columns_of_curves = {
    {"kinetic", "kinetic_energy"},
    {"strain", "strain_energy"},
    {"volume", "volume_energy"},
    {"hourglass", "hourglass_energy"},
    {"gravity", "gravity_energy"},
    {"load", "load_energy"},
    {"springs of contact", "contact_energy"},
    {"heat of friction", "friction_heat"},
    {"lost in impacts", "impact_loss"},
    {"lost otherwise in contact", "other_contact_loss"},
    {"plastic work", "plastic_work"},
    {"viscous work", "viscous_work"},
    {"taken by fracture", "fracture_energy"}};

const std::string floor_below = "[[obstacle]]\nname = 'a floor, \"hard\"'\nshape = 'plane'\n";

class ReportedEnergies : public test::Program {
 protected:
  /// Runs a block that is thrown across what is below it.
  void run_with(const std::string& below) {
    write("scene.toml", R"(gravity = [0, 0, -9.81]
[time]
end = 0.2
[solver]
device = "cpu"
precision = "double"
[output]
directory = "out"
frames_per_second = 100
fields = ["displacement"]
[[body]]
shape = "block"
size = [0.2, 0.2, 0.2]
spacing = 0.05
translation = [0, 0, 0.12]
velocity = [0.5, 0, -1]
material = { young = 1e5, poisson = 0.3, density = 1000, viscosity = 1e-4 }
)" + below);
    const Outcome done = run({"run", "scene.toml", "--force"});
    EXPECT_EQ(done.code, 0) << done.err;
  }
  /// The data of the page of the run.
  json reported() const {
    const Outcome done = run({"report", "out", "-o", "page.html", "--force"});
    EXPECT_EQ(done.code, 0) << done.err;
    return data_of(text_of(folder_ / "page.html"));
  }
  json data_with(const std::string& below) {
    run_with(below);
    return reported();
  }
  /// The labels of the chart of energies, as a browser draws it.
  std::vector<std::string> curves() const {
    test::seen_by_browser(folder_, "page.html");
    const std::string chart =
        between(text_of(folder_ / "dom.html"), "<h2>Energy</h2>", "</div></div></div>");
    std::vector<std::string> labels;
    for (std::size_t at = chart.find("</i>"); at != std::string::npos;
         at = chart.find("</i>", at + 1)) {
      labels.push_back(chart.substr(at + 4, chart.find('<', at + 4) - at - 4));
    }
    return labels;
  }
};

/// The values of a column of a page's log.
std::vector<double> column(const json& data, const std::string& name) {
  const json& names = data["log"]["columns"];
  const auto at = std::find_if(names.begin(), names.end(), [&](const json& each) {
    return each.get<std::string>().starts_with(name + " [");
  });
  if (at == names.end()) return {};
  std::vector<double> values;
  for (const json& row : data["log"]["rows"]) values.push_back(row[at - names.begin()]);
  return values;
}

/// Expects that curves sum to the total energy in each row.
void expect_sum(const json& data, std::vector<std::string> curves) {
  ASSERT_FALSE(curves.empty());
  ASSERT_EQ(curves.back(), "total");
  curves.pop_back();
  const std::vector<double> total = column(data, "total_energy");
  std::vector<double> sum(total.size());
  double largest = 0;
  for (const std::string& label : curves) {
    ASSERT_TRUE(columns_of_curves.contains(label)) << label;
    const std::vector<double> part = column(data, columns_of_curves.at(label));
    ASSERT_EQ(part.size(), sum.size()) << label;
    for (std::size_t k = 0; k < sum.size(); ++k) {
      sum[k] += part[k];
      largest = std::max(largest, std::abs(part[k]));
    }
  }
  // Numbers have seven digits.
  for (std::size_t k = 0; k < sum.size(); ++k) EXPECT_NEAR(sum[k], total[k], 1e-6 * largest) << k;
}

TEST_F(ReportedEnergies, HaveTheLossesOfAllContacts) {
  const json data = data_with(floor_below + "friction = 0.3\n");
  const json contact = json::parse(text_of(folder_ / "out" / "run.json"))["contacts"][0];
  const double heat = column(data, "friction_heat").back(),
               impact = column(data, "impact_loss").back();
  EXPECT_GT(heat, 0);
  EXPECT_GT(impact, 0);
  // Seven digits.
  EXPECT_NEAR(heat, contact["friction_heat_j"].get<double>(), 1e-6 * heat);
  EXPECT_NEAR(impact, contact["impact_loss_j"].get<double>(), 1e-6 * impact);
  for (const double other : column(data, "other_contact_loss")) EXPECT_EQ(other, 0);
  EXPECT_NEAR(column(data, "contact_loss").back(), heat + impact, 1e-6 * (heat + impact));
}

TEST_F(ReportedEnergies, AreThoseOfTheirTimesWhereNumbersOfStepsRecur) {
  run_with(floor_below + "friction = 0.3\n");
  // As where the step changes: the last two lines have the same number of steps.
  for (const char* log : {"out/energy.csv", "out/contacts.csv"}) {
    std::string text = text_of(folder_ / log);
    const std::size_t last = text.rfind('\n', text.size() - 2) + 1,
                      before = text.rfind('\n', last - 2) + 1;
    text.replace(last, text.find(',', last) - last,
                 text.substr(before, text.find(',', before) - before));
    write(log, text);
  }
  const json data = reported();
  const std::vector<double> heat = column(data, "friction_heat");
  EXPECT_TRUE(std::is_sorted(heat.begin(), heat.end()));
  EXPECT_GT(heat.back(), 0);
  for (const double other : column(data, "other_contact_loss")) EXPECT_EQ(other, 0);
}

TEST_F(ReportedEnergies, KeepLossesWithoutALogOfContacts) {
  const json whole = data_with(floor_below + "friction = 0.3\n");
  std::filesystem::remove(folder_ / "out" / "contacts.csv");
  const json data = reported();
  EXPECT_EQ(column(data, "other_contact_loss"), column(whole, "contact_loss"));
  write("out/contacts.csv", "step,time [s],obstacle\n0,0,floor\n");
  const Outcome broken = run({"report", "out", "-o", "page.html", "--force"});
  EXPECT_EQ(broken.code, 2);
  EXPECT_THAT(broken.err, ::testing::HasSubstr("contacts.csv: no column \"friction_heat [J]\""));
}

TEST_F(ReportedEnergies, HaveNoColumnsOfContactWithoutContact) {
  const json data = data_with("");
  EXPECT_EQ(column(data, "friction_heat").size(), 0u);
  EXPECT_EQ(column(data, "other_contact_loss").size(), 0u);
  EXPECT_EQ(data["log"]["rows"][0].size(), data["log"]["columns"].size());
}

TEST_F(ReportedEnergies, AreCurvesThatSumToTheTotal) {
  PHYXEL_NEEDS_TOOL(std::system("command -v chromium >/dev/null") == 0, "chromium");
  json data = data_with(floor_below + "friction = 0.3\n");
  std::vector<std::string> drawn = curves();
  EXPECT_THAT(drawn, IsSupersetOf({"kinetic", "gravity", "heat of friction", "lost in impacts",
                                   "viscous work"}));
  expect_sum(data, drawn);

  data = data_with(floor_below + "method = 'penalty'\nstiffness = 1\n");
  drawn = curves();
  EXPECT_THAT(drawn, IsSupersetOf({"springs of contact", "total"}));
  expect_sum(data, drawn);

  // A free rigid body that falls on the floor beside the block loses energy in no contact with it.
  data = data_with(floor_below +
                   "[[obstacle]]\nname = 'die'\nshape = 'box'\nsize = [0.1, 0.1, 0.1]\n"
                   "density = 1000\ntranslation = [1, 0, 0.06]\nvelocity = [0, 0, -1]\n");
  drawn = curves();
  EXPECT_THAT(drawn, IsSupersetOf({"lost in impacts", "lost otherwise in contact"}));
  expect_sum(data, drawn);

  data_with("");
  EXPECT_THAT(curves(), ElementsAre("kinetic", "gravity", "total"));
}

}  // namespace
}  // namespace phyxel
