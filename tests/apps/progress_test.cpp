/// Progress lines: content, frequency and width.
#include "progress.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <sstream>

#include "stage.hpp"

namespace phyxel::app {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

/// A stream in memory and a clock that the test advances.
class ProgressLines : public ::testing::Test {
 protected:
  ProgressLines() : stream_(open_memstream(&text_, &size_)) {
    style_.terminal = false;
    style_.clock = [this] { return now_; };
    style_.load = [] { return std::nullopt; };  // this machine's is no business of the tests
  }
  ~ProgressLines() override {
    std::fclose(stream_);
    std::free(text_);
  }

  std::string text() const {
    std::fflush(stream_);
    return {text_, size_};
  }
  std::vector<std::string> split(char end) const {
    std::vector<std::string> lines;
    std::istringstream in(text());
    for (std::string line; std::getline(in, line, end);) lines.push_back(line);
    return lines;
  }

  char* text_ = nullptr;
  std::size_t size_ = 0;
  std::FILE* stream_;
  double now_ = 1000;
  ProgressStyle style_;
};

TEST_F(ProgressLines, ALineTellsShareTimeLeftAndSpeeds) {
  style_.phyxels = 575;
  Progress progress(2, stream_, style_);
  now_ += 10;
  // Half a second of two took 100 steps: 300 are left, 6 s at 50 steps/s.
  progress.update(0.5, 100, 50, -1.25);
  EXPECT_EQ(text(),
            " 25.0%  0:06 left  0.500/2 s  2.88e+04 phyxel-steps/s  50 steps/s  step 100  "
            "E = -1.25 J\n");
}

/// A search by Newton's method shows its own parts at the same frequency; a permanent line is
/// printed at once.
TEST_F(ProgressLines, ShowsACallersOwnPartsAndLinesThatStay) {
  Progress progress(2, stream_, style_);
  progress.update({"residual 1e-03", "newton 2"});
  EXPECT_EQ(text(), "");  // not yet due
  progress.say("the step is halved");
  EXPECT_EQ(text(), "the step is halved\n");
  now_ += 10;
  progress.update({"residual 1e-04", "newton 3"});
  progress.update({"residual 1e-05", "newton 4"});
  EXPECT_EQ(text(), "the step is halved\nresidual 1e-04  newton 3\n");
  now_ += 10;
  progress.update(0.5, 100, 50, -1.25);  // steps have theirs again
  EXPECT_THAT(text(), HasSubstr("0.500/2 s"));
}

/// Two threads of a run on two cores are a load of 2, except for the noise of the average.
TEST_F(ProgressLines, ALoadAboveTheCoresIsShown) {
  HostLoad host{2.5, 2};
  style_.load = [&] { return host; };
  Progress progress(2, stream_, style_);
  now_ += 10;
  progress.update(0.5, 100, 50, -1.25);
  EXPECT_THAT(text(), Not(HasSubstr("load")));
  host.load = 2.6;
  now_ += 10;
  progress.update(0.6, 120, 50, -1.25);
  EXPECT_THAT(text(), HasSubstr("load 2.6 on 2 cores"));
}

TEST_F(ProgressLines, LongTimesLeftAreGivenInHours) {
  Progress progress(2, stream_, style_);
  now_ += 10;
  progress.update(1, 18367, 1, 0);  // as many steps again: 18367 s
  EXPECT_THAT(text(), HasSubstr("  5:06:07 left  "));
}

TEST_F(ProgressLines, TimeLeftIsUnknownBeforeTheFirstStep) {
  Progress progress(2, stream_, style_);
  now_ += 10;
  progress.update(0, 0, 0, 0);
  EXPECT_THAT(text(), StartsWith("  0.0%  -:-- left"));
}

TEST_F(ProgressLines, ALogGetsAtMostOneLineInFiveSeconds) {
  Progress progress(100, stream_, style_);
  for (int step = 1; step <= 22; ++step) {
    now_ += 1;
    progress.update(step, step, 1, 0);
  }
  progress.finish();
  ASSERT_EQ(split('\n').size(), 5u);  // after 5, 10, 15 and 20 s, and the last update
  EXPECT_THAT(split('\n')[0], HasSubstr("step 5 "));
  EXPECT_THAT(split('\n')[3], HasSubstr("step 20 "));
  EXPECT_THAT(split('\n')[4], HasSubstr("step 22 "));
  EXPECT_THAT(text(), Not(HasSubstr("\x1b")));
  EXPECT_THAT(text(), Not(HasSubstr("\r")));
}

TEST_F(ProgressLines, OnlyTheEndIsAHundredPercent) {
  Progress progress(1, stream_, style_);
  now_ += 10;
  progress.update(0.99999, 99999, 1e4, 0);
  now_ += 10;
  progress.update(1 - 1e-13, 100000, 1e4, 0);  // the sum of 100,000 steps, rounded
  ASSERT_EQ(split('\n').size(), 2u);
  EXPECT_THAT(split('\n')[0], StartsWith(" 99.9%"));
  EXPECT_THAT(split('\n')[1], StartsWith("100.0%  0:00 left"));
}

TEST_F(ProgressLines, ATerminalLineIsRedrawnInPlaceAndEndedOnce) {
  style_.terminal = true;
  style_.columns = 120;
  {
    Progress progress(2, stream_, style_);
    progress.update(0.5, 1, 1, 0);
    now_ += 0.05;
    progress.update(0.6, 2, 1, 0);  // sooner than a tenth of a second: not drawn
    now_ += 0.1;
    progress.update(1, 3, 1, 0);
    progress.finish();
    progress.update(2, 4, 1, 0);  // after the end: ignored
  }
  const auto drawn = split('\r');
  ASSERT_EQ(drawn.size(), 3u);
  EXPECT_EQ(drawn[0], "");
  EXPECT_THAT(drawn[1], StartsWith("[####............]   25.0%"));
  EXPECT_THAT(drawn[2], StartsWith("[########........]   50.0%"));
  EXPECT_EQ(std::count(drawn[2].begin(), drawn[2].end(), '\n'), 1);
  EXPECT_EQ(drawn[2].back(), '\n');
}

TEST_F(ProgressLines, NoTerminalWrapsTheLine) {
  style_.terminal = true;
  style_.phyxels = 1000000;
  for (int columns = 1; columns <= 160; ++columns) {
    style_.columns = columns;
    Progress(2, stream_, style_).update(1.23456, 123456, 1234.5, -1.2345e-6);
    std::string latest = split('\r').back();
    latest = latest.substr(0, latest.find('\x1b'));
    EXPECT_LT(latest.size(), static_cast<std::size_t>(columns) + (columns == 1));
    if (columns < 80) continue;
    EXPECT_THAT(latest, HasSubstr("1:03 left  1.235/2 s  1.23e+09 phyxel-steps/s")) << columns;
  }
}

TEST_F(ProgressLines, NoUpdateLeavesNoTrace) {
  style_.terminal = true;
  { Progress progress(2, stream_, style_); }
  EXPECT_EQ(text(), "");
}

TEST(Progress, WithoutAStreamItIsSilent) {
  int asked = 0;
  ProgressStyle style;
  style.clock = [&] { return 10.0 * ++asked; };
  Progress progress(2, nullptr, style);
  progress.update(1, 1, 1, 1);
  progress.finish();
  EXPECT_EQ(asked, 0);  // not even the clock is read
}

/// A set-up of half a minute, most of which is the second stage.
void tell_stages(double& now) {
  in_stage("reading", [&] { now += 1; });
  Stage filling("filling");
  for (int k = 1; k < 25; ++k) {
    now += 1;
    filling.reach(k / 25.0);
  }
  now += 1;
  filling.reach(0.99999);
  filling.finish();
}

TEST_F(ProgressLines, StagesOfASetUpAreABarThatGoesAway) {
  style_.terminal = true;
  style_.columns = 80;
  {
    const SetupProgress shown(stream_, style_);
    tell_stages(now_);
  }
  const auto drawn = split('\r');
  ASSERT_GE(drawn.size(), 28u);
  EXPECT_THAT(drawn[drawn.size() - 2], HasSubstr(" 99.9%  filling"));  // 100% is the end
  EXPECT_EQ(drawn[1], "[................]    0.0%  reading\x1b[K");
  EXPECT_EQ(drawn[2], "\x1b[K");  // taken away
  EXPECT_EQ(drawn[3], "[................]    0.0%  filling\x1b[K");
  // 5 of 25 parts took 5 s: 20 are left.
  EXPECT_THAT(drawn[8], StartsWith("[###.............]   20.0%  filling  0:2"));
  EXPECT_EQ(drawn.back(), "\x1b[K");
  EXPECT_EQ(std::count(text_, text_ + size_, '\n'), 0);
}

TEST_F(ProgressLines, ALogGetsALineOfALongSetUpInFiveSecondsAndNoneOfAShortOne) {
  {
    const SetupProgress shown(stream_, style_);
    in_stage("short", [&] { now_ += 4.9; });
  }
  EXPECT_EQ(text(), "");
  {
    const SetupProgress shown(stream_, style_);
    tell_stages(now_);
  }
  const auto lines = split('\n');
  ASSERT_EQ(lines.size(), 5u);  // after 5, 10, 15, 20 and 25 s of 26
  EXPECT_EQ(lines[0], " 16.0%  filling  0:21 left");
  EXPECT_THAT(lines[4], StartsWith(" 96.0%  filling  0:0"));
}

TEST(Progress, WithoutAStreamNoStageIsTold) {
  int asked = 0;
  ProgressStyle style;
  style.clock = [&] { return 10.0 * ++asked; };
  const SetupProgress silent(nullptr, style);
  in_stage("reading", [] {});
  EXPECT_EQ(asked, 0);
}

TEST(Progress, AStreamThatCannotBeWrittenDoesNotEndTheRun) {
  std::FILE* full = std::fopen("/dev/full", "w");
  ASSERT_NE(full, nullptr);
  std::setvbuf(full, nullptr, _IONBF, 0);
  {
    Progress progress(2, full);
    progress.update(1, 1, 1, 1);
    EXPECT_NO_THROW(progress.finish());
  }
  EXPECT_TRUE(std::ferror(full));
  std::fclose(full);
}

}  // namespace
}  // namespace phyxel::app
