/// The figures of section 6: Figure 1 from a simulation, the other figures from the tables.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "camera.hpp"
#include "compose.hpp"
#include "paper.hpp"
#include "paper/paper_backend.hpp"
#include "paper/paper_model.hpp"
#include "phyxel/shapes.hpp"
#include "phyxel/solver.hpp"
#include "plot.hpp"
#include "png_file.hpp"

namespace phyxel::app {
namespace {

namespace fs = std::filesystem;

constexpr double hanging_seconds = 0.6;

/// Direction of the camera: from the front for the head, from the side for the other bodies.
Vec3d view_of(const std::string& body, Pose pose) {
  if (body != "alien_head") return {-1, 2, -0.6};
  return pose == Pose::rest ? Vec3d{-1, -0.15, -0.06} : Vec3d{-1, -0.15, 0.06};
}

void draw_body(const fs::path& file, Vec3d view, const FrameData& surface,
               const FrameData& phyxels) {
  CameraFit fit(640, 640, view, {0, 0, 1});
  fit.include(surface.point);
  Setting setting;
  setting.camera = fit.camera();
  setting.extent = fit.extent();
  setting.spacing = typical_spacing(phyxels.point);
  write_png(file, draw_picture(&surface, &phyxels, setting));
}

/// Draws the present state of a body.
void draw_state(const fs::path& file, Vec3d view, const Model& model, paper::PaperBackend& backend,
                const Solver& solver) {
  const State state = solver.state();
  SurfelState surfels;
  backend.advect_surfels(surfels);
  FrameData surface, phyxels;
  surface.time = phyxels.time = state.time;
  surface.point = surfels.position;
  surface.normal = surfels.normal;
  surface.triangle = model.surfels.triangle;
  for (Index i = 0; i < model.size(); ++i) {
    phyxels.point.push_back(model.position[i] + state.displacement[i]);
  }
  draw_body(file, view, surface, phyxels);
}

/// The curve of y over x of matching rows.
Curve curve_of(const CsvTable& table, const std::string& label, const std::string& x,
               const std::string& y, const Match& match) {
  Curve curve{label, {}, {}};
  for (std::size_t r = 0; r < table.rows.size(); ++r) {
    if (!table.matches(r, match) || table.text(r, y).empty()) continue;
    curve.x.push_back(table.number(r, x));
    curve.y.push_back(table.number(r, y));
  }
  return curve;
}

void add_if_any(LineChart& chart, Curve curve) {
  if (!curve.x.empty()) chart.curves.push_back(std::move(curve));
}

/// Adds the line of real time, the frame rate of video in the paper's introduction.
void add_real_time(LineChart& chart, const CsvTable& frames) {
  if (chart.curves.empty()) return;
  double most = 1;
  for (std::size_t r = 0; r < frames.rows.size(); ++r) {
    most = std::max(most, frames.number(r, "objects"));
  }
  Curve line{fmt::format("real time, {} frames/s", real_time_rate), {1, most}, {}};
  line.y.assign(2, real_time_rate);
  line.level = true;
  chart.curves.push_back(std::move(line));
}

/// Figures 2 and 3. A frame is a step; dashed lines are the number of steps in a second of motion.
LineChart rates(const CsvTable& frames, const std::string& title, const std::string& with_surfels) {
  LineChart chart{title, "objects", "frames per second", false, true, {}};
  const std::vector<std::string>& bodies = paper::body_names();
  for (const bool needed : {false, true}) {
    if (needed && !frames.has("step_s")) break;  // a table of an earlier version
    for (std::size_t b = 0; b < bodies.size(); ++b) {
      Curve curve = curve_of(frames, bodies[b], "objects", needed ? "step_s" : "frames_per_s",
                             {{"body", bodies[b]},
                              {"program", "kernels of 2008"},
                              {"with_surfels", with_surfels},
                              {"frames", "shown"}});
      curve.colour = static_cast<int>(b) + 1;
      curve.dashed = needed;
      if (needed) {
        curve.label += ", steps in a second of motion";
        for (double& y : curve.y) y = 1 / y;
      }
      add_if_any(chart, std::move(curve));
    }
  }
  add_real_time(chart, frames);
  return chart;
}

/// Figures 4 and 5: the GPU, the paper's sequential program (dashed), and phyxel's CPU solver on
/// all cores (dotted).
LineChart comparison(const CsvTable& frames, const std::string& title,
                     const std::string& with_surfels) {
  LineChart chart{title, "objects", "frames per second", false, true, {}};
  const std::vector<std::string> own_cores =
      frames.values("cores", {{"program", "phyxel CPU"}, {"with_surfels", with_surfels}});
  struct Way {
    std::string program, cores, label;
  };
  std::vector<Way> ways{{"kernels of 2008", "0", "GPU"}, {"sequential of 2008", "1", "sequential"}};
  if (!own_cores.empty()) {
    const std::string& most = own_cores.back();
    ways.push_back(
        {"phyxel CPU", most, fmt::format("phyxel CPU, {} core{}", most, most == "1" ? "" : "s")});
  }
  const std::vector<std::string>& bodies = paper::body_names();
  for (std::size_t w = 0; w < ways.size(); ++w) {
    for (std::size_t b = 0; b < bodies.size(); ++b) {
      Curve curve = curve_of(frames, bodies[b] + ", " + ways[w].label, "objects", "frames_per_s",
                             {{"body", bodies[b]},
                              {"program", ways[w].program},
                              {"cores", ways[w].cores},
                              {"with_surfels", with_surfels},
                              {"frames", "shown"}});
      curve.colour = static_cast<int>(b) + 1;
      curve.dashed = w == 1;
      curve.dotted = w == 2;
      add_if_any(chart, std::move(curve));
    }
  }
  add_real_time(chart, frames);
  return chart;
}

/// Speed-ups of the GPU over the sequential program for one object, beside those of Figures 4 and 5
/// of the paper.
BarChart speedup_chart(const CsvTable& frames) {
  BarChart chart{"GPU over the sequential program, one object", "speedup", true, {}, {}};
  BarChart::Series of_paper{"the paper prints", {}}, phyxels{"phyxels", {}},
      both{"phyxels and surfels", {}};
  for (const PrintedSpeedup& paper : printed_speedups) {
    const auto ratio = [&](const char* surfels) {
      const auto rate = [&](const char* program) {
        const auto row = frames.find({{"body", paper.body},
                                      {"program", program},
                                      {"objects", "1"},
                                      {"with_surfels", surfels},
                                      {"frames", "shown"}});
        return row ? frames.number(*row, "frames_per_s") : NAN;
      };
      return rate("kernels of 2008") / rate("sequential of 2008");
    };
    const double with = ratio("yes"), without = ratio("no");
    if (std::isnan(with) && std::isnan(without)) continue;
    chart.groups.push_back(paper.body);
    of_paper.values.push_back(paper.speedup);
    phyxels.values.push_back(without);
    both.values.push_back(with);
  }
  if (!chart.groups.empty()) chart.series = {of_paper, phyxels, both};
  return chart;
}

LineChart absolute_times(const CsvTable& frames) {
  LineChart chart{"Figure 6: phyxels and surfels, kernels of 2008",
                  "objects",
                  "milliseconds per frame",
                  false,
                  true,
                  {}};
  for (const std::string& body : paper::body_names()) {
    for (const char* how : {"shown", "queued"}) {
      add_if_any(chart,
                 curve_of(frames, fmt::format("{}, {}", body, how), "objects", "ms_per_frame",
                          {{"body", body},
                           {"program", "kernels of 2008"},
                           {"with_surfels", "yes"},
                           {"frames", how}}));
    }
  }
  return chart;
}

LineChart memory_chart(const CsvTable& memory) {
  LineChart chart{"Memory that one body takes", "phyxels", "bytes, measured", true, true, {}};
  const auto add = [&](const char* label, const char* program, const char* numbers) {
    add_if_any(chart, curve_of(memory, label, "phyxels", "measured_bytes",
                               {{"program", program},
                                {"numbers_a_pair", numbers},
                                {"bodies", "1"},
                                {"answer", "fits"}}));
  };
  add("n x n forces", "kernels of 2008", "3");
  add("nine numbers a pair", "matrix alone", "9");
  add("CSR gather", "CSR gather", "0");
  return chart;
}

LineChart stiffness_chart(const CsvTable& stiffness) {
  LineChart chart{"Stress of a spinning bar against long double",
                  "Young's modulus [Pa]",
                  "relative error",
                  true,
                  true,
                  {}};
  for (const char* precision : {"float", "double"}) {
    for (const char* fraction : {"0.1", "0.5", "0.9"}) {
      add_if_any(chart,
                 curve_of(stiffness, fmt::format("{}, {} of the step limit", precision, fraction),
                          "young_pa", "stress_error",
                          {{"precision", precision}, {"step_of_limit", fraction}}));
    }
  }
  return chart;
}

}  // namespace

fs::path figure_1_file(const fs::path& folder, const std::string& body, Pose pose) {
  const char* ending[] = {"_rest", "", "_soft", "_stiff"};
  return folder / fmt::format("figure1_{}{}.png", body, ending[static_cast<int>(pose)]);
}

std::vector<fs::path> draw_figure_1(const PaperRequest& request) {
  std::vector<fs::path> files;
  for (const std::string& name : request.bodies) {
    const Cloud cloud = make_shape({.name = name});
    FrameData surface, phyxels;
    surface.point = cloud.surface.position;
    surface.normal = cloud.surface.normal;
    surface.triangle = cloud.surface.triangle;
    phyxels.point = cloud.position;
    files.push_back(figure_1_file(request.out, name, Pose::rest));
    draw_body(files.back(), view_of(name, Pose::rest), surface, phyxels);
    say(files.back().string() + " as it was made");

    const std::vector<Cloud> placed = make_clouds(paper::body_scene(name), {});
    for (const Pose pose : {Pose::hanging, Pose::soft, Pose::stiff}) {
      Scene scene = paper::body_scene(name);
      if (pose == Pose::soft) scene.bodies[0].material.young = softest;
      if (pose == Pose::stiff) scene.bodies[0].material.young = stiffest;
      const Model model = paper::paper_model(scene, placed);
      const auto backend = request.gpu
                               ? paper::make_gpu_backend(model, {.device = request.gpu->index})
                               : paper::make_sequential_backend<float>(model);
      Solver solver(*backend, initial_state(model, scene, 0.5 * step_limit(model).largest_step));
      while (solver.time() < hanging_seconds) solver.step();
      files.push_back(figure_1_file(request.out, name, pose));
      draw_state(files.back(), view_of(name, pose), model, *backend, solver);
      say(fmt::format("{} after {:.2f} s by {}", files.back().string(), solver.time(),
                      backend->name()));
    }
  }
  return files;
}

std::vector<fs::path> figure_files(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const char* name :
       {"figure2", "figure3", "figure4", "figure5", "figure6", "speedups", "memory", "stiffness"}) {
    files.push_back(folder / (std::string(name) + ".svg"));
  }
  return files;
}

std::vector<fs::path> draw_figures(const fs::path& folder) {
  std::vector<fs::path> files;
  const auto draw = [&](const char* name, const auto& chart, bool any) {
    const fs::path file = folder / (std::string(name) + ".svg");
    if (!any) {
      fs::remove(file);  // it belongs to an earlier measurement
      return;
    }
    draw_svg(script_of(chart), file);
    files.push_back(file);
  };
  const auto draw_lines = [&](const char* name, const LineChart& chart) {
    draw(name, chart, !chart.curves.empty());
  };
  const auto draw_bars = [&](const char* name, const BarChart& chart) {
    draw(name, chart, !chart.series.empty());
  };
  if (const auto frames = read_table(folder, paper_table::frames)) {
    draw_lines("figure2", rates(*frames, "Figure 2: phyxels only, kernels of 2008", "no"));
    draw_lines("figure3", rates(*frames, "Figure 3: phyxels and surfels, kernels of 2008", "yes"));
    draw_lines("figure4", comparison(*frames, "Figure 4: CPU and GPU, phyxels only", "no"));
    draw_lines("figure5", comparison(*frames, "Figure 5: CPU and GPU, phyxels and surfels", "yes"));
    draw_bars("speedups", speedup_chart(*frames));
    draw_lines("figure6", absolute_times(*frames));
  }
  if (const auto memory = read_table(folder, paper_table::memory)) {
    draw_lines("memory", memory_chart(*memory));
  }
  if (const auto stiffness = read_table(folder, paper_table::stiffness)) {
    draw_lines("stiffness", stiffness_chart(*stiffness));
  }
  return files;
}

}  // namespace phyxel::app
