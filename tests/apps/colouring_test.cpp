/// Pictures whose colours show a field of the frames.
#include "colouring.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "png_reader.hpp"
#include "support/thrown_block.hpp"

namespace phyxel::app {
namespace {

using test::Outcome;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

TEST(Colouring, ShowsNumbersAndLengthsOfVectors) {
  FrameData frame;
  frame.point = {{0, 0, 0}, {1, 0, 0}};
  frame.field["velocity"] = {3, 4, 0, 0, 0, 2};
  frame.field["von_mises"] = {7, 9};
  frame.field["stress"] = std::vector<double>(12, 1.0);  // six components: neither
  EXPECT_THAT(colour_fields(frame), ElementsAre("velocity", "speed", "von_mises"));
  EXPECT_THAT(*field_values(frame, "speed"), ElementsAre(5, 2));
  EXPECT_THAT(*field_values(frame, "von_mises"), ElementsAre(7, 9));
  EXPECT_FALSE(field_values(frame, "stress"));
  EXPECT_FALSE(field_values(frame, "mass"));
}

TEST(Colouring, PagesShowWhatMaterialsRememberButForComponents) {
  FrameData frame;
  frame.point = {{0, 0, 0}, {1, 0, 0}};
  for (const char* name : {"broken", "equivalent_plastic_strain", "plastic_strain_xy", "mass",
                           "von_mises", "plastic_work"}) {
    frame.field[name] = {1, 2};
  }
  frame.field["velocity"] = {3, 4, 0, 0, 0, 2};
  EXPECT_THAT(other_numbers(frame),
              ElementsAre("broken", "equivalent_plastic_strain", "plastic_work"));
  EXPECT_EQ(unit_of("plastic_work"), "J/m^3");
  EXPECT_EQ(unit_of("broken"), "");
}

TEST(Colouring, SurfelsTakeMeansOfPhyxelsUnlessTheyHaveTheField) {
  FrameData surface, phyxels;
  surface.point = {{0, 0, 0}};
  phyxels.point = {{0, 0, 0}, {1, 0, 0}};
  phyxels.field["mass"] = {10, 20};
  const Colouring colouring{.field = "mass", .carriers = {{0, 1, 0, 0}, {204, 51, 0, 0}}};
  EXPECT_THAT(shown_values(&surface, &phyxels, colouring), ElementsAre(12));  // 0.8, 0.2
  EXPECT_THAT(shown_values(nullptr, &phyxels, colouring), ElementsAre(10, 20));
  EXPECT_THAT(shown_values(&surface, nullptr, colouring), IsEmpty());
  surface.field["mass"] = {5};
  EXPECT_THAT(shown_values(&surface, &phyxels, colouring), ElementsAre(5));
}

TEST(Colouring, SpansViridisAndNoMore) {
  const Colouring colouring{.field = "mass", .range = {1, 3}};
  const auto expect = [&](double value, int red, int green, int blue) {
    const Colour c = field_colour(value, colouring);
    // The polynomial is a fit of matplotlib's table, to 5 of 255.
    EXPECT_NEAR(encode(c.x), red, 5);
    EXPECT_NEAR(encode(c.y), green, 5);
    EXPECT_NEAR(encode(c.z), blue, 5);
  };
  for (const double low : {-9.0, 1.0, std::nan("")}) expect(low, 68, 1, 84);
  expect(2, 33, 145, 140);
  for (const double high : {3.0, 1e9}) expect(high, 253, 231, 37);
}

/// Values from low to high whose logarithms are evenly spaced.
std::vector<double> crowded(double low, double high) {
  std::vector<double> values;
  for (int k = 0; k <= 100; ++k) values.push_back(low * std::pow(high / low, k / 100.0));
  return values;
}

TEST(ColourRange, LeavesOutliersOut) {
  std::vector<double> values(1000);
  for (std::size_t k = 0; k < values.size(); ++k) values[k] = static_cast<double>(k);
  values[3] = 1e9;
  values[4] = -1e9;
  values[5] = std::nan("");
  values[6] = HUGE_VAL;
  const ColourRange range = colour_range(values, Scale::automatic);
  EXPECT_FALSE(range.logarithmic);
  EXPECT_NEAR(range.low, 10, 8);
  EXPECT_NEAR(range.high, 990, 8);
  EXPECT_EQ(range.share_of(1e9), 1);
  EXPECT_EQ(range.share_of(std::nan("")), 0);
  EXPECT_NEAR(range.share_of(500), 0.5, 0.01);
}

TEST(ColourRange, IsLogarithmicWhereValuesCrowdAtTheLowEnd) {
  const ColourRange range = colour_range(crowded(1, 1e4), Scale::automatic);
  ASSERT_TRUE(range.logarithmic);
  EXPECT_GE(range.high / range.low, 100);
  EXPECT_LE(range.high / range.low, 1000.001);  // at most three decades
  EXPECT_NEAR(range.share_of(std::sqrt(range.low * range.high)), 0.5, 1e-12);
  EXPECT_EQ(range.share_of(0), 0);
  EXPECT_EQ(range.share_of(-1), 0);
  EXPECT_FALSE(colour_range(crowded(1, 1e4), Scale::linear).logarithmic);
  std::vector<double> even, negative = crowded(1, 1e4);
  for (int k = 1; k <= 1000; ++k) even.push_back(k);
  EXPECT_FALSE(colour_range(even, Scale::automatic).logarithmic);
  EXPECT_TRUE(colour_range(even, Scale::logarithmic).logarithmic);
  negative.push_back(-1);
  EXPECT_FALSE(colour_range(negative, Scale::logarithmic).logarithmic);
  EXPECT_FALSE(colour_range({0, 0, 5, 5}, Scale::logarithmic).logarithmic);
  EXPECT_FALSE(colour_range({}, Scale::logarithmic).logarithmic);
}

TEST(ColourRange, TicksAreRoundNumbersWithinIt) {
  EXPECT_THAT(ticks_of({0.1, 2.219}, 4), ElementsAre(1, 2));
  EXPECT_THAT(ticks_of({0, 2}, 4), ElementsAre(0, 0.5, 1, 1.5, 2));
  EXPECT_THAT(ticks_of({-30, 55}, 4), ElementsAre(0, 50));
  EXPECT_THAT(ticks_of({411, 1.66e5, true}, 4), ElementsAre(1e3, 1e4, 1e5));
  EXPECT_THAT(ticks_of({3, 40, true}, 4), ElementsAre(5, 10, 20));
  EXPECT_THAT(ticks_of({2, 2}, 4), IsEmpty());
  EXPECT_THAT(ticks_of({1e300, HUGE_VAL}, 4), IsEmpty());
  EXPECT_EQ(short_number(1.66e5), "1.66e5");
  EXPECT_EQ(short_number(1e-7), "1e-7");
  EXPECT_EQ(short_number(-0.0), "0");
  EXPECT_EQ(short_number(0.25), "0.25");
}

TEST(Colouring, ABarSaysTheRangeAndLeavesTheRestAlone) {
  Image blank{320, 240, std::vector<std::uint8_t>(320 * 240 * 3, 255)}, image = blank;
  draw_colour_bar(image, {.field = "speed", .range = {0, 2}});
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const bool same = std::equal(image.pixel(x, y), image.pixel(x, y) + 3, blank.pixel(x, y));
      if (x < image.width / 2 || y < image.height / 2) {
        ASSERT_TRUE(same) << x << ", " << y;
      }
    }
  }
  EXPECT_NE(image.rgb, blank.rgb);
  Image tiny{16, 16, std::vector<std::uint8_t>(16 * 16 * 3, 255)};
  EXPECT_NO_THROW(draw_colour_bar(tiny, {.field = "speed"}));
}

class ColouredPictures : public test::ThrownBlock {
 protected:
  void SetUp() override {
    ThrownBlock::SetUp();
    throw_block(100);
  }
};

TEST_F(ColouredPictures, ShowAFieldOfThePhyxelsOnTheSurface) {
  ASSERT_EQ(run({"render", "out", "--frames", "1", "--out", "plain"}).code, 0);
  const auto coloured = [&](const char* range, const char* out, const char* scale = "auto") {
    const Outcome done =
        run({"render", "out", "--frames", "1", "--color", "speed", "--range", range, "--out", out,
             "--width", "96", "--height", "96", "--scale", scale});
    EXPECT_EQ(done.code, 0) << done.err;
    const std::string png = test::text_of(folder_ / out / "frame_000001.png");
    EXPECT_FALSE(png.empty());
    return png;
  };
  // All of the block moves at 2 m/s: it is at one end of these ranges, or at the other.
  EXPECT_NE(coloured("0,1", "high"), coloured("3,4", "low"));
  // 2 m/s is half way between 1 and 3, and further on by logarithms.
  EXPECT_NE(coloured("1,3", "linear"), coloured("1,3", "log", "log"));
}

TEST_F(ColouredPictures, SurfacesHaveTheFieldsOfTheirScene) {
  const FrameData surface = read_frame(folder_ / "out" / "surface_000001.hdf", true);
  const std::vector<double>& velocity = surface.field.at("velocity");
  ASSERT_EQ(velocity.size(), 3 * surface.point.size());
  for (std::size_t k = 0; k < velocity.size(); ++k) {
    EXPECT_NEAR(velocity[k], k % 3 == 2 ? 2 : 0, 1e-6);
  }
  EXPECT_EQ(surface.field.at("displacement").size(), velocity.size());
}

TEST_F(ColouredPictures, ShowTheInsideByACut) {
  const auto green_of = [&](const std::vector<std::string>& more, const char* out) {
    std::vector<std::string> words{"render", "out",      "--frames", "0",          "--width",
                                   "200",    "--height", "200",      "--no-floor", "--view",
                                   "0,1,0",  "--out",    out};
    words.insert(words.end(), more.begin(), more.end());
    const Outcome done = run(words);
    EXPECT_EQ(done.code, 0) << done.err;
    return read_png(folder_ / out / "frame_000000.png").rgb;
  };
  const std::vector<std::string> coloured{"--colour", "speed", "--range", "1,2"};
  auto cut = coloured;
  cut.insert(cut.end(), {"--cut", "y=0.1"});
  EXPECT_NE(green_of(coloured, "whole"), green_of(cut, "cut"));
  EXPECT_NE(green_of({}, "plain"), green_of({"--cut", "0,0,0,0,-1,0"}, "plain_cut"));
  const auto refused = [&](const std::vector<std::string>& more, const char* why) {
    std::vector<std::string> words{"render", "out", "--out", "none"};
    words.insert(words.end(), more.begin(), more.end());
    const Outcome outcome = run(words);
    EXPECT_EQ(outcome.code, 2);
    EXPECT_THAT(outcome.err, HasSubstr(why));
    EXPECT_FALSE(std::filesystem::exists(folder_ / "none"));
  };
  refused({"--cut", "q=1"}, "--cut q=1: allowed: a position [m] along an axis");
  refused({"--no-phyxels", "--colour", "speed", "--cut", "x=0"},
          "--cut x=0 --colour speed: the phyxels of the frames lack the field");
}

TEST_F(ColouredPictures, HaveAFloorWithShadowsIfTheCameraLooksDown) {
  const auto drawn = [&](const char* view, bool floor) {
    std::vector<std::string> words{"render",  "out",      "--frames", "1",     "--width",
                                   "96",      "--height", "96",       "--out", "p",
                                   "--force", "--view",   view};
    if (!floor) words.emplace_back("--no-floor");
    const Outcome done = run(words);
    EXPECT_EQ(done.code, 0) << done.err;
    return test::text_of(folder_ / "p" / "frame_000001.png");
  };
  EXPECT_NE(drawn("1,2,-0.6", true), drawn("1,2,-0.6", false));
  EXPECT_EQ(drawn("1,2,0.6", true), drawn("1,2,0.6", false));
  EXPECT_NE(drawn("0,0,-1", true), drawn("0,0,-1", false));
  // A page has it, too, but not among the obstacles of its scene.
  const Outcome page = run({"report", "out", "--json"});
  ASSERT_EQ(page.code, 0) << page.err;
  EXPECT_THAT(page.out, HasSubstr("\"obstacles\": []"));
  const std::string html = test::text_of(folder_ / "out" / "report.html");
  EXPECT_THAT(html, HasSubstr("\"only_floor\":true"));
}

TEST_F(ColouredPictures, WrongFieldsAndRangesAreRefused) {
  const auto refused = [&](const std::vector<std::string>& more, const char* why) {
    std::vector<std::string> words{"render", "out", "--out", "none"};
    words.insert(words.end(), more.begin(), more.end());
    const Outcome outcome = run(words);
    EXPECT_EQ(outcome.code, 2);
    EXPECT_THAT(outcome.err, HasSubstr(why));
    EXPECT_FALSE(std::filesystem::exists(folder_ / "none"));
  };
  refused({"--colour", "von_mises"}, "allowed: displacement, speed, velocity");
  refused({"--colour", "speed", "--range", "2,1"}, "--range 2,1: allowed: two numbers");
  refused({"--colour", "speed", "--range", "0,1", "--scale", "log"},
          "--range 0,1 with --scale log: allowed: positive numbers");
  refused({"--colour", "speed", "--scale", "decades"}, "auto");
}

}  // namespace
}  // namespace phyxel::app
