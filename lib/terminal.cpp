#include "terminal.hpp"

#include <fmt/color.h>
#include <unistd.h>

#include <cstdlib>
#include <string_view>

namespace phyxel {
namespace {

std::string word(const char* text, fmt::terminal_color colour) {
  const char* plain = std::getenv("NO_COLOR");
  if (!is_terminal(stderr) || (plain != nullptr && *plain != '\0')) return text;
  return fmt::format(fmt::emphasis::bold | fmt::fg(colour), "{}", text);
}

}  // namespace

bool is_terminal(std::FILE* stream) {
  const char* kind = std::getenv("TERM");
  return ::isatty(::fileno(stream)) == 1 && !(kind != nullptr && std::string_view(kind) == "dumb");
}

std::string error_word() { return word("error: ", fmt::terminal_color::red); }
std::string warning_word() { return word("warning: ", fmt::terminal_color::yellow); }

}  // namespace phyxel
