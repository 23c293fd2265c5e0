/// Arrays of a caller that do not fit are refused before a file is written.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "phyxel/body_file.hpp"
#include "phyxel/checkpoint.hpp"
#include "phyxel/recorder.hpp"
#include "support/clouds.hpp"
#include "support/folder.hpp"
#include "support/refusal.hpp"
#include "support/two_bodies.hpp"

namespace phyxel {
namespace {

using ::testing::HasSubstr;
using testing::refusal_of;

class CallerArrays : public test::Folder {};

TEST_F(CallerArrays, BodiesThatCouldNotBeReadAreNotWritten) {
  const auto with = [&](auto&& change) {
    Cloud cloud = testing::lattice(3, 3, 3, 0.1);
    change(cloud);
    std::filesystem::remove(folder_ / "body.h5");
    const std::string words = refusal_of([&] { write_body(folder_ / "body.h5", cloud, false); });
    EXPECT_EQ(std::filesystem::exists(folder_ / "body.h5"), words == "accepted");
    return words;
  };
  EXPECT_EQ(with([](Cloud&) {}), "accepted");
  EXPECT_EQ(with([](Cloud& c) { c.volume.pop_back(); }),
            (folder_ / "body.h5").string() +
                ": the cloud has 26 volumes for 27 phyxels; allowed: as many, or none");
  EXPECT_THAT(with([](Cloud& c) { c.position[3].x = std::nan(""); }),
              HasSubstr("body.h5: phyxel 3 lies at [nan, 0.15, 0.05] m; allowed: "));
  EXPECT_THAT(with([](Cloud& c) { c.surface.position.resize(2); }), HasSubstr("0 normals for 2"));
  EXPECT_THAT(with([](Cloud& c) { c.regions["end"] = {27}; }), HasSubstr("phyxel 27 in region"));
}

TEST_F(CallerArrays, FramesHaveValuesForTheirModel) {
  const Model model = test::two_bodies();
  const Scene scene = test::two_bodies_scene(folder_ / "out");
  Recorder recorder(model, scene, false);
  const test::TwoBodiesFrame made(model, 0);
  const auto with = [&](auto&& change) {
    Frame frame = made.frame();
    State state = *frame.state;
    SurfelState surfels = *frame.surfels;
    frame.state = &state;
    frame.surfels = &surfels;
    change(frame, state, surfels);
    return refusal_of([&] { recorder.write(frame); });
  };
  using S = State;
  using U = SurfelState;
  const std::string n = std::to_string(model.size());
  EXPECT_EQ(with([](Frame&, S&, U&) {}), "accepted");
  EXPECT_EQ(with([](Frame& f, S&, U&) { f.state = nullptr; }),
            "frame: state is null; allowed: the state of the model");
  EXPECT_EQ(with([](Frame&, S& s, U&) { s.displacement.resize(1); }),
            "frame: displacement has 1 entries; allowed: " + n);
  EXPECT_EQ(with([](Frame&, S& s, U&) { s.velocity.clear(); }),
            "frame: velocity has 0 entries; allowed: " + n);
  EXPECT_EQ(with([](Frame& f, S&, U&) { f.fields[Quantity::von_mises].resize(2); }),
            "frame: von_mises has 2 entries; allowed: " + n + " or none");
  EXPECT_THAT(with([](Frame& f, S&, U&) { f.fields[Quantity::volume_ratio].resize(3); }),
              HasSubstr("volume_ratio has 3"));
  EXPECT_THAT(with([](Frame&, S& s, U&) {
                s.history = {{"strain", {1, 2}}};
              }),
              HasSubstr("history \"strain\" has 2 entries"));
  EXPECT_THAT(with([&](Frame&, S& s, U&) {
                s.history = {{"strain", std::vector<double>(model.position.size())}};
              }),
              HasSubstr("1 columns of history; allowed: 0 or none"));
  EXPECT_THAT(with([](Frame&, S&, U& u) { u.position.pop_back(); }),
              HasSubstr("surfels.position has "));
  EXPECT_THAT(with([](Frame&, S&, U& u) { u.normal.clear(); }), HasSubstr("surfels.normal has 0"));
  EXPECT_EQ(recorder.frames_written(), 1);
}

/// A source of a program's own that has too few values.
class ShortSource final : public FrameSource {
 public:
  using FrameSource::FrameSource;
  std::span<const double> values(Quantity quantity, Index begin, Index end) override {
    const auto all = FrameSource::values(quantity, begin, end);
    return quantity == Quantity::displacement ? all.first(all.size() - 1) : all;
  }
};

TEST_F(CallerArrays, SourcesHaveAsManyValuesAsAskedFor) {
  const Model model = test::two_bodies();
  const Scene scene = test::two_bodies_scene(folder_ / "out");
  Recorder recorder(model, scene, false);
  const test::TwoBodiesFrame made(model, 0);
  const Frame frame = made.frame();
  ShortSource source(model, frame);
  EXPECT_THAT(refusal_of([&] { recorder.write(frame.diagnostics, source); }),
              HasSubstr("/VTKHDF/Points: the source has "));
  FrameSource whole(model, frame);
  const Index n = model.size();
  EXPECT_EQ(refusal_of([&] { whole.values(Quantity::mass, 0, n); }), "accepted");
  EXPECT_THAT(refusal_of([&] { whole.values(Quantity::mass, 1, n + 1); }), HasSubstr("rows 1 to "));
  EXPECT_THAT(refusal_of([&] { whole.values(Quantity::mass, -1, 2); }), HasSubstr("rows -1 to 2"));
  EXPECT_THAT(refusal_of([&] { whole.values(Quantity::mass, 3, 2); }), HasSubstr("rows 3 to 2"));
}

TEST_F(CallerArrays, CheckpointsHaveAsManyVelocitiesAsDisplacements) {
  State state = testing::state_of(std::vector<Vec3d>(5));
  EXPECT_EQ(refusal_of([&] { write_checkpoint(folder_, state, {}); }), "accepted");
  state.velocity.pop_back();
  EXPECT_EQ(refusal_of([&] { write_checkpoint(folder_, state, {}); }),
            "state of a checkpoint: velocity has 4 entries; allowed: 5, as many as displacements");
  state.velocity.resize(5);
  state.history = {{"strain", {0, 0}}};
  EXPECT_THAT(refusal_of([&] { write_checkpoint(folder_, state, {}); }),
              HasSubstr("history \"strain\" has 2 entries"));
}

}  // namespace
}  // namespace phyxel
