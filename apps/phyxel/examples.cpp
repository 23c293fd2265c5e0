/// phyxel examples: a list of the examples that the program carries, and copies of them.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <nlohmann/json.hpp>

#include "command.hpp"
#include "example_list.hpp"
#include "files/atomic_file.hpp"
#include "known_names.hpp"
#include "outside_text.hpp"
#include "phyxel/error.hpp"

namespace phyxel::app {
namespace {

namespace fs = std::filesystem;

struct ExamplesOptions {
  std::string name;
  fs::path to;
  bool force = false, json = false;
};

void list_examples(bool json) {
  if (json) {
    nlohmann::ordered_json list = nlohmann::ordered_json::array();
    for (const Example& example : examples()) {
      list.push_back({{"name", example.name},
                      {"kind", kind_name(example.kind)},
                      {"sentence", example.sentence},
                      {"command", example.command(example.name)}});
    }
    fmt::print("{}\n", json_text({{"examples", list}}));
    return;
  }
  std::size_t width = 0;
  for (const Example& example : examples()) width = std::max(width, example.name.size());
  constexpr std::pair<Example::Kind, const char*> heads[] = {
      {Example::Kind::scene, "Scenes:"},
      {Example::Kind::program, "Programs in C++, which link the library:"},
      {Example::Kind::script, "Python scripts:"}};
  for (const auto& [kind, head] : heads) {
    fmt::print("{}\n", head);
    for (const Example& example : examples()) {
      if (example.kind != kind) continue;
      fmt::print("  {:<{}}  {}\n", example.name, width, example.sentence);
    }
  }
  fmt::print("phyxel examples copy NAME copies one of them.\n");
}

/// Copies an example. All files are checked before the first one is written.
void copy_example(const ExamplesOptions& options) {
  check_known("examples copy", {options.name}, example_names());
  const Example& example =
      *std::find_if(examples().begin(), examples().end(),
                    [&](const Example& one) { return one.name == options.name; });
  const fs::path folder = options.to.empty() ? fs::path(example.name) : options.to;
  if (fs::exists(folder) && !fs::is_directory(folder)) {
    throw InputError(fmt::format("{}{}: is a file; allowed: a folder",
                                 options.to.empty() ? "" : "--to ", folder.string()));
  }
  for (const EmbeddedFile* file : example.files) {
    check_output_file(folder / Example::name_in_copy(*file), options.force, Output::file);
  }
  make_writable_folder(folder);
  nlohmann::ordered_json written = nlohmann::ordered_json::array();
  for (const EmbeddedFile* file : example.files) {
    const fs::path copy = folder / Example::name_in_copy(*file);
    write_whole_file(copy, file->content, Durable::no);
    written.push_back(copy.string());
  }
  if (options.json) {
    fmt::print("{}\n", json_text({{"name", example.name},
                                  {"folder", folder.string()},
                                  {"files", written},
                                  {"command", example.command(folder)}}));
    return;
  }
  for (const auto& file : written) fmt::print("{}\n", file.get<std::string>());
  fmt::print("{} {}\n", example.kind == Example::Kind::program ? "Build it:" : "Run it:",
             example.command(folder));
}

}  // namespace

void add_examples(CLI::App& program) {
  CLI::App* command = program.add_subcommand(
      "examples", "List the examples, which the program carries, or copy one");
  auto options = std::make_shared<ExamplesOptions>();
  command->add_flag("--json", options->json, "Print the list as JSON");
  command->footer(
      "Examples:\n"
      "  phyxel examples\n"
      "  phyxel examples copy wooden_beam && phyxel run wooden_beam/scene.toml");
  command->callback([command, options] {
    if (!command->got_subcommand("copy")) list_examples(options->json);
  });
  CLI::App* copy = command->add_subcommand("copy", "Copy an example into a folder");
  copy->add_option("name", options->name, "Name of the example")->required();
  copy->add_option("--to", options->to,
                   "Folder of the copy (default: one with the example's name)");
  copy->add_flag("--force", options->force, "Replace files of an earlier copy");
  copy->add_flag("--json", options->json,
                 "Names of the files and the command as JSON, nothing else on stdout");
  copy->footer(
      "Examples:\n"
      "  phyxel examples copy dice\n"
      "  phyxel examples copy step_loop --to loop --force");
  copy->callback([options] { copy_example(*options); });
}

}  // namespace phyxel::app
