/// File names that are not UTF-8, which Linux allows, in the JSON output of all commands.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "support/program.hpp"

namespace phyxel {
namespace {

namespace fs = std::filesystem;
using test::Outcome;

class Names : public test::Program {
 protected:
  /// The output of a command, which must be JSON only.
  nlohmann::json json_of(std::vector<std::string> arguments) const {
    arguments.emplace_back("--json");
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.code, 0) << arguments[0] << ": " << outcome.err;
    const auto json = nlohmann::json::parse(outcome.out, nullptr, false);
    EXPECT_FALSE(json.is_discarded()) << arguments[0] << ": " << outcome.out;
    return json;
  }
};

TEST_F(Names, ThatAreNoUtf8AreReplacedInJsonAndEndNoCommand) {
  const std::string odd = "a\xff\xfe", shown = "a\xef\xbf\xbd\xef\xbf\xbd";
  write(odd + ".toml", R"([time]
end = 0.01
[solver]
device = "cpu"
[[body]]
shape = "beam"
size = [0.2, 0.1, 0.1]
spacing = 0.05
material = { young = 1e5, poisson = 0.3, density = 1000 }
)");
  write(odd + ".obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n");
  const std::string scene = odd + ".toml", out = odd + "_out";
  EXPECT_EQ(json_of({"run", scene, "--dry-run"})["scene"], shown + ".toml");
  EXPECT_EQ(json_of({"run", scene, "--out", out})["directory"], shown + "_out");
  EXPECT_TRUE(json_of({"run", scene, "--out", out, "--resume", "auto"}).contains("finished"));
  EXPECT_EQ(json_of({"render", out})["pictures"][0], shown + "_out/pictures/frame_000000.png");
  EXPECT_EQ(json_of({"report", out})["file"], shown + "_out/report.html");
  EXPECT_EQ(json_of({"export", out + "/phyxels.hdf.series", "--single", odd + ".vtkhdf"})["file"],
            shown + ".vtkhdf");
  EXPECT_EQ(json_of({"sample", odd + ".obj", "--phyxels", "20", "--out", odd + ".h5"})["file"],
            shown + ".h5");
  for (const std::string& file : {odd + ".obj", odd + ".h5", odd + ".vtkhdf",
                                  out + "/phyxels.hdf.series", out + "/phyxels_000000.hdf"}) {
    EXPECT_THAT(json_of({"info", file})["file"].get<std::string>(), ::testing::StartsWith(shown));
  }
  json_of({"info", scene, "--partition", "2"});
  json_of({"bench", "step", "--phyxels", "27", "--precision", "float", "--terms", "green",
           "--threads", "1", "--seconds", "0.01", "--repeat", "1", "--csv", odd + ".csv"});
  EXPECT_EQ(json_of({"bench", "sample", odd + ".obj", "--phyxels", "20"})["rows"][0]["mesh"],
            shown + ".obj");
  EXPECT_EQ(json_of({"examples", "copy", "dice", "--to", odd + "_e"})["files"][0],
            shown + "_e/scene.toml");
  fs::create_directory(folder_ / (odd + "_p"));
  write(odd + "_p/frames.csv",
        "body,phyxels,surfels,program,cores,threads,objects,with_surfels,"
        "frames,frames_per_s,ms_per_frame,spread\n");
  EXPECT_EQ(json_of({"paper", "--redraw", "--out", odd + "_p"})["page"], shown + "_p/paper.md");
}

}  // namespace
}  // namespace phyxel
