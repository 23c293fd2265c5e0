/// Bodies that break in runs of the program: an example against its numbers, and wrong input.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>

#include "phyxel/recorder.hpp"
#include "support/csv_column.hpp"
#include "support/glb.hpp"
#include "support/page.hpp"
#include "support/program.hpp"
#include "support/skips.hpp"

namespace phyxel {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using test::Outcome;
using test::text_of;
using ::testing::HasSubstr;

class FractureOfRuns : public test::Program {
 protected:
  /// Runs a notched plate that is pulled apart.
  void tear_plate() {
    write("scene.toml",
          "[time]\nend = 0.04\n[output]\nframes_per_second = 250\nfields = ['broken', 'fragment']\n"
          "[[body]]\nshape = 'block'\nsize = [0.8, 0.6, 0.12]\nspacing = 0.04\nlattice = 'cells'\n"
          "[body.material]\nyoung = 1e6\npoisson = 0.25\ndensity = 1000\n"
          "[body.fracture]\nenergy_release_rate = 50\n"
          "[[body.notch]]\ncentre = [-0.4, 0.001, 0]\nnormal = [0, 1, 0]\nradius = 0.3\n"
          "[[body.motion]]\nregion = 'y+'\nvelocity = [0, 1, 0]\n"
          "[[body.motion]]\nregion = 'y-'\nvelocity = [0, -1, 0]\n");
    ASSERT_EQ(run({"run", "scene.toml", "--out", "out", "--no-pictures"}).code, 0);
  }
  /// The values of the column of energy.csv that begins with a name.
  std::vector<double> column(const std::string& name) const {
    return test::csv_column(text_of(folder_ / "out" / "energy.csv"), name);
  }
  /// Returns the message with which the program refuses a plate with the given lines in place of
  /// its section of fracture.
  std::string refusal(const std::string& lines) {
    write("scene.toml",
          "[time]\nend = 1e-3\n[[body]]\nshape = 'block'\nsize = [0.8, 0.6, 0.12]\n"
          "spacing = 0.04\nlattice = 'cells'\n" +
              lines);
    const Outcome outcome = run({"run", "scene.toml", "--out", "out", "--force"});
    EXPECT_EQ(outcome.code, 2) << outcome.err;
    EXPECT_TRUE(!fs::exists(folder_ / "out") || fs::is_empty(folder_ / "out"));
    return outcome.err;
  }
};

/// The total energy is the work of the striker, within 2% with a step of 0.8 of the limit: seen
/// 0.5%. Breaking takes energy only.
TEST_F(FractureOfRuns, AStruckPlateBreaksByTheEnergyItWasGiven) {
  const fs::path example = fs::path(PHYXEL_SOURCE_DIR) / "examples" / "kalthoff" / "scene.toml";
  const Outcome outcome =
      run({"run", example.string(), "--out", "out", "--until", "6e-5", "--no-pictures", "--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const json summary = json::parse(outcome.out);
  const std::vector<double> total = column("total_energy"), taken = column("fracture_energy");
  const std::vector<double> time = column("time");
  ASSERT_GT(total.size(), 6u);
  const double work = summary["reactions"][1]["work_j"].get<double>();
  EXPECT_NEAR(total.back(), work, 0.02 * work);
  for (std::size_t k = 1; k < taken.size(); ++k) EXPECT_GE(taken[k], taken[k - 1]);
  // The wave is at the notch's tip after 50 mm / 5,654 m/s = 9 us, and the crack grows from 20 to
  // 30 us on: a tenth of what a crack of 10 mm through 4 layers takes.
  for (std::size_t k = 0; k < taken.size(); ++k) {
    if (time[k] < 1.5e-5) {
      EXPECT_EQ(taken[k], 0);
    }
    if (time[k] > 4e-5) {
      EXPECT_GT(taken[k], 0.1 * 22130 * 0.01 * 0.004);
    }
  }
}

/// A beam that is cut through and held at one end: the other half falls freely, in the table, the
/// summary and the field of frames, but for what the sagging face of the notch pushes: seen 3e-8
/// m/s. Verlet's velocities are half a step old.
TEST_F(FractureOfRuns, FragmentsAreTold) {
  write("scene.toml",
        "gravity = [0, 0, -10]\n[time]\nend = 0.02\n[solver]\nprecision = 'double'\n"
        "[output]\nframes_per_second = 100\nfields = ['fragment', 'broken']\n"
        "[[body]]\nname = 'beam, cut'\nshape = 'block'\nsize = [0.8, 0.2, 0.2]\nspacing = 0.05\n"
        "lattice = 'cells'\n[body.material]\nyoung = 1e6\npoisson = 0.25\ndensity = 1000\n"
        "[[body.notch]]\ncentre = [0.1, 0, 0]\nnormal = [1, 0, 0]\nradius = 9\n"
        "[[body.fixed]]\nregion = 'x-'\n");
  const Outcome outcome = run({"run", "scene.toml", "--out", "out", "--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const json summary = json::parse(outcome.out);
  EXPECT_EQ(summary["fragments"]["count"], 2);
  EXPECT_EQ(summary["fragments"]["dust_phyxels"], 0);
  EXPECT_NEAR(summary["fragments"]["largest_share_of_mass"].get<double>(), 10.0 / 16, 1e-12);
  const std::string table = text_of(folder_ / "out" / "fragments.csv");
  EXPECT_THAT(table, HasSubstr(",\"beam, cut\",1,"));
  std::string plain = table;  // a comma in a name would count as one between cells
  for (auto at = plain.find("beam, cut"); at != std::string::npos; at = plain.find("beam, cut")) {
    plain.replace(at, 9, "beam");
  }
  const auto column = [&](const char* name) { return test::csv_column(plain, name, "beam\",2,"); };
  const double dt = summary["time_step_s"].get<double>();
  ASSERT_EQ(column("time").size(), 3u);
  for (std::size_t k = 0; k < 3; ++k) {
    const double time = column("time")[k];
    EXPECT_NEAR(column("velocity_z")[k], -10 * (time - dt / 2), 1e-6);
    EXPECT_NEAR(column("centre_z")[k], -5 * time * time, 1e-9);
    EXPECT_NEAR(column("centre_x")[k], 0.25, 1e-5);
    EXPECT_NEAR(column("mass")[k], 1000 * 0.3 * 0.2 * 0.2, 1e-12);
    EXPECT_EQ(column("phyxels")[k], 6 * 16);
  }
  // The surface has lost a ring of triangles around the cut, and nothing else.
  const FrameData frame =
      read_frame(read_series(folder_ / "out" / "surface.hdf.series").back().file, true);
  for (const Triangle& t : frame.triangle) {
    const auto number = [&](std::size_t c) { return frame.field.at("fragment")[t[c]]; };
    EXPECT_TRUE(number(0) == number(1) && number(1) == number(2));
  }
  const Outcome again = run({"run", "scene.toml", "--out", "again"});
  EXPECT_THAT(again.out,
              HasSubstr("  fragments   2, the heaviest with 62.5% of the mass; no dust"));
}

/// A file of glTF draws, at each frame, the triangles that the frame has: those of nodes that have
/// not vanished.
TEST_F(FractureOfRuns, GltfOpensAsFramesDo) {
  tear_plate();
  const Outcome outcome = run({"export", "out", "--format", "glb", "--out", "plate.glb"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const test::Gltf gltf = test::read_glb(folder_ / "plate.glb");
  const std::vector<SeriesEntry> frames = read_series(folder_ / "out" / "surface.hdf.series");
  ASSERT_GT(frames.size(), 5u);
  std::size_t vanishing = 0;
  for (std::size_t k = 0; k < frames.size(); ++k) {
    std::multiset<Triangle> drawn;
    for (std::size_t node = 0; node < gltf.json["nodes"].size(); ++node) {
      if (!gltf.json["nodes"][node].contains("mesh")) continue;
      const std::vector<float> scales = gltf.keyframes(node, "scale");
      if (!scales.empty()) {
        ASSERT_EQ(scales.size(), 3 * frames.size());
        for (std::size_t e = 3 * k; e < 3 * k + 3; ++e) EXPECT_EQ(scales[e], scales[3 * k]);
        EXPECT_TRUE(scales[3 * k] == 0 || scales[3 * k] == 1);
        vanishing += scales[3 * k] == 0 ? 1 : 0;
        if (scales[3 * k] == 0) continue;
      }
      const auto corners = gltf.values<std::uint32_t>(gltf.primitive(node)["indices"]);
      for (std::size_t c = 0; c + 2 < corners.size(); c += 3) {
        drawn.insert({static_cast<Index>(corners[c]), static_cast<Index>(corners[c + 1]),
                      static_cast<Index>(corners[c + 2])});
      }
    }
    const FrameData frame = read_frame(frames[k].file);
    EXPECT_EQ(drawn, std::multiset<Triangle>(frame.triangle.begin(), frame.triangle.end())) << k;
  }
  EXPECT_GT(vanishing, 0u);
}

/// The page of a run draws, of each frame, the triangles that the frame has.
TEST_F(FractureOfRuns, PagesOpenAsFramesDo) {
  tear_plate();
  const Outcome outcome = run({"report", "out", "-o", "page.html"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const std::string page = text_of(folder_ / "page.html");
  const json data = test::data_of(page);
  const std::vector<std::uint32_t> corners = test::embedded<std::uint32_t>(page, "triangles");
  const std::vector<SeriesEntry> frames = read_series(folder_ / "out" / "surface.hdf.series");
  ASSERT_EQ(data["uncut"].size(), frames.size());
  EXPECT_LT(data["uncut"].back(), data["uncut"].front());
  for (std::size_t k = 0; k < frames.size(); ++k) {
    std::set<Triangle> drawn;
    for (std::size_t t = 0; t < data["uncut"][k].get<std::size_t>(); ++t) {
      drawn.insert({static_cast<Index>(corners[3 * t]), static_cast<Index>(corners[3 * t + 1]),
                    static_cast<Index>(corners[3 * t + 2])});
    }
    const std::vector<Triangle> of_frame = read_frame(frames[k].file).triangle;
    EXPECT_EQ(drawn, std::set<Triangle>(of_frame.begin(), of_frame.end())) << k;
  }
  PHYXEL_NEEDS_TOOL(std::system("command -v chromium >/dev/null") == 0, "chromium");
  EXPECT_THAT(test::seen_by_browser(folder_, "page.html#t=0.04"), HasSubstr("data-error=\"0\""));
}

TEST_F(FractureOfRuns, WrongInputIsRefusedWithWhatIsAllowed) {
  const std::string material =
      "[body.material]\nyoung = 1e6\npoisson = 0.25\ndensity = 1000\n[body.fracture]\n";
  const auto expect = [&](const std::string& lines, const std::vector<std::string>& words) {
    const std::string said = refusal(lines);
    for (const std::string& word : words) EXPECT_THAT(said, HasSubstr(word));
  };
  expect(material + "energy_release_rate = 0\n", {"scene.toml:13", "energy_release_rate", "0"});
  expect(material + "energy_release_rate = -5\n", {"energy_release_rate", "-5"});
  expect(material + "strength = 1e4\n", {"scene.toml:12", "energy_release_rate", "missing"});
  expect(material + "energy_release_rate = 50\nstrength = 10\n",
         {"scene.toml:12", "strength", "10 Pa", "m apart"});
  expect(material + "energy_release_rate = 50\nseed = 3\n", {"seed", "scatter"});
  expect(material +
             "energy_release_rate = 50\n[[body.notch]]\ncentre = [9, 9, 9]\n"
             "normal = [0, 1, 0]\nradius = 0.1\n",
         {"scene.toml:14", "centre = [9, 9, 9]", "cuts no pair"});
  expect(material +
             "energy_release_rate = 50\n[[body.notch]]\ncentre = [0, 0, 0]\n"
             "normal = [0, 0, 0]\nradius = 0.1\n",
         {"scene.toml:16", "normal", "a direction"});
  expect(material + "energy_release_rate = 50\n[[body.notch]]\ncentre = [0, 0, 0]\n",
         {"scene.toml:15", "body.notch.centre", "without normal"});
  expect(material + "energy_release_rate = 50\n[[body.notch]]\nmesh = 'none.obj'\n",
         {"scene.toml:15", "none.obj"});
  write("line.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n");
  expect(material + "energy_release_rate = 50\n[[body.notch]]\nmesh = 'line.obj'\n",
         {"scene.toml:14", "line.obj"});
  expect(
      "[body.material]\nyoung = 1e6\npoisson = 0.45\ndensity = 1000\n[body.fracture]\n"
      "energy_release_rate = 50\n",
      {"poisson = 0.45", "0 to 0.35"});
  expect(
      "[body.material]\nlaw = 'j2'\nyoung = 1e6\npoisson = 0.25\ndensity = 1000\n"
      "yield_stress = 1e4\n[body.fracture]\nenergy_release_rate = 50\n",
      {"body.fracture", "law = \"j2\"", "an elastic law"});
}

}  // namespace
}  // namespace phyxel
