/// phyxel paper: the measurements of section 6 of Farias et al. 2008.
#include "command.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "device_option.hpp"
#include "files/atomic_file.hpp"
#include "known_names.hpp"
#include "outside_text.hpp"
#include "paper.hpp"
#include "paper/paper_model.hpp"
#include "phyxel/error.hpp"
#include "plot.hpp"

namespace phyxel::app {
namespace {

namespace fs = std::filesystem;

using Json = nlohmann::ordered_json;

FILE* progress = stdout;  ///< Stream of `say`; stderr with --json.

struct PaperOptions {
  PaperRequest request;
  std::vector<int> figures;
  std::vector<std::string> tables;
  std::string device = "auto";
  bool force = false, redraw = false, json = false;
};

const std::vector<std::string> all_tables{paper_table::kernels,   paper_table::trajectory,
                                          paper_table::young,     paper_table::memory,
                                          paper_table::stiffness, paper_table::exchange};

template <class T, class U>
bool contains(const std::vector<T>& list, const U& value) {
  return std::find(list.begin(), list.end(), value) != list.end();
}

/// Checks that files with the names of figures and page were written by this command, since each
/// measurement rewrites them. @throws InputError
void refuse_foreign_files(const fs::path& folder, bool force) {
  if (force || is_paper_page(folder / paper_page_name)) return;
  std::vector<fs::path> files = figure_files(folder);
  files.push_back(folder / paper_page_name);
  for (const fs::path& file : files) {
    if (fs::exists(file)) {
      throw InputError(
          fmt::format("{}: exists, and the folder has no page of phyxel paper; "
                      "allowed: another --out, or --force",
                      file.string()));
    }
  }
}

/// Prints the tables, figures and page of the folder.
void say_files(const fs::path& folder) {
  const auto there = [](const std::vector<fs::path>& files) {
    Json names = Json::array();
    for (const fs::path& file : files) {
      if (fs::exists(file)) names.push_back(file.string());
    }
    return names;
  };
  std::vector<fs::path> tables{table_file(folder, paper_table::frames)}, figures;
  for (const std::string& table : all_tables) tables.push_back(table_file(folder, table));
  for (const std::string& body : paper::body_names()) {
    for (const Pose pose : poses) {
      figures.push_back(figure_1_file(folder, body, pose));
    }
  }
  for (const fs::path& file : figure_files(folder)) figures.push_back(file);
  const Json said{{"page", (folder / paper_page_name).string()},
                  {"tables", there(tables)},
                  {"figures", there(figures)}};
  fmt::print("{}\n", json_text(said));
}

/// Checks the names of bodies and tables. @throws InputError
void check_names(const PaperOptions& options) {
  for (const std::string& body : options.request.bodies) paper::body_scene(body);
  check_known("--table", options.tables, all_tables);
}

/// Checks that the folder has a table. @throws InputError
void check_tables(const PaperRequest& request) {
  std::vector<std::string> tables = all_tables;
  tables.push_back(paper_table::frames);
  if (std::none_of(tables.begin(), tables.end(), [&](const std::string& table) {
        return fs::exists(table_file(request.out, table));
      })) {
    throw InputError(
        fmt::format("{}: has none of the tables ({}.csv); allowed: --out with a "
                    "folder that phyxel paper has written",
                    request.out.string(), fmt::join(tables, ".csv, ")));
  }
}

/// Checks that no file of the measurements exists, unless it may be replaced. @throws InputError
void check_outputs(const PaperOptions& options, bool rates) {
  const PaperRequest& request = options.request;
  const auto refuse_existing = [&](const fs::path& file) {
    if (fs::exists(file) && !options.force) {
      throw InputError(
          fmt::format("{}: exists; allowed: another --out, or --force", file.string()));
    }
  };
  if (contains(options.figures, 1)) {
    for (const std::string& body : request.bodies) {
      for (const Pose pose : poses) refuse_existing(figure_1_file(request.out, body, pose));
    }
  }
  if (rates) refuse_existing(table_file(request.out, paper_table::frames));
  for (const std::string& table : options.tables) refuse_existing(table_file(request.out, table));
}

/// Prints the GPU, or what is left out without one. @param rates numbers of figures, 2 to 6
void say_device(const PaperOptions& options, const std::vector<int>& rates) {
  const PaperRequest& request = options.request;
  if (request.gpu) {
    say(fmt::format("GPU: {}; {}", request.gpu->describe(), cuda_version()));
    return;
  }
  say("left out, for " + request.why_no_gpu + ":");
  const auto has = [&](int figure) { return contains(rates, figure); };
  if (has(2)) say("  figure 2 (GPU frame rates, phyxels)");
  if (has(3)) say("  figure 3 (GPU frame rates, surfels)");
  if (has(4) || has(5) || has(6)) say("  the GPU's part of figures 4, 5 and 6");
  for (const std::string& table : options.tables) {
    if (table == paper_table::exchange) continue;  // this table needs no GPU
    say("  " + std::string(table == paper_table::memory ? "" : "the GPU's part of ") + "table " +
        table);
  }
}

/// Measures the requested figures and tables.
void measure(PaperOptions& options) {
  PaperRequest& request = options.request;
  const ChosenDevice device = choose_device(options.device);
  request.gpu = device.gpu;
  request.why_no_gpu = device.why_no_gpu;
  if (options.figures.empty() && options.tables.empty()) {
    options.figures = {1, 2, 3, 4, 5, 6};
    options.tables = all_tables;
  }
  std::vector<int> rates;
  std::copy_if(options.figures.begin(), options.figures.end(), std::back_inserter(rates),
               [](int figure) { return figure > 1; });
  check_outputs(options, !rates.empty());
  make_writable_folder(request.out);
  say_device(options, rates);

  if (contains(options.figures, 1)) draw_figure_1(request);
  if (!rates.empty()) {
    write_csv(table_file(request.out, paper_table::frames), measure_frames(request, rates));
  }
  const struct {
    const char* name;
    CsvTable (*measure)(const PaperRequest&);
    bool needs_gpu;
  } measurements[] = {{paper_table::kernels, measure_kernels, false},
                      {paper_table::trajectory, measure_trajectories, false},
                      {paper_table::young, measure_young, false},
                      {paper_table::memory, measure_memory, true},
                      {paper_table::stiffness, measure_stiffness, false},
                      {paper_table::exchange, measure_exchange, false}};
  for (const auto& m : measurements) {
    if (!contains(options.tables, m.name) || (m.needs_gpu && !request.gpu)) continue;
    write_csv(table_file(request.out, m.name), m.measure(request));
  }
}

void paper_command(PaperOptions& options) {
  if (options.json) progress = stderr;
  PaperRequest& request = options.request;
  if (request.bodies.empty()) request.bodies = paper::body_names();
  check_names(options);
  if (options.redraw) check_tables(request);
  refuse_foreign_files(request.out, options.force);
  if (!options.redraw) measure(options);
  if (can_plot()) {
    for (const fs::path& file : draw_figures(request.out)) say(file.string());
  } else {
    say("gnuplot was not found, so figures 2 to 6 are not drawn; `phyxel paper --redraw --out " +
        request.out.string() + "` draws them where it is installed");
  }
  write_paper_page(request.out);
  say((request.out / paper_page_name).string());
  if (options.json) say_files(request.out);
}

}  // namespace

void say(const std::string& line) {
  fmt::print(progress, "{}\n", line);
  std::fflush(progress);
}

void add_paper(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "paper", "Repeat the measurements of Farias et al. 2008 with its kernels");
  auto options = std::make_shared<PaperOptions>();
  PaperRequest& request = options->request;
  command->add_option("--out", request.out, "Folder of tables, figures and page")
      ->capture_default_str();
  command->add_option("--figure", options->figures, "Only these figures, 1 to 6, comma separated")
      ->delimiter(',')
      ->check(CLI::Range(1, 6));
  command
      ->add_option("--table", options->tables,
                   "Only these tables: kernels, trajectory, young, memory, stiffness, exchange")
      ->delimiter(',');
  command->add_option("--body", request.bodies, "Only these bodies: horn_bug, alien_head, dino")
      ->delimiter(',');
  command->add_option("--device", options->device, device_help)->capture_default_str();
  command->add_option("--repeat", request.repeat, "Number of repeats; the median is reported")
      ->capture_default_str()
      ->check(CLI::Range(1, 1000));
  command->add_option("--objects", request.objects, "Largest number of objects")
      ->capture_default_str()
      ->check(CLI::Range(1, 1000));
  command->add_option("--seconds", request.seconds, "Duration of one repeat [s]")
      ->capture_default_str()
      ->check(CLI::Range(0.001, 60.0));
  command->add_flag("--force", options->force, "Replace earlier tables in the folder");
  command->add_flag("--json", options->json,
                    "The files of the folder as JSON, nothing else on stdout");
  command->add_flag("--redraw", options->redraw,
                    "Draw figures and page from the folder's tables without measuring");
  command->footer(
      "Examples:\n"
      "  phyxel paper                              all measurements, to out/paper\n"
      "  phyxel paper --figure 5 --repeat 11 --out out/figure5\n"
      "  phyxel paper --table memory --device cuda:1 --out out/memory\n"
      "  phyxel paper --redraw --out docs/results/paper");
  command->callback([options] { paper_command(*options); });
}

}  // namespace phyxel::app
