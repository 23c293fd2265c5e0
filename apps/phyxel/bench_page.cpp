/// phyxel bench page: docs/performance.md from the tables of the other bench commands. Every number
/// on it is read from a table; what was asked for stands here.
#include "bench_page.hpp"

#include <fmt/format.h>

#include <cmath>
#include <functional>
#include <optional>

#include "cantilever_page.hpp"
#include "files/atomic_file.hpp"
#include "markdown.hpp"
#include "outside_text.hpp"
#include "phyxel/error.hpp"
#include "plot.hpp"

namespace phyxel::app {
namespace {

namespace fs = std::filesystem;

/// What the solver is to reach on one H200, in float.
constexpr double asked_large = 8e9, asked_double = 3e9;  // phyxel-steps/s, 2 to 17 million phyxels
constexpr double asked_setup = 1;                        // s for 16 million
constexpr double asked_with_surfels = 1e5;               // steps/s of Dino
struct AskedStep {
  const char* body;
  double microseconds;
};
constexpr AskedStep asked_steps[] = {{"dino", 2}, {"alien_head", 1.5}};

std::string against(double reached, double asked) {
  const double share = reached / asked - 1;
  return std::abs(share) < 0.005 ? "as asked"
                                 : fmt::format("{:+.0f}% of what was asked", 100 * share);
}

class Page {
 public:
  /// @param link from the page to `results`, where figures lie too
  Page(fs::path results, std::string link) : results_(std::move(results)), link_(std::move(link)) {}

  std::string write() {
    text_ =
        "# Performance of the GPU solver\n\nWritten by `phyxel bench page` from the CSV files in "
        "`docs/results/`, which `scripts/measure_gpu.sh` and `scripts/profile_gpu.sh` make. A step "
        "is both passes and Verlet's, of a jittered cube under gravity with Green's strain unless "
        "said otherwise; *error* is the largest difference of a force from that in double on the "
        "same GPU (which the tests hold against the CPU), over the largest force, at strains of "
        "some 10%; *spread* is (fastest − slowest)/median of the "
        "repeats: under load the GPU lowers its clock, so that the first repeat is the "
        "fastest.\n\n";
    with("gpu_sizes.csv", [&](const CsvTable& t) { sizes(t); });
    with("gpu_small.csv", [&](const CsvTable& t) { small(t); });
    with("gpu_surfels.csv", [&](const CsvTable& t) { surfels(t); });
    with("gpu_neighbours.csv", [&](const CsvTable& t) { neighbours(t); });
    with("gpu_cantilever.csv", [&](const CsvTable& t) { cantilever(t); });
    with("gpu_terms.csv", [&](const CsvTable& t) { terms(t); });
    with("gpu_setup.csv", [&](const CsvTable& t) { setup(t); });
    with("gpu_profile.csv", [&](const CsvTable& t) { profile(t); });
    tried();
    return text_;
  }

 private:
  void with(const char* name, const std::function<void(const CsvTable&)>& section) {
    if (!fs::exists(results_ / name)) return;
    const CsvTable table = read_page_table(results_ / name);
    if (table.rows.empty()) {
      throw InputError(
          fmt::format("{}: has no rows; allowed: a table of a bench that ended, or none",
                      (results_ / name).string()));
    }
    section(table);
  }
  void measured_by(const CsvTable& t) {
    text_ += fmt::format("Measured by {} on {}; {}; {}.\n\n", t.fact("program"), t.fact("gpu"),
                         t.fact("cuda"), t.fact("date"));
  }
  /// Billions a second.
  static std::string rate(const CsvTable& t, std::size_t r) {
    return fmt::format("{:.3g}", t.number(r, "phyxel_steps_per_s") * 1e-9);
  }
  /// A curve for each precision.
  void speeds(const CsvTable& t, const std::string& name, const std::string& title,
              const std::string& x, const std::string& x_label, bool logarithmic) {
    LineChart chart{.title = title,
                    .x_label = x_label,
                    .y_label = "10⁹ phyxel-steps/s",
                    .log_x = logarithmic,
                    .log_y = logarithmic,
                    .curves = {}};
    for (const std::string& precision : t.values("precision")) {
      Curve& curve = chart.curves.emplace_back(Curve{precision, {}, {}});
      for (std::size_t r = 0; r < t.rows.size(); ++r) {
        if (t.text(r, "precision") != precision) continue;
        curve.x.push_back(t.number(r, x));
        curve.y.push_back(t.number(r, "phyxel_steps_per_s") * 1e-9);
      }
    }
    figure(chart, name);
  }
  /// Drawn where gnuplot is, shown where it was.
  void figure(const LineChart& chart, const std::string& name) {
    const fs::path file = results_ / (name + ".svg");
    if (can_plot()) draw_svg(script_of(chart), file);
    if (fs::exists(file)) text_ += fmt::format("![{}]({}{}.svg)\n\n", chart.title, link_, name);
  }

  void sizes(CsvTable t) {
    text_ += "## Against size\n\n";
    measured_by(t);
    with("gpu_capacity.csv", [&](const CsvTable& more) {
      t.rows.insert(t.rows.end(), more.rows.begin(), more.rows.end());
    });
    std::vector<std::vector<std::string>> rows;
    double slowest = HUGE_VAL, fastest = 0, slowest_double = HUGE_VAL, largest = 0;
    for (std::size_t r = 0; r < t.rows.size(); ++r) {
      const double n = t.number(r, "phyxels"), speed = t.number(r, "phyxel_steps_per_s");
      const std::string& precision = t.text(r, "precision");
      if (n > 2e6 && n < 2e7 && precision == "float") {
        slowest = std::min(slowest, speed);
        fastest = std::max(fastest, speed);
      }
      if (n > 2e6 && n < 2e7 && precision == "double") {
        slowest_double = std::min(slowest_double, speed);
      }
      largest = std::max(largest, n);
      const std::string& error = t.text(r, "force_error");
      // What is resident moves none of them.
      const bool moves = t.text(r, "path").find("resident") == std::string::npos;
      rows.push_back({t.text(r, "phyxels"), precision, t.text(r, "path"),
                      fmt::format("{:.4g}", 1e6 / t.number(r, "steps_per_s")), rate(t, r),
                      fmt::format("{:.0f}%", 100 * t.number(r, "spread")),
                      t.text(r, "memory_bytes_per_phyxel"),
                      moves ? t.text(r, "bytes_per_phyxel_step") : "–",
                      moves ? fmt::format("{:.0f}%", 100 * t.number(r, "bytes_per_s") /
                                                         t.number(r, "copy_bytes_per_s"))
                            : "–",
                      error.empty() ? "–" : error});
    }
    if (fastest > 0) {
      text_ += fmt::format(
          "From 2 to 17 million phyxels, float: {:.3g} to {:.3g} billion phyxel-steps/s ({}; {}); "
          "double: at least {:.3g} ({}). The largest body measured has {:.0f} million "
          "phyxels.\n\n",
          slowest * 1e-9, fastest * 1e-9, against(slowest, asked_large),
          against(fastest, asked_large), slowest_double * 1e-9,
          against(slowest_double, asked_double), largest * 1e-6);
    }
    speeds(t, "gpu_sizes", "Steps of a cube on one GPU", "phyxels", "phyxels", true);
    text_ +=
        "*Path*: `tiles` are two launches a step, which a graph repeats where launches would "
        "count; what is resident stays in shared memory for many steps a launch, in a cluster of "
        "blocks a body or in blocks that send each other "
        "mail. *Bytes moved* are the least that a step must move; their share of a plain copy's "
        "bandwidth says that memory is not the limit.\n\n";
    text_ += table_text(
        {"phyxels", "precision", "path", "µs a step", "10⁹ phyxel-steps/s", "spread",
         "bytes held a phyxel", "bytes moved a phyxel-step", "of copy bandwidth", "error"},
        rows);
  }

  void small(const CsvTable& t) {
    text_ += "## The paper's bodies, alone and side by side\n\n";
    measured_by(t);
    for (const auto& [body, microseconds] : asked_steps) {
      if (const auto row = t.find({{"shape", body}, {"bodies", "1"}})) {
        const double step = 1e6 / t.number(*row, "steps_per_s");
        text_ += fmt::format("{}, {} phyxels: {:.3g} µs a step, {:.3g} µs asked.\n\n", body,
                             t.text(*row, "phyxels"), step, microseconds);
      }
    }
    std::vector<std::vector<std::string>> rows;
    for (std::size_t r = 0; r < t.rows.size(); ++r) {
      const double alone = 1 / t.number(*t.find({{"shape", t.text(r, "shape")}}), "steps_per_s");
      const double step = 1 / t.number(r, "steps_per_s");
      rows.push_back({t.text(r, "shape"), t.text(r, "bodies"), t.text(r, "phyxels"),
                      t.text(r, "path"), fmt::format("{:.3g}", 1e6 * step),
                      fmt::format("{:.3g}", step / alone), rate(t, r), t.text(r, "force_error")});
    }
    text_ += table_text({"body", "bodies", "phyxels", "path", "µs a step of all", "× one alone",
                         "10⁹ phyxel-steps/s", "error"},
                        rows);
    text_ +=
        "Alone, a body takes as long as its slowest block needs for the chain of its longest "
        "list, twice, and for two exchanges. Many side by side are limited by the loads from "
        "shared memory of all.\n\n";
  }

  void surfels(const CsvTable& t) {
    text_ += "## Surfels moved after every step\n\n";
    measured_by(t);
    std::vector<std::vector<std::string>> rows;
    for (std::size_t r = 0; r < t.rows.size(); ++r) {
      if (t.text(r, "terms") != "surfels") continue;
      const double rate = t.number(r, "steps_per_s");
      const auto without = t.find(
          {{"shape", t.text(r, "shape")}, {"phyxels", t.text(r, "phyxels")}, {"terms", "green"}});
      const double bare = without ? 1e6 / t.number(*without, "steps_per_s") : 0;
      rows.push_back({t.text(r, "shape"), t.text(r, "phyxels"), t.text(r, "surfels"),
                      fmt::format("{:.4g}", rate), fmt::format("{:.3g}", 1e6 / rate),
                      without ? fmt::format("{:.3g}", bare) : "–"});
      if (t.text(r, "shape") == "dino") {
        text_ += fmt::format("Dino, {} surfels: {:.3g} steps/s ({}).\n\n", t.text(r, "surfels"),
                             rate, against(rate, asked_with_surfels));
      }
    }
    text_ += table_text({"body", "phyxels", "surfels", "steps/s", "µs a step", "µs a step without"},
                        rows);
    text_ +=
        "A resident body leaves what its surfels need after each of up to sixteen steps of a "
        "launch; then all surfels move after all of those steps at once. Whoever wants to see them "
        "after a step ends the launch there.\n\n";
  }

  void neighbours(const CsvTable& t) {
    text_ += "## Against neighbours\n\n";
    measured_by(t);
    speeds(t, "gpu_neighbours", "Two million phyxels", "neighbours", "neighbours a phyxel", false);
    std::vector<std::vector<std::string>> rows;
    for (std::size_t r = 0; r < t.rows.size(); ++r) {
      rows.push_back({t.text(r, "neighbours"), t.text(r, "precision"), rate(t, r),
                      fmt::format("{:.3g}", t.number(r, "pairs_per_s") * 1e-9),
                      t.text(r, "memory_bytes_per_phyxel"), t.text(r, "force_error")});
    }
    text_ += table_text({"neighbours", "precision", "10⁹ phyxel-steps/s",
                         "10⁹ pairs/s, both passes", "bytes held a phyxel", "error"},
                        rows);
  }

  void cantilever(const CsvTable& t) {
    text_ += "## Speed against error: a cantilever\n\n";
    measured_by(t);
    text_ += cantilever_words(t);
    figure(cantilever_chart(t), "gpu_cantilever");
    text_ += cantilever_table(t);
  }

  void terms(const CsvTable& t) {
    text_ += "## What each term costs\n\n";
    measured_by(t);
    text_ +=
        "Two million phyxels. *Added* is the difference from Green's strain alone in the same "
        "precision; differences of time within the spread are noise. A term that is off has no "
        "array and is in no kernel.\n\n";
    std::vector<std::vector<std::string>> rows;
    for (std::size_t r = 0; r < t.rows.size(); ++r) {
      const auto base = t.find({{"terms", "green"}, {"precision", t.text(r, "precision")}});
      const auto picoseconds = [&](std::size_t row) {
        return 1e12 / t.number(row, "phyxel_steps_per_s");
      };
      const auto bytes = [&](std::size_t row) { return t.number(row, "memory_bytes_per_phyxel"); };
      rows.push_back(
          {t.text(r, "terms"), t.text(r, "precision"), fmt::format("{:.0f}", picoseconds(r)),
           base ? fmt::format("{:+.0f}", picoseconds(r) - picoseconds(*base)) : "–",
           fmt::format("{:.0f}%", 100 * t.number(r, "spread")), fmt::format("{:.0f}", bytes(r)),
           base ? fmt::format("{:+.0f}", bytes(r) - bytes(*base)) : "–", t.text(r, "force_error")});
    }
    text_ += table_text({"term", "precision", "ps a phyxel-step", "added [ps]", "spread",
                         "bytes held a phyxel", "added", "error"},
                        rows);
  }

  void setup(const CsvTable& t) {
    text_ += "## Set-up\n\n";
    measured_by(t);
    const std::size_t last = t.rows.size() - 1;
    const double on_device = t.number(last, "survey_s") + t.number(last, "backend_s");
    text_ += fmt::format(
        "*Survey*: spacings, supports, list lengths, ranks of moments. *Model*: the host's copies. "
        "*Backend*: order along the curve, tiles, lists, moments, all arrays. *Step limit*: "
        "Lanczos' iteration. Survey and backend together for {} phyxels: {:.3g} s ({}).\n\n",
        t.text(last, "phyxels"), on_device, against(on_device, asked_setup));
    std::vector<std::vector<std::string>> rows;
    for (std::size_t r = 0; r < t.rows.size(); ++r) {
      rows.push_back({t.text(r, "phyxels"), t.text(r, "survey_s"), t.text(r, "model_s"),
                      t.text(r, "backend_s"), t.text(r, "limit_s"), t.text(r, "iterations")});
    }
    text_ += table_text(
        {"phyxels", "survey [s]", "model [s]", "backend [s]", "step limit [s]", "iterations"},
        rows);
  }

  void profile(const CsvTable& t) {
    text_ += "## What limits the two passes\n\n";
    text_ += fmt::format(
        "Nsight Compute on {} with {}, {}, two million phyxels; it holds the clock at its base. "
        "Shares are of what the hardware can do at most.\n\n",
        t.fact("gpu"), t.fact("program"), t.fact("date"));
    struct Metric {
      const char *name, *title;
      double scale;
    };
    constexpr Metric metrics[] = {
        {"gpu__time_duration.sum", "time [µs]", 1e-3},
        {"smsp__cycles_elapsed.avg.per_second", "clock [GHz]", 1e-9},
        {"smsp__inst_executed.sum", "10⁶ instructions of a warp", 1e-6},
        {"smsp__issue_active.avg.pct_of_peak_sustained_active", "issue slots used [%]", 1},
        {"l1tex__data_pipe_lsu_wavefronts.avg.pct_of_peak_sustained_elapsed",
         "loads and stores of shared memory and cache [%]", 1},
        {"sm__pipe_fma_cycles_active.avg.pct_of_peak_sustained_active", "float arithmetic [%]", 1},
        {"sm__pipe_fp64_cycles_active.avg.pct_of_peak_sustained_active", "double arithmetic [%]",
         1},
        {"lts__t_bytes.sum", "second-level cache [MB]", 1e-6},
        {"lts__t_sectors.avg.pct_of_peak_sustained_elapsed", "second-level cache [%]", 1},
        {"dram__bytes.sum", "memory [MB]", 1e-6},
        {"dram__throughput.avg.pct_of_peak_sustained_elapsed", "memory [%]", 1},
        {"sm__warps_active.avg.pct_of_peak_sustained_active", "warps in residence [%]", 1}};
    std::vector<std::string> head{"metric"};
    for (const std::string& precision : t.values("precision")) {
      for (const char* kernel : {"pass 1", "pass 2"}) {
        head.push_back(fmt::format("{}, {}", kernel, precision));
      }
    }
    std::vector<std::vector<std::string>> rows;
    for (const Metric& m : metrics) {
      std::vector<std::string> row{m.title};
      for (const std::string& precision : t.values("precision")) {
        for (const char* kernel : {"pass 1", "pass 2"}) {
          const auto r = t.find({{"precision", precision}, {"kernel", kernel}, {"metric", m.name}});
          row.push_back(r ? fmt::format("{:.3g}", t.number(*r, "value") * m.scale) : "–");
        }
      }
      rows.push_back(row);
    }
    text_ += table_text(head, rows);
  }

  void tried() {
    text_ +=
        "## What was tried\n\n"
        "In the order of what it gained, from a thread a phyxel over compressed rows: tiles in "
        "shared memory with 16-bit slots; lists ordered so that eight lanes never wait for a "
        "column of shared memory, with broadcasts counted as free; the own stress through a "
        "constant of the cloud; a tile's own phyxels in its first slots, lists 16 bytes at a time, "
        "constants fetched into the second-level cache ahead of their use. What lost: two phyxels "
        "a lane (half the loads, too few warps), tiles of 512 and 1024 (too few blocks in "
        "residence), filling lists up with the lane's own phyxel instead of far points (it meets "
        "others in a column), records half as precise. Launches that begin while the last one ends "
        "gained 2 to 5% at half a million phyxels, nothing above, and lost a third at 27 thousand: "
        "graphs gain 4 to 17% below a million and lose nowhere. For surfels, gradients found by "
        "each block of surfels itself lost a half to the tiles' own pass, and lists of carriers "
        "common to a warp won 4% where surfels are dense and lost 20% where they are not; of a "
        "resident body's surfels, one launch a step lost a third to sixteen steps together, and "
        "blocks that walk the sixteen steps one after another lost up to a half to a block a step. "
        "In clusters: fetching the next neighbours' stresses while the present ones are summed "
        "(the longer loop waits for its own "
        "instructions).\n";
  }

  fs::path results_;
  std::string link_, text_;
};

}  // namespace

void write_bench_page(const fs::path& results, const fs::path& page) {
  if (!fs::is_directory(results)) {
    throw InputError(
        fmt::format("{}: no such folder; allowed: one with the tables of `phyxel "
                    "bench`",
                    results.string()));
  }
  const fs::path folder = page.has_parent_path() ? page.parent_path() : fs::path(".");
  const std::string link = markdown_link(fs::relative(results, folder)) + "/";
  write_whole_file(page, Page(results, link).write(), Durable::no);
}

}  // namespace phyxel::app
