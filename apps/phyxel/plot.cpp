#include "plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "child_process.hpp"
#include "files/atomic_file.hpp"
#include "outside_text.hpp"
#include "phyxel/error.hpp"

namespace phyxel::app {
namespace {

namespace fs = std::filesystem;

std::string number(double value) {
  return std::isfinite(value) ? fmt::format("{:.9g}", value) : "?";
}

/// The line style of a curve. @param place number of the curve in its chart, from 1
std::string style_of(const Curve& curve, int place) {
  if (curve.level) return "lines lt 1 lc rgb '#808080' dt 4";
  return fmt::format("linespoints lt {}{}", curve.colour ? curve.colour : place,
                     curve.dashed   ? " dt 2"
                     : curve.dotted ? " dt 3"
                                    : "");
}

std::string head(const std::string& title, const std::string& y_label) {
  return "set encoding utf8\nset title " + gnuplot_string(title) + " noenhanced\nset ylabel " +
         gnuplot_string(y_label) +
         " noenhanced\nset grid ytics lc rgb '#d0d0d0'\nset border 3\nset tics nomirror\nset "
         "datafile missing '?'\n"
         "set key below noenhanced\n"
         "set linetype 1 lc rgb '#0072b2' lw 2 pt 7\nset linetype 2 lc rgb '#d55e00' lw 2 pt 5\n"
         "set linetype 3 lc rgb '#009e73' lw 2 pt 9\nset linetype 4 lc rgb '#cc79a7' lw 2 pt 13\n"
         "set linetype 5 lc rgb '#e69f00' lw 2 pt 11\nset linetype 6 lc rgb '#56b4e9' lw 2 pt 3\n";
}

fs::path gnuplot() { return program_on_path("gnuplot"); }

}  // namespace

bool can_plot() { return !gnuplot().empty(); }

std::string script_of(const LineChart& chart) {
  std::string script = head(chart.title, chart.y_label);
  script += "set xlabel " + gnuplot_string(chart.x_label) + " offset 0,0.5 noenhanced\n";
  if (chart.log_x) script += "set logscale x\nset format x '10^{%T}'\n";
  if (chart.log_y) script += "set logscale y\nset format y '10^{%T}'\n";
  std::string plots;
  for (std::size_t c = 0; c < chart.curves.size(); ++c) {
    const Curve& curve = chart.curves[c];
    script += fmt::format("$curve{} << EOD\n", c);
    for (std::size_t k = 0; k < curve.x.size(); ++k) {
      script += number(curve.x[k]) + " " + number(curve.y[k]) + "\n";
    }
    script += "EOD\n";
    plots += fmt::format("{}$curve{} using 1:2 with {} title {}", c ? ", " : "", c,
                         style_of(curve, static_cast<int>(c) + 1), gnuplot_string(curve.label));
  }
  return script + "plot " + plots + "\n";
}

std::string script_of(const BarChart& chart) {
  std::string script = head(chart.title, chart.y_label);
  script +=
      "set style data histogram\nset style histogram clustered gap 1\n"
      "set style fill solid noborder\nset boxwidth 0.9\nset xtics noenhanced font ',12'\n";
  // Groups are at 0, 1, 2 …; gnuplot's default range would leave room for two more.
  script +=
      fmt::format("set xrange [-0.6:{}]\n", number(static_cast<double>(chart.groups.size()) - 0.4));
  if (chart.log_y) {
    double lowest = HUGE_VAL;
    for (const auto& series : chart.series) {
      for (const double value : series.values) {
        if (value > 0) lowest = std::min(lowest, value);
      }
    }
    // Bars on a logarithmic axis start at a power of ten below all values.
    const double floor = std::pow(10, std::floor(std::log10(lowest) - 0.3));
    script +=
        fmt::format("set logscale y\nset yrange [{}:*]\nset format y '10^{{%T}}'\n", number(floor));
  }
  std::string tics;
  for (std::size_t g = 0; g < chart.groups.size(); ++g) {
    tics += fmt::format("{}{} {}", g ? ", " : "", gnuplot_string(chart.groups[g]), g);
  }
  script += fmt::format("set xtics ({})\n$bars << EOD\n", tics);
  for (std::size_t g = 0; g < chart.groups.size(); ++g) {
    for (const auto& series : chart.series) script += number(series.values[g]) + " ";
    script += "\n";
  }
  script += "EOD\nplot ";
  for (std::size_t s = 0; s < chart.series.size(); ++s) {
    script += fmt::format("{}$bars using {} lt {} title {}", s ? ", " : "", s + 1, s + 1,
                          gnuplot_string(chart.series[s].label));
  }
  return script + "\n";
}

void draw_svg(const std::string& script, const fs::path& file) {
  const fs::path program = gnuplot();
  if (program.empty()) throw OutputError("gnuplot was not found (Debian: gnuplot-nox)");
  // Fixed names: names that a user chose do not enter the script.
  const PrivateFolder folder;
  const fs::path source = folder.file("chart.gp"), drawing = folder.file("chart.svg"),
                 words = folder.file("words.txt");
  write_whole_file(source,
                   "set terminal svg size 800,450 font 'sans,14' background rgb 'white'\n" + script,
                   Durable::no);
  constexpr std::size_t most_read = std::size_t{1} << 26;
  Child child({program, {"-d", source.string()}, drawing, words});  // -d: without settings of users
  if (!child.wait() || fs::file_size(drawing) == 0) {
    throw OutputError(
        fmt::format("{}: gnuplot failed: {}", file.string(), read_text_file(words, most_read)));
  }
  write_whole_file(file, read_text_file(drawing, most_read), Durable::no);
}

}  // namespace phyxel::app
