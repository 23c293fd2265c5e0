#include "scene/scene_toml.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>
#include <vector>

#include "phyxel/error.hpp"

namespace phyxel {
namespace {

constexpr int most_key_parts = 16;

/// Index just behind the string that begins at `i`.
std::size_t skip_string(std::string_view text, std::size_t i) {
  const char quote = text[i];
  const bool multi = text.substr(i, 3) == std::string(3, quote);
  const std::string closing(multi ? 3 : 1, quote);
  for (i += closing.size(); i < text.size(); ++i) {
    if (quote == '"' && text[i] == '\\') {
      ++i;
    } else if (text.substr(i, closing.size()) == closing) {
      i += closing.size();
      while (multi && i < text.size() && text[i] == quote) ++i;  // """it says "so"""""
      return i;
    } else if (!multi && text[i] == '\n') {
      return i;
    }
  }
  return text.size();
}

bool beyond_ascii(char c) { return static_cast<unsigned char>(c) >= 0x80; }

/// Whether a letter beyond ASCII follows a backslash, or the blanks and line ends that it skips.
bool escapes_beyond_ascii(std::string_view string) {
  for (std::size_t i = 0; i < string.size(); ++i) {
    if (string[i] != '\\') continue;
    const std::size_t next = string.find_first_not_of(" \t\r\n\v\f", i + 1);
    if (next == string.npos) return false;
    if (beyond_ascii(string[next])) return true;
    if (next == i + 1) ++i;  // an escaped backslash begins no escape
  }
  return false;
}

/// A piece of text that is a string, a comment or a single other character.
struct Piece {
  std::size_t end;
  bool free;  ///< Any letters may be in it.
};

Piece piece_at(std::string_view text, std::size_t i) {
  if (text[i] == '#') return {std::min(text.find('\n', i), text.size()), true};
  if (text[i] != '"' && text[i] != '\'') return {i + 1, false};
  // Where a quote follows something else at once, the parser sees no string, and reads on.
  const bool apart = i == 0 || std::string_view(" \t\r\n=,[{").find(text[i - 1]) != text.npos;
  const std::size_t end = skip_string(text, i);
  return {end, apart && !(text[i] == '"' && escapes_beyond_ascii(text.substr(i, end - i)))};
}

/// Refuses two things outside strings and comments that the parser cannot stand: dotted keys of
/// very many parts (each part is a table in the one before, and tables nested by the hundred
/// thousand overflow the stack when they are freed), and letters beyond ASCII (some of which take
/// toml++ 3.3 to undefined behaviour).
void check_bare_text(std::string_view text, const std::string& file) {
  std::size_t line = 1, line_begin = 0;
  int parts = 1;
  const auto refuse = [&](std::size_t i, const std::string& problem) {
    throw InputError(fmt::format("{}:{}:{}: {}", file, line, i - line_begin + 1, problem));
  };
  for (std::size_t i = text.starts_with("\xef\xbb\xbf") ? 3 : 0; i < text.size();) {
    const Piece piece = piece_at(text, i);
    const std::string_view letters = text.substr(i, piece.end - i);
    if (!piece.free && std::any_of(letters.begin(), letters.end(), beyond_ascii)) {
      refuse(i,
             "not valid TOML: a letter beyond ASCII; allowed: only in comments and in "
             "quotes, there not right behind a backslash");
    }
    if (text[i] == '.' && ++parts > most_key_parts) {
      refuse(i, fmt::format("a key of more than {} parts joined by dots found; allowed: {}",
                            most_key_parts, most_key_parts));
    }
    if (std::string_view("\n,=[]{}").find(text[i]) != text.npos) parts = 1;
    for (; i < piece.end; ++i) {
      if (text[i] == '\n') ++line, line_begin = i + 1;
    }
  }
}

bool loses_parser(std::string_view text) {
  try {
    static_cast<void>(toml::parse(text));
  } catch (const ParserLost&) {
    return true;
  } catch (const toml::parse_error&) {
  }
  return false;
}

/// First line that the parser cannot even refuse. It reads from front to back, so a text that
/// ends before that line does not lose it, and any longer one does.
std::size_t losing_line(std::string_view text) {
  std::vector<std::size_t> ends;  // of each line
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '\n' || i + 1 == text.size()) ends.push_back(i + 1);
  }
  const auto found = std::partition_point(ends.begin(), ends.end(), [&](std::size_t end) {
    return !loses_parser(text.substr(0, end));
  });
  return static_cast<std::size_t>(found - ends.begin()) + 1;
}

}  // namespace

toml::table parse_toml(const std::string& text, const std::filesystem::path& file) {
  const std::string name = file.empty() ? "scene" : file.string();
  if (text.size() > largest_scene_file) {
    throw InputError(fmt::format("{}: more than {} MB found; allowed: a scene file up to that size",
                                 name, largest_scene_file >> 20));
  }
  check_bare_text(text, name);
  try {
    return toml::parse(std::string_view(text), std::string_view(name));
  } catch (const toml::parse_error& error) {
    throw InputError(fmt::format("{}:{}:{}: not valid TOML: {}", name, error.source().begin.line,
                                 error.source().begin.column, error.description()));
  } catch (const ParserLost&) {
    throw InputError(
        fmt::format("{}:{}: not valid TOML: no key, value or section can be made out "
                    "here",
                    name, losing_line(text)));
  }
}

}  // namespace phyxel
