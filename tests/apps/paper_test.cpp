/// `phyxel paper` on the CPU; docs/results has its measurements on a GPU.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

#include "csv.hpp"
#include "phyxel/error.hpp"
#include "plot.hpp"
#include "support/program.hpp"
#include "support/skips.hpp"

namespace phyxel::app {
namespace {

namespace fs = std::filesystem;
using test::Outcome;
using test::text_of;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

class Paper : public test::Program {
 protected:
  /// Options for short measurements, since speed is not tested.
  Outcome paper(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), {"paper", "--repeat", "1", "--seconds", "0.001"});
    return run(arguments);
  }
};

TEST_F(Paper, WithoutAGpuMeasuresTheCpuAndSaysWhatItLeftOut) {
  const Outcome outcome = paper({"--device", "cpu", "--body", "horn_bug,alien_head", "--figure",
                                 "2,4,5", "--table", "memory", "--objects", "3", "--out", "p"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out,
              AllOf(HasSubstr("left out, for --device cpu"), HasSubstr("figure 2 (GPU"),
                    HasSubstr("the GPU's part of figures 4, 5 and 6"), HasSubstr("table memory")));
  const CsvTable frames = read_csv(folder_ / "p" / "frames.csv");
  EXPECT_THAT(frames.values("body"), ElementsAre("horn_bug", "alien_head"));
  EXPECT_THAT(frames.values("program"), ElementsAre("sequential of 2008", "phyxel CPU"));
  for (const char* program : {"sequential of 2008", "phyxel CPU"}) {
    for (const char* surfels : {"no", "yes"}) {
      EXPECT_THAT(frames.values("objects", {{"program", program}, {"with_surfels", surfels}}),
                  ElementsAre("1", "2", "3"));
    }
  }
  // The counts of section 6.
  EXPECT_THAT(frames.values("phyxels", {{"body", "horn_bug"}}), ElementsAre("666"));
  EXPECT_THAT(frames.values("surfels", {{"body", "alien_head"}}), ElementsAre("16000"));
  for (const char* fact : {"program", "hardware", "compiler", "date", "gpu"}) {
    EXPECT_NE(frames.fact(fact), "") << fact;
  }
  for (std::size_t r = 0; r < frames.rows.size(); ++r) {
    // Both are printed with five digits.
    EXPECT_NEAR(frames.number(r, "frames_per_s") * frames.number(r, "ms_per_frame"), 1000, 0.1);
  }
  EXPECT_FALSE(fs::exists(folder_ / "p" / "memory.csv"));
  EXPECT_EQ(fs::exists(folder_ / "p" / "figure4.svg"), can_plot());
  EXPECT_FALSE(fs::exists(folder_ / "p" / "figure2.svg"));
  if (can_plot()) {
    EXPECT_THAT(text_of(folder_ / "p" / "figure4.svg"), HasSubstr("real time, 30 frames/s"));
  }
  const std::string page = text_of(folder_ / "p" / "paper.md");
  EXPECT_THAT(page, AllOf(HasSubstr("No GPU was measured"), HasSubstr("sequential of 2008")));
}

/// A table as measured on a GPU.
TEST_F(Paper, RealTimeIsCountedInObjectsAndDrawn) {
  CsvTable frames{{{"repeats", "1"}},
                  {"body", "phyxels", "surfels", "program", "cores", "threads", "objects",
                   "with_surfels", "frames", "frames_per_s", "ms_per_frame", "spread", "step_s"},
                  {}};
  const auto add = [&](const char* program, const char* cores, int objects, const char* rate) {
    frames.rows.push_back({"dino", "575", "53504", program, cores, cores, std::to_string(objects),
                           "yes", "shown", rate, "1", "0", "0.002"});
  };
  add("kernels of 2008", "0", 1, "2000");
  add("kernels of 2008", "0", 2, "501");
  add("kernels of 2008", "0", 3, "300");
  add("sequential of 2008", "1", 1, "31");
  add("sequential of 2008", "1", 2, "29");
  write("p/frames.csv", csv_text(frames));
  const Outcome outcome = run({"paper", "--redraw", "--out", "p"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  // Video's 30 frames a second; 500 steps of 2 ms in a second of motion.
  EXPECT_THAT(text_of(folder_ / "p" / "paper.md"),
              AllOf(HasSubstr("| dino | yes | kernels of 2008 | GPU | all 3 | 500 | 2 |"),
                    HasSubstr("| dino | yes | sequential of 2008 | 1 | 1 | 500 | 0 |")));
  if (!can_plot()) return;
  for (const char* figure : {"figure3.svg", "figure5.svg"}) {
    EXPECT_THAT(text_of(folder_ / "p" / figure), HasSubstr("real time, 30 frames/s")) << figure;
  }
  EXPECT_THAT(text_of(folder_ / "p" / "figure3.svg"),
              HasSubstr("dino, steps in a second of motion"));
  EXPECT_THAT(text_of(folder_ / "p" / "speedups.svg"), HasSubstr("the paper prints"));
}

TEST_F(Paper, BothEndsOfYoungsModulusKeepToTheWaveSpeed) {
  const Outcome outcome =
      paper({"--device", "cpu", "--body", "alien_head", "--table", "young", "--out", "p"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const CsvTable young = read_csv(folder_ / "p" / "young.csv");
  const auto of = [&](const char* modulus, const char* column) {
    return young.number(young.find({{"young_pa", modulus}, {"precision", "double"}}).value(),
                        column);
  };
  // Waves travel with √(E/ρ), a tenth as fast in the soft one; steps are printed with four digits.
  EXPECT_NEAR(of("10000", "step_s") / of("1e+06", "step_s"), 10, 0.01);
  EXPECT_GT(of("10000", "largest_displacement_m"), of("1e+06", "largest_displacement_m"));
  for (std::size_t r = 0; r < young.rows.size(); ++r) {
    // Roundings of a thousand steps or fewer, which grow as they are added up.
    const double epsilon = young.text(r, "precision") == "float" ? 1.2e-7 : 2.3e-16;
    EXPECT_LT(young.number(r, "relative_error"), 1e4 * epsilon);
    EXPECT_GT(young.number(r, "relative_error"), 0);
  }
  EXPECT_THAT(text_of(folder_ / "p" / "paper.md"), HasSubstr("## Both ends of Young's modulus"));
}

TEST_F(Paper, ForcesSummedBeforeTheyAreSentAreFewerBytesAndOtherBits) {
  const Outcome outcome =
      paper({"--device", "cpu", "--body", "alien_head", "--table", "exchange", "--out", "p"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const CsvTable sent = read_csv(folder_ / "p" / "exchange.csv");
  EXPECT_THAT(sent.values("partitioner"), ElementsAre("metis", "curve", "bisection"));
  EXPECT_EQ(sent.rows.size(), 18U);  // two bodies, three numbers of parts
  for (std::size_t r = 0; r < sent.rows.size(); ++r) {
    const double stresses = sent.number(r, "pair_stress_bytes");
    EXPECT_EQ(stresses, 48 * sent.number(r, "ghosts"));  // twelve floats
    EXPECT_LT(stresses, sent.number(r, "pair_force_bytes"));
    EXPECT_LT(sent.number(r, "summed_force_bytes"), stresses);
    // Sums of float in another order; only phyxels that are pushed from elsewhere can differ.
    EXPECT_GT(sent.number(r, "summed_other_bits"), 0);
    EXPECT_LT(sent.number(r, "summed_other_bits"), sent.number(r, "phyxels"));
    // The same sum but for roundings of some 64 terms, none larger than a few of the largest sum.
    EXPECT_LT(sent.number(r, "summed_difference"), 64 * 1.2e-7);
  }
}

TEST_F(Paper, KernelErrorsOfTheSequentialProgramAreThoseOfItsPrecision) {
  const Outcome outcome =
      paper({"--device", "cpu", "--body", "horn_bug", "--table", "kernels", "--out", "p"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const CsvTable kernels = read_csv(folder_ / "p" / "kernels.csv");
  EXPECT_THAT(kernels.values("kernel"),
              ::testing::IsSupersetOf({"precalcImutableValues", "calcStrainStressA",
                                       "calcStrainStressB", "integrate", "updateSurfels"}));
  for (std::size_t r = 0; r < kernels.rows.size(); ++r) {
    // Sums of some 30 neighbours and inverses of condition 10: a hundred roundings at most.
    const double epsilon = kernels.text(r, "precision") == "float" ? 1.2e-7 : 2.3e-16;
    const double error = kernels.number(r, "relative_error");
    EXPECT_LT(error, 100 * epsilon) << kernels.text(r, "quantity");
    EXPECT_GT(error, 0) << kernels.text(r, "quantity");
  }
}

TEST_F(Paper, RedrawsFromTheTablesAlone) {
  ASSERT_EQ(paper({"--device", "cpu", "--body", "horn_bug", "--figure", "4", "--objects", "1",
                   "--out", "p"})
                .code,
            0);
  fs::create_directory(folder_ / "q");
  fs::copy_file(folder_ / "p" / "frames.csv", folder_ / "q" / "frames.csv");
  const Outcome outcome = run({"paper", "--redraw", "--out", "q"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const std::string page = text_of(folder_ / "p" / "paper.md");
  EXPECT_EQ(text_of(folder_ / "q" / "paper.md"), page);
  EXPECT_EQ(text_of(folder_ / "q" / "frames.csv"), text_of(folder_ / "p" / "frames.csv"));
  // A table that a script writes beside the program's own.
  fs::copy_file(fs::path(PHYXEL_SOURCE_DIR) / "docs/results/paper/machine_code.csv",
                folder_ / "q" / "machine_code.csv");
  ASSERT_EQ(run({"paper", "--redraw", "--out", "q"}).code, 0);
  EXPECT_THAT(text_of(folder_ / "q" / "paper.md"),
              AllOf(::testing::StartsWith(page), HasSubstr("| `with_mul24` |  | 1 | 0 | 0 | 1 |")));
}

TEST_F(Paper, RefusesToOverwriteAndChangesNothing) {
  write("p/frames.csv", "a measurement of last week");
  const Outcome outcome = paper({"--device", "cpu", "--figure", "4", "--out", "p"});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("p/frames.csv: exists"), HasSubstr("--force")));
  EXPECT_EQ(text_of(folder_ / "p" / "frames.csv"), "a measurement of last week");
  EXPECT_FALSE(fs::exists(folder_ / "p" / "paper.md"));
}

TEST_F(Paper, WrongOptionsNameWhatIsAllowed) {
  const struct {
    std::vector<std::string> arguments;
    const char* message;
  } cases[] = {
      {{"--table", "kernel"}, "--table kernel: unknown (did you mean \"kernels\"?)"},
      {{"--body", "dyno"}, "body \"dyno\": not one of the paper's (did you mean \"dino\"?)"},
      {{"--device", "gpu"}, "--device gpu: unknown device"},
      {{"--device", "cuda:x"}, "allowed: auto, cpu, cuda, cuda:0"},
      {{"--figure", "7"}, "--figure"},
      {{"--repeat", "0"}, "--repeat"},
      {{"--redraw", "--out", "nothing"}, "nothing: has none of the tables"},
  };
  for (const auto& c : cases) {
    const Outcome outcome = run([&] {
      std::vector<std::string> arguments{"paper"};
      arguments.insert(arguments.end(), c.arguments.begin(), c.arguments.end());
      return arguments;
    }());
    EXPECT_EQ(outcome.code, 2) << c.message;
    EXPECT_THAT(outcome.err, HasSubstr(c.message));
    EXPECT_FALSE(fs::exists(folder_ / "out"));
  }
}

/// The test passes with and without GPUs, and in builds with and without CUDA.
TEST_F(Paper, AGpuThatIsNotThereIsExitCode4) {
  environment_ = {{"CUDA_VISIBLE_DEVICES", ""}};
  const Outcome outcome = paper({"--device", "cuda", "--figure", "4"});
  EXPECT_EQ(outcome.code, 4) << outcome.out;
  EXPECT_THAT(outcome.err, HasSubstr("CPU"));
  EXPECT_FALSE(fs::exists(folder_ / "out"));
  const Outcome automatic = paper({"--body", "horn_bug", "--figure", "2"});
  EXPECT_EQ(automatic.code, 0) << automatic.err;
  EXPECT_THAT(automatic.out, HasSubstr("left out"));
}

TEST_F(Paper, Figure1ShowsABodyAsMadeAndHungWithThreeModuli) {
  const std::vector<std::string> arguments{"--device", "cpu", "--body", "alien_head",
                                           "--figure", "1",   "--out",  "p"};
  const Outcome outcome = paper(arguments);
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  for (const char* pose : {"_rest", "", "_soft", "_stiff"}) {
    const std::string file = "figure1_alien_head" + std::string(pose) + ".png";
    EXPECT_GT(fs::file_size(folder_ / "p" / file), 10000u) << file;  // an empty one takes 2 kB
  }
  const Outcome again = paper(arguments);
  EXPECT_EQ(again.code, 2);
  EXPECT_THAT(again.err, HasSubstr("figure1_alien_head_rest.png: exists"));
}

class Tables : public test::Folder {};

TEST_F(Tables, ComeBackAsWritten) {
  const CsvTable table{{{"hardware", "a: b, c"}, {"date", "2008-10-29"}},
                       {"n", "answer"},
                       {{"1", "yes"}, {"2.5e-3", ""}}};
  write_csv(folder_ / "t.csv", table);
  const CsvTable back = read_csv(folder_ / "t.csv");
  EXPECT_EQ(back.facts, table.facts);
  EXPECT_EQ(back.columns, table.columns);
  EXPECT_EQ(back.rows, table.rows);
  EXPECT_EQ(back.number(1, "n"), 2.5e-3);
  EXPECT_EQ(back.find({{"answer", ""}}), 1u);
  EXPECT_EQ(back.find({{"answer", "no"}}), std::nullopt);
}

TEST_F(Tables, CommasInACellDoNotMakeCells) {
  write_csv(folder_ / "t.csv", {{}, {"answer"}, {{"no, 3 GB\nare free"}}});
  EXPECT_EQ(read_csv(folder_ / "t.csv").text(0, "answer"), "no; 3 GB are free");
}

TEST_F(Tables, DamageIsNamedWithItsLine) {
  write("t.csv", "# date: today\na,b\n1,2\n3\n");
  try {
    read_csv(folder_ / "t.csv");
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("t.csv:4"), HasSubstr("1 cells under 2 columns")));
  }
  const CsvTable table{{}, {"a"}, {{"x"}}};
  EXPECT_THROW(table.number(0, "a"), InputError);
  EXPECT_THROW(table.text(0, "b"), InputError);
}

TEST(Median, OfAnyOrder) {
  EXPECT_EQ(median_of({3, 1, 2}).value, 2);
  EXPECT_EQ(median_of({3, 1, 2}).spread, 1);
  EXPECT_EQ(median_of({5}).spread, 0);
  EXPECT_EQ(median_of({4, 1, 3, 2}).value, 2.5);
}

class Charts : public test::Folder {};

TEST_F(Charts, AreDrawnWithTheirLabels) {
  PHYXEL_NEEDS_TOOL(can_plot(), "gnuplot");
  const LineChart lines{"It's a \"title\"",
                        "x",
                        "frames_per_s",
                        false,
                        true,
                        {{"horn_bug", {1, 2, 3}, {10, 100, 1000}}}};
  draw_svg(script_of(lines), folder_ / "it's.svg");
  const std::string svg = text_of(folder_ / "it's.svg");
  EXPECT_THAT(svg, AllOf(HasSubstr("<svg"), HasSubstr("horn_bug"), HasSubstr("frames_per_s")));
  BarChart bars{"bars", "y", true, {"group_a", "b"}, {{"s", {1, 20}}}};
  draw_svg(script_of(bars), folder_ / "bars.svg");
  EXPECT_THAT(text_of(folder_ / "bars.svg"), HasSubstr("group_a"));
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), {}), 2);  // nothing left lying about
}

TEST_F(Charts, GnuplotsComplaintIsPassedOn) {
  PHYXEL_NEEDS_TOOL(can_plot(), "gnuplot");
  try {
    draw_svg("plot nonsense\n", folder_ / "a.svg");
    FAIL();
  } catch (const OutputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("nonsense"));
  }
  EXPECT_TRUE(fs::is_empty(folder_));
}

}  // namespace
}  // namespace phyxel::app
