#include "page_sections.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "markdown.hpp"
#include "paper.hpp"

namespace phyxel::app {
namespace {

/// The largest number of objects with a frame rate of at least `rate`, and the number measured.
std::string keeping_up(const CsvTable& t, const Match& match, double rate) {
  int most = 0, measured = 0;
  for (std::size_t r = 0; r < t.rows.size(); ++r) {
    if (!t.matches(r, match)) continue;
    const int objects = static_cast<int>(t.number(r, "objects"));
    measured = std::max(measured, objects);
    if (t.number(r, "frames_per_s") >= rate) most = std::max(most, objects);
  }
  return most == measured ? fmt::format("all {}", most) : std::to_string(most);
}

}  // namespace

std::string measured_by(const CsvTable& t) {
  return fmt::format("Measured by {} on {}; GPU: {}; {}; {}; {}.\n\n", t.fact("program"),
                     t.fact("hardware"), t.fact("gpu"), t.fact("cuda"), t.fact("compiler"),
                     t.fact("date"));
}

std::string real_time_section(const CsvTable& t) {
  std::string text;
  text += fmt::format(
      "Real time: the only frame rate that the paper names is the {} Hz of video, the grey lines "
      "of "
      "Figures 2 to 5; each of its frames is a step. Motion at its own pace asks for more: as many "
      "steps a second as a second of motion takes, 1/Δt, the dashed lines of Figures 2 and 3. The "
      "table has the largest number of objects that keep to either rate, of those measured:\n\n",
      real_time_rate);
  std::vector<std::vector<std::string>> rows;
  for (const std::string& body : t.values("body")) {
    for (const std::string& surfels : t.values("with_surfels")) {
      for (const std::string& program : t.values("program")) {
        const std::vector<std::string> cores = t.values("cores", {{"program", program}});
        const Match match{{"body", body},
                          {"with_surfels", surfels},
                          {"program", program},
                          {"cores", cores.back()},
                          {"frames", "shown"}};
        const auto row = t.find(match);
        if (!row) continue;
        const double needed = t.has("step_s") ? 1 / t.number(*row, "step_s") : NAN;
        rows.push_back({body, surfels, program, cores.back() == "0" ? "GPU" : cores.back(),
                        keeping_up(t, match, real_time_rate),
                        std::isnan(needed) ? "–" : fmt::format("{:.0f}", needed),
                        std::isnan(needed) ? "–" : keeping_up(t, match, needed)});
      }
    }
  }
  text += table_text(
      {"body", "surfels", "program", "cores", fmt::format("objects at {} frames/s", real_time_rate),
       "steps in a second of motion", "objects at that rate"},
      rows);
  return text;
}

std::string young_section(const CsvTable& t) {
  std::string text;
  text += "## Both ends of Young's modulus\n\n";
  text += measured_by(t);
  text +=
      "Section 6.1: E from 10⁴ N/m² (\"quasi-melting behavior\") to 10⁶ N/m² (\"high "
      "stiffness\"). A second of motion at either end, at half of the largest stable step, "
      "which shrinks as 1/√E; errors against long double with the same step.\n\n";
  std::vector<std::vector<std::string>> rows;
  for (std::size_t r = 0; r < t.rows.size(); ++r) {
    std::vector<std::string> row;
    for (const char* column : {"body", "young_pa", "step_s", "steps", "program", "precision",
                               "relative_error", "largest_displacement_m", "inverted_phyxels"}) {
      row.push_back(t.text(r, column));
    }
    rows.push_back(row);
  }
  text += table_text({"body", "E [Pa]", "step [s]", "steps", "program", "precision", "error",
                      "largest displacement [m]", "inverted phyxels"},
                     rows);
  return text;
}

std::string exchange_section(const CsvTable& t) {
  std::string text;
  text += "## What ranks would send\n\n";
  text += measured_by(t);
  text +=
      "kB a step in float, over all parts. Displacements of ghosts are sent in every scheme; "
      "with them their pair stresses, as phyxel does, or the force of each pair, or forces that "
      "each part has summed for each ghost. The first two give the owner all forces one by one, "
      "so that it sums them in one order, and the bits are those of one rank. With the third the "
      "order of the sum is the cut's: the last columns have the phyxels whose force, from the same "
      "pair forces in float, has other bits than on one rank, and the largest such difference. "
      "*Slowest*: what the part with most "
      "to do has to do, ghosts counted, over the mean. METIS depends on its version.\n\n";
  std::vector<std::vector<std::string>> rows;
  for (std::size_t r = 0; r < t.rows.size(); ++r) {
    std::vector<std::string> row;
    for (const char* column :
         {"body", "phyxels", "parts", "partitioner", "cut_pairs", "ghosts", "slowest"}) {
      row.push_back(t.text(r, column));
    }
    for (const char* column : {"pair_stress_bytes", "pair_force_bytes", "summed_force_bytes"}) {
      row.push_back(fmt::format("{:.1f}", 1e-3 * t.number(r, column)));
    }
    row.push_back(t.text(r, "summed_other_bits"));
    row.push_back(t.text(r, "summed_difference"));
    rows.push_back(row);
  }
  text += table_text(
      {"body", "phyxels", "parts", "cut by", "cut pairs", "ghosts", "slowest", "pair stresses [kB]",
       "pair forces [kB]", "summed forces [kB]", "summed: other bits", "by, of the largest force"},
      rows);
  return text;
}

std::string machine_code_section(const CsvTable& t) {
  std::string text;
  text += fmt::format(
      "## 24-bit multiplication\n\nCounted by `scripts/paper_machine_code.py` with {} for {}; "
      "{}.\n\n",
      t.fact("compiler"), t.fact("architecture"), t.fact("date"));
  text +=
      "The source asks for 24-bit products of indices, as the paper does. The compiler writes "
      "none: it cuts the factors down to 24 bits, which takes instructions of its own where it "
      "cannot tell that they are short, and multiplies in 32 bits (`IMAD`). The first two rows "
      "are kernels of one line.\n\n";
  std::vector<std::vector<std::string>> rows;
  for (std::size_t r = 0; r < t.rows.size(); ++r) {
    std::vector<std::string> row{"`" + t.text(r, "kernel") + "`"};
    for (const char* column : {"precision", "in_source", "ptx_24_bit", "sass_24_bit", "sass_32_bit",
                               "ptx_truncations", "sass_instructions"}) {
      row.push_back(t.text(r, column));
    }
    rows.push_back(row);
  }
  text += table_text(
      {"kernel", "precision", "`__mul24` in the source", "24-bit in PTX", "24-bit in machine code",
       "32-bit in machine code", "truncations in PTX", "instructions"},
      rows);
  return text;
}

}  // namespace phyxel::app
