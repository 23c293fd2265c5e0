/// The measurements of `phyxel paper` and their page. Each measurement is a CSV table; figures and
/// page are made from the tables alone.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "csv.hpp"
#include "device.hpp"
#include "paper/paper_backend.hpp"

namespace phyxel::app {

struct PaperRequest {
  std::filesystem::path out = "out/paper";
  std::optional<Device> gpu;  ///< The GPU; unset for the CPU's part only.
  std::string why_no_gpu;
  std::vector<std::string> bodies;  ///< Names of section 6.
  int repeat = 5;
  int objects = 10;      ///< Largest number of objects in Figures 2 to 6.
  double seconds = 0.1;  ///< Length of a repeat [s].
};

/// Names of the tables, whose files are <name>.csv.
namespace paper_table {
inline constexpr const char* frames = "frames";          ///< Figures 2 to 6.
inline constexpr const char* kernels = "kernels";        ///< Errors of each kernel.
inline constexpr const char* trajectory = "trajectory";  ///< Errors over a second of motion.
inline constexpr const char* memory = "memory";          ///< The n×n matrix.
inline constexpr const char* stiffness = "stiffness";    ///< Young's modulus against error.
inline constexpr const char* young = "young";            ///< Both ends of section 6.1's range.
inline constexpr const char* exchange = "exchange";      ///< Communication volume of ranks.
/// Instructions in machine code, counted by scripts/paper_machine_code.py, not by this command.
inline constexpr const char* machine_code = "machine_code";
}  // namespace paper_table

std::filesystem::path table_file(const std::filesystem::path& folder, const std::string& table);

/// The table, if it is in the folder. @throws InputError if it cannot be read
std::optional<CsvTable> read_table(const std::filesystem::path& folder, const std::string& table);

/// The range of Young's moduli in section 6.1, from "quasi-melting" to "high stiffness" [Pa].
inline constexpr double softest = 1e4, stiffest = 1e6;

/// Frame rate that counts as real time [1/s]: that of video, the only rate in the paper.
inline constexpr int real_time_rate = 30;

/// A speed-up printed in section 6.2 of the paper ("about 20 times").
struct PrintedSpeedup {
  const char* body;
  double speedup;
};
inline constexpr PrintedSpeedup printed_speedups[] = {
    {"horn_bug", 10.05}, {"dino", 20.57}, {"alien_head", 24.76}};

/// The facts of each measurement.
Facts paper_facts(const PaperRequest& request);

/// A way to run the program of 2008.
struct PaperProgram {
  std::string name, precision;
  std::function<std::unique_ptr<paper::PaperBackend>(const Model&)> make;
};
/// The sequential program and, with a GPU, the kernels with either force store, in float and
/// double. The request must outlive them.
std::vector<PaperProgram> paper_programs(const PaperRequest& request);

/// Measures frame rates. @param figures numbers of figures, 2 to 6
CsvTable measure_frames(const PaperRequest& request, const std::vector<int>& figures);
CsvTable measure_kernels(const PaperRequest& request);
CsvTable measure_trajectories(const PaperRequest& request);
CsvTable measure_young(const PaperRequest& request);
CsvTable measure_memory(const PaperRequest& request);
CsvTable measure_stiffness(const PaperRequest& request);
/// Counts what ranks would send in a step, by three ways to exchange forces. Needs no GPU.
CsvTable measure_exchange(const PaperRequest& request);

/// A jittered block of exactly `n` phyxels with a spacing of 0.1 m, without surfels.
Model paper_block(Index n);

/// A state of bending and torsion with strains of about 10%, exact in float.
State bent_and_twisted(const Model& model);

/// Poses of Figure 1: at rest, or hanging, with the body's Young's modulus or an end of the range.
enum class Pose { rest, hanging, soft, stiff };
inline constexpr Pose poses[] = {Pose::rest, Pose::hanging, Pose::soft, Pose::stiff};

/// The file of a pose: figure1_<body>.png for the hanging body; with the suffix _rest, _soft or
/// _stiff for the other poses.
std::filesystem::path figure_1_file(const std::filesystem::path& folder, const std::string& body,
                                    Pose pose);

/// Draws Figure 1: each body in each pose, with its phyxels. @returns the files
std::vector<std::filesystem::path> draw_figure_1(const PaperRequest& request);

/// Names of Figures 2 to 6 and of three more charts in `folder`.
std::vector<std::filesystem::path> figure_files(const std::filesystem::path& folder);

/// Draws the charts from the tables in `folder`; removes those for which a table has no rows.
/// @returns the files drawn
std::vector<std::filesystem::path> draw_figures(const std::filesystem::path& folder);

/// Name of the page, which is made from the tables and figures in `folder`.
inline constexpr const char* paper_page_name = "paper.md";
/// True if a file begins as a page of this command.
bool is_paper_page(const std::filesystem::path& file);
void write_paper_page(const std::filesystem::path& folder);

/// Prints a line of progress.
void say(const std::string& line);

}  // namespace phyxel::app
