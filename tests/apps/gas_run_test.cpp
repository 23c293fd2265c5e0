/// Gases in the output of a run.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <sstream>

#include "phyxel/checkpoint.hpp"
#include "support/hollow_cube.hpp"
#include "support/program.hpp"

namespace phyxel {
namespace {

using test::Outcome;
using test::text_of;
using ::testing::HasSubstr;
using ::testing::StartsWith;

class GasesOfRuns : public test::Program {
 protected:
  void write_cube(const std::string& end) const {
    write("hollow.stl", test::hollow_cube_stl());
    write("cube.toml", "[time]\nend = " + end + "\n" + test::hollow_cube_scene);
  }
};

/// The cells of the lines of a log below its header.
std::vector<std::vector<std::string>> cells_of(const std::string& log) {
  std::vector<std::vector<std::string>> rows;
  std::istringstream in(log);
  std::string line;
  std::getline(in, line);
  while (std::getline(in, line)) {
    std::istringstream cells(line);
    rows.emplace_back();
    for (std::string cell; std::getline(cells, cell, ',');) rows.back().push_back(cell);
  }
  return rows;
}

/// A gas at constant temperature has the same product of pressure and volume at all times.
TEST_F(GasesOfRuns, AreWrittenBesideTheEnergiesAndSummedUp) {
  write_cube("0.1");
  const Outcome printed = run({"run", "cube.toml", "--out", "out"});
  ASSERT_EQ(printed.code, 0) << printed.err;
  EXPECT_THAT(printed.out, HasSubstr("gas         hollow, traction 2: pressure "));
  const std::string log = text_of(folder_ / "out" / "gas.csv");
  EXPECT_THAT(log, StartsWith("step,time [s],body,set,pressure [Pa],volume [m^3]\n0,0,hollow,"));
  const auto rows = cells_of(log);
  ASSERT_EQ(rows.size(), 6u);
  double least = 1, most = 0;
  for (const auto& row : rows) {
    ASSERT_EQ(row.size(), 6u);
    EXPECT_EQ(row[3], "traction 2");
    const double pressure = std::stod(row[4]), volume = std::stod(row[5]);
    EXPECT_NEAR(pressure * volume, std::stod(rows[0][4]) * std::stod(rows[0][5]), 1e-12 * 128);
    least = std::min(least, volume);
    most = std::max(most, volume);
  }
  EXPECT_NEAR(std::stod(rows[0][4]), 2e3, 1e-9);
  EXPECT_NEAR(std::stod(rows[0][5]), 0.064, 0.02 * 0.064);  // from the areas of few phyxels
  EXPECT_GT(most, 1.005 * least);                           // it breathes

  const Outcome summed = run({"run", "cube.toml", "--out", "out", "--force", "--json"});
  ASSERT_EQ(summed.code, 0) << summed.err;
  const auto gases = nlohmann::json::parse(summed.out)["gases"];
  ASSERT_EQ(gases.size(), 1u);
  EXPECT_EQ(gases[0]["body"], "hollow");
  EXPECT_EQ(gases[0]["set"], "traction 2");
  EXPECT_EQ(gases[0]["pressure_pa"].get<double>(), std::stod(rows.back()[4]));
  EXPECT_EQ(gases[0]["volume_m3"].get<double>(), std::stod(rows.back()[5]));

  // At rest the gas has its whole pressure, and the same product.
  const Outcome rest = run({"run", "cube.toml", "--out", "rest", "--json", "--method",
                            "equilibrium", "--precision", "double"});
  ASSERT_EQ(rest.code, 0) << rest.err;
  const auto found = nlohmann::json::parse(rest.out)["gases"][0];
  EXPECT_NEAR(found["pressure_pa"].get<double>() * found["volume_m3"].get<double>(),
              2e3 * std::stod(rows[0][5]), 1e-9);
  EXPECT_GT(found["volume_m3"].get<double>(), 1.001 * std::stod(rows[0][5]));
}

TEST_F(GasesOfRuns, AreTheSameBytesAfterAStopAndAResumedRun) {
  write_cube("0.6");
  ASSERT_EQ(run({"run", "cube.toml", "--out", "whole"}).code, 0);
  ASSERT_EQ(
      interrupted({"run", "cube.toml", "--out", "parts"}, "parts/phyxels_000003.hdf", SIGTERM).code,
      75);
  const std::string log = text_of(folder_ / "parts" / "gas.csv");
  // A log without the lines of its frames is refused.
  write("parts/gas.csv", log.substr(0, log.find('\n') + 1));
  const Outcome refused = run({"run", "cube.toml", "--out", "parts", "--resume", "auto"});
  EXPECT_EQ(refused.code, 2);
  EXPECT_THAT(refused.err, HasSubstr("gas.csv: "));
  write("parts/gas.csv", log);
  ASSERT_EQ(run({"run", "cube.toml", "--out", "parts", "--resume", "auto"}).code, 0);
  EXPECT_EQ(text_of(folder_ / "whole" / "gas.csv"), text_of(folder_ / "parts" / "gas.csv"));
  EXPECT_EQ(cells_of(log).size() < cells_of(text_of(folder_ / "whole" / "gas.csv")).size(), true);
}

/// A resumed run has the curve of its start.
TEST_F(GasesOfRuns, CurvesOfLoadsMayNotChangeWhenARunGoesOn) {
  write_cube("0.1");
  ASSERT_EQ(run({"run", "cube.toml", "--out", "out"}).code, 0);
  std::string text = text_of(folder_ / "cube.toml");
  const std::string last = "[0.06, -0.5]";
  text.replace(text.find(last), last.size(), "[0.06, -0.4]");
  text.replace(text.find("end = 0.1"), 9, "end = 0.2");
  write("cube.toml", text);
  const Outcome refused = run({"run", "cube.toml", "--out", "out", "--resume", "auto"});
  EXPECT_EQ(refused.code, 2);
  EXPECT_THAT(refused.err, HasSubstr("body.traction.curve of body 1"));
  EXPECT_THAT(refused.err, HasSubstr("[0.06, -0.4]"));
}

TEST_F(GasesOfRuns, WithoutGasesThereIsNoFile) {
  write_cube("0.02");
  std::string text = text_of(folder_ / "cube.toml");
  text.erase(text.find("gas = 1\n"), 8);
  write("cube.toml", text);
  ASSERT_EQ(run({"run", "cube.toml", "--out", "out"}).code, 0);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out" / "gas.csv"));
}

}  // namespace
}  // namespace phyxel
