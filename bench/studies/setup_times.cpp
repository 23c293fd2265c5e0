/// phyxel_studies setup: the time of each part of a body's set-up.
#include <fmt/format.h>
#include <omp.h>

#include "bench_body.hpp"
#include "device_option.hpp"
#include "phyxel/phyxel.hpp"
#include "printed_table.hpp"
#include "setup.hpp"
#include "setup/survey.hpp"
#include "stopwatch.hpp"
#include "studies.hpp"

namespace phyxel::studies {
namespace {

struct SetupOptions {
  std::vector<Index> sizes{10648, 103823, 1000000};
  std::vector<std::string> precisions{"float", "double", "mixed"};
  std::string device = "cpu";
  int repeats = 5;
  app::TableOptions table;
};

/// Measures the neighbour search on the GPU (survey), the rest of the model, the backend with its
/// neighbour lists, and the step limit. On the CPU, the model's time includes the lists.
void measure_setup(const SetupOptions& options) {
  const ChosenDevice device = app::choose_device(options.device);
  app::PrintedTable table(options.table,
                          {"precision", "threads", "phyxels", "neighbours", "survey_s", "model_s",
                           "backend_s", "limit_s", "omega_max", "iterations"},
                          app::device_facts(device));
  for (const Index size : options.sizes) {
    const Scene scene = app::bench_scene("green");
    const Cloud cloud = app::bench_cube(size);
    for (const std::string& precision : options.precisions) {
      std::vector<double> survey_time, model_time, backend_time, limit_time;
      StepLimit limit;
      double neighbours = 0;
      int threads = 0;
      for (int repeat = 0; repeat < options.repeats; ++repeat) {
        const Surveyor surveyor = [&](auto&&... cloud_and_rule) {
          const auto start = app::Clock::now();
          Survey survey = cuda_surveyor(device.gpu->index)(cloud_and_rule...);
          survey_time.push_back(app::seconds_since(start));
          return survey;
        };
        auto start = app::Clock::now();
        const Model model = device.gpu ? build_model(scene, std::span(&cloud, 1), surveyor)
                                       : build_model(scene, std::span(&cloud, 1));
        if (!device.gpu) survey_time.push_back(0);
        model_time.push_back(app::seconds_since(start) - survey_time.back());
        start = app::Clock::now();
        const auto backend =
            make_backend(model, app::precision_option(precision), device, omp_get_max_threads());
        backend->wait();
        backend_time.push_back(app::seconds_since(start));
        start = app::Clock::now();
        limit = step_limit(model, *backend);
        limit_time.push_back(app::seconds_since(start));
        neighbours = static_cast<double>(model.pairs()) / model.size();
        threads = backend->threads();
      }
      const auto seconds = [](const std::vector<double>& times) {
        return fmt::format("{:.4g}", app::median_of(times).value);
      };
      table.row({precision, std::to_string(threads), std::to_string(cloud.position.size()),
                 fmt::format("{:.1f}", neighbours), seconds(survey_time), seconds(model_time),
                 seconds(backend_time), seconds(limit_time), fmt::format("{:.8g}", limit.omega_max),
                 std::to_string(limit.iterations)});
    }
  }
}

}  // namespace

void add_setup(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "setup", "Measure the time from a cloud to the first step: neighbours, moments, step limit");
  auto options = std::make_shared<SetupOptions>();
  app::add_size_options(*command, options->sizes, options->repeats);
  command->add_option("--device", options->device, app::device_help)->capture_default_str();
  command->add_option("--precision", options->precisions, "Precisions: float, double, mixed")
      ->delimiter(',');
  app::add_table_options(*command, options->table);
  command->footer(
      "Examples:\n"
      "  phyxel_studies setup\n"
      "  phyxel_studies setup --device cuda --csv setup.csv");
  command->callback([options] { measure_setup(*options); });
}

}  // namespace phyxel::studies
