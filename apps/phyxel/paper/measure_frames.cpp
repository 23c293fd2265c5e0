/// Frame rates: Figures 2 to 6.
#include <fmt/format.h>
#include <omp.h>

#include <algorithm>
#include <functional>
#include <memory>

#include "paper.hpp"
#include "paper/paper_backend.hpp"
#include "paper/paper_model.hpp"
#include "phyxel/solver.hpp"
#include "stopwatch.hpp"

namespace phyxel::app {
namespace {

struct Body {
  std::string name;
  Scene scene;
  Model model;
  State start;
};

/// Makes a body. @param one a positioned cloud of the body
Body make_body(const std::string& name, int copies, const Cloud& one) {
  Body body{name, paper::body_scene(name, copies), {}, {}};
  const std::vector<Cloud> clouds(static_cast<std::size_t>(copies), one);
  body.model = paper::paper_model(body.scene, clouds);
  body.start = initial_state(body.model, body.scene, 0.5 * step_limit(body.model).largest_step);
  return body;
}

/// Time of a frame [s]: the median over the repeats.
Median time_frames(const PaperRequest& request, const std::function<void(int)>& run_frames) {
  run_frames(2);
  auto start = Clock::now();
  run_frames(3);
  const double estimate = seconds_since(start) / 3;
  const int frames = std::clamp(static_cast<int>(request.seconds / estimate), 3, 1'000'000);
  std::vector<double> seconds;
  for (int r = 0; r < request.repeat; ++r) {
    start = Clock::now();
    run_frames(frames);
    seconds.push_back(seconds_since(start) / frames);
  }
  return median_of(seconds);
}

/// Several objects of the 2008 program, each with its own launches.
class Objects {
 public:
  template <class Make>
  Objects(const Body& body, int count, bool surfels, Make&& make)
      : surfels_(surfels), dt_(body.start.dt) {
    for (int k = 0; k < count; ++k) {
      objects_.push_back(make(body.model));
      objects_.back()->upload(body.start);
    }
  }
  /// Steps all objects. @param wait true if the host synchronises after each frame, as it must to
  /// show
  ///   frames
  void run(int frames, bool wait) {
    for (int f = 0; f < frames; ++f) {
      for (auto& object : objects_) {
        object->stress();
        if (surfels_) object->update_surfels();
        object->advance(0, dt_);
      }
      if (wait) objects_.back()->wait();
    }
    objects_.back()->wait();
  }

 private:
  std::vector<std::unique_ptr<paper::PaperBackend>> objects_;
  bool surfels_;
  double dt_;
};

class FrameTable {
 public:
  explicit FrameTable(const PaperRequest& request) : request_(request) {
    table_.facts = paper_facts(request);
    table_.facts.emplace_back("repeats", std::to_string(request.repeat));
    table_.columns = {"body",         "phyxels", "surfels",      "program", "cores",
                      "threads",      "objects", "with_surfels", "frames",  "frames_per_s",
                      "ms_per_frame", "spread",  "step_s"};
  }
  /// Adds a row. @param cores cores available to a CPU program, which may use fewer; 0 for a GPU
  void add(const Body& body, const char* program, int cores, int threads, int objects, bool surfels,
           const char* frames, const std::function<void(int)>& run) {
    const Median time = time_frames(request_, run);
    table_.rows.push_back(
        {body.name, std::to_string(body.model.size() / body.scene.bodies.size()),
         std::to_string(body.model.surfels.position.size() / body.scene.bodies.size()), program,
         std::to_string(cores), std::to_string(threads), std::to_string(objects),
         surfels ? "yes" : "no", frames, fmt::format("{:.5g}", 1 / time.value),
         fmt::format("{:.5g}", 1e3 * time.value), fmt::format("{:.3f}", time.spread),
         fmt::format("{:.4g}", body.start.dt)});
    say(fmt::format("{:10} x {:2} {:8} {:22} {:2} threads, {:6}: {:10.1f} frames/s", body.name,
                    objects, surfels ? "surfels" : "phyxels", program, threads, frames,
                    1 / time.value));
  }
  CsvTable take() { return std::move(table_); }

 private:
  const PaperRequest& request_;
  CsvTable table_;
};

void measure_gpu(const PaperRequest& request, const Body& body, bool surfels, bool queued,
                 FrameTable& table) {
  for (int objects = 1; objects <= request.objects; ++objects) {
    Objects group(body, objects, surfels, [&](const Model& model) {
      return paper::make_gpu_backend(model, {.device = request.gpu->index});
    });
    table.add(body, "kernels of 2008", 0, 0, objects, surfels, "shown",
              [&](int frames) { group.run(frames, true); });
    if (!queued) continue;
    table.add(body, "kernels of 2008", 0, 0, objects, surfels, "queued",
              [&](int frames) { group.run(frames, false); });
  }
}

/// Measures the sequential program of 2008, and phyxel's CPU solver on one core and on all.
/// @param together the same number of objects in one model
void measure_cpu(const Body& one, const Body& together, bool surfels, FrameTable& table) {
  const int objects = static_cast<int>(together.scene.bodies.size());
  Objects group(one, objects, surfels, paper::make_sequential_backend<float>);
  table.add(one, "sequential of 2008", 1, 1, objects, surfels, "shown",
            [&](int frames) { group.run(frames, true); });

  std::vector<int> cores{1};
  if (omp_get_num_procs() > 1) cores.push_back(omp_get_num_procs());
  for (const int c : cores) {
    const auto backend = make_cpu_backend(together.model, Precision::single, c);
    Solver solver(*backend, together.start);
    SurfelState vertices;
    table.add(together, "phyxel CPU", c, surfels ? c : backend->threads(), objects, surfels,
              "shown", [&](int frames) {
                for (int f = 0; f < frames; ++f) {
                  solver.step();
                  if (surfels) backend->advect_surfels(vertices);
                }
              });
  }
}

}  // namespace

CsvTable measure_frames(const PaperRequest& request, const std::vector<int>& figures) {
  const auto wanted = [&](std::initializer_list<int> any) {
    return std::any_of(any.begin(), any.end(), [&](int figure) {
      return std::find(figures.begin(), figures.end(), figure) != figures.end();
    });
  };
  FrameTable table(request);
  for (const std::string& name : request.bodies) {
    const Cloud cloud = make_clouds(paper::body_scene(name), {}).front();
    const Body one = make_body(name, 1, cloud);
    for (const bool surfels : {false, true}) {
      const bool gpu = surfels ? wanted({3, 5, 6}) : wanted({2, 4});
      const bool cpu = surfels ? wanted({5, 6}) : wanted({4});
      if (gpu && request.gpu) measure_gpu(request, one, surfels, surfels, table);
      for (int objects = 1; cpu && objects <= request.objects; ++objects) {
        measure_cpu(one, make_body(name, objects, cloud), surfels, table);
      }
    }
  }
  return table.take();
}

}  // namespace phyxel::app
