/// Files: content is read back as written, damage is found before parsing, nothing is lost.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <functional>
#include <random>

#include "files/atomic_file.hpp"
#include "files/hdf5_file.hpp"
#include "files/hdf5_memory.hpp"
#include "files/sealed_file.hpp"
#include "phyxel/body_file.hpp"
#include "phyxel/checkpoint.hpp"
#include "phyxel/error.hpp"
#include "support/folder.hpp"

namespace phyxel {
namespace {

namespace fs = std::filesystem;
using test::text_of;
using ::testing::HasSubstr;

class Files : public test::Folder {};

Cloud small_cloud() {
  Cloud cloud;
  cloud.position = {{0.1, 0.2, 0.3}, {1.0 / 3, -2e-300, 1e6}, {4, 5, 6}};
  cloud.volume = {1e-3, 2e-3, 1.0 / 7};
  cloud.spacing = {0.1, 0.2, 0.5};
  cloud.surface.position = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  cloud.surface.normal = {{0, 0, -1}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  cloud.surface.triangle = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}};
  cloud.regions = {{"mouth", {0, 2}}, {"x-", {1}}, {"none", {}}};
  return cloud;
}

State small_state(bool as_float) {
  State state;
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  const auto value = [&] {
    return as_float ? static_cast<double>(static_cast<float>(normal(random))) : normal(random);
  };
  for (int i = 0; i < 5; ++i) {
    state.displacement.push_back({value(), value(), value()});
    state.velocity.push_back({value(), value(), value()});
  }
  state.step = 1234;
  state.dt = 1.0 / 3000;
  state.time = 1234 * state.dt;
  return state;
}

TEST_F(Files, ABodyComesBackToTheBit) {
  const Cloud cloud = small_cloud();
  write_body(folder_ / "body.h5", cloud, false);
  const Cloud back = read_body(folder_ / "body.h5");
  EXPECT_TRUE(back.position == cloud.position);
  EXPECT_EQ(back.volume, cloud.volume);
  EXPECT_EQ(back.spacing, cloud.spacing);
  EXPECT_TRUE(back.surface.position == cloud.surface.position);
  EXPECT_TRUE(back.surface.normal == cloud.surface.normal);
  EXPECT_EQ(back.surface.triangle, cloud.surface.triangle);
  EXPECT_EQ(back.regions, cloud.regions);
}

TEST_F(Files, ABodyWithoutVolumesOrSurfaceComesBackWithoutThem) {
  Cloud cloud;
  cloud.position = {{1, 2, 3}};
  write_body(folder_ / "body.h5", cloud, false);
  const Cloud back = read_body(folder_ / "body.h5");
  EXPECT_TRUE(back.position == cloud.position);
  EXPECT_TRUE(back.volume.empty());
  EXPECT_TRUE(back.spacing.empty());
  EXPECT_TRUE(back.surface.position.empty());
  EXPECT_TRUE(back.regions.empty());
}

TEST_F(Files, AnExistingBodyIsKeptUnlessToldOtherwise) {
  write("body.h5", "precious");
  EXPECT_THROW(write_body(folder_ / "body.h5", small_cloud(), false), InputError);
  EXPECT_EQ(text_of(folder_ / "body.h5"), "precious");
  write_body(folder_ / "body.h5", small_cloud(), true);
  EXPECT_EQ(read_body(folder_ / "body.h5").position.size(), 3u);
  EXPECT_FALSE(fs::exists(folder_ / "body.h5.tmp"));
}

TEST_F(Files, TheSameContentIsTheSameBytes) {
  write_body(folder_ / "a.h5", small_cloud(), false);
  write_body(folder_ / "b.h5", small_cloud(), false);
  EXPECT_EQ(text_of(folder_ / "a.h5"), text_of(folder_ / "b.h5"));
}

TEST_F(Files, ACheckpointComesBackToTheBitInEveryPrecision) {
  for (const Precision precision : {Precision::single, Precision::double_, Precision::mixed}) {
    State state = small_state(precision == Precision::single);
    state.looks = {.next = 130,
                   .last = 114,
                   .ratio = 4.0 / 3,
                   .change = 1.0 / 7,
                   .measured = 98,
                   .measured_ratio = 1.1,
                   .measured_share = 0.7,
                   .apart = 512,
                   .too_long = 64,
                   .doublings = 5};
    CheckpointInfo info;
    info.program = "phyxel 0 (test)";
    info.precision = precision;
    info.scene_text = "title = \"x\"\n# ü\n";
    info.model_digest = 0xfedcba9876543210u;
    info.total_energy = 1.0 / 3;
    info.watched = {.start_energy = -2e-200, .start_speed = 7.25, .peak_energy = 1.0 / 7};
    info.frames_written = 17;
    info.parameters = {{"gravity", "[0, 0, -9.81]"}, {"body.name of body 1 (\"ü\")", "\"ü\""}};
    const fs::path file = write_checkpoint(folder_, state, info);
    const Checkpoint back = read_checkpoint(file);
    EXPECT_TRUE(back.state.displacement == state.displacement);
    EXPECT_TRUE(back.state.velocity == state.velocity);
    EXPECT_EQ(back.state.step, state.step);
    EXPECT_EQ(back.state.time, state.time);
    EXPECT_EQ(back.state.dt, state.dt);
    EXPECT_TRUE(back.state.looks == state.looks);
    EXPECT_EQ(back.info.precision, precision);
    EXPECT_EQ(back.info.program, info.program);
    EXPECT_EQ(back.info.scene_text, info.scene_text);
    EXPECT_EQ(back.info.model_digest, info.model_digest);
    EXPECT_EQ(back.info.total_energy, info.total_energy);
    EXPECT_TRUE(back.info.watched == info.watched);
    EXPECT_EQ(back.info.frames_written, info.frames_written);
    EXPECT_EQ(back.info.parameters, info.parameters);
    EXPECT_EQ(back.info.version, 4);
  }
}

std::vector<std::string> names_in(const fs::path& folder) {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder)) names.push_back(entry.path().filename());
  std::sort(names.begin(), names.end());
  return names;
}

TEST_F(Files, ACheckpointIsReadInStretches) {
  const State state = small_state(false);
  const CheckpointReader reader(
      write_checkpoint(folder_, state, {.precision = Precision::double_}));
  EXPECT_EQ(reader.phyxels(), 5);
  EXPECT_EQ(reader.info().precision, Precision::double_);
  EXPECT_TRUE(reader.state(0, 0).displacement.empty());
  EXPECT_EQ(reader.state(0, 0).time, state.time);
  State read;
  for (const auto& [begin, end] : {std::pair{0, 2}, {2, 4}, {4, 5}}) {
    const State some = reader.state(begin, end);
    read.displacement.insert(read.displacement.end(), some.displacement.begin(),
                             some.displacement.end());
    read.velocity.insert(read.velocity.end(), some.velocity.begin(), some.velocity.end());
  }
  EXPECT_TRUE(read.displacement == state.displacement);
  EXPECT_TRUE(read.velocity == state.velocity);
  EXPECT_THROW(reader.state(4, 6), InputError);
}

TEST_F(Files, TheLastTwoCheckpointsAreKept) {
  State state = small_state(false);
  for (const std::int64_t step : {100, 200, 300, 1000}) {
    state.step = step;
    write_checkpoint(folder_, state, {});
  }
  EXPECT_THAT(names_in(folder_),
              ::testing::ElementsAre("checkpoint_000000300.h5", "checkpoint_000001000.h5"));
  // A run that went back to an earlier checkpoint leaves its old future behind.
  state.step = 400;
  write_checkpoint(folder_, state, {});
  EXPECT_THAT(names_in(folder_),
              ::testing::ElementsAre("checkpoint_000000300.h5", "checkpoint_000000400.h5"));
}

TEST_F(Files, ADamagedNewestCheckpointIsSkippedWithAWarning) {
  State state = small_state(false);
  state.step = 1;
  const fs::path older = write_checkpoint(folder_, state, {});
  state.step = 2;
  const fs::path newer = write_checkpoint(folder_, state, {});
  write("checkpoint_x.h5", "foreign");
  std::string warning;
  EXPECT_EQ(latest_checkpoint(folder_, &warning), newer);
  EXPECT_EQ(warning, "");
  fs::resize_file(newer, fs::file_size(newer) - 1);
  EXPECT_EQ(latest_checkpoint(folder_, &warning), older);
  EXPECT_THAT(warning, HasSubstr(newer.string()));
  fs::resize_file(older, 10);
  EXPECT_EQ(latest_checkpoint(folder_), std::nullopt);
  EXPECT_EQ(latest_checkpoint(folder_ / "nowhere"), std::nullopt);
}

/// The message of the InputError that `call` throws, or "" if it throws none.
std::string refusal(const std::function<void()>& call) {
  try {
    call();
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST_F(Files, EveryChangedByteAndEveryCutIsFoundBeforeHdf5Looks) {
  write_body(folder_ / "body.h5", small_cloud(), false);
  const std::string good = text_of(folder_ / "body.h5");
  std::mt19937 random(1);
  for (int trial = 0; trial < 300; ++trial) {
    std::string bad = good;
    const std::size_t at = random() % bad.size();
    if (trial % 3 == 0) {
      bad.resize(at);
    } else {
      bad[at] = static_cast<char>(bad[at] ^ (1 << random() % 8));
    }
    const fs::path file = write("bad.h5", bad);
    const std::string message = refusal([&] { check_seal(file, "body"); });
    // Padding of the seal carries nothing: a change there may pass, and changes nothing.
    if (message.empty()) {
      EXPECT_LT(at, seal_size);
      EXPECT_GT(at, 60u);
      EXPECT_TRUE(read_body(file).position == small_cloud().position);
    } else {
      EXPECT_THAT(message, HasSubstr("bad.h5"));
    }
  }
}

TEST_F(Files, ForeignFilesAreNamed) {
  State state = small_state(false);
  const fs::path checkpoint = write_checkpoint(folder_, state, {});
  const struct {
    fs::path file;
    std::string message;
  } cases[] = {
      {folder_ / "missing.h5", "no such file"},
      {folder_, "folder"},
      {write("empty.h5", ""), "not a file written by phyxel"},
      {write("text.h5", std::string(5000, 'x')), "not a file written by phyxel"},
      {write("plain.h5", "\x89HDF\r\n\x1a\n" + std::string(2000, '\0')),
       "not a file written by phyxel"},
      {write("future.h5", "phyxel sealed file 2\n" + std::string(2000, '\n')), "another version"},
      {checkpoint, "is a phyxel checkpoint; expected a body"},
  };
  for (const auto& c : cases) {
    const std::string message = refusal([&] { read_body(c.file); });
    EXPECT_THAT(message, HasSubstr(c.message));
    EXPECT_THAT(message, HasSubstr(c.file.string()));
  }
}

/// Bodies with a valid seal and invalid content.
TEST_F(Files, WrongContentIsNamedByArrayAndRow) {
  using Write = std::function<void(Hdf5Writer&)>;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto base = [](Hdf5Writer& out) {
    out.group("/phyxel");
    out.attribute("/phyxel", "version", std::int64_t{1});
  };
  const auto points = [](Hdf5Writer& out) {
    const std::vector<Vec3d> position{{0, 0, 0}, {1, 1, 1}};
    out.vectors("/position", position, false);
  };
  const auto surface = [](Hdf5Writer& out, std::vector<Index> corners, std::size_t normals) {
    out.vectors("/surface/position", std::vector<Vec3d>(3, Vec3d{}), false);
    out.vectors("/surface/normal", std::vector<Vec3d>(normals, Vec3d{0, 0, 1}), false);
    out.array<Index>("/surface/triangle", corners, 3);
  };
  const struct {
    std::string message;
    Write write;
  } cases[] = {
      {"/phyxel", [](Hdf5Writer&) {}},
      {"version 2",
       [](Hdf5Writer& o) {
         o.group("/phyxel");
         o.attribute("/phyxel", "version", std::int64_t{2});
       }},
      {"version",
       [](Hdf5Writer& o) {
         o.group("/phyxel");
         o.attribute("/phyxel", "version", 1.0);
       }},
      {"version",
       [](Hdf5Writer& o) {
         o.group("/phyxel");
         o.attribute("/phyxel", "version", std::string("1"));
       }},
      {"/position is missing", base},
      {"no phyxels",
       [&](Hdf5Writer& o) {
         base(o);
         o.vectors("/position", {}, false);
       }},
      {"/position",
       [&](Hdf5Writer& o) {
         base(o);
         o.group("/position");
       }},
      {"/position",
       [&](Hdf5Writer& o) {
         base(o);
         o.array<double>("/position", std::vector<double>(6));
       }},
      {"/position",
       [&](Hdf5Writer& o) {
         base(o);
         o.array<double>("/position", std::vector<double>(4), 2);
       }},
      {"/position does not hold reals",
       [&](Hdf5Writer& o) {
         base(o);
         o.array<Index>("/position", std::vector<Index>(6), 3);
       }},
      {"/position is not finite in row 1",
       [&](Hdf5Writer& o) {
         base(o);
         o.array<double>("/position", std::vector<double>{0, 0, 0, 0, nan, 0}, 3);
       }},
      {"/volume has 3 rows",
       [&](Hdf5Writer& o) {
         base(o);
         points(o);
         o.array<double>("/volume", std::vector<double>(3, 1));
       }},
      {"/spacing is 0 in row 1",
       [&](Hdf5Writer& o) {
         base(o);
         points(o);
         o.array<double>("/spacing", std::vector<double>{1, 0});
       }},
      {"/volume is 0 in row 1",
       [&](Hdf5Writer& o) {
         base(o);
         points(o);
         o.array<double>("/volume", std::vector<double>{1, 0});
       }},
      {"/volume is nan",
       [&](Hdf5Writer& o) {
         base(o);
         points(o);
         o.array<double>("/volume", std::vector<double>{1, nan});
       }},
      {"index 3 at 2; allowed 0 to 2",
       [&](Hdf5Writer& o) {
         base(o);
         points(o);
         surface(o, {0, 1, 3}, 3);
       }},
      {"index -1 at 0",
       [&](Hdf5Writer& o) {
         base(o);
         points(o);
         surface(o, {-1, 1, 2}, 3);
       }},
      {"/surface/normal has 2 rows",
       [&](Hdf5Writer& o) {
         base(o);
         points(o);
         surface(o, {0, 1, 2}, 2);
       }},
      {"/surface/position is missing",
       [&](Hdf5Writer& o) {
         base(o);
         points(o);
         o.group("/surface");
       }},
      {"/regions/a holds the index 2 at 0",
       [&](Hdf5Writer& o) {
         base(o);
         points(o);
         o.array<Index>("/regions/a", std::vector<Index>{2});
       }},
      {"/regions/a does not hold integers",
       [&](Hdf5Writer& o) {
         base(o);
         points(o);
         o.array<double>("/regions/a", std::vector<double>{0});
       }},
  };
  for (const auto& c : cases) {
    Hdf5Writer out;
    c.write(out);
    write_sealed(folder_ / "body.h5", "body", out.content(), Durable::no);
    const std::string message = refusal([&] { read_body(folder_ / "body.h5"); });
    EXPECT_THAT(message, HasSubstr(c.message));
    EXPECT_THAT(message, HasSubstr("body.h5"));
  }
}

TEST_F(Files, AFileOnDiskSealedAfterwardsIsReadLikeAnother) {
  {
    Hdf5Writer out(folder_ / "disk.h5");
    out.reserve<float>("/a/b", 4, 2);
    out.rows<float>("/a/b", 2, std::vector<float>{5, 6, 7, 8}, 2);
    out.rows<float>("/a/b", 0, std::vector<float>{1, 2, 3, 4}, 2);
    out.text("/note", "hello");
    out.close();
  }
  seal_in_place(folder_ / "disk.h5", "trajectory");
  EXPECT_EQ(check_seal(folder_ / "disk.h5"), "trajectory");
  const Hdf5Reader in(folder_ / "disk.h5");
  EXPECT_THAT(in.array<double>("/a/b", 2), ::testing::ElementsAre(1, 2, 3, 4, 5, 6, 7, 8));
  EXPECT_EQ(in.text("/note"), "hello");
}

/// Arrays of a billion phyxels: only the requested chunk is in memory.
TEST_F(Files, ArraysThatComeLaterTakeNoMemory) {
  constexpr std::size_t rows = 1'000'000'000;
  Hdf5Writer out;
  out.group("/state");
  out.later<double>("/state/u", rows, 3, 1000, [](std::size_t first, std::span<double> values) {
    ASSERT_EQ(values.size(), 3000u);
    for (std::size_t k = 0; k < values.size(); ++k) {
      values[k] = static_cast<double>(3 * first + k);
    }
  });
  out.later<std::uint8_t>("/state/kind", rows, 0, 1000,
                          [](std::size_t, std::span<std::uint8_t>) {});
  out.text("/note", "hello");
  const Content content = out.content();
  EXPECT_GT(content.size, 25 * rows);
  EXPECT_LT(content.size, 25 * rows + 10000);
  // The first few pieces, whose numbers count on.
  struct Enough {};
  std::size_t pieces = 0, longest = 0;
  double next = 0;
  const auto look = [&](std::span<const std::byte> bytes) {
    longest = std::max(longest, bytes.size());
    if (bytes.size() == 3000 * sizeof(double)) {
      double first = 0;
      std::memcpy(&first, bytes.data(), sizeof first);
      EXPECT_EQ(first, next);
      next += 3000;
    }
    if (++pieces == 20) throw Enough();
  };
  EXPECT_THROW(for (const Content::Piece& piece : content.pieces) piece.produce(look), Enough);
  EXPECT_EQ(longest, 3000 * sizeof(double));
  EXPECT_GT(next, 0);
}

/// As in a file on a disk, bytes that were cut off are zero when the file grows again.
TEST(SparseBytes, CutAndGrownAreZero) {
  const auto read_all = [](const SparseBytes& bytes) {
    std::vector<std::byte> all(bytes.size());
    bytes.read(0, all);
    return all;
  };
  constexpr std::uint64_t far = std::uint64_t{1} << 40;
  const std::vector<std::byte> ones(300'000, std::byte{1});  // of several pages
  for (const std::uint64_t cut : {0, 1, 65'536, 100'000, 299'999}) {
    SparseBytes bytes;
    bytes.write(0, ones);
    bytes.write(far, std::span(ones).first(1));
    EXPECT_EQ(bytes.size(), far + 1);
    bytes.resize(cut);
    bytes.resize(ones.size());
    std::vector<std::byte> expected(ones.size(), std::byte{0});
    std::fill_n(expected.begin(), cut, std::byte{1});
    EXPECT_TRUE(read_all(bytes) == expected) << cut;
    std::byte last{1};
    bytes.resize(far + 1);
    bytes.read(far, {&last, 1});
    EXPECT_EQ(last, std::byte{0});
  }
}

TEST_F(Files, ALogIsExtendedInOneWriteAndNeverShortenedByAnother) {
  const fs::path log = write("log.csv", "a\nb\n]");
  replace_tail(log, 4, "c\n]");
  EXPECT_EQ(text_of(log), "a\nb\nc\n]");
  EXPECT_THROW(replace_tail(log, 100, "d"), OutputError);
  EXPECT_THROW(replace_tail(folder_ / "none", 0, "d"), OutputError);
  EXPECT_EQ(text_of(log), "a\nb\nc\n]");
}

TEST_F(Files, AFailedWriteLeavesTheOldFile) {
  const fs::path file = write("kept", "old");
  fs::create_directories(folder_ / "kept.tmp");  // the temporary name is taken by a folder
  EXPECT_THROW(write_whole_file(file, "new", Durable::yes), OutputError);
  EXPECT_EQ(text_of(file), "old");
}

TEST_F(Files, AFolderThatCannotBeMadeIsNamed) {
  write("file", "x");
  EXPECT_THAT(refusal([&] { make_writable_folder(folder_ / "file"); }), HasSubstr("file"));
  EXPECT_THAT(refusal([&] { make_writable_folder(folder_ / "file" / "below"); }),
              HasSubstr("below"));
  EXPECT_THAT(refusal([&] { make_writable_folder("/proc/phyxel"); }), HasSubstr("/proc/phyxel"));
  EXPECT_NO_THROW(make_writable_folder(folder_ / "a" / "b"));
  EXPECT_TRUE(fs::is_empty(folder_ / "a" / "b"));
}

}  // namespace
}  // namespace phyxel
