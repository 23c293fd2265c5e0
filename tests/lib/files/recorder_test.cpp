/// Trajectories: frames are read by phyxel, VTK and h5py; restarts; nothing is lost.
#include "phyxel/recorder.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include <cstdlib>

#include "files/hdf5_file.hpp"
#include "phyxel/checkpoint.hpp"
#include "phyxel/error.hpp"
#include "support/folder.hpp"
#include "support/skips.hpp"
#include "support/two_bodies.hpp"

namespace phyxel {
namespace {

namespace fs = std::filesystem;
using test::text_of;
using ::testing::HasSubstr;

class Recording : public test::Folder {
 protected:
  void record(Recorder& recorder, int k) const {
    recorder.write(test::TwoBodiesFrame(model_, k).frame());
  }

  Model model_ = test::two_bodies();
  Scene scene_ = test::two_bodies_scene(folder_ / "out");
};

TEST_F(Recording, FramesComeBack) {
  for (const Precision precision : {Precision::single, Precision::double_}) {
    scene_.solver.precision = precision;
    Recorder recorder(model_, scene_, true);
    for (int k = 0; k < 3; ++k) record(recorder, k);
    EXPECT_EQ(recorder.frames_written(), 3);
    const auto series = read_series(folder_ / "out" / "phyxels.hdf.series");
    ASSERT_EQ(series.size(), 3u);
    EXPECT_EQ(series[2].time, 0.1 * 2);
    const FrameData frame = read_frame(series[2].file);
    EXPECT_EQ(frame.time, 0.1 * 2);
    ASSERT_EQ(frame.point.size(), 5u);
    for (int i = 0; i < 5; ++i) {  // halves are exact in float
      EXPECT_EQ(frame.point[i].x, model_.position[i].x + 1.0);
      EXPECT_EQ(frame.point[i].z, model_.position[i].z);
    }
    EXPECT_EQ(frame.body, (std::vector<Index>{0, 0, 1, 1, 1}));
    EXPECT_TRUE(frame.field.empty());
    const FrameData with_fields = read_frame(series[2].file, true);
    ASSERT_EQ(with_fields.field.at("displacement").size(), 3 * 5u);
    for (int i = 0; i < 5; ++i) EXPECT_EQ(with_fields.field.at("displacement")[3 * i], 1);
    const FrameData surface =
        read_frame(read_series(folder_ / "out" / "surface.hdf.series")[1].file);
    EXPECT_EQ(surface.triangle, model_.surfels.triangle);
    EXPECT_EQ(surface.point[1].x, 1.5);
    EXPECT_TRUE(surface.normal == model_.surfels.normal);
    EXPECT_EQ(surface.body, (std::vector<Index>{1, 1, 1, 1}));
  }
}

/// A source that counts requests.
class Counted : public FrameSource {
 public:
  using FrameSource::FrameSource;
  std::span<const double> values(Quantity quantity, Index begin, Index end) override {
    ++asked;
    longest = std::max(longest, end - begin);
    return FrameSource::values(quantity, begin, end);
  }
  int asked = 0;
  Index longest = 0;
};

TEST_F(Recording, FramesAreTheSameBytesWhateverTheLengthOfStretches) {
  for (const Precision precision : {Precision::single, Precision::double_}) {
    scene_.solver.precision = precision;
    const test::TwoBodiesFrame moment(model_, 3);
    const Frame frame = moment.frame();
    Recorder(model_, scene_, true).write(frame);
    const std::string phyxels = text_of(folder_ / "out" / "phyxels_000000.hdf");
    const std::string surface = text_of(folder_ / "out" / "surface_000000.hdf");
    for (const Index length : {1, 2, 3, 5}) {
      Counted values(model_, frame, length);
      Recorder(model_, scene_, true).write(frame.diagnostics, values);
      EXPECT_EQ(values.longest, length);
      EXPECT_TRUE(text_of(folder_ / "out" / "phyxels_000000.hdf") == phyxels) << length;
      EXPECT_TRUE(text_of(folder_ / "out" / "surface_000000.hdf") == surface) << length;
    }
  }
}

/// Imitates ranks that write arrays collectively through HDF5, which changes the layout.
class WrittenBeside : public FrameSource {
 public:
  using FrameSource::FrameSource;
  bool writes_collectively(Index) const override { return true; }
  void write_collectively(const fs::path& file, const FileArray& array) override {
    std::vector<double> sum;
    for (const Quantity term : array.terms) {
      const auto more = FrameSource::values(term, 0, array.count);
      sum.resize(more.size());
      for (std::size_t k = 0; k < sum.size(); ++k) sum[k] += more[k];
    }
    const hid_t opened = H5Fopen(file.c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
    const hid_t rows = H5Dopen2(opened, array.path.c_str(), H5P_DEFAULT);
    EXPECT_GE(H5Dwrite(rows, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, sum.data()), 0);
    H5Dclose(rows);
    EXPECT_GE(H5Fclose(opened), 0);
    ++written;
  }
  int written = 0;
};

TEST_F(Recording, FramesThatOthersWriteAreTheSameBytes) {
  const test::TwoBodiesFrame moment(model_, 3);
  const Frame frame = moment.frame();
  Recorder(model_, scene_, true).write(frame);
  const std::string phyxels = text_of(folder_ / "out" / "phyxels_000000.hdf");
  const std::string surface = text_of(folder_ / "out" / "surface_000000.hdf");
  WrittenBeside values(model_, frame, 2);
  Recorder(model_, scene_, true).write(frame.diagnostics, values);
  EXPECT_EQ(values.written, 9);  // points, six fields; points, normals
  EXPECT_TRUE(text_of(folder_ / "out" / "phyxels_000000.hdf") == phyxels);
  EXPECT_TRUE(text_of(folder_ / "out" / "surface_000000.hdf") == surface);
  const FrameData read = read_frame(folder_ / "out" / "phyxels_000000.hdf");
  EXPECT_EQ(read.point[4].x, model_.position[4].x + 1.5);
}

/// Limits the size of files of this process, as a full disk does.
class SmallDisk {
 public:
  explicit SmallDisk(rlim_t bytes) : handler_(signal(SIGXFSZ, SIG_IGN)) {
    getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit limit{bytes, before_.rlim_max};
    setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~SmallDisk() {
    setrlimit(RLIMIT_FSIZE, &before_);
    signal(SIGXFSZ, handler_);
  }

 private:
  rlimit before_{};
  void (*handler_)(int);
};

TEST_F(Recording, AFullDiskIsFoundBeforeAnyValueIsAskedFor) {
  const test::TwoBodiesFrame moment(model_, 0);
  const Frame frame = moment.frame();
  Counted values(model_, frame, 2);
  Recorder recorder(model_, scene_, false);
  recorder.write(frame);
  const std::string before = text_of(folder_ / "out" / "phyxels_000000.hdf");
  const auto expect_failure = [&](auto&& write, const char* file) {
    const SmallDisk disk(4000);
    try {
      write();
      ADD_FAILURE() << file << " fits?";
    } catch (const OutputError& error) {
      EXPECT_THAT(error.what(), HasSubstr(file));
      EXPECT_THAT(error.what(), HasSubstr("bytes could not be written"));
    }
  };
  expect_failure([&] { recorder.write(frame.diagnostics, values); }, "phyxels_000001.hdf");
  expect_failure([&] { write_checkpoint(folder_ / "out", moment.state, {}, 5, values); },
                 "checkpoint_000000000.h5");
  EXPECT_EQ(values.asked, 0);
  EXPECT_EQ(recorder.frames_written(), 1);
  EXPECT_EQ(text_of(folder_ / "out" / "phyxels_000000.hdf"), before);
  EXPECT_EQ(read_series(folder_ / "out" / "phyxels.hdf.series").size(), 1u);
  for (const auto& entry : fs::directory_iterator(folder_ / "out")) {
    EXPECT_NE(entry.path().extension(), ".tmp");
  }
}

TEST_F(Recording, TheLogHasOneLineAFrameAndUnitsInItsHeader) {
  Recorder recorder(model_, scene_, false);
  for (int k = 0; k < 3; ++k) record(recorder, k);
  std::istringstream log(text_of(folder_ / "out" / "energy.csv"));
  std::string line;
  std::getline(log, line);
  EXPECT_EQ(line.rfind("step,time [s],kinetic_energy [J],", 0), 0u) << line;
  const auto columns = std::count(line.begin(), line.end(), ',');
  for (int k = 0; k < 3; ++k) {
    ASSERT_TRUE(std::getline(log, line));
    EXPECT_EQ(std::count(line.begin(), line.end(), ','), columns);
    EXPECT_EQ(std::stod(line.substr(line.find(',') + 1)), 0.1 * k);
  }
  EXPECT_FALSE(std::getline(log, line));
}

TEST_F(Recording, ReactionsHaveOneLineAFrameAndSetAndAreCutBackToTheCheckpoint) {
  const fs::path file = folder_ / "out" / "reactions.csv";
  {
    Recorder none(model_, scene_, true);
    record(none, 0);
    EXPECT_FALSE(fs::exists(file));  // nothing is fixed or moved
  }
  model_.motions.resize(2);
  const auto record_with = [&](Recorder& recorder, int k) {
    Frame frame = test::TwoBodiesFrame(model_, k).frame();
    const test::TwoBodiesFrame data(model_, k);
    frame.state = &data.state;
    frame.surfels = &data.surfels;
    frame.readings.reactions = {{.body = "a, \"b\"", .set = "fixed 1", .force = {0.1 * k, 2, 3}},
                                {.body = "c",
                                 .set = "motion 1",
                                 .torque = {1, 2, 3},
                                 .work = std::numeric_limits<double>::quiet_NaN()}};
    recorder.write(frame);
  };
  {
    Recorder recorder(model_, scene_, true);
    for (int k = 0; k < 4; ++k) record_with(recorder, k);
  }
  const std::string log = text_of(file);
  std::istringstream lines(log);
  std::string line;
  std::getline(lines, line);
  EXPECT_EQ(line,
            "step,time [s],body,set,force_x [N],force_y [N],force_z [N],torque_x [N m],"
            "torque_y [N m],torque_z [N m],work [J],centre_x [m],centre_y [m],centre_z [m]");
  std::getline(lines, line);
  EXPECT_EQ(line, "0,0,\"a, \"\"b\"\"\",fixed 1,0,2,3,0,0,0,0,0,0,0");
  std::getline(lines, line);
  EXPECT_EQ(line, "0,0,c,motion 1,0,0,0,1,2,3,,0,0,0");  // work that is not known
  EXPECT_EQ(std::count(log.begin(), log.end(), '\n'), 1 + 4 * 2);

  Recorder resumed(model_, scene_, false, Continuation{2});
  const std::string kept = text_of(file);
  EXPECT_EQ(std::count(kept.begin(), kept.end(), '\n'), 1 + 2 * 2);
  for (int k = 2; k < 4; ++k) record_with(resumed, k);
  EXPECT_EQ(text_of(file), log);

  // A folder of an earlier version of the program has no reactions.
  fs::remove(file);
  Recorder again(model_, scene_, false, Continuation{3});
  record_with(again, 3);
  EXPECT_EQ(text_of(file), log.substr(0, log.find('\n') + 1) + log.substr(log.find("30,0.3")));

  const auto expect_refused = [&](const char* why) {
    try {
      Recorder(model_, scene_, false, Continuation{3});
      ADD_FAILURE() << "another file was taken for a log of reactions";
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr(why));
      EXPECT_THAT(error.what(), HasSubstr("another folder"));
    }
  };
  write("out/reactions.csv", log.substr(0, log.find("20,0.2")));
  expect_refused("reactions.csv: ends at t = 0.1 s, and energy.csv goes on to t = 0.2 s");
  write("out/reactions.csv", "step,force\n");
  expect_refused("reactions.csv: begins with \"step,force\"");
}

TEST_F(Recording, ResumingCutsBackToTheCheckpointAndGoesOnTheSame) {
  {
    Recorder recorder(model_, scene_, false);
    for (int k = 0; k < 5; ++k) record(recorder, k);
  }
  const std::string series = text_of(folder_ / "out" / "phyxels.hdf.series");
  const std::string log = text_of(folder_ / "out" / "energy.csv");
  const std::string last = text_of(folder_ / "out" / "surface_000004.hdf");
  Recorder resumed(model_, scene_, false, Continuation{2});
  EXPECT_EQ(resumed.frames_written(), 2);
  EXPECT_TRUE(fs::exists(folder_ / "out" / "phyxels_000001.hdf"));
  EXPECT_FALSE(fs::exists(folder_ / "out" / "phyxels_000002.hdf"));
  EXPECT_EQ(read_series(folder_ / "out" / "surface.hdf.series").size(), 2u);
  for (int k = 2; k < 5; ++k) record(resumed, k);
  EXPECT_EQ(text_of(folder_ / "out" / "phyxels.hdf.series"), series);
  EXPECT_EQ(text_of(folder_ / "out" / "energy.csv"), log);
  EXPECT_EQ(text_of(folder_ / "out" / "surface_000004.hdf"), last);
}

/// The number of a step falls where the step is doubled: times tell which frames were first.
TEST_F(Recording, ResumingCutsBackToTheTimeOfACheckpointAfterTheStepHasGrown) {
  const auto record_as = [&](Recorder& recorder, int k, std::int64_t step) {
    const test::TwoBodiesFrame data(model_, k);
    Frame frame = data.frame();
    frame.diagnostics.step = step;
    recorder.write(frame);
  };
  {
    Recorder recorder(model_, scene_, false);
    for (int k = 0; k < 3; ++k) record(recorder, k);
    record_as(recorder, 3, 15);
    record_as(recorder, 4, 20);
  }
  const std::string log = text_of(folder_ / "out" / "energy.csv");
  Recorder resumed(model_, scene_, false, Continuation{.frames = 4, .time = 0.1 * 3});
  EXPECT_EQ(resumed.frames_written(), 4);
  EXPECT_FALSE(fs::exists(folder_ / "out" / "phyxels_000004.hdf"));
  record_as(resumed, 4, 20);
  EXPECT_EQ(text_of(folder_ / "out" / "energy.csv"), log);
}

TEST_F(Recording, ResumingIntoAnotherFolderNumbersOn) {
  Recorder resumed(model_, scene_, false, Continuation{7});
  record(resumed, 7);
  EXPECT_TRUE(fs::exists(folder_ / "out" / "phyxels_000007.hdf"));
  EXPECT_EQ(read_series(folder_ / "out" / "phyxels.hdf.series").size(), 1u);
}

TEST_F(Recording, ATrajectoryThatIsThereIsKept) {
  {
    Recorder recorder(model_, scene_, false);
    record(recorder, 0);
  }
  const std::string before = text_of(folder_ / "out" / "phyxels_000000.hdf");
  EXPECT_THROW(Recorder(model_, scene_, false), InputError);
  EXPECT_THROW(Recorder(model_, scene_, false, Continuation{3}),
               InputError);  // the checkpoint has seen more
  EXPECT_EQ(text_of(folder_ / "out" / "phyxels_000000.hdf"), before);
  const std::string other = "notes";
  std::ofstream(folder_ / "out" / "notes.txt") << other;
  Recorder replaced(model_, scene_, true);
  EXPECT_FALSE(fs::exists(folder_ / "out" / "phyxels_000000.hdf"));
  EXPECT_EQ(text_of(folder_ / "out" / "notes.txt"), other);  // not ours
}

TEST_F(Recording, ADiskWithoutRoomIsRefusedBeforehand) {
  scene_.time.end = 1e9;
  scene_.output.frames_per_second = 1e6;
  try {
    Recorder recorder(model_, scene_, false);
    FAIL() << "10^15 frames fit on the disk?";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("frames_per_second"));
    EXPECT_THAT(error.what(), HasSubstr("free"));
  }
}

TEST_F(Recording, OnlyWhatTheSceneAsksForIsWritten) {
  scene_.output.surface = false;
  scene_.output.fields = {};
  Recorder recorder(model_, scene_, false);
  record(recorder, 0);
  EXPECT_FALSE(fs::exists(folder_ / "out" / "surface_000000.hdf"));
  EXPECT_FALSE(fs::exists(folder_ / "out" / "surface.hdf.series"));
  EXPECT_EQ(recorder.files().size(), 2u);
}

TEST_F(Recording, SeriesThatAreNoneAreRefused) {
  for (const char* text :
       {"", "{", "[]", "{}", "{\"files\":1}", "{\"files\":[1]}",
        "{\"files\":[{\"name\":1,\"time\":0}]}", "{\"files\":[{\"name\":\"a\"}]}",
        "{\"files\":[{\"name\":\"a\",\"time\":\"0\"}]}",
        "{\"files\":[{\"name\":\"a\",\"time\":1e999}]}"}) {
    EXPECT_THROW(read_series(write("x.hdf.series", text)), InputError) << text;
  }
  EXPECT_THROW(read_series(write("deep.hdf.series", std::string(1000000, '['))), InputError);
  EXPECT_THROW(read_series(folder_ / "missing"), InputError);
  EXPECT_THROW(read_frame(write("x.hdf", "no frame")), InputError);
}

/// Independent readers: VTK and h5py, in Debian's Python or the one that the environment names.
int read_back(const fs::path& folder, const std::string& what, double far) {
  const char* named = std::getenv("PHYXEL_PYTHON");
  const std::string python = named ? named : "/usr/bin/python3";
  const std::string command = python + " '" PHYXEL_SOURCE_DIR "/tests/read_back.py' " + what +
                              " '" + folder.string() + "' " + std::to_string(far);
  const int status = std::system(command.c_str());
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}
constexpr int no_reader = 77;

TEST_F(Recording, VtkAndH5pyReadTheSameNumbers) {
  for (const Precision precision : {Precision::single, Precision::double_}) {
    scene_.solver.precision = precision;
    Recorder recorder(model_, scene_, true);
    for (int k = 0; k < 3; ++k) record(recorder, k);
    const int code = read_back(folder_ / "out", "frames", 0);
    PHYXEL_NEEDS_TOOL(code != no_reader, "python3-vtk9 or python3-h5py");
    EXPECT_EQ(code, 0);
  }
}

/// Floats have a spacing of a metre ten thousand kilometres from the origin: a run in float writes
/// doubles there, which VTK and h5py read, and the single file keeps them.
TEST_F(Recording, FramesFarFromTheOriginTellAllPointsApart) {
  constexpr double far = 1e7;
  for (Vec3d& x : model_.position) x.x += far;
  for (Vec3d& x : model_.surfels.position) x.x += far;
  for (Part& part : model_.parts) {
    part.farthest = far + 5;
    part.volume = part.size = part.surfels = 1;
  }
  {
    Recorder recorder(model_, scene_, false);
    for (int k = 0; k < 3; ++k) record(recorder, k);
  }
  for (const char* family : {"phyxels", "surface"}) {
    const fs::path series = folder_ / "out" / (std::string(family) + ".hdf.series");
    const FrameData frame = read_frame(read_series(series)[1].file);
    EXPECT_EQ(frame.point[1].x, far + 1.5) << family;
    export_single(series, folder_ / "out" / (std::string(family) + ".vtkhdf"), false);
  }
  for (const char* what : {"frames", "single"}) {
    const int code = read_back(folder_ / "out", what, far);
    PHYXEL_NEEDS_TOOL(code != no_reader, "python3-vtk9 or python3-h5py");
    EXPECT_EQ(code, 0) << what;
  }
}

TEST_F(Recording, TheSingleFileHoldsEveryStep) {
  {
    Recorder recorder(model_, scene_, false);
    for (int k = 0; k < 3; ++k) record(recorder, k);
  }
  for (const char* family : {"phyxels", "surface"}) {
    const fs::path out = folder_ / "out" / (std::string(family) + ".vtkhdf");
    export_single(folder_ / "out" / (std::string(family) + ".hdf.series"), out, false);
    EXPECT_THROW(export_single(folder_ / "out" / (std::string(family) + ".hdf.series"), out, false),
                 InputError);
    EXPECT_FALSE(fs::exists(out.string() + ".tmp"));
    // Cells stay where they are: each step has an offset of 0 for each of its two kinds of them.
    const Hdf5Reader in(out);
    const std::string steps = "/VTKHDF/Steps/";
    EXPECT_EQ(in.array<std::int64_t>(steps + "PartOffsets"), (std::vector<std::int64_t>{0, 0, 0}));
    EXPECT_EQ(in.array<std::int64_t>(steps + "NumberOfParts"),
              (std::vector<std::int64_t>{1, 1, 1}));
    for (const char* name : {"CellOffsets", "ConnectivityIdOffsets"}) {
      EXPECT_EQ(in.array<std::int64_t>(steps + name, 1), (std::vector<std::int64_t>{0, 0, 0}));
    }
    const auto points = static_cast<std::int64_t>(in.shape("/VTKHDF/Points").rows / 3);
    EXPECT_EQ(in.array<std::int64_t>(steps + "PointOffsets"),
              (std::vector<std::int64_t>{0, points, 2 * points}));
  }
  const int code = read_back(folder_ / "out", "single", 0);
  PHYXEL_NEEDS_TOOL(code != no_reader, "python3-vtk9 or python3-h5py");
  EXPECT_EQ(code, 0);
}

/// Frames of a surface that cracks open have triangles of their own, and so have the steps of the
/// single file: each is a part of it.
TEST_F(Recording, TheSingleFileHoldsTheTrianglesOfEveryStep) {
  const std::vector<Triangle> all = model_.surfels.triangle;
  const std::vector<std::vector<Triangle>> of_frames{all, {all[1], all[3]}, {}, {all[3]}};
  {
    Recorder recorder(model_, scene_, false);
    for (int k = 0; k < 4; ++k) {
      const test::TwoBodiesFrame made(model_, k);
      Frame frame = made.frame();
      if (k > 0) frame.triangles = &of_frames[static_cast<std::size_t>(k)];
      recorder.write(frame);
    }
  }
  const fs::path series = folder_ / "out" / "surface.hdf.series", out = folder_ / "surface.vtkhdf";
  export_single(series, out, false);
  const Hdf5Reader in(out);
  const auto numbers = [&](const char* name) {
    return in.array<std::int64_t>(std::string("/VTKHDF/") + name);
  };
  using Numbers = std::vector<std::int64_t>;
  EXPECT_EQ(numbers("NumberOfPoints"), Numbers(4, 4));
  EXPECT_EQ(numbers("NumberOfCells"), (Numbers{4, 2, 0, 1}));
  EXPECT_EQ(numbers("NumberOfConnectivityIds"), (Numbers{12, 6, 0, 3}));
  EXPECT_EQ(numbers("Offsets"), (Numbers{0, 3, 6, 9, 12, 0, 3, 6, 0, 0, 3}));
  EXPECT_EQ(numbers("Steps/PartOffsets"), (Numbers{0, 1, 2, 3}));
  EXPECT_EQ(in.array<std::int64_t>("/VTKHDF/Steps/CellOffsets", 1), (Numbers{0, 4, 6, 6}));
  EXPECT_EQ(in.array<std::int64_t>("/VTKHDF/Steps/ConnectivityIdOffsets", 1),
            (Numbers{0, 12, 18, 18}));
  EXPECT_EQ(in.array<std::uint8_t>("/VTKHDF/Types"), std::vector<std::uint8_t>(7, 5));
  Numbers corners;
  for (std::size_t k = 0; k < 4; ++k) {
    EXPECT_EQ(read_frame(read_series(series)[k].file).triangle, of_frames[k]);
    for (const Triangle& t : of_frames[k]) corners.insert(corners.end(), t.begin(), t.end());
  }
  EXPECT_EQ(numbers("Connectivity"), corners);
}

}  // namespace
}  // namespace phyxel
