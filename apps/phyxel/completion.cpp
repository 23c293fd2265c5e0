/// phyxel completion: completion scripts for shells, made from the parser's options.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <string>
#include <vector>

#include "command.hpp"
#include "example_list.hpp"

namespace phyxel::app {
namespace {

/// A command and its subcommands.
struct Node {
  std::string path;  ///< Words of the command, e.g. "bench step"; "" for the program.
  const CLI::App* app;
};

void collect(const CLI::App& app, const std::string& path, std::vector<Node>& nodes) {
  nodes.push_back({path, &app});
  for (const CLI::App* sub : app.get_subcommands([](const CLI::App*) { return true; })) {
    collect(*sub, path.empty() ? sub->get_name() : path + " " + sub->get_name(), nodes);
  }
}

std::vector<Node> commands_of(const CLI::App& program) {
  std::vector<Node> nodes;
  collect(program, "", nodes);
  return nodes;
}

std::vector<std::string> options_of(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::Option* option : app.get_options()) {
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  }
  return names;
}

std::vector<std::string> subcommands_of(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* sub : app.get_subcommands([](const CLI::App*) { return true; })) {
    names.push_back(sub->get_name());
  }
  return names;
}

/// Words that may follow a command: its subcommands, or names of examples.
std::vector<std::string> words_after(const std::string& path, const CLI::App& app) {
  return path == "examples copy" ? example_names() : subcommands_of(app);
}

/// The bash script: a function that offers the options and next words of the command typed so far,
/// or else files.
std::string bash_script(const CLI::App& program) {
  std::string known, options, subcommands;
  for (const auto& [path, app] : commands_of(program)) {
    if (!path.empty()) known += fmt::format("{}\"{}\"", known.empty() ? "" : "|", path);
    options += fmt::format("    \"{}\") options=\"{}\"", path, fmt::join(options_of(*app), " "));
    options += fmt::format("; commands=\"{}\" ;;\n", fmt::join(words_after(path, *app), " "));
  }
  return fmt::format(R"bash(# phyxel in bash: eval "$(phyxel completion bash)"
_phyxel() {{
  local word=${{COMP_WORDS[COMP_CWORD]}} path= next= options= commands= k
  for ((k = 1; k < COMP_CWORD; ++k)); do
    next="${{path:+$path }}${{COMP_WORDS[k]}}"
    case $next in {}) path=$next ;; esac
  done
  case $path in
{}  esac
  if [[ $word == -* ]]; then
    COMPREPLY=($(compgen -W "$options" -- "$word"))
  else
    COMPREPLY=($(compgen -W "$commands" -- "$word"))
  fi
}}
complete -o default -F _phyxel phyxel
)bash",
                     known, options);
}

std::string zsh_script(const CLI::App& program) {
  std::string script = bash_script(program);
  const std::size_t line = script.find('\n') + 1;
  return "# phyxel in zsh: eval \"$(phyxel completion zsh)\"\n"
         "autoload -U +X bashcompinit && bashcompinit\n" +
         script.substr(line);
}

/// The first line of a text in single quotes.
std::string fish_text(std::string text) {
  text = text.substr(0, text.find('\n'));
  std::string quoted;
  for (const char c : text) {
    if (c == '\'' || c == '\\') quoted += '\\';
    quoted += c;
  }
  return "'" + quoted + "'";
}

/// The fish condition that exactly the commands of `path` were typed.
std::string fish_condition(const std::string& path, const CLI::App& app) {
  if (path.empty()) return "__fish_use_subcommand";
  std::string condition = "__fish_seen_subcommand_from " + path.substr(path.rfind(' ') + 1);
  const std::vector<std::string> below = subcommands_of(app);
  if (!below.empty()) {
    condition += fmt::format("; and not __fish_seen_subcommand_from {}", fmt::join(below, " "));
  }
  const std::size_t parent = path.find(' ');
  if (parent != std::string::npos) {
    condition =
        fmt::format("__fish_seen_subcommand_from {}; and {}", path.substr(0, parent), condition);
  }
  return condition;
}

std::string fish_script(const CLI::App& program) {
  std::string script = "# phyxel in fish: phyxel completion fish | source\n";
  for (const auto& [path, app] : commands_of(program)) {
    const std::string when = fish_text(fish_condition(path, *app));
    for (const CLI::App* sub : app->get_subcommands([](const CLI::App*) { return true; })) {
      script += fmt::format("complete -c phyxel -n {} -f -a {} -d {}\n", when, sub->get_name(),
                            fish_text(sub->get_description()));
    }
    if (path == "examples copy") {
      script += fmt::format("complete -c phyxel -n {} -f -a {}\n", when,
                            fish_text(fmt::format("{}", fmt::join(example_names(), " "))));
    }
    for (const CLI::Option* option : app->get_options()) {
      for (const std::string& name : option->get_lnames()) {
        const bool takes_value = option->get_items_expected_max() > 0;
        script += fmt::format("complete -c phyxel -n {} -l {}{} -d {}\n", when, name,
                              takes_value ? " -r" : "", fish_text(option->get_description()));
      }
    }
  }
  return script;
}

}  // namespace

void add_completion(CLI::App& program) {
  CLI::App* command = program.add_subcommand("completion", "Print a completion script for a shell");
  auto shell = std::make_shared<std::string>();
  command->add_option("shell", *shell, "bash, zsh or fish")
      ->required()
      ->check(CLI::IsMember({"bash", "zsh", "fish"}));
  command->footer(
      "Examples:\n"
      "  eval \"$(phyxel completion bash)\"        now; in ~/.bashrc for each shell\n"
      "  phyxel completion fish > ~/.config/fish/completions/phyxel.fish");
  command->callback([&program, shell] {
    fmt::print("{}", *shell == "bash"  ? bash_script(program)
                     : *shell == "zsh" ? zsh_script(program)
                                       : fish_script(program));
  });
}

}  // namespace phyxel::app
