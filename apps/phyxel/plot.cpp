#include "plot.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <sstream>

#include "files/atomic_file.hpp"
#include "phyxel/error.hpp"

namespace phyxel::app {
namespace {

namespace fs = std::filesystem;

/// Between double quotes.
std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    out += c;
  }
  return out + "\"";
}

std::string number(double value) {
  return std::isfinite(value) ? fmt::format("{:.9g}", value) : "?";
}

/// @param place of the curve in its chart, from 1
std::string style_of(const Curve& curve, int place) {
  if (curve.level) return "lines lt 1 lc rgb '#808080' dt 4";
  return fmt::format("linespoints lt {}{}", curve.colour ? curve.colour : place,
                     curve.dashed   ? " dt 2"
                     : curve.dotted ? " dt 3"
                                    : "");
}

std::string head(const std::string& title, const std::string& y_label) {
  return "set encoding utf8\nset title " + quoted(title) + " noenhanced\nset ylabel " +
         quoted(y_label) +
         " noenhanced\nset grid ytics lc rgb '#d0d0d0'\nset border 3\nset tics nomirror\nset "
         "datafile missing '?'\n"
         "set key below noenhanced\n"
         "set linetype 1 lc rgb '#0072b2' lw 2 pt 7\nset linetype 2 lc rgb '#d55e00' lw 2 pt 5\n"
         "set linetype 3 lc rgb '#009e73' lw 2 pt 9\nset linetype 4 lc rgb '#cc79a7' lw 2 pt 13\n"
         "set linetype 5 lc rgb '#e69f00' lw 2 pt 11\nset linetype 6 lc rgb '#56b4e9' lw 2 pt 3\n";
}

fs::path gnuplot() {
  const char* path = std::getenv("PATH");
  std::istringstream folders(path ? path : "");
  for (std::string folder; std::getline(folders, folder, ':');) {
    const fs::path program = fs::path(folder) / "gnuplot";
    if (access(program.c_str(), X_OK) == 0) return program;
  }
  return {};
}

std::string output_of(const std::string& command, int* status) {
  std::string text;
  FILE* pipe = popen(command.c_str(), "r");
  if (!pipe) {
    *status = -1;
    return "no process could be started";
  }
  char buffer[4096];
  for (std::size_t got; (got = fread(buffer, 1, sizeof buffer, pipe)) > 0;)
    text.append(buffer, got);
  *status = pclose(pipe);
  return text;
}

}  // namespace

bool can_plot() { return !gnuplot().empty(); }

std::string script_of(const LineChart& chart) {
  std::string script = head(chart.title, chart.y_label);
  script += "set xlabel " + quoted(chart.x_label) + " offset 0,0.5 noenhanced\n";
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
                         style_of(curve, static_cast<int>(c) + 1), quoted(curve.label));
  }
  return script + "plot " + plots + "\n";
}

std::string script_of(const BarChart& chart) {
  std::string script = head(chart.title, chart.y_label);
  script +=
      "set style data histogram\nset style histogram clustered gap 1\n"
      "set style fill solid noborder\nset boxwidth 0.9\nset xtics noenhanced font ',12'\n";
  // Groups stand at 0, 1, 2 …; gnuplot's own range leaves room for two more.
  script +=
      fmt::format("set xrange [-0.6:{}]\n", number(static_cast<double>(chart.groups.size()) - 0.4));
  if (chart.log_y) {
    double lowest = HUGE_VAL;
    for (const auto& series : chart.series) {
      for (const double value : series.values) {
        if (value > 0) lowest = std::min(lowest, value);
      }
    }
    // Bars of a logarithmic axis stand on a power of ten below them all.
    const double floor = std::pow(10, std::floor(std::log10(lowest) - 0.3));
    script +=
        fmt::format("set logscale y\nset yrange [{}:*]\nset format y '10^{{%T}}'\n", number(floor));
  }
  script += "$bars << EOD\n";
  for (std::size_t g = 0; g < chart.groups.size(); ++g) {
    script += quoted(chart.groups[g]);
    for (const auto& series : chart.series) script += " " + number(series.values[g]);
    script += "\n";
  }
  script += "EOD\nplot ";
  for (std::size_t s = 0; s < chart.series.size(); ++s) {
    script += fmt::format("{}$bars using {}{} lt {} title {}", s ? ", " : "", s + 2,
                          s == 0 ? ":xtic(1)" : "", s + 1, quoted(chart.series[s].label));
  }
  return script + "\n";
}

void draw_svg(const std::string& script, const fs::path& file) {
  const fs::path program = gnuplot();
  if (program.empty()) throw OutputError("gnuplot was not found (Debian: gnuplot-nox)");
  fs::path source = file, drawing = file;
  source += ".gp.tmp";
  drawing += ".tmp";
  write_whole_file(source,
                   "set terminal svg size 800,450 font 'sans,14' background rgb 'white'\n"
                   "set output " +
                       quoted(drawing.string()) + "\n" + script,
                   Durable::no);
  std::string shell = "'";
  for (const char c : source.string())
    shell += c == '\'' ? std::string("'\\''") : std::string(1, c);
  int status = 0;
  const std::string words = output_of(program.string() + " " + shell + "' 2>&1", &status);
  fs::remove(source);
  if (status != 0 || !fs::exists(drawing)) {
    fs::remove(drawing);
    throw OutputError(fmt::format("{}: gnuplot failed: {}", file.string(), words));
  }
  move_into_place(drawing, file, Durable::no);
}

}  // namespace phyxel::app
