/// Checkpoints that earlier versions wrote, and later ones will.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "files/hdf5_file.hpp"
#include "files/looks_group.hpp"
#include "files/sealed_file.hpp"
#include "phyxel/checkpoint.hpp"
#include "phyxel/error.hpp"
#include "support/folder.hpp"

namespace phyxel {
namespace {

using ::testing::HasSubstr;

class CheckpointVersions : public test::Folder {
 protected:
  /// A checkpoint as version 2 wrote it, one phyxel; or with another number, or with parameters.
  std::filesystem::path written(std::int64_t version, const std::string& parameters = "",
                                const Looks& looks = {}, double peak_energy = 4.5,
                                bool doubles = true) const {
    Hdf5Writer out;
    out.group("/phyxel");
    out.attribute("/phyxel", "version", version);
    out.attribute("/phyxel", "program", std::string("phyxel 0"));
    out.attribute("/phyxel", "precision", std::string("double"));
    out.attribute("/phyxel", "method", std::string("verlet"));
    out.attribute("/phyxel", "model_digest", std::string("00000000000000ff"));
    out.attribute("/phyxel", "total_energy", 1.5);
    out.attribute("/phyxel", "initial_energy", 2.5);
    out.attribute("/phyxel", "frames_written", std::int64_t{3});
    out.text("/phyxel/scene", "title = \"x\"");
    out.text("/phyxel/parameters", parameters);
    out.group("/state");
    out.attribute("/state", "step", std::int64_t{7});
    out.attribute("/state", "time", 0.7);
    out.attribute("/state", "dt", 0.1);
    if (version > 2) {
      out.attribute("/phyxel", "initial_speed", 3.5);
      out.attribute("/phyxel", "peak_energy", peak_energy);
      if (doubles) {
        write_looks(out, looks);
      } else {
        write_looks_without_doublings(out, looks);
      }
    }
    const std::vector<Vec3d> values{{1, 2, 3}};
    out.vectors("/state/displacement", values, false);
    out.vectors("/state/velocity", values, false);
    std::filesystem::path file = folder_ / "checkpoint_000000007.h5";
    write_sealed(file, "checkpoint", out.content(), Durable::yes);
    return file;
  }
  static void write_looks_without_doublings(Hdf5Writer& out, const Looks& looks) {
    const std::string group = "/state/looks";
    out.group(group);
    out.attribute(group, "next", looks.next);
    out.attribute(group, "last", looks.last);
    out.attribute(group, "ratio", looks.ratio);
    out.attribute(group, "change", looks.change);
    out.attribute(group, "measured", looks.measured);
    out.attribute(group, "measured_ratio", looks.measured_ratio);
    out.attribute(group, "measured_share", looks.measured_share);
    out.attribute(group, "apart", looks.apart);
  }
  static std::string refusal_of(const std::filesystem::path& file) {
    try {
      read_checkpoint(file);
    } catch (const InputError& error) {
      return error.what();
    }
    return "read";
  }
};

TEST_F(CheckpointVersions, TwoIsReadWithoutParameters) {
  const Checkpoint old = read_checkpoint(written(2));
  EXPECT_EQ(old.info.version, 2);
  EXPECT_TRUE(old.info.parameters.empty());
  EXPECT_EQ(old.info.model_digest, 0xffu);
  EXPECT_EQ(old.info.watched.start_energy, 2.5);
  EXPECT_TRUE(std::isnan(old.info.watched.start_speed));  // which it does not tell
  EXPECT_EQ(old.state.step, 7);
  EXPECT_EQ(old.state.displacement.at(0).y, 2);
}

TEST_F(CheckpointVersions, OthersAreRefusedByNumber) {
  EXPECT_THAT(refusal_of(written(1)),
              HasSubstr("format version 1; this program reads versions 2 to 4"));
  EXPECT_THAT(refusal_of(written(5)), HasSubstr("format version 5"));
}

TEST_F(CheckpointVersions, LooksThatNoRunTookAreRefused) {
  EXPECT_TRUE(read_checkpoint(written(2)).state.looks == Looks{});
  EXPECT_TRUE(read_checkpoint(written(3)).state.looks == Looks{});
  const double nan = std::nan("");
  for (const Looks& wrong :
       {Looks{.next = -1}, Looks{.last = -2}, Looks{.ratio = nan}, Looks{.change = nan},
        Looks{.measured = -5}, Looks{.apart = -1}, Looks{.measured_ratio = 0},
        Looks{.measured_share = -1}, Looks{.measured_share = nan}, Looks{.too_long = -2},
        Looks{.doublings = -1}}) {
    EXPECT_THAT(refusal_of(written(3, "", wrong)), HasSubstr("/state/looks"));
  }
}

/// Files of the time before steps were doubled have eight numbers of looks, not ten.
TEST_F(CheckpointVersions, LooksWithoutDoublingsAreRead) {
  const Looks looks{.next = 9, .last = 8, .ratio = 1.5, .measured = 7, .apart = 32};
  EXPECT_TRUE(read_checkpoint(written(3, "", looks, 4.5, false)).state.looks == looks);
  const Looks doubled{.next = 9, .last = 8, .apart = 32, .too_long = 6, .doublings = 3};
  EXPECT_TRUE(read_checkpoint(written(3, "", doubled)).state.looks == doubled);
}

TEST_F(CheckpointVersions, WhatIsWatchedIsReadAndRefusedIfNoRunHadIt) {
  const Watched expected{2.5, 3.5, 4.5};
  EXPECT_TRUE(read_checkpoint(written(3)).info.watched == expected);
  for (const double wrong : {-1.0, std::nan("")}) {
    EXPECT_THAT(refusal_of(written(3, "", {}, wrong)), HasSubstr("peak_energy"));
  }
}

TEST_F(CheckpointVersions, ParametersAreNamesAndValues) {
  const Checkpoint now = read_checkpoint(written(3, "a\t1\nb c\t\n"));
  const std::vector<Parameter> expected{{"a", "1"}, {"b c", ""}};
  EXPECT_EQ(now.info.parameters, expected);
  for (const char* broken : {"a", "a\t1", "a\n", "a\t1\nb\n"}) {
    EXPECT_THAT(refusal_of(written(3, broken)), HasSubstr("/phyxel/parameters")) << broken;
  }
}

}  // namespace
}  // namespace phyxel
