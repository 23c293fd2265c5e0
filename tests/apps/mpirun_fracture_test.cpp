/// Bodies that break on several ranks under mpirun, and after a restart.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "device.hpp"
#include "mpirun.hpp"
#include "phyxel/checkpoint.hpp"
#include "phyxel/recorder.hpp"
#include "support/csv_column.hpp"

namespace phyxel {
namespace {

namespace fs = std::filesystem;
using test::Outcome;

/// A plate with a notch, pulled apart until it breaks; its critical stretches scatter.
constexpr const char* plate =
    "[time]\nend = 0.04\n[solver]\nprecision = '{precision}'\ndevice = 'cpu'\n"
    "[output]\nframes_per_second = 250\nfields = ['displacement', 'velocity', 'broken', "
    "'fragment']\n"
    "[[body]]\nshape = 'block'\nsize = [0.8, 0.6, 0.12]\nspacing = 0.04\nlattice = 'cells'\n"
    "[body.material]\nyoung = 1e6\npoisson = 0.25\ndensity = 1000\n"
    "[body.fracture]\nenergy_release_rate = 50\nscatter = 20\nseed = 3\n"
    "[[body.notch]]\ncentre = [-0.4, 0.001, 0]\nnormal = [0, 1, 0]\nradius = 0.3\n"
    "[[body.motion]]\nregion = 'y+'\nvelocity = [0, 1, 0]\n"
    "[[body.motion]]\nregion = 'y-'\nvelocity = [0, -1, 0]\n";

class BreakingPlate : public Mpirun {
 protected:
  void write_plate(const std::string& precision) const {
    std::string text = plate;
    const std::string mark = "{precision}";
    text.replace(text.find(mark), mark.size(), precision);
    write("scene.toml", text);
  }
  /// Removes all checkpoints of a run but the last, since a run that stopped has others.
  void keep_last_checkpoint(const std::string& out) const {
    const std::optional<fs::path> last = latest_checkpoint(folder_ / out);
    ASSERT_TRUE(last);
    std::vector<fs::path> others;
    for (const auto& entry : fs::directory_iterator(folder_ / out)) {
      const bool is_checkpoint = entry.path().filename().string().starts_with("checkpoint_");
      if (is_checkpoint && entry.path() != *last) others.push_back(entry.path());
    }
    for (const fs::path& other : others) fs::remove(other);
  }
  /// The last value of a column of energy.csv.
  double last_energy(const std::string& folder, const std::string& column) const {
    return test::csv_column(test::text_of(folder_ / folder / "energy.csv"), column).back();
  }
};

TEST_F(BreakingPlate, BreaksTheSameOnAllRanksAndThreads) {
  for (const std::string precision : {"float", "double"}) {
    write_plate(precision);
    const Outcome alone = run_on(0, {"run", "scene.toml", "--out", "alone", "--force"});
    ASSERT_EQ(alone.code, 0) << alone.err;
    // The notch leaves 0.5 m by 0.12 m, of which a good part has broken by the end.
    EXPECT_GT(last_energy("alone", "fracture_energy"), 0.1 * 50 * 0.5 * 0.12);
    // The surface opens, and the table of fragments is among the files that are compared.
    const std::vector<SeriesEntry> frames = read_series(folder_ / "alone" / "surface.hdf.series");
    EXPECT_LT(read_frame(frames.back().file).triangle.size(),
              read_frame(frames.front().file).triangle.size());
    EXPECT_THAT(test::csv_column(test::text_of(folder_ / "alone" / "fragments.csv"), "mass"),
                ::testing::Each(::testing::Gt(0)));
    for (const int ranks : {2, 3}) {
      const std::string name = std::to_string(ranks);
      const Outcome outcome = run_on(ranks, {"run", "scene.toml", "--out", name, "--force"});
      ASSERT_EQ(outcome.code, 0) << outcome.err;
      expect_same_files("alone", name);
    }
  }
}

/// Ranks share a GPU, if there is one alone; each transport brings the displacements of ghosts to
/// the look at pairs after each step.
TEST_F(BreakingPlate, BreaksTheSameOnGpusOfAnyNumberOfRanks) {
  if (cuda_devices().empty()) GTEST_SKIP() << "no CUDA device";
  for (const std::string precision : {"float", "double"}) {
    write_plate(precision);
    const auto on = [&](int ranks, const std::string& out, std::vector<std::string> more) {
      std::vector<std::string> words{"run", "scene.toml", "--device", "cuda", "--out", out};
      words.insert(words.end(), more.begin(), more.end());
      return run_on(ranks, words);
    };
    const Outcome alone = on(0, "alone", {"--force"});
    ASSERT_EQ(alone.code, 0) << alone.err;
    EXPECT_GT(last_energy("alone", "fracture_energy"), 0.1 * 50 * 0.5 * 0.12);
    keep_last_checkpoint("alone");
    for (const std::string transport : {"direct", "host"}) {
      const Outcome outcome = on(2, transport, {"--force", "--transport", transport});
      ASSERT_EQ(outcome.code, 0) << outcome.err;
      keep_last_checkpoint(transport);
      expect_same_files("alone", transport);
    }
    // The crack runs at this time.
    ASSERT_EQ(on(2, "resumed", {"--force", "--until", "0.028"}).code, 0);
    const Outcome resumed = on(0, "resumed", {"--resume", "auto"});
    ASSERT_EQ(resumed.code, 0) << resumed.err;
    keep_last_checkpoint("resumed");
    expect_same_files("alone", "resumed");
  }
}

TEST_F(BreakingPlate, ContinuesWithTheSameBits) {
  write_plate("float");
  ASSERT_EQ(run_on(0, {"run", "scene.toml", "--out", "alone"}).code, 0);
  keep_last_checkpoint("alone");
  for (const int ranks : {0, 2}) {
    const std::string out = "resumed" + std::to_string(ranks);
    // The crack runs at this time.
    const Outcome begun = run_on(ranks, {"run", "scene.toml", "--out", out, "--until", "0.028"});
    ASSERT_EQ(begun.code, 0) << begun.err;
    EXPECT_GT(last_energy(out, "fracture_energy"), 0);
    const Outcome resumed = run_on(ranks, {"run", "scene.toml", "--out", out, "--resume", "auto"});
    ASSERT_EQ(resumed.code, 0) << resumed.err;
    keep_last_checkpoint(out);
    expect_same_files("alone", out);
  }
}

}  // namespace
}  // namespace phyxel
