#include "example_list.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <string_view>

namespace phyxel::app {
namespace {

/// The lines of the first comment of a file in TOML, C++ or Python, without the marks of comments.
std::vector<std::string> comment_of(std::string_view text) {
  constexpr std::string_view quotes = "\"\"\"";
  const bool quoted = text.starts_with(quotes);
  const std::string_view mark = text.starts_with("///") ? "///" : "#";
  if (quoted) text = text.substr(quotes.size(), text.find(quotes, quotes.size()) - quotes.size());
  std::vector<std::string> lines;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    if (!quoted) {
      if (!line.starts_with(mark)) break;
      line.remove_prefix(mark.size());
      if (line.starts_with(' ')) line.remove_prefix(1);
    }
    lines.emplace_back(line);
  }
  return lines;
}

/// The first sentence of a comment: up to a full stop or a question mark that a space and a letter
/// follow ("et al. 2008" goes on), or up to an empty line.
std::string sentence_of(const std::vector<std::string>& lines) {
  std::string text;
  for (const std::string& line : lines) {
    if (line.empty()) break;
    text += (text.empty() ? "" : " ") + line;
  }
  if (text.starts_with("phyxel as a library")) text.erase(0, text.find(": ") + 2);
  for (std::size_t k = 0; k + 2 < text.size(); ++k) {
    const bool stop = text[k] == '.' || text[k] == '?';
    if (stop && text[k + 1] == ' ' && std::isalpha(static_cast<unsigned char>(text[k + 2])) != 0) {
      text.resize(k + 1);
    }
  }
  if (!text.empty()) {
    text[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(text[0])));
  }
  return text;
}

/// The path as one word of a shell.
std::string shell_word(const std::filesystem::path& path) {
  const std::string text = path.string();
  const bool plain = std::all_of(text.begin(), text.end(), [](unsigned char c) {
    return std::isalnum(c) != 0 ||
           std::string_view("/._-+,=@%").find(static_cast<char>(c)) != std::string_view::npos;
  });
  if (plain) return text;
  std::string quoted = "'";
  for (const char c : text) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return quoted + "'";
}

std::vector<Example> find_examples() {
  std::vector<Example> found;
  const auto add = [&](std::string name, Example::Kind kind, const EmbeddedFile& file) {
    found.push_back({std::move(name), kind, sentence_of(comment_of(file.content)), {&file}});
  };
  for (const EmbeddedFile& file : example_files()) {
    const std::string folder(file.name.substr(0, file.name.find('/')));
    const std::string_view name = file.name.substr(folder.size() + 1);
    if (name == "scene.toml") add(folder, Example::Kind::scene, file);
    if (name == "main.cpp") add(folder, Example::Kind::program, file);
    if (folder == "python") {
      add(std::string(name.substr(0, name.rfind('.'))), Example::Kind::script, file);
    }
  }
  for (Example& example : found) {
    if (example.kind == Example::Kind::script) continue;
    for (const EmbeddedFile& file : example_files()) {
      const bool own = file.name.starts_with(example.name + "/");
      if (own && &file != example.files.front()) example.files.push_back(&file);
    }
  }
  std::stable_sort(found.begin(), found.end(),
                   [](const Example& a, const Example& b) { return a.kind < b.kind; });
  return found;
}

}  // namespace

std::filesystem::path Example::name_in_copy(const EmbeddedFile& file) {
  return std::filesystem::path(file.name).filename();
}

std::string Example::command(const std::filesystem::path& folder) const {
  const std::string copy = shell_word(folder);
  if (kind == Kind::program)
    return fmt::format("cmake -S {0} -B {0}/build && cmake --build {0}/build", copy);
  if (kind == Kind::script)
    return fmt::format("python3 {}", shell_word(folder / name_in_copy(*files.front())));
  // The command of the comment, which names the scene by its path in the source tree.
  const std::string scene = fmt::format("examples/{}/scene.toml", name);
  for (std::string line : comment_of(files.front()->content)) {
    const std::size_t at = line.find(scene);
    if (at == std::string::npos || line.find("phyxel run ") == std::string::npos) continue;
    line.replace(at, scene.size(), shell_word(folder / "scene.toml"));
    return line.substr(line.find_first_not_of(' '));
  }
  return fmt::format("phyxel run {}", shell_word(folder / "scene.toml"));
}

const char* kind_name(Example::Kind kind) {
  switch (kind) {
    case Example::Kind::scene:
      return "scene";
    case Example::Kind::program:
      return "c++";
    case Example::Kind::script:
      break;
  }
  return "python";
}

const std::vector<Example>& examples() {
  static const std::vector<Example> all = find_examples();
  return all;
}

std::vector<std::string> example_names() {
  std::vector<std::string> names;
  for (const Example& example : examples()) names.push_back(example.name);
  return names;
}

}  // namespace phyxel::app
