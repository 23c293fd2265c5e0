#include "scaling_model.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "markdown.hpp"

namespace phyxel::app {
namespace {

/// Of links between nodes, which were not measured: one of 400 Gbit/s for each GPU.
constexpr double network_bytes_per_s = 50e9, network_latency = 5e-6;

/// Seconds of a step of one GPU, by its phyxels.
class OneGpu {
 public:
  explicit OneGpu(const CsvTable& sizes) {
    for (std::size_t r = 0; r < sizes.rows.size(); ++r) {
      if (!sizes.matches(r, {{"bodies", "1"}, {"terms", "green"}, {"precision", "float"}}))
        continue;
      points_.emplace_back(sizes.number(r, "phyxels"), 1 / sizes.number(r, "steps_per_s"));
    }
    std::sort(points_.begin(), points_.end());
  }
  bool is_known() const { return points_.size() > 1; }
  /// Between sizes measured by a power law; beyond them in proportion.
  double seconds(double phyxels) const {
    const auto above = std::find_if(points_.begin(), points_.end(),
                                    [&](const auto& point) { return point.first >= phyxels; });
    if (above == points_.begin()) return above->second;
    const auto& [n, t] = above[-1];
    if (above == points_.end()) return t * phyxels / n;
    return t * std::pow(above->second / t, std::log(phyxels / n) / std::log(above->first / n));
  }

 private:
  std::vector<std::pair<double, double>> points_;
};

/// A line through what exchanges have added to steps.
struct Fit {
  double latency = 0, bytes_per_s = 0;  ///< [s]
  double slowdown = 0;                  ///< Of one GPU on that day, against the table of sizes.
  double layers = 0;                    ///< Of ghosts at a face.
  double bytes_per_ghost = 0;
  int rows = 0;
};

Fit fitted(const std::vector<CsvTable>& tables, const OneGpu& one) {
  struct Point {
    double bytes, seconds;
  };
  std::vector<Point> points;
  Fit fit;
  for (const CsvTable& table : tables) {
    for (std::size_t r = 0; r < table.rows.size(); ++r) {
      if (table.text(r, "phyxels_alone").empty() || table.number(r, "ranks") < 2 ||
          table.text(r, "precision") != "float" ||
          table.text(r, "transport").find("IPC") == std::string::npos) {
        continue;
      }
      const double alone = table.number(r, "phyxels_alone"),
                   slowdown =
                       alone / table.number(r, "phyxel_steps_per_s_alone") / one.seconds(alone),
                   ghosts = table.number(r, "most_ghosts"),
                   bytes = table.number(r, "bytes_per_step");
      points.push_back({bytes, 1 / table.number(r, "steps_per_s") -
                                   slowdown * one.seconds(table.number(r, "most"))});
      fit.slowdown += slowdown;
      fit.bytes_per_ghost += bytes / ghosts;
      if (table.number(r, "ranks") == 2 && table.text(r, "cut_by") == "curve") {
        fit.layers = ghosts / std::pow(table.number(r, "phyxels"), 2.0 / 3);  // one face each
      }
    }
  }
  fit.rows = static_cast<int>(points.size());
  if (points.size() < 3) return fit;
  const double count = static_cast<double>(points.size());
  fit.slowdown /= count;
  fit.bytes_per_ghost /= count;
  double bytes = 0, seconds = 0, square = 0, product = 0;
  for (const Point& p : points) {
    bytes += p.bytes / count;
    seconds += p.seconds / count;
  }
  for (const Point& p : points) {
    square += (p.bytes - bytes) * (p.bytes - bytes);
    product += (p.bytes - bytes) * (p.seconds - seconds);
  }
  fit.bytes_per_s = square / product;
  fit.latency = std::max(0.0, seconds - bytes / fit.bytes_per_s);
  return fit;
}

}  // namespace

std::string scaling_model(const std::vector<CsvTable>& tables, const CsvTable& sizes) {
  const OneGpu one(sizes);
  if (!one.is_known()) return "";
  const Fit fit = fitted(tables, one);
  if (fit.rows < 3 || fit.layers == 0 || !(fit.bytes_per_s > 0)) return "";
  std::string text = fmt::format(
      "### A model of more GPUs\n\nNot a measurement. A step of a part takes what one GPU takes "
      "for "
      "as many phyxels (its table of sizes, times {:.3f} for the clocks of that day), and for its "
      "exchanges {:.1f} µs and a second for every {:.0f} GB: a line fitted to the {} rows above. "
      "Parts are cubes with {:.2f} layers of ghosts on six faces, {:.0f} bytes each. *Between "
      "nodes* "
      "each GPU is given {:.0f} GB/s and {:.0f} µs for each of the two exchanges instead, which "
      "are "
      "assumed: no second node was to be had.\n\n",
      fit.slowdown, 1e6 * fit.latency, 1e-9 * fit.bytes_per_s, fit.rows, fit.layers,
      fit.bytes_per_ghost, 1e-9 * network_bytes_per_s, 1e6 * network_latency);
  struct Case {
    const char* name;
    double phyxels;
    bool each;  // of one GPU
  };
  std::vector<std::vector<std::string>> rows;
  for (const Case& c : {Case{"17 million", 17e6, false}, Case{"a billion", 1e9, false},
                        Case{"16 million a GPU", 16e6, true}}) {
    for (const int gpus : {8, 64, 512, 1024}) {
      const double part = c.each ? c.phyxels : c.phyxels / gpus;
      const double alone = fit.slowdown * one.seconds(part);
      const double bytes = fit.bytes_per_ghost * 6 * fit.layers * std::pow(part, 2.0 / 3);
      const double near = alone + fit.latency + bytes / fit.bytes_per_s;
      const double far = alone + fit.latency + 2 * network_latency + bytes / network_bytes_per_s;
      // One GPU with the whole body, or with its part.
      const double ideal = c.each ? alone : fit.slowdown * one.seconds(c.phyxels) / gpus;
      const auto efficiency = [&](double seconds) {
        return fmt::format("{:.0f}%", 100 * ideal / seconds);
      };
      rows.push_back({c.name, std::to_string(gpus), fmt::format("{:.0f}", 1 / near),
                      efficiency(near), gpus > 8 ? fmt::format("{:.0f}", 1 / far) : "–",
                      gpus > 8 ? efficiency(far) : "–"});
    }
  }
  return text + table_text({"phyxels", "GPUs", "steps/s, one kind of link", "efficiency",
                            "steps/s, between nodes", "efficiency"},
                           rows);
}

}  // namespace phyxel::app
