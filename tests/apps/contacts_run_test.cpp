/// Obstacles in runs of the program, and the examples that have some.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <sstream>

#include "support/beam_program.hpp"

namespace phyxel {
namespace {

using nlohmann::json;
using test::Outcome;
using test::text_of;
using ::testing::HasSubstr;

class ContactsOfRuns : public test::BeamProgram {
 protected:
  /// The summary of an example.
  json summary_of(const std::string& example, const std::string& threads = "1") {
    const std::string scene =
        std::string(PHYXEL_SOURCE_DIR) + "/examples/" + example + "/scene.toml";
    const Outcome ran = run({"run", scene, "--json", "--no-pictures", "--threads", threads, "--out",
                             (folder_ / example).string()});
    EXPECT_EQ(ran.code, 0) << ran.err;
    return json::parse(ran.out);
  }
  /// The values of a column at the lines of an obstacle in a log.
  std::vector<double> column(const std::string& example, const std::string& obstacle,
                             const std::string& name) const {
    std::istringstream log(text_of(folder_ / example / "contacts.csv"));
    std::string line;
    std::getline(log, line);
    const auto cells = [](const std::string& text) {
      std::vector<std::string> all;
      std::istringstream row(text);
      for (std::string cell; std::getline(row, cell, ',');) all.push_back(cell);
      return all;
    };
    const std::vector<std::string> names = cells(line);
    std::size_t at = 0;
    while (at < names.size() && !names[at].starts_with(name)) ++at;
    std::vector<double> values;
    while (std::getline(log, line)) {
      if (line.find(obstacle) != std::string::npos) values.push_back(std::stod(cells(line).at(at)));
    }
    return values;
  }
};

constexpr double g = 9.81;

TEST_F(ContactsOfRuns, ABlockSlidesDownASlopeAsCoulombSays) {
  const json summary = summary_of("slope");
  const std::vector<double> time = column("slope", "slope", "time"),
                            x = column("slope", "slope", "impulse_x"),
                            z = column("slope", "slope", "impulse_z");
  // Along the slope, whose direction is (cos 30°, 0, -sin 30°), over the last 0.4 s.
  const double angle = std::numbers::pi / 6, mass = 8;
  const std::size_t first = time.size() / 2, last = time.size() - 1;
  const double span = time[last] - time[first];
  const double gained = mass * g * std::sin(angle) * span + std::cos(angle) * (x[last] - x[first]) -
                        std::sin(angle) * (z[last] - z[first]);
  const double expected = g * (std::sin(angle) - 0.3 * std::cos(angle));
  // The rest of its swinging (seen: 1e-4).
  EXPECT_NEAR(gained / mass / span, expected, 1e-3 * expected);
  EXPECT_LT(std::abs(summary["energy_drift"].get<double>()), 1e-3);
  EXPECT_LT(summary["contacts"][0]["deepest_m"].get<double>(), 1e-6);
}

TEST_F(ContactsOfRuns, JawsCarryABarByFriction) {
  const json summary = summary_of("jaws");
  const double weight = 1100 * 0.1 * 0.3 * 0.08 * g;
  const json& contacts = summary["contacts"];
  EXPECT_EQ(contacts[0]["force_n"][2].get<double>(), 0) << "the bar is on the table still";
  // It swings by 5%.
  EXPECT_NEAR(contacts[1]["force_n"][2].get<double>() + contacts[2]["force_n"][2].get<double>(),
              weight, 0.1 * weight);
  EXPECT_NEAR(contacts[1]["force_n"][0].get<double>(), -contacts[2]["force_n"][0].get<double>(),
              1e-3 * contacts[1]["force_n"][0].get<double>());
  // The work of the jaws lifts the bar, presses it, and is lost to friction.
  const double work = contacts[1]["work_j"].get<double>() + contacts[2]["work_j"].get<double>();
  EXPECT_NEAR(work, summary["energy_j"].get<double>(), 0.02 * work);
}

TEST_F(ContactsOfRuns, AreTheSameBytesAfterARestartInTheMiddleOfACollision) {
  write_beam("0.2", "");
  replace_in_beam("[[body.fixed]]\nregion = \"x-\"\n", "");
  write("beam.toml", text_of(folder_ / "beam.toml") +
                         "[[obstacle]]\nshape = 'sphere'\nradius = 0.3\nfriction = 0.4\n"
                         "translation = [0.2, 0.05, -0.405]\n");
  const Outcome whole = run({"run", "beam.toml"});
  ASSERT_EQ(whole.code, 0) << whole.err;
  EXPECT_THAT(whole.out, HasSubstr("obstacle    obstacle 1: sphere at [0.2, 0.05, -0.405] m"));
  EXPECT_THAT(whole.out, HasSubstr("contact     obstacle 1: force on the bodies ("));
  const std::string log = text_of(folder_ / "out" / "contacts.csv"),
                    energies = text_of(folder_ / "out" / "energy.csv");
  EXPECT_EQ(std::count(log.begin(), log.end(), '\n'), 1 + 11);  // frames

  ASSERT_EQ(run({"run", "beam.toml", "--force", "--until", "0.1"}).code, 0);
  const Outcome resumed = run({"run", "beam.toml", "--resume", "auto"});
  ASSERT_EQ(resumed.code, 0) << resumed.err;
  EXPECT_EQ(text_of(folder_ / "out" / "contacts.csv"), log);
  EXPECT_EQ(text_of(folder_ / "out" / "energy.csv"), energies);
}

TEST_F(ContactsOfRuns, OfFrictionAreRefusedToImplicitSteps) {
  write_beam("0.2", "");
  write("beam.toml",
        text_of(folder_ / "beam.toml") +
            "[[obstacle]]\nshape = 'plane'\nfriction = 0.4\ntranslation = [0, 0, -3]\n");
  const Outcome ran =
      run({"run", "beam.toml", "--method", "implicit", "--precision", "double", "--step", "0.01"});
  EXPECT_EQ(ran.code, 2);
  EXPECT_THAT(ran.err, HasSubstr("obstacle.friction = 0.4 of obstacle \"obstacle 1\" found with "
                                 "solver.method = \"implicit\"; allowed with this method: 0"));
}

TEST_F(ContactsOfRuns, AStackStandsOnAFloor) {
  const json summary = summary_of("stack");
  const double weight = 4 * 8 * g;
  ASSERT_EQ(summary["contacts"].size(), 5u);
  EXPECT_NEAR(summary["contacts"][0]["force_n"][2].get<double>(), weight, 1e-3 * weight);
  // Each block carries those above it.
  EXPECT_NEAR(summary["contacts"][1]["force_n"][2].get<double>(), -0.75 * weight, 2e-3 * weight);
  EXPECT_NEAR(summary["contacts"][4]["force_n"][2].get<double>(), 0.25 * weight, 1e-3 * weight);
  for (const json& contact : summary["contacts"]) {
    EXPECT_LT(contact["deepest_m"].get<double>(), 0.2 * 0.05);  // spacings
  }
}

}  // namespace
}  // namespace phyxel
