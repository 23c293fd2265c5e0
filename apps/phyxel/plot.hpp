/// Line and bar charts as SVG, drawn by gnuplot.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace phyxel::app {

struct Curve {
  std::string label;
  std::vector<double> x, y;  ///< Of one length.
  int colour = 0;            ///< 1 to 6; 0: by its place in the chart.
  bool dashed = false;
  bool dotted = false;
  bool level = false;  ///< A grey line without points: something that the others are held against.
};

struct LineChart {
  std::string title, x_label, y_label;
  bool log_x = false, log_y = false;
  std::vector<Curve> curves;
};

/// Groups of bars side by side, a bar of every group for each series.
struct BarChart {
  std::string title, y_label;
  bool log_y = true;
  std::vector<std::string> groups;
  struct Series {
    std::string label;
    std::vector<double> values;  ///< One a group; NaN: no bar.
  };
  std::vector<Series> series;
};

/// Whether gnuplot is on the path.
bool can_plot();

/// What a chart is drawn from: a gnuplot script with its data inside, the same for the same chart.
std::string script_of(const LineChart& chart);
std::string script_of(const BarChart& chart);

/// Draws the script into an SVG file. @throws OutputError with gnuplot's words.
void draw_svg(const std::string& script, const std::filesystem::path& file);

}  // namespace phyxel::app
