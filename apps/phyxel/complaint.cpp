#include "complaint.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cctype>
#include <optional>
#include <string_view>
#include <vector>

#include "phyxel/error.hpp"

namespace phyxel::app {
namespace {

/// A word in American spelling and small letters, without leading dashes, for comparison.
std::string plain(std::string_view word) {
  word.remove_prefix(std::min(word.find_first_not_of('-'), word.size()));
  std::string text(word);
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  constexpr std::pair<std::string_view, std::string_view> spellings[] = {
      {"colour", "color"}, {"neighbour", "neighbor"}, {"centre", "center"}, {"ise", "ize"}};
  for (const auto& [british, american] : spellings) {
    if (const std::size_t at = text.find(british); at != std::string::npos) {
      text.replace(at, british.size(), american);
    }
  }
  return text;
}

/// The suggestion " (did you mean "--force"?)" of the nearest known word; "" if none is near.
std::string meant(const std::string& word, const std::vector<std::string>& known) {
  const std::string typed = plain(word);
  std::vector<std::string> names;
  for (const std::string& name : known) names.push_back(plain(name));
  std::string found = did_you_mean(typed, names);
  for (std::size_t k = 0; k < known.size(); ++k) {
    const bool initial = typed.size() == 1 && names[k].substr(0, 1) == typed;  // -V: --version
    if (initial || found == fmt::format(" (did you mean \"{}\"?)", names[k])) {
      return fmt::format(" (did you mean \"{}\"?)", known[k]);
    }
  }
  return "";
}

std::vector<std::string> options_of(const CLI::App& command) {
  std::vector<std::string> known;
  for (const CLI::Option* option : command.get_options()) {
    for (const std::string& name : option->get_lnames()) known.push_back("--" + name);
  }
  return known;
}

std::vector<const CLI::App*> parts_of(const CLI::App& command) {
  return command.get_subcommands([](const CLI::App*) { return true; });
}

const CLI::Option* option_named(const CLI::App& command, const std::string& word) {
  for (const CLI::Option* option : command.get_options()) {
    if (!option->get_positional() && option->check_name(word)) return option;
    for (const std::string& name : option->get_lnames()) {
      if (word == "--" + name) return option;
    }
  }
  return nullptr;
}

/// Frequent unknown options, as `plain` spells them, and their alternatives.
constexpr std::pair<std::string_view, std::string_view> instead[] = {
    {"color", "colours are for terminals, and NO_COLOR=1 turns them off"},
    {"no-color", "NO_COLOR=1 in the environment turns colours off"}};

/// The hint "; "phyxel run" has --until" if the program or another command has the option; else "".
std::string elsewhere(const CLI::App& program, const std::string& word) {
  const std::string typed = plain(word);
  for (const auto& [known, what] : instead) {
    if (typed == known) return fmt::format("; {}", what);
  }
  for (const std::string& name : options_of(program)) {
    if (plain(name) == typed || (typed.size() == 1 && plain(name).substr(0, 1) == typed)) {
      return fmt::format("; \"{}\" has {}", program.get_name(), name);
    }
  }
  for (const CLI::App* command : parts_of(program)) {
    for (const std::string& name : options_of(*command)) {
      if (plain(name) == typed) {
        return fmt::format("; \"phyxel {}\" has {}", command->get_name(), name);
      }
    }
  }
  return "";
}

/// The typed words, checked one after the other against the commands and options.
class Words {
 public:
  Words(const CLI::App& program, int argc, const char* const* argv)
      : program_(program), command_(&program), words_(argv + std::min(argc, 1), argv + argc) {}

  std::string complaint(const CLI::ParseError& error) {
    for (at_ = 0; at_ < words_.size() && words_[at_] != "--"; ++at_) {
      const std::string& word = words_[at_];
      const bool number = word.size() > 1 && (std::isdigit(word[1]) || word[1] == '.');
      const auto wrong =
          word.size() > 1 && word[0] == '-' && !number ? option(word) : command(word);
      if (wrong) return *wrong;
    }
    std::string said = error.what();
    constexpr std::string_view unexpected = "The following argument was not expected: ";
    if (said.rfind(unexpected, 0) == 0) {
      said = fmt::format("{}: one argument too many", said.substr(unexpected.size()));
    }
    for (const auto& [option, typed] : typed_) {
      for (const std::string& name : option->get_lnames()) {
        const std::string full = "--" + name;
        if (said.find(full) == std::string::npos) continue;
        if (dynamic_cast<const CLI::ConversionError*>(&error) != nullptr) {
          return fmt::format("{}: cannot be read; allowed: {}", typed, option->get_type_name());
        }
        const std::string head = full + ": ";
        return fmt::format("{}: {}", typed,
                           said.rfind(head, 0) == 0 ? said.substr(head.size()) : said);
      }
    }
    return fmt::format("{}; {} --help explains", said, path_);
  }

 private:
  /// The error of an option, if any; skips its values.
  std::optional<std::string> option(const std::string& word) {
    const std::string name = word.substr(0, word.find('='));
    const CLI::Option* known = option_named(*command_, name);
    if (known == nullptr) {
      std::string hint = meant(name, options_of(*command_));
      if (hint.empty()) hint = elsewhere(program_, name);
      return fmt::format("{}: unknown option of \"{}\"{}; {} --help lists them", name, path_, hint,
                         path_);
    }
    std::string typed = word;
    if (known->get_items_expected_max() > 0 && name == word && at_ + 1 < words_.size()) {
      typed += " " + words_[++at_];
    }
    typed_.emplace_back(known, typed);
    return {};
  }
  /// The error of a command, if any.
  std::optional<std::string> command(const std::string& word) {
    const auto parts = parts_of(*command_);
    if (parts.empty()) return {};  // the word is an argument
    std::vector<std::string> known;
    for (const CLI::App* part : parts) {
      known.push_back(part->get_name());
      if (known.back() != word) continue;
      command_ = part;
      path_ += " " + word;
      return {};
    }
    const auto takes_words = [](const CLI::Option* option) { return option->get_positional(); };
    if (!command_->get_options(takes_words).empty()) return {};
    for (std::string& name : options_of(*command_)) known.push_back(std::move(name));
    return fmt::format("{}: unknown command{}; {} --help lists them", word, meant(word, known),
                       path_);
  }

  const CLI::App& program_;
  const CLI::App* command_;
  std::vector<std::string> words_;
  std::size_t at_ = 0;
  std::string path_ = "phyxel";
  std::vector<std::pair<const CLI::Option*, std::string>> typed_;
};

}  // namespace

std::string complaint(const CLI::App& program, const CLI::ParseError& error, int argc,
                      const char* const* argv) {
  return Words(program, argc, argv).complaint(error);
}

}  // namespace phyxel::app
