/// Files of values of all ranks, written on the first rank's thread, are equal to those of one
/// rank.
#include "file_writer.hpp"

#include <gmock/gmock.h>

#include <chrono>
#include <thread>

#include "../partition/bodies.hpp"
#include "mpi/parallel_file.hpp"
#include "mpi/row_redistribution.hpp"
#include "phyxel/checkpoint.hpp"
#include "ranks.hpp"
#include "support/folder.hpp"

namespace phyxel::app {
namespace {

namespace fs = std::filesystem;
using phyxel::test::text_of;
using phyxel::test::world;
using ::testing::HasSubstr;

Scene two_bodies(const fs::path& directory) {
  Scene scene;
  for (const char* name : {"sphere", "horn_bug"}) {  // one with surfels
    BodyRequest& body = scene.bodies.emplace_back();
    body.name = name;
    body.where = "test";
    body.source.shape.name = name;
    body.source.shape.spacing = 0.2;
    body.source.shape.radius = 1;
    body.material = testing::rubber();
  }
  scene.solver.precision = Precision::double_;
  scene.output.directory = directory;
  scene.output.fields = {"displacement", "velocity", "von_mises", "volume_ratio", "mass", "volume"};
  return scene;
}

/// A number from which the global id and the quantity follow.
double value_of(Index number, int what) { return 0.25 * number + 1e4 * what; }

/// The values of a model at the time `k`.
std::shared_ptr<const Moment> moment_at(int k, const Model& model) {
  const auto state = std::make_shared<State>();
  const auto moment = std::make_shared<Moment>();
  state->step = k;
  state->dt = 0.5;
  state->time = 0.5 * k;
  for (Index i = 0; i < model.size(); ++i) {
    const Index number = model.owns(i) ? model.global_id(i) : -1;
    const auto value = [&](int what) { return value_of(number, what) + k; };
    state->displacement.push_back({value(0), value(1), value(2)});
    state->velocity.push_back({value(3), value(4), value(5)});
    moment->frame.fields[Quantity::von_mises].push_back(value(6));
    moment->frame.fields[Quantity::volume_ratio].push_back(value(7));
  }
  for (Index s = 0; s < static_cast<Index>(model.surfels.position.size()); ++s) {
    const Index number = model.share ? model.share->global_surfel_id[s] : s;
    moment->surfels.position.push_back({value_of(number, 8) + k, 0, 1});
    moment->surfels.normal.push_back({0, value_of(number, 9), 1});
  }
  moment->state = state;
  moment->frame.state = state.get();
  moment->frame.surfels = &moment->surfels;
  moment->frame.diagnostics.step = k;
  moment->frame.diagnostics.time = state->time;
  moment->optional = {Quantity::von_mises, Quantity::volume_ratio, Quantity::surfel_position};
  return moment;
}

/// The ranks of this program.
class SharedFiles : public phyxel::test::Folder {
 protected:
  static void SetUpTestSuite() { set_ranks(phyxel::test::all_ranks()); }

  bool leads() const { return world().rank() == 0; }
  static CheckpointInfo info() {
    CheckpointInfo info;
    info.precision = Precision::double_;
    return info;
  }

  Scene scene_ = two_bodies(folder_ / "shared");
  SharedModel shared_{phyxel::test::all_ranks(), scene_, ChosenDevice{}};
};

/// Checks that the tests of this program cover mpi/parallel_file.cpp.
TEST_F(SharedFiles, AreWrittenByAllRanksWithAParallelHdf5) {
  EXPECT_EQ(can_write_collectively(), PHYXEL_PARALLEL_HDF5 == 1);
}

TEST_F(SharedFiles, AreThoseOfOneRankToTheByte) {
  constexpr Index length = 37;
  constexpr int frames = 4;
  std::optional<Recorder> recorder;
  if (leads()) recorder.emplace(shared_.here(), scene_, false);
  {
    FileWriter writer(shared_, length);
    for (int k = 0; k < frames; ++k) {
      const auto moment = moment_at(k, shared_.here());
      writer.submit(moment, [&, now = moment->frame.diagnostics](ChunkedSource& values) {
        EXPECT_EQ(values.length(), length);
        recorder->write(now, values);
      });
      writer.serve();  // and the ranks go on
    }
    const auto moment = moment_at(frames, shared_.here());
    writer.submit(moment, [&](ChunkedSource& values) {
      write_checkpoint(recorder->directory(), *moment->state, info(), shared_.here().global_count(),
                       values);
    });
    writer.finish();
  }
  if (!leads()) return;
  const Scene alone = two_bodies(folder_ / "alone");
  const Model whole = build_model(alone);
  Recorder expected(whole, alone, false);
  for (int k = 0; k < frames; ++k) expected.write(moment_at(k, whole)->frame);
  write_checkpoint(expected.directory(), *moment_at(frames, whole)->state, info());
  int files = 0;
  for (const auto& entry : fs::directory_iterator(expected.directory())) {
    const fs::path file = recorder->directory() / entry.path().filename();
    EXPECT_TRUE(text_of(entry.path()) == text_of(file)) << file;
    ++files;
  }
  EXPECT_EQ(files, 2 * frames + 4);
}

/// No request is larger than a chunk, the additional memory of the first rank.
TEST_F(SharedFiles, TakeAStretchOfTheFirstRanksMemory) {
  if (world().size() == 1) GTEST_SKIP() << "one rank has all values anyway";
  const Index all = shared_.here().global_count();
  const auto moment = moment_at(0, shared_.here());
  FileWriter writer(shared_, 50);
  std::size_t most = 0;
  Index found = 0;
  writer.submit(moment, [&](ChunkedSource& values) {
    for (Index begin = 0; begin < all; begin += values.length()) {
      const Index end = std::min(all, begin + values.length());
      const auto some = values.values(Quantity::velocity, begin, end);
      most = std::max(most, some.size());
      for (Index i = begin; i < end; ++i) {
        found += some[3 * static_cast<std::size_t>(i - begin)] == value_of(i, 3);
      }
    }
  });
  writer.finish();
  if (!leads()) return;
  EXPECT_EQ(most, 150u);
  EXPECT_EQ(found, all);
}

TEST_F(SharedFiles, AnErrorOfTheWriterIsThatOfAllRanks) {
  FileWriter writer(shared_, 50);
  const auto moment = moment_at(0, shared_.here());
  const auto message_of = [](auto&& work) -> std::string {
    try {
      work();
    } catch (const Error& error) {
      return error.what();
    }
    return "no error";
  };
  bool later = false;
  writer.submit(moment, [](ChunkedSource& values) {
    values.values(Quantity::mass, 0, 10);
    throw OutputError("out/phyxels_000000.hdf: No space left on device");
  });
  const std::string message = message_of([&] {
    while (true) {
      writer.serve();
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  });
  EXPECT_THAT(message, HasSubstr("No space left on device"));
  EXPECT_EQ(message_of([&] { writer.submit(moment, [&](ChunkedSource&) { later = true; }); }),
            message);
  EXPECT_EQ(message_of([&] { writer.finish(); }), message);
  EXPECT_FALSE(later);
}

TEST_F(SharedFiles, MayBeLeftUnfinished) {
  if (world().size() == 1) GTEST_SKIP() << "one rank writes what waits";
  std::string error;
  {
    FileWriter writer(shared_, 50);
    const auto moment = moment_at(0, shared_.here());
    writer.submit(moment, [&](ChunkedSource& values) {
      try {
        values.values(Quantity::mass, 0, 10);
      } catch (const OutputError& left) {
        error = left.what();
        throw;
      }
    });
    writer.submit(moment, [&](ChunkedSource&) { error = "written"; });
  }
  if (leads()) {
    EXPECT_THAT(error, HasSubstr("ended before"));
  }
}

/// A state of the whole model reaches owners and ghosts, for any length of chunks.
TEST_F(SharedFiles, StatesComeBackToAllRanks) {
  if (world().size() == 1) GTEST_SKIP() << "one rank reads all";
  const Model& here = shared_.here();
  for (const Index length : {1000, here.global_count(), ChunkedSource::usual_length}) {
    Index most = 0;
    const State state = shared_.exchange().scattered(length, [&](Index begin, Index end) {
      most = std::max(most, end - begin);
      State some;
      for (Index i = begin; i < end; ++i) {
        some.displacement.push_back({value_of(i, 0), 0, 0});
        some.velocity.push_back({0, value_of(i, 1), 0});
      }
      return some;
    });
    EXPECT_EQ(most, leads() ? std::min(length, here.global_count()) : 0);
    ASSERT_EQ(state.displacement.size(), here.position.size());
    for (Index i = 0; i < here.size(); ++i) {
      EXPECT_EQ(state.displacement[i].x, value_of(here.global_id(i), 0));
      EXPECT_EQ(state.velocity[i].y, value_of(here.global_id(i), 1));
    }
  }
}

TEST_F(SharedFiles, AnErrorOfTheReaderIsThatOfAllRanks) {
  if (world().size() == 1) GTEST_SKIP() << "one rank reads all";
  const auto read = [](Index begin, Index) -> State {
    if (begin > 0) throw InputError("checkpoint.h5: /state/velocity is not finite in row 12");
    return {.displacement = std::vector<Vec3d>(10), .velocity = std::vector<Vec3d>(10)};
  };
  EXPECT_THROW(shared_.exchange().scattered(10, read), AgreedError);
}

}  // namespace
}  // namespace phyxel::app
