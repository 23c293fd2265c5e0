/// Line and bar charts as SVG, drawn by gnuplot.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace phyxel::app {

struct Curve {
  std::string label;
  std::vector<double> x, y;  ///< Points; equal lengths.
  int colour = 0;            ///< 1 to 6; 0 for the colour of its number in the chart.
  bool dashed = false;
  bool dotted = false;
  bool level = false;  ///< True for a grey reference line without points.
};

struct LineChart {
  std::string title, x_label, y_label;
  bool log_x = false, log_y = false;
  std::vector<Curve> curves;
};

/// A chart of groups of bars, in which each group has a bar of each series.
struct BarChart {
  std::string title, y_label;
  bool log_y = true;
  std::vector<std::string> groups;
  struct Series {
    std::string label;
    std::vector<double> values;  ///< A value for each group; NaN for no bar.
  };
  std::vector<Series> series;
};

/// True if gnuplot is on the path.
bool can_plot();

/// The gnuplot script of a chart, including its data; equal charts give equal scripts.
std::string script_of(const LineChart& chart);
std::string script_of(const BarChart& chart);

/// Draws the script into an SVG file. @throws OutputError with gnuplot's message
void draw_svg(const std::string& script, const std::filesystem::path& file);

}  // namespace phyxel::app
