/// The pages of phyxel report: their content, and that a browser draws them.
#include "report/report.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <csignal>
#include <nlohmann/json.hpp>

#include "base64.hpp"
#include "phyxel/error.hpp"
#include "phyxel/recorder.hpp"
#include "report/page.hpp"
#include "report/replay_data.hpp"
#include "support/page.hpp"
#include "support/program.hpp"
#include "support/skips.hpp"

namespace phyxel {
namespace {

namespace fs = std::filesystem;
using app::FramePlan;
using nlohmann::json;
using test::between;
using test::data_of;
using test::embedded;
using test::Outcome;
using test::seen_by_browser;
using test::text_of;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

TEST(Page, Base64IsThatOfRfc4648) {
  const auto of = [](std::string_view text) {
    return app::base64(std::as_bytes(std::span(text.data(), text.size())));
  };
  EXPECT_EQ(of(""), "");
  EXPECT_EQ(of("f"), "Zg==");
  EXPECT_EQ(of("fo"), "Zm8=");
  EXPECT_EQ(of("foo"), "Zm9v");
  EXPECT_EQ(of("foobar"), "Zm9vYmFy");
  EXPECT_EQ(of("\xff\xfe\xfd"), "//79");
}

TEST(Page, NothingOfAUserEndsItsElement) {
  EXPECT_EQ(app::html_text("a < b & \"c\""), "a &lt; b &amp; &quot;c&quot;");
  const std::string safe = app::script_json({{"title", "</script><!-- @data@"}});
  EXPECT_THAT(safe, Not(HasSubstr("<")));
  EXPECT_EQ(json::parse(safe)["title"], "</script><!-- @data@");
  const std::string page = app::filled_page("replay.html", {{"title", "@summary@"},
                                                            {"summary", "s"},
                                                            {"warnings", ""},
                                                            {"facts", ""},
                                                            {"scene", ""},
                                                            {"frames", ""},
                                                            {"data", "{}"},
                                                            {"footer", ""}});
  EXPECT_THAT(page, HasSubstr("<title>@summary@</title>"));  // replaced once
  EXPECT_THROW(app::filled_page("replay.html", {}), std::logic_error);
}

TEST(FramesThatFit, MotionComesBeforeDetail) {
  const auto expect = [](const FramePlan& plan, std::size_t frames, std::size_t stride) {
    EXPECT_EQ(plan.frames, frames);
    EXPECT_EQ(plan.phyxel_stride, stride);
  };
  expect(app::plan_frames(500, 0, 100, 50000), 500, 1);
  expect(app::plan_frames(500, 0, 100, 20000), 200, 1);
  expect(app::plan_frames(500, 0, 100, 2000), 80, 4);  // 50 frames of every phyxel would not fit
  expect(app::plan_frames(3, 0, 100, 300), 3, 1);
  expect(app::plan_frames(500, 900, 100, 1900), 2, 4);  // 950 of each frame but for the stride
  expect(app::plan_frames(500, 900, 100, 2000), 2, 1);
  expect(app::plan_frames(500, 0, 1e6, 2000), 8, 4096);
  EXPECT_THROW(app::plan_frames(500, 1001, 100, 2000), InputError);
  EXPECT_EQ(app::plan_frames(1, 1000, 0, 1000).frames, 1u);
}

/// Frames of a field: at rest, all alike, and spread over its range.
TEST(Opening, IsAtTheLiveliestFrame) {
  const std::vector<double> rest(8, 0.0), alike(8, 1.0), spread{0, 1, 2, 3, 4, 5, 6, 7};
  std::vector<app::Instance> instances(3);
  instances[0].fields = {rest, rest, rest};
  instances[1].fields = {alike, spread, rest};
  instances[2].fields = {spread, alike, rest};
  const std::vector<app::ColourRange> ranges(3, {0, 7});
  const auto opening = [&](const std::vector<std::string>& names) {
    const app::Opening found = app::opening_of(instances, names, ranges);
    return std::pair(found.frame, found.field);
  };
  EXPECT_EQ(opening({"displacement", "speed", "stress (von Mises)"}), std::pair(1ul, 1ul));
  EXPECT_EQ(opening({"displacement", "stress (von Mises)", "speed"}), std::pair(1ul, 1ul));
  EXPECT_EQ(opening({"stress (von Mises)", "speed", "displacement"}), std::pair(2ul, 0ul));
  EXPECT_EQ(opening({"volume ratio", "strain", "speed"}), std::pair(2ul, 0ul));
  instances.resize(1);  // nothing moves
  EXPECT_EQ(opening({"displacement", "speed", "strain"}), std::pair(0ul, 0ul));
}

class Reports : public test::Program {
 protected:
  /// Runs a beam under its own weight, into the folder `out`.
  void run_beam(const std::string& fields = "[\"displacement\", \"velocity\"]",
                const std::string& frames_per_second = "50") const {
    write("beam.toml", R"(title = "A </script> beam"
gravity = [0, 0, -9.81]
[time]
end = 0.1
[solver]
device = "cpu"
precision = "double"
[output]
directory = "out"
frames_per_second = )" + frames_per_second +
                           "\nfields = " + fields + R"(
[[body]]
shape = "beam"
size = [1, 0.2, 0.2]
spacing = 0.05
[body.material]
young = 1e5
poisson = 0.3
density = 1000
[[body.fixed]]
region = "x-"
)");
    const Outcome done = run({"run", "beam.toml"});
    ASSERT_EQ(done.code, 0) << done.err;
  }
  std::string page_of(const std::vector<std::string>& more = {}) const {
    std::vector<std::string> words{"report", "out", "-o", "page.html", "--force"};
    words.insert(words.end(), more.begin(), more.end());
    const Outcome done = run(words);
    EXPECT_EQ(done.code, 0) << done.err;
    return text_of(folder_ / "page.html");
  }
};

TEST_F(Reports, AReplayShowsWhatTheFramesHold) {
  run_beam("[\"displacement\", \"velocity\", \"von_mises\"]");
  const std::string page = page_of();
  const json data = data_of(page);
  const auto series = read_series(folder_ / "out" / "phyxels.hdf.series");
  ASSERT_EQ(data["frames"].size(), series.size());
  std::vector<std::string> names;
  for (const auto& field : data["fields"]) names.push_back(field["name"]);
  EXPECT_THAT(names, ElementsAre("displacement", "speed", "stress (von Mises)",
                                 "strain (equivalent)", "volume ratio"));
  const std::size_t n = data["phyxels"], m = data["surfels"];
  const FrameData frame = read_frame(series.back().file, true);
  const FrameData surface =
      read_frame(read_series(folder_ / "out" / "surface.hdf.series").back().file);
  ASSERT_EQ(frame.point.size(), n);
  ASSERT_EQ(surface.point.size(), m);
  const auto numbers = embedded<std::uint16_t>(page, "frame" + std::to_string(series.size() - 1));
  ASSERT_EQ(numbers.size(), 3 * m + (3 + names.size()) * n);

  // Distances are those of the frame by one factor, to half a step of 16 bits at either end.
  const auto shown = [&](std::size_t i) {
    const auto at = [&](std::size_t c) {
      return numbers[3 * i + c] * data["scale"][c].get<double>() + data["low"][c].get<double>();
    };
    return Vec3d{at(0), at(1), at(2)};
  };
  const auto size = [](Vec3d v) { return std::sqrt(dot(v, v)); };
  const double factor =
      size(shown(m + n - 1) - shown(m)) / size(frame.point[n - 1] - frame.point[0]);
  const double step = std::max({data["scale"][0].get<double>(), data["scale"][1].get<double>(),
                                data["scale"][2].get<double>()});
  for (std::size_t i = 0; i < n; ++i) {
    EXPECT_NEAR(size(shown(m + i) - shown(m)), factor * size(frame.point[i] - frame.point[0]),
                4 * step);
  }
  for (std::size_t s = 0; s < m; ++s) {
    EXPECT_NEAR(size(shown(s) - shown(m)), factor * size(surface.point[s] - frame.point[0]),
                4 * step);
  }
  const auto field = [&](std::size_t f, std::size_t i) {
    const double low = data["fields"][f]["low"], high = data["fields"][f]["high"];
    return low + numbers[3 * (m + n) + f * n + i] / 65535.0 * (high - low);
  };
  const double most = data["fields"][2]["high"];
  const auto& stress = frame.field.at("von_mises");
  for (std::size_t i = 0; i < n; ++i) EXPECT_NEAR(field(2, i), stress[i], most / 65535);

  // Surfels have the weights of a mean.
  const auto carriers = embedded<std::uint32_t>(page, "carriers");
  const auto weights = embedded<std::uint8_t>(page, "weights");
  ASSERT_EQ(carriers.size(), data["carriers"].get<std::size_t>() * m);
  ASSERT_EQ(weights.size(), carriers.size());
  for (std::size_t s = 0; s < m; ++s) {
    int sum = 0;
    for (std::size_t k = 0; k < weights.size() / m; ++k) {
      sum += weights[s * (weights.size() / m) + k];
      EXPECT_LT(carriers[s * (weights.size() / m) + k], n);
    }
    EXPECT_EQ(sum, 255);
  }
  EXPECT_EQ(embedded<Triangle>(page, "triangles"), surface.triangle);

  EXPECT_THAT(page, HasSubstr("A &lt;/script&gt; beam"));
  EXPECT_THAT(page, HasSubstr("shape = &quot;beam&quot;"));
  EXPECT_EQ(data["log"]["rows"].size(), series.size());
  EXPECT_GT(data["timing"].size(), 3u);
  EXPECT_THAT(page, Not(HasSubstr("http://www.w3.org/1999")));
  EXPECT_THAT(page, Not(HasSubstr("src=")));  // all of it is here
  EXPECT_THAT(page, Not(HasSubstr("link rel")));
}

TEST_F(Reports, StressThatFramesLackIsFoundFromTheScene) {
  run_beam("[\"displacement\", \"velocity\", \"von_mises\"]");
  const json written = data_of(page_of());
  fs::remove_all(folder_ / "out");
  run_beam();
  const json found = data_of(page_of());
  // Frames have stress in float.
  EXPECT_NEAR(found["fields"][3]["high"].get<double>(), written["fields"][2]["high"].get<double>(),
              1e-5 * written["fields"][2]["high"].get<double>());
  EXPECT_EQ(found["fields"][3]["name"], "stress (von Mises)");
  EXPECT_EQ(data_of(page_of({"--no-stress"}))["fields"].size(), 2u);
}

TEST_F(Reports, WhatDoesNotFitIsLeftOutAndSaid) {
  run_beam("[\"displacement\", \"velocity\"]", "1000");
  const std::string whole = page_of();
  EXPECT_EQ(data_of(whole)["frames"].size(), 101u);
  EXPECT_GT(whole.size(), 1'000'000u);
  const std::string page = page_of({"--max-megabytes", "1"});
  EXPECT_LT(page.size(), 1'000'000u);
  const json frames = data_of(page)["frames"];
  EXPECT_GE(frames.size(), 50u);
  EXPECT_EQ(frames.front(), data_of(whole)["frames"].front());
  EXPECT_EQ(frames.back(), data_of(whole)["frames"].back());
  EXPECT_THAT(page, HasSubstr("One phyxel in 4 is shown"));
  const Outcome said =
      run({"report", "out", "-o", "page.html", "--force", "--json", "--max-megabytes", "1"});
  EXPECT_EQ(json::parse(said.out)["notes"].size(), 1u);
  EXPECT_EQ(run({"report", "out", "-o", "other.html", "--max-megabytes", "0.5"}).code, 2);
}

TEST_F(Reports, AStoppedRunsSceneThatIsGoneIsNoObstacle) {
  run_beam();
  fs::remove(folder_ / "out" / "run.json");
  const Outcome shown = run({"report", "out", "--json"});
  ASSERT_EQ(shown.code, 0) << shown.err;
  EXPECT_TRUE(fs::exists(folder_ / "out" / "report.html"));
  EXPECT_THAT(text_of(folder_ / "out" / "report.html"), HasSubstr("No run.json"));
  for (const char* wrong : {"{", "[1]", "{\"phyxel_steps_per_second\": \"fast\"}"}) {
    write("out/run.json", wrong);
    const Outcome broken = run({"report", "out", "--force"});
    EXPECT_EQ(broken.code, 2);
    EXPECT_THAT(broken.err, HasSubstr("run.json"));
  }
  write("out/run.json", "{\"phyxel_steps_per_second\": null}");
  EXPECT_EQ(run({"report", "out", "--force"}).code, 0);
}

TEST_F(Reports, DisplacementIsFromRestOrSaysFromWhere) {
  run_beam("[\"mass\"]");
  const json whole = data_of(page_of());
  ASSERT_EQ(run({"report", "out/phyxels_000005.hdf", "-o", "last.html"}).code, 0);
  const json last = data_of(text_of(folder_ / "last.html"));
  EXPECT_EQ(last["fields"][0]["name"], "displacement");
  EXPECT_GT(last["fields"][0]["high"].get<double>(), 0.01);
  EXPECT_LE(last["fields"][0]["high"].get<double>(), whole["fields"][0]["high"].get<double>());
  ASSERT_EQ(run({"report", "out/surface_000005.hdf", "-o", "surface.html"}).code, 0);
  EXPECT_EQ(data_of(text_of(folder_ / "surface.html"))["fields"][0]["name"],
            "displacement since t = 0.1 s");
}

TEST_F(Reports, ARunsSummaryIsOfItsEnd) {
  run_beam();
  EXPECT_TRUE(fs::exists(folder_ / "out" / "run.json"));
  const Outcome odd = run({"run", "beam.toml", "--out", "\xe9", "--json"});  // no UTF-8
  EXPECT_EQ(odd.code, 0) << odd.err;
  EXPECT_TRUE(json::accept(odd.out));
  // Killed on its way: what the folder had at the last end is not of this one.
  const pid_t child = start({"run", "beam.toml", "--until", "200", "--resume", "auto"});  // 1 GB
  const auto begun = [&] { return !fs::exists(folder_ / "out" / "run.json"); };
  comes_true([&] { return begun() || has_ended(child); });
  EXPECT_TRUE(begun());
  kill(child, SIGKILL);
  const Outcome killed = finish(child);
  EXPECT_EQ(killed.code, 128 + SIGKILL) << killed.err;
}

TEST_F(Reports, OneFamilyAloneIsShown) {
  run_beam();
  ASSERT_EQ(run({"report", "out/surface.hdf.series", "-o", "surface.html"}).code, 0);
  const json surface = data_of(text_of(folder_ / "surface.html"));
  EXPECT_EQ(surface["phyxels"], 0);
  ASSERT_EQ(surface["fields"].size(), 2u);
  EXPECT_EQ(surface["fields"][1]["name"], "speed");
  ASSERT_EQ(run({"report", "out/phyxels_000003.hdf"}).code, 0);
  const json one = data_of(text_of(folder_ / "out" / "phyxels_000003.html"));
  EXPECT_EQ(one["surfels"], 0);
  EXPECT_EQ(one["frames"].size(), 1u);
}

TEST_F(Reports, BodiesAreToldApart) {
  run_beam();
  EXPECT_THAT(page_of(), Not(HasSubstr("id=\"surfels-bodies\"")));  // a single one
  std::string scene = text_of(folder_ / "beam.toml");
  const std::string body = scene.substr(scene.find("[[body]]"));
  write("beam.toml", scene + body + "\n[body.array]\ncount = [1, 2, 1]\nspacing = [0, 1, 0]\n");
  ASSERT_EQ(run({"run", "beam.toml", "--force"}).code, 0);
  const std::string page = page_of();
  const json data = data_of(page);
  for (const char* family : {"surfels", "phyxels"}) {
    const auto bodies = embedded<std::uint16_t>(page, std::string(family) + "-bodies");
    ASSERT_EQ(bodies.size(), data[family].get<std::size_t>());
    for (const int k : {0, 1, 2}) {
      EXPECT_EQ(std::count(bodies.begin(), bodies.end(), k), bodies.size() / 3);
    }
  }
  PHYXEL_NEEDS_TOOL(std::system("command -v chromium >/dev/null") == 0, "chromium");
  const std::string seen = seen_by_browser(folder_, "page.html#colours=bodies");
  EXPECT_THAT(seen, HasSubstr("data-state=\"drawn\""));
  EXPECT_THAT(seen, HasSubstr("data-error=\"0\""));
  EXPECT_THAT(text_of(folder_ / "dom.html"), HasSubstr("<div class=\"legend\" hidden=\"\">"));
  // What records a video is there.
  EXPECT_THAT(text_of(folder_ / "dom.html"),
              ::testing::ContainsRegex("<button id=\"video\"[^>]*>Save"));
  EXPECT_THAT(text_of(folder_ / "dom.html"),
              Not(::testing::ContainsRegex("<button id=\"video\"[^>]*hidden")));
}

TEST_F(Reports, WrongRequestsAreRefused) {
  run_beam();
  write("a.csv", "n\n1\n");
  write("kept.html", "mine");
  const auto refused = [&](const std::vector<std::string>& words, const char* why) {
    const Outcome outcome = run(words);
    EXPECT_EQ(outcome.code, 2);
    EXPECT_THAT(outcome.err, HasSubstr(why));
  };
  refused({"report", "nowhere"}, "nowhere: no such file or folder");
  refused({"report", "a.csv"}, "a.csv: is a table; allowed here: a run's folder");
  refused({"report", "out", "-o", "kept.html"}, "kept.html: exists already and is kept");
  refused({"report", "kept.html"}, "kept.html");
  EXPECT_EQ(text_of(folder_ / "kept.html"), "mine");
}

TEST_F(Reports, ABrowserDrawsAReplay) {
  PHYXEL_NEEDS_TOOL(std::system("command -v chromium >/dev/null") == 0, "chromium");
  run_beam();
  const std::string page = page_of();
  EXPECT_GT(data_of(page)["opening"]["frame"], 0);  // not at rest
  const std::string replay = seen_by_browser(folder_, "page.html");
  EXPECT_THAT(replay, HasSubstr("data-state=\"drawn\""));
  EXPECT_THAT(replay, HasSubstr("data-error=\"0\""));
  EXPECT_THAT(replay, HasSubstr("data-frame=\"" + data_of(page)["opening"]["frame"].dump() + "\""));
  // The colours have a bar with ticks.
  EXPECT_THAT(between(text_of(folder_ / "dom.html"), "<div class=\"ticks\">", "</div>"),
              HasSubstr("</span><span"));
  EXPECT_THAT(text_of(folder_ / "dom.html"), HasSubstr("kinetic"));
  // The beam, seen whole, covers some of the stage, not all of it; the floor below it most of it.
  const auto drawn = [](const std::string& body) {
    return std::stod(between(body, "data-drawn=\"", "\""));
  };
  EXPECT_THAT(replay, HasSubstr("data-obstacles=\"1\""));
  EXPECT_THAT(replay, HasSubstr("data-faces=\"0.0000\""));
  const std::string alone = seen_by_browser(folder_, "page.html#t=0&obstacles=off");
  EXPECT_THAT(alone, HasSubstr("data-frame=\"0\""));
  EXPECT_GT(drawn(alone), 0.02);
  EXPECT_LT(drawn(alone), 0.7);
  EXPECT_GT(drawn(replay), drawn(alone) + 0.1);
}

/// Across its length, the cut through the middle of the beam shows a long face, and takes from the
/// beam half of what is seen of it, but for that face.
TEST_F(Reports, ABrowserCutsBodiesOpen) {
  PHYXEL_NEEDS_TOOL(std::system("command -v chromium >/dev/null") == 0, "chromium");
  run_beam();
  page_of();
  const auto share = [](const std::string& body, const char* name) {
    return std::stod(between(body, "data-" + std::string(name) + "=\"", "\""));
  };
  const std::string whole = seen_by_browser(folder_, "page.html#t=0&obstacles=off");
  const std::string cut = seen_by_browser(folder_, "page.html#t=0&obstacles=off&cut=y");
  EXPECT_THAT(cut, HasSubstr("data-error=\"0\""));
  EXPECT_GT(share(cut, "faces"), 0.2 * share(whole, "drawn"));
  EXPECT_LT(share(cut, "faces"), 0.8 * share(whole, "drawn"));
  EXPECT_LT(share(cut, "drawn"), share(whole, "drawn"));
  // Before the near end nothing is cut away, beyond the far one all is.
  const std::string before = seen_by_browser(folder_, "page.html#t=0&obstacles=off&cut=y:-99");
  EXPECT_EQ(share(before, "faces"), 0);
  EXPECT_EQ(share(before, "drawn"), share(whole, "drawn"));
  const std::string beyond = seen_by_browser(folder_, "page.html#t=0&obstacles=off&cut=y:99");
  EXPECT_EQ(share(beyond, "drawn"), 0);
  // The same plane by its normal, of any length; and one across an edge of the beam, whose place in
  // metres is along the normal of length 1.
  const std::string by_normal = seen_by_browser(folder_, "page.html#t=0&obstacles=off&cut=0,3,0");
  EXPECT_EQ(share(by_normal, "faces"), share(cut, "faces"));
  EXPECT_EQ(share(by_normal, "drawn"), share(cut, "drawn"));
  const std::string oblique = seen_by_browser(folder_, "page.html#t=0&obstacles=off&cut=1,1,0");
  EXPECT_GT(share(oblique, "faces"), 0);
  EXPECT_LT(share(oblique, "faces"), share(cut, "faces"));
  EXPECT_LT(share(oblique, "drawn"), share(whole, "drawn"));
}

}  // namespace
}  // namespace phyxel
