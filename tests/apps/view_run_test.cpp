/// phyxel view: sessions that are replayed, and a page in a browser.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <csignal>
#include <filesystem>

#include "phyxel/checkpoint.hpp"
#include "session.hpp"
#include "support/program.hpp"
#include "support/skips.hpp"
#ifdef PHYXEL_HAVE_VIEW
#include "support/browser.hpp"
#endif

namespace phyxel {
namespace {

namespace fs = std::filesystem;
using test::Outcome;
using test::text_of;
using testing::HasSubstr;

class View : public test::Program {
 protected:
  void SetUp() override {
    test::Program::SetUp();
    write("scene.toml", test::session_scene());
    write("session.jsonl", app::text_of(test::session()));
  }
  State saved(const std::string& out, const std::string& folder) const {
    return read_checkpoint(latest_checkpoint(folder_ / out / folder).value_or("none")).state;
  }
};

TEST_F(View, RepeatsASessionToTheLastBit) {
  const Outcome first =
      run({"view", "scene.toml", "--replay", "session.jsonl", "--headless", "--out", "first"});
  ASSERT_EQ(first.code, 0) << first.err;
  EXPECT_THAT(first.out, HasSubstr("saved first/saved_0002/checkpoint_"));
  // The saved session is the one that was replayed, and repeats it; so do more threads.
  EXPECT_EQ(text_of(folder_ / "first/saved_0002/session.jsonl"),
            text_of(folder_ / "session.jsonl"));
  const Outcome again = run({"view", "scene.toml", "--replay", "first/saved_0002/session.jsonl",
                             "--headless", "--out", "again", "--threads", "2"});
  ASSERT_EQ(again.code, 0) << again.err;
  for (const char* folder : {"saved_0001", "saved_0002"}) {
    const State a = saved("first", folder), b = saved("again", folder);
    EXPECT_EQ(a.step, b.step) << folder;
    EXPECT_TRUE(a.displacement == b.displacement) << folder;
    EXPECT_TRUE(a.velocity == b.velocity) << folder;
  }
  // The acts did something: the block was lifted, and the cube pushed.
  const State held = saved("first", "saved_0001");
  EXPECT_GT(held.displacement[9].z, 0.01);
  EXPECT_GT(held.displacement.back().x, 0.001);
}

TEST_F(View, SavesWhatARunContinues) {
  const Outcome replayed =
      run({"view", "scene.toml", "--replay", "session.jsonl", "--headless", "--out", "view"});
  ASSERT_EQ(replayed.code, 0) << replayed.err;
  const fs::path checkpoint = latest_checkpoint(folder_ / "view/saved_0001").value_or("none");
  const Outcome went_on =
      run({"run", "scene.toml", "--resume", checkpoint.string(), "--until", "0.5"});
  EXPECT_EQ(went_on.code, 0) << went_on.err;
  // With other settings, it is another scene.
  const fs::path changed = latest_checkpoint(folder_ / "view/saved_0002").value_or("none");
  const Outcome refused =
      run({"run", "scene.toml", "--resume", changed.string(), "--out", "other"});
  EXPECT_EQ(refused.code, 2);
  EXPECT_THAT(refused.err, HasSubstr("gravity"));
}

TEST_F(View, RefusesSessionsOfOtherScenes) {
  std::string other = test::session_scene();
  other.replace(other.find("0.3, 0.1, 0.1"), 13, "0.3, 0.1, 0.12");
  other.replace(other.find("0.051"), 5, "0.061");
  write("other.toml", other);
  const Outcome outcome =
      run({"view", "other.toml", "--replay", "session.jsonl", "--headless", "--out", "o"});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("recorded in another run"));
  const Outcome missing = run({"view", "scene.toml", "--replay", "none.jsonl", "--headless"});
  EXPECT_EQ(missing.code, 2);
  EXPECT_THAT(missing.err, HasSubstr("none.jsonl"));
  const Outcome idle = run({"view", "scene.toml", "--headless"});
  EXPECT_EQ(idle.code, 2);
  EXPECT_THAT(idle.err, HasSubstr("--replay"));
}

#ifdef PHYXEL_HAVE_VIEW

/// A view whose page is in a browser.
class ViewInABrowser : public View {
 protected:
  void begin(const std::vector<std::string>& options) {
    std::vector<std::string> words = {"view", "scene.toml", "--port", "0"};
    words.insert(words.end(), options.begin(), options.end());
    child_ = start(words);
    ASSERT_TRUE(comes_true([&] { return address().find("token") != std::string::npos; }));
    browser_.emplace(folder_, address());
    ASSERT_TRUE(browser_->comes_true("document.body.dataset.state === 'live'"));
  }
  std::string address() const {
    const std::string text = text_of(folder_ / "stdout.txt");
    return text.find('\n') == std::string::npos ? "" : text.substr(0, text.find('\n'));
  }
  double number(const std::string& expression) {
    const test::Browser::Json value = browser_->value("Number(" + expression + ")");
    return value.is_number() ? value.get<double>() : NAN;
  }
  Outcome end_view() {
    kill(child_, SIGINT);
    return finish(child_);
  }

  pid_t child_ = -1;
  std::optional<test::Browser> browser_;
};

TEST_F(ViewInABrowser, PullsABodyByTheMouse) {
  PHYXEL_NEEDS_TOOL(std::system("command -v chromium >/dev/null") == 0, "chromium");
  // A beam that is held at one end; nothing but the hand does work.
  write("scene.toml",
        "[time]\nend = 1\n[solver]\ndevice = 'cpu'\nthreads = 1\n[output]\ndirectory = 'out'\n"
        "[[body]]\nshape = 'beam'\nsize = [0.6, 0.12, 0.12]\nspacing = 0.03\n[body.material]\n"
        "young = 1e5\npoisson = 0.3\ndensity = 1000\n[[body.fixed]]\nregion = 'x-'\n");
  begin({"--pace", "0.2"});
  EXPECT_EQ(browser_->value("document.body.dataset.role"), "steers");
  EXPECT_EQ(number("document.body.dataset.error"), 0);
  EXPECT_GT(number("document.body.dataset.drawn"), 0.02);
  // A place inside the free end, as it is seen.
  const std::string end =
      "ids.reduce((most, _, i) => rest.phyxels[3 * i] > rest.phyxels[3 * most] ? i : most, 0)";
  const auto seen = [&](int axis, const char* side) {
    return number("onStage(phyxelAt(latest, " + end + ").map(x => 0.85 * x))[" +
                  std::to_string(axis) + "] + canvas.getBoundingClientRect()." + side);
  };
  const double x = seen(0, "left"), y = seen(1, "top");
  browser_->mouse("mousePressed", x, y);
  for (int k = 1; k <= 10; ++k) browser_->mouse("mouseMoved", x + 3 * k, y - 8 * k);
  EXPECT_EQ(browser_->value("hand !== null"), true);
  EXPECT_TRUE(browser_->comes_true("samples.length > 2 && Math.abs(samples.at(-1).work) > 0.01"));
  browser_->mouse("mouseReleased", x + 30, y - 80);
  EXPECT_EQ(browser_->value("hand === null"), true);
  // From then on the work stays, and the energy is what the hand has put in: 1%, for Verlet's
  // energies swing by the square of the step.
  browser_->value("globalThis.released = samples.at(-1).time");
  EXPECT_TRUE(browser_->comes_true("samples.filter(s => s.time > released).length > 4"));
  EXPECT_EQ(number("samples.at(-1).work"), number("samples.at(-2).work"));
  EXPECT_NEAR(number("samples.at(-1).energy.total / samples.at(-1).work"), 1, 0.01);
  const Outcome outcome = end_view();
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_FALSE(fs::exists(folder_ / "out"));  // nothing was saved
}

TEST_F(ViewInABrowser, ObeysItsControls) {
  PHYXEL_NEEDS_TOOL(std::system("command -v chromium >/dev/null") == 0, "chromium");
  begin({"--paused"});
  EXPECT_EQ(number("latest.time"), 0);
  const auto click = [&](const std::string& id) {
    browser_->value("document.getElementById('" + id + "').click()");
  };
  click("step");
  EXPECT_TRUE(browser_->comes_true("latest.time > 0"));
  const double after_a_step = number("latest.time");
  EXPECT_LT(after_a_step, 0.1);
  browser_->value(
      "{ const g = document.getElementById('set-gravity'); g.value = 2; "
      "g.dispatchEvent(new Event('change')); const f = document.getElementById('field'); "
      "f.value = 2; f.dispatchEvent(new Event('change')); }");
  EXPECT_TRUE(browser_->comes_true("latest.field === 2"));
  click("play");
  EXPECT_TRUE(browser_->comes_true("latest.time > 0.15"));
  click("save");
  EXPECT_TRUE(browser_->comes_true("!document.getElementById('message').hidden"));
  EXPECT_THAT(browser_->value("document.getElementById('message').textContent").get<std::string>(),
              HasSubstr("session.jsonl"));
  click("play");  // pauses, now that it plays
  EXPECT_TRUE(browser_->comes_true("!playing"));
  click("restart");
  EXPECT_TRUE(browser_->comes_true("latest.time === 0"));
  // The picture moves with the bodies, and comes back with them.
  const auto picture = [&] { return browser_->value("draw(), canvas.toDataURL()"); };
  const test::Browser::Json at_rest = picture();
  EXPECT_EQ(picture(), at_rest);
  click("play");
  EXPECT_TRUE(browser_->comes_true("latest.time > 0.1"));
  click("play");
  EXPECT_TRUE(browser_->comes_true("!playing"));
  EXPECT_NE(picture(), at_rest);
  click("restart");
  EXPECT_TRUE(browser_->comes_true("latest.time === 0"));
  EXPECT_EQ(picture(), at_rest);
  const Outcome outcome = end_view();
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  const app::Recording saved =
      app::parse_recording(text_of(folder_ / "out/saved_0001/session.jsonl"), "session.jsonl");
  ASSERT_GE(saved.acts.size(), 2u);
  EXPECT_EQ(saved.acts[0].act.settings.gravity, (Vec3d{0, 0, -2}));
  EXPECT_EQ(saved.acts.back().act.kind, app::RequestKind::save);
}

#endif

}  // namespace
}  // namespace phyxel
