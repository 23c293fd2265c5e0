/// The page that compares the paper's printed figures with new measurements. Each number on it is
/// read from the tables.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <functional>
#include <optional>

#include "files/atomic_file.hpp"
#include "markdown.hpp"
#include "page_sections.hpp"
#include "paper.hpp"
#include "paper/paper_model.hpp"

namespace phyxel::app {
namespace {

namespace fs = std::filesystem;

constexpr const char* first_line = "# The 2008 paper, run again";

constexpr const char* printed_hardware =
    "Athlon 64 X2 4800+ (one core) and GeForce 8800 GTX (128 scalar processors, 768 MB)";

class Page {
 public:
  explicit Page(fs::path folder) : folder_(std::move(folder)) {}

  std::string write() {
    text_ = first_line;
    text_ += "\n\n";
    text_ +=
        "Written by `phyxel paper` from the CSV files beside it. Farias, Almeida, Teixeira, "
        "Teichrieb, Kelner: *A High Performance Massively Parallel Approach for Real Time "
        "Deformable Body Physics Simulation*, SBAC-PAD 2008. The kernels are theirs by name and "
        "role; what their text leaves open, and how it was filled, is in "
        "`docs/paper.md`.\n\n";
    with(paper_table::frames, [&](const CsvTable& t) { frames(t); });
    pictures();
    with(paper_table::kernels, [&](const CsvTable& t) { kernels(t); });
    with(paper_table::trajectory, [&](const CsvTable& t) { trajectories(t); });
    with(paper_table::young, [&](const CsvTable& t) { text_ += young_section(t); });
    with(paper_table::memory, [&](const CsvTable& t) { memory(t); });
    with(paper_table::stiffness, [&](const CsvTable& t) { stiffness(t); });
    with(paper_table::exchange, [&](const CsvTable& t) { text_ += exchange_section(t); });
    with(paper_table::machine_code, [&](const CsvTable& t) { text_ += machine_code_section(t); });
    return text_;
  }

 private:
  void with(const char* name, const std::function<void(const CsvTable&)>& section) {
    const auto table = read_table(folder_, name);
    if (table && !table->rows.empty()) section(*table);
  }

  void figure(const std::string& name, const std::string& caption) {
    if (fs::exists(folder_ / name)) text_ += fmt::format("![{}]({})\n\n", caption, name);
  }

  void frames(const CsvTable& t) {
    text_ += "## Frame rates and speedups (Figures 2 to 6)\n\n";
    text_ += measured_by(t);
    text_ +=
        "A frame is one time step of every object, each by its own launches of "
        "`calcStrainStressA`, `calcStrainStressB`, `integrate` and, with surfels, "
        "`updateSurfels`; *shown* frames end with the host knowing that they are done, *queued* "
        "ones follow each other without waiting. Float; medians over " +
        t.fact("repeats") + " repeats.\n\n";
    speedups(t);
    figure("speedups.svg", "Speedups of one object");
    text_ += real_time_section(t);
    for (int f = 2; f <= 6; ++f) {
      figure(fmt::format("figure{}.svg", f), fmt::format("Figure {}", f));
    }
    all_rates(t);
  }

  /// Adds the speed-ups of the GPU over each CPU program, for one object and for the number of
  /// objects measured on the CPU.
  void speedups(const CsvTable& t) {
    struct Program {
      std::string name, cores;
    };
    std::vector<Program> programs{{"sequential of 2008", "1"}};
    for (const std::string& cores : t.values("cores", {{"program", "phyxel CPU"}})) {
      programs.push_back({"phyxel CPU", cores});
    }
    std::vector<std::string> head{"body", "phyxels", "surfels", "objects", "the paper prints"};
    for (const char* what : {"phyxels", "phyxels + surfels"}) {
      for (const Program& p : programs) {
        head.push_back(fmt::format("{}: GPU / {}, {} core{}", what, p.name, p.cores,
                                   p.cores == "1" ? "" : "s"));
      }
    }
    std::vector<std::vector<std::string>> rows;
    bool any = false;
    for (const PrintedSpeedup& printed_one : printed_speedups) {
      const Match body{{"body", printed_one.body}, {"frames", "shown"}};
      Match on_cpu = body;
      on_cpu.emplace_back("program", "sequential of 2008");
      const std::vector<std::string> counts = t.values("objects", on_cpu);
      for (const std::string& objects : counts) {  // other counts are in the figures
        if (objects != counts.front() && objects != counts.back()) continue;
        const auto rate = [&](const Program& program, const char* surfels) {
          Match match = body;
          match.insert(match.end(), {{"program", program.name},
                                     {"cores", program.cores},
                                     {"objects", objects},
                                     {"with_surfels", surfels}});
          const auto row = t.find(match);
          return row ? t.number(*row, "frames_per_s") : NAN;
        };
        const auto some = t.find(body);
        std::vector<std::string> row{printed_one.body, t.text(*some, "phyxels"),
                                     t.text(*some, "surfels"), objects,
                                     objects == "1" ? fmt::format("{}", printed_one.speedup) : ""};
        for (const char* surfels : {"no", "yes"}) {
          for (const Program& program : programs) {
            const double ratio = rate({"kernels of 2008", "0"}, surfels) / rate(program, surfels);
            row.push_back(std::isfinite(ratio) ? fmt::format("{:.3g}", ratio) : "–");
            any = any || std::isfinite(ratio);
          }
        }
        rows.push_back(row);
      }
    }
    if (!any) {
      text_ += "No GPU was measured, so there are no speedups.\n\n";
      return;
    }
    text_ += fmt::format(
        "Speedups of the GPU. The paper's figures are for one object on {}. *Sequential* is the "
        "program that the paper describes, one phyxel after the other on one core of today. "
        "*phyxel CPU* is this project's own solver with vector units; several cores share surfels, "
        "and phyxels from 800 on, so that a single one of these bodies is stepped by one core. The "
        "kernels of 2008 take one body a launch, a thread a phyxel: each launch takes as long as a "
        "thread needs to walk its list, however empty the GPU is, and objects follow one "
        "another.\n\n",
        printed_hardware);
    text_ += table_text(head, rows);
  }

  void all_rates(const CsvTable& t) {
    std::vector<std::string> head{"body",  "surfels",         "program",
                                  "cores", "threads at work", "frames"};
    const std::vector<std::string> counts = t.values("objects");
    for (const std::string& n : counts) head.push_back(n + (n == "1" ? " object" : " objects"));
    std::vector<std::vector<std::string>> rows;
    for (const std::string& body : t.values("body")) {
      for (const std::string& surfels : t.values("with_surfels")) {
        for (const std::string& program : t.values("program")) {
          for (const std::string& cores : t.values("cores", {{"program", program}})) {
            for (const std::string& how : t.values("frames")) {
              const Match match{{"body", body},
                                {"with_surfels", surfels},
                                {"program", program},
                                {"cores", cores},
                                {"frames", how}};
              if (!t.find(match)) continue;
              const bool gpu = cores == "0";
              std::vector<std::string> row{
                  body,
                  surfels,
                  program,
                  gpu ? "GPU" : cores,
                  gpu ? "" : fmt::format("{}", fmt::join(t.values("threads", match), ", ")),
                  how};
              for (const std::string& n : counts) {
                Match one = match;
                one.emplace_back("objects", n);
                row.push_back(cell(t, "frames_per_s", one));
              }
              rows.push_back(row);
            }
          }
        }
      }
    }
    text_ += "Frames per second:\n\n" + table_text(head, rows);
  }

  void pictures() {
    std::vector<std::string> head{""};
    std::vector<std::vector<std::string>> rows;
    const char* names[] = {"as made", "after 0.6 s", "after 0.6 s, E = 10⁴ Pa",
                           "after 0.6 s, E = 10⁶ Pa"};
    for (const Pose pose : poses) {
      std::vector<std::string> row{names[static_cast<int>(pose)]};
      for (const std::string& body : paper::body_names()) {
        const std::string file = figure_1_file({}, body, pose).string();
        if (!fs::exists(folder_ / file)) continue;
        if (std::find(head.begin(), head.end(), body) == head.end()) head.push_back(body);
        row.push_back(fmt::format("![{}]({})", body, file));
      }
      if (row.size() == head.size() && row.size() > 1) rows.push_back(row);
    }
    if (rows.empty()) return;
    text_ +=
        "## Figure 1\n\nThe bodies as they were made, and hung by a leg, the neck and the mouth, "
        "after 0.6 s of falling: with their own Young's moduli, and with both ends of the range of "
        "section 6.1. Dots are phyxels.\n\n" +
        table_text(head, rows);
  }

  void kernels(const CsvTable& t) {
    text_ += "## Errors of each kernel\n\n";
    text_ += measured_by(t);
    text_ +=
        "Largest difference from the same equations in long double, over the largest value, for a "
        "bend and twist with strains of some 10%. The tests hold the same kernels against an "
        "independent evaluation of the papers' equations.\n\n";
    std::vector<std::string> head{"kernel", "quantity"};
    std::vector<Match> columns;
    for (const std::string& precision : t.values("precision")) {
      for (const std::string& program : t.values("program", {{"precision", precision}})) {
        if (program == "CSR gather") continue;  // results are equal bit by bit
        for (const std::string& body : t.values("body")) {
          head.push_back(fmt::format("{}, {}, {}", program, precision, body));
          columns.push_back({{"precision", precision}, {"program", program}, {"body", body}});
        }
      }
    }
    std::vector<std::vector<std::string>> rows;
    for (const std::string& kernel : t.values("kernel")) {
      for (const std::string& quantity : t.values("quantity", {{"kernel", kernel}})) {
        std::vector<std::string> row{"`" + kernel + "`", quantity};
        for (Match match : columns) {
          match.emplace_back("kernel", kernel);
          match.emplace_back("quantity", quantity);
          row.push_back(cell(t, "relative_error", match));
        }
        rows.push_back(row);
      }
    }
    text_ += table_text(head, rows);
  }

  void trajectories(const CsvTable& t) {
    text_ += "## A second of motion\n\n";
    text_ += measured_by(t);
    text_ +=
        "Largest difference of a displacement from the trajectory in long double with the same "
        "step, over the largest displacement. From float to double the distance shrinks by about "
        "2²⁹ ≈ 5·10⁸, the ratio of their roundings: it is rounding that grows along the motion, "
        "and "
        "nothing else.\n\n";
    const std::vector<std::string> times = t.values("time_s");
    std::vector<std::string> head{"body", "program", "precision"};
    for (const std::string& time : times) head.push_back(time + " s");
    std::vector<std::vector<std::string>> rows;
    for (const std::string& body : t.values("body")) {
      for (const std::string& program : t.values("program")) {
        for (const std::string& precision : t.values("precision")) {
          std::vector<std::string> row{body, program, precision};
          for (const std::string& time : times) {
            row.push_back(cell(t, "relative_error",
                               {{"body", body},
                                {"program", program},
                                {"precision", precision},
                                {"time_s", time}}));
          }
          if (row.back() != "–") rows.push_back(row);
        }
      }
    }
    text_ += table_text(head, rows);
  }

  void memory(const CsvTable& t) {
    text_ += "## The n×n matrix\n\n";
    text_ += measured_by(t);
    text_ +=
        "Section 5.2 gives 34.33 MB for 1,000 phyxels, which is nine floats a pair (36 bytes, in "
        "MiB); a force is three (11.44 MiB). Ours stores three. Measured: what the GPU's free "
        "memory fell by, in steps of its allocator (2 MiB); the CSR gather does the same work "
        "without the matrix, to the same bits.\n\n";
    const auto mebibytes = [&](const Match& match) {
      const auto row = t.find(match);
      if (!row) return std::string("–");
      if (t.text(*row, "answer") != "fits") return std::string("does not fit");
      return fmt::format("{:.2f}", t.number(*row, "measured_bytes") / (1 << 20));
    };
    std::vector<std::vector<std::string>> rows;
    for (const std::string& n : t.values("phyxels", {{"program", "CSR gather"}})) {
      const Match dense{{"phyxels", n}, {"program", "kernels of 2008"}, {"bodies", "1"}};
      const Match csr{{"phyxels", n}, {"program", "CSR gather"}};
      const auto arrays = t.find(dense);
      rows.push_back(
          {n, arrays ? fmt::format("{:.2f}", t.number(*arrays, "array_bytes") / (1 << 20)) : "–",
           mebibytes(dense), mebibytes({{"phyxels", n}, {"program", "matrix alone"}}),
           mebibytes(csr), cell(t, "steps_per_s", dense), cell(t, "steps_per_s", csr)});
    }
    text_ += table_text({"phyxels", "arrays, 3 a pair [MiB]", "measured [MiB]",
                         "matrix with 9 a pair, measured [MiB]", "CSR gather, measured [MiB]",
                         "steps/s, matrix", "steps/s, CSR"},
                        rows);
    figure("memory.svg", "Memory against phyxels");
    text_ += "What is refused, in the program's words:\n\n";
    for (std::size_t r = 0; r < t.rows.size(); ++r) {
      if (t.text(r, "answer") == "fits") continue;
      text_ += fmt::format("- {} × {} phyxels, {} numbers a pair: {}\n", t.text(r, "bodies"),
                           t.text(r, "phyxels"), t.text(r, "numbers_a_pair"), t.text(r, "answer"));
    }
    text_ += "\n";
  }

  void stiffness(const CsvTable& t) {
    text_ += "## Young's modulus and single precision\n\n";
    text_ += measured_by(t);
    text_ +=
        "Section 6.1 warns that a large Young's modulus \"may cause unexpected results, due the "
        "single floating point precision\". A free bar of 54 phyxels spins at 10 rad/s for 0.1 s. "
        "Its displacements grow to the size of the bar whatever E is; its strains, which the spin "
        "alone decides, fall as 1/E. A displacement u rounds to ε|u|, so a difference of "
        "neighbours "
        "carries a strain error of about ε|u|/spacing, and a stress error of E times that: the "
        "share "
        "of rounding in the stress grows with E. It is largest for the smallest steps, of which "
        "there "
        "are most and whose Δt²f/m is the smallest beside u. Error of the stress, over the largest "
        "stress, against long double with the same step; at 1.1 of the limit, against half the "
        "step: "
        "there every precision diverges.\n\n";
    std::vector<std::string> head{"E [Pa]", "stress [Pa]"};
    std::vector<Match> columns;
    for (const std::string& precision : t.values("precision")) {
      for (const std::string& fraction : t.values("step_of_limit")) {
        head.push_back(fmt::format("{}, {} Δt_max", precision, fraction));
        columns.push_back({{"precision", precision}, {"step_of_limit", fraction}});
      }
    }
    std::vector<std::vector<std::string>> rows;
    for (const std::string& young : t.values("young_pa")) {
      std::vector<std::string> row{
          young, cell(t, "largest_stress_pa", {{"young_pa", young}, {"step_of_limit", "0.5"}})};
      for (Match match : columns) {
        match.emplace_back("young_pa", young);
        row.push_back(cell(t, "stress_error", match));
      }
      rows.push_back(row);
    }
    text_ += table_text(head, rows);
    text_ += "From which E on more than a tenth of the stress is rounding:\n\n";
    std::vector<std::vector<std::string>> limits;
    for (const std::string& precision : t.values("precision")) {
      std::vector<std::string> row{precision};
      for (const char* fraction : stable_fractions) row.push_back(breaks(t, precision, fraction));
      limits.push_back(row);
    }
    std::vector<std::string> limits_head{"precision"};
    for (const char* fraction : stable_fractions) {
      limits_head.push_back(fmt::format("{} Δt_max", fraction));
    }
    text_ += table_text(limits_head, limits);
    figure("stiffness.svg", "Error of the stress against Young's modulus");
  }

  static constexpr const char* stable_fractions[] = {"0.1", "0.5", "0.9"};

  /// The first E of the table with an error of at least a tenth; if there is none, the E to which
  /// the last row's error extrapolates linearly.
  static std::string breaks(const CsvTable& t, const std::string& precision,
                            const std::string& fraction) {
    double last_young = 0, last_error = 0;
    for (std::size_t r = 0; r < t.rows.size(); ++r) {
      if (!t.matches(r, {{"precision", precision}, {"step_of_limit", fraction}})) continue;
      last_young = t.number(r, "young_pa");
      last_error = t.number(r, "stress_error");
      if (!(last_error < 0.1)) return fmt::format("{:g} Pa", last_young);
    }
    return last_error > 0 ? fmt::format("about {:.0e} Pa, extrapolated from the last row",
                                        last_young * 0.1 / last_error)
                          : "–";
  }

  fs::path folder_;
  std::string text_;
};

}  // namespace

bool is_paper_page(const fs::path& file) {
  std::ifstream in(file);
  std::string line;
  return std::getline(in, line) && line == first_line;
}

void write_paper_page(const fs::path& folder) {
  write_whole_file(folder / paper_page_name, Page(folder).write(), Durable::no);
}

}  // namespace phyxel::app
