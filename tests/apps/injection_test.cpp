/// Content of files and names of folders stays text: neither a shell nor gnuplot executes it, pages
/// do not interpret it as markup, and pictures are still drawn.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "csv.hpp"
#include "outside_text.hpp"
#include "plot.hpp"
#include "support/program.hpp"

namespace phyxel::app {
namespace {

namespace fs = std::filesystem;
using test::Outcome;
using test::text_of;
using ::testing::HasSubstr;
using ::testing::Not;

/// Texts that would create a file "canary" if a shell or gnuplot evaluated them.
const std::vector<std::string> hostile_words{
    "`touch canary`",
    "$(touch canary)",
    "'; touch canary; '",
    "\"; system(\"touch canary\"); a=\"",
    "'; system('touch canary'); a='",
    "\\\"; system(\\\"touch canary\\\"); #",
    "x'\\",
    "x\n!touch canary\nsystem('touch canary')",
    "x\nEOD\nsystem('touch canary')",
    "@ARG0 {/Symbol a}_b^c",
    "</text><script>alert(1)</script>",
    "| ![x](javascript:x) <img src=x onerror=x>",
    "\xff\xfe no UTF-8",
};

class Injection : public test::Program {
 protected:
  void expect_no_canary() const {
    for (const auto& entry : fs::recursive_directory_iterator(folder_)) {
      EXPECT_NE(entry.path().filename(), "canary") << entry.path();
    }
    EXPECT_FALSE(fs::exists("canary"));  // where draw_svg was called
  }
};

TEST_F(Injection, LabelsOfChartsAreText) {
  if (!can_plot()) GTEST_SKIP() << "no gnuplot";
  for (std::size_t k = 0; k < hostile_words.size(); ++k) {
    const std::string& words = hostile_words[k];
    SCOPED_TRACE(words);
    const fs::path folder = folder_ / (words.find('/') == words.npos ? words : std::to_string(k));
    fs::create_directory(folder);
    const LineChart lines{words, words, words, false, false, {{words, {1, 2}, {1, 2}}}};
    draw_svg(script_of(lines), folder / "lines.svg");
    draw_svg(script_of(BarChart{words, words, true, {words, "b"}, {{words, {1, 2}}}}),
             folder / "bars.svg");
    for (const char* name : {"lines.svg", "bars.svg"}) {
      const std::string svg = text_of(folder / name);
      EXPECT_THAT(svg, HasSubstr("</svg>"));
      EXPECT_THAT(svg, Not(HasSubstr("<script")));
      EXPECT_THAT(svg, Not(HasSubstr("\xff")));  // a picture that is no UTF-8 is shown nowhere
    }
    EXPECT_EQ(std::distance(fs::directory_iterator(folder), {}), 2);  // nothing is left over
  }
  expect_no_canary();
  draw_svg(
      script_of(LineChart{"`touch canary` it's", "x", "y", false, false, {{"$(a)", {1}, {1}}}}),
      folder_ / "a.svg");
  EXPECT_THAT(text_of(folder_ / "a.svg"), HasSubstr("`touch canary` it"));  // as it was written
  EXPECT_THAT(text_of(folder_ / "a.svg"), HasSubstr("$(a)"));
}

/// `paper --redraw` puts cells of tables into charts.
TEST_F(Injection, CellsOfPaperPagesAreText) {
  for (std::size_t k = 1; k < hostile_words.size(); k += 2) {
    const std::string& words = hostile_words[k];
    SCOPED_TRACE(words);
    const std::string folder = words.find('/') == words.npos ? words : std::to_string(k);
    fs::create_directory(folder_ / folder);
    CsvTable frames{{{"gpu", words}},
                    {"body", "phyxels", "surfels", "program", "cores", "threads", "objects",
                     "with_surfels", "frames", "frames_per_s", "ms_per_frame", "spread"},
                    {}};
    for (const char* count : {"1", "2"}) {
      frames.rows.push_back({"dino", "575", words, "phyxel CPU", words, "1", count, "no", "shown",
                             "100", "10", "0.1"});
    }
    write_csv(folder_ / folder / "frames.csv", frames);
    const Outcome redrawn = run({"paper", "--redraw", "--out", folder});
    ASSERT_EQ(redrawn.code, 0) << redrawn.err;
    const std::string text = text_of(folder_ / folder / "paper.md");
    EXPECT_FALSE(text.empty());
    for (const char* markup : {"<script", "<img", "](javascript", "\n!touch", "\xff"}) {
      EXPECT_THAT(text, Not(HasSubstr(markup)));
    }
    if (!can_plot()) continue;
    std::size_t pictures = 0;
    for (const auto& entry : fs::directory_iterator(folder_ / folder)) {
      pictures += entry.path().extension() == ".svg";
    }
    EXPECT_GE(pictures, 1u);  // Figure 4
  }
  expect_no_canary();
}

TEST(OutsideText, NumbersAndPlainWordsStayAsTheyAre) {
  for (const char* plain : {"1.5e-3", "nodes, α = 0.3", "dino", "", "8.1%", "ν_x * 2 - 1"}) {
    EXPECT_EQ(markdown_text(plain), plain);
    EXPECT_EQ(gnuplot_string(plain), "'" + std::string(plain) + "'");
  }
  EXPECT_EQ(markdown_text("a|<b>`[\n"), "a&#124;&#60;b&#62;&#96;&#91; ");
  EXPECT_EQ(gnuplot_string("it's\n`x`"), "'it\u2019s `x`'");
  EXPECT_EQ(valid_utf8("a\xff"
                       "b"),
            "a\xef\xbf\xbd"
            "b");
}

}  // namespace
}  // namespace phyxel::app
