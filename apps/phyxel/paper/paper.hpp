/// What `phyxel paper` measures, and the page it makes of it. Every measurement ends as a CSV
/// table; figures and page are made from those alone.
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
  std::optional<Device> gpu;  ///< Nothing: the CPU parts only.
  std::string why_no_gpu;
  std::vector<std::string> bodies;  ///< Names of section 6.
  int repeat = 5;
  int objects = 10;      ///< Figures 2 to 6: from one to so many.
  double seconds = 0.1;  ///< Of one repeat.
};

/// Names of the tables, which are also those of their files: <name>.csv.
namespace paper_table {
inline constexpr const char* frames = "frames";          ///< Figures 2 to 6.
inline constexpr const char* kernels = "kernels";        ///< Errors of each kernel.
inline constexpr const char* trajectory = "trajectory";  ///< Errors over a second of motion.
inline constexpr const char* memory = "memory";          ///< The n×n matrix.
inline constexpr const char* stiffness = "stiffness";    ///< Young's modulus against error.
inline constexpr const char* young = "young";            ///< Both ends of section 6.1's range.
inline constexpr const char* exchange = "exchange";      ///< What ranks would send each other.
/// Counted by scripts/paper_machine_code.py, not by this command.
inline constexpr const char* machine_code = "machine_code";
}  // namespace paper_table

std::filesystem::path table_file(const std::filesystem::path& folder, const std::string& table);

/// The table, if it is in the folder. @throws InputError if it cannot be read.
std::optional<CsvTable> read_table(const std::filesystem::path& folder, const std::string& table);

/// The range of Young's moduli in section 6.1: quasi-melting, and of high stiffness [Pa].
inline constexpr double softest = 1e4, stiffest = 1e6;

/// Frames per second from which on the paper calls a simulation real time: it quotes that rate for
/// video, and gives no other number.
inline constexpr int real_time_rate = 30;

/// What the paper prints: speedups of section 6.2 ("about 20 times").
struct PrintedSpeedup {
  const char* body;
  double speedup;
};
inline constexpr PrintedSpeedup printed_speedups[] = {
    {"horn_bug", 10.05}, {"dino", 20.57}, {"alien_head", 24.76}};

/// What every measurement is labelled with.
Facts paper_facts(const PaperRequest& request);

/// One way to run the program of 2008.
struct PaperProgram {
  std::string name, precision;
  std::function<std::unique_ptr<paper::PaperBackend>(const Model&)> make;
};
/// The sequential one, and with a GPU its kernels with either store, in float and double. The
/// request must outlive them.
std::vector<PaperProgram> paper_programs(const PaperRequest& request);

/// Frame rates. @param figures which of 2 to 6
CsvTable measure_frames(const PaperRequest& request, const std::vector<int>& figures);
CsvTable measure_kernels(const PaperRequest& request);
CsvTable measure_trajectories(const PaperRequest& request);
CsvTable measure_young(const PaperRequest& request);
CsvTable measure_memory(const PaperRequest& request);
CsvTable measure_stiffness(const PaperRequest& request);
/// What ranks would send each other in a step, by three ways to exchange forces. Needs no GPU.
CsvTable measure_exchange(const PaperRequest& request);

/// A jittered block of exactly `n` phyxels, 0.1 m apart, without surfels.
Model paper_block(Index n);

/// A bend and a twist with strains of some 10%, exact in float.
State bent_and_twisted(const Model& model);

/// How Figure 1 shows a body: as it was made, or while it hangs; that with its own Young's modulus,
/// or with one end of the range.
enum class Pose { rest, hanging, soft, stiff };
inline constexpr Pose poses[] = {Pose::rest, Pose::hanging, Pose::soft, Pose::stiff};

/// figure1_<body>.png for the hanging one; else with _rest, _soft or _stiff before the point.
std::filesystem::path figure_1_file(const std::filesystem::path& folder, const std::string& body,
                                    Pose pose);

/// Figure 1: each body in every pose, with its phyxels. @returns the files.
std::vector<std::filesystem::path> draw_figure_1(const PaperRequest& request);

/// Names that figures 2 to 6 and three more take in `folder`.
std::vector<std::filesystem::path> figure_files(const std::filesystem::path& folder);

/// Draws them from the tables in `folder`; removes those for which a table has no rows any more.
/// @returns the files drawn.
std::vector<std::filesystem::path> draw_figures(const std::filesystem::path& folder);

/// The page, from the tables and figures in `folder`.
inline constexpr const char* paper_page_name = "paper.md";
/// Whether the file begins as our pages do.
bool is_paper_page(const std::filesystem::path& file);
void write_paper_page(const std::filesystem::path& folder);

/// One line on the terminal while measuring.
void say(const std::string& line);

}  // namespace phyxel::app
