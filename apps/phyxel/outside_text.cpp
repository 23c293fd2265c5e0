#include "outside_text.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

namespace phyxel::app {
namespace {

/// The text in UTF-8, with control characters replaced by spaces.
std::string on_one_line(const std::string& text) {
  std::string line = valid_utf8(text);
  for (char& c : line) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte < 0x20 || byte == 0x7f) c = ' ';
  }
  return line;
}

}  // namespace

std::string json_text(const nlohmann::ordered_json& json, int indent) {
  return json.dump(indent, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

std::string valid_utf8(const std::string& text) {
  return nlohmann::json::parse(json_text(text, -1)).get<std::string>();
}

std::string markdown_text(const std::string& text) {
  std::string safe;
  for (const char c : on_one_line(text)) {
    if (std::string_view("<>&|`[]\\").find(c) != std::string_view::npos) {
      safe += fmt::format("&#{};", static_cast<int>(c));
    } else {
      safe += c;
    }
  }
  return safe;
}

std::string gnuplot_string(const std::string& text) {
  std::string quoted = "'";
  for (const char c : on_one_line(text)) {
    if (c == '\'') {
      quoted +=
          "\u2019";  // gnuplot 5.4 does not accept a doubled quote at the beginning of a string
    } else {
      quoted += c;
    }
  }
  return quoted + "'";
}

}  // namespace phyxel::app
