#include "report/page.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <stdexcept>

#include "base64.hpp"
#include "embedded_files.hpp"
#include "outside_text.hpp"

namespace phyxel::app {
namespace {

/// The content of the embedded file of that name; empty if there is none.
std::string_view page_file(std::string_view name) {
  for (const EmbeddedFile& file : page_files()) {
    if (file.name == name) return file.content;
  }
  return {};
}

}  // namespace

std::string filled_page(std::string_view name, const Fillings& fillings) {
  std::string_view rest = page_file(name);
  std::string page;
  while (true) {
    const std::size_t begin = rest.find('@');
    if (begin == std::string_view::npos) break;
    const std::size_t end = rest.find('@', begin + 1);
    if (end == std::string_view::npos) break;
    page += rest.substr(0, begin);
    const std::string_view wanted = rest.substr(begin + 1, end - begin - 1);
    const auto filling = fillings.find(wanted);
    const std::string_view found = filling != fillings.end() ? filling->second : page_file(wanted);
    if (filling == fillings.end() && found.empty()) {
      throw std::logic_error(fmt::format("{}: nothing for @{}@", name, wanted));
    }
    page += found;
    rest = rest.substr(end + 1);
  }
  page += rest;
  return page;
}

std::string html_text(std::string_view text) {
  std::string html;
  for (const char c : text) {
    switch (c) {
      case '&':
        html += "&amp;";
        break;
      case '<':
        html += "&lt;";
        break;
      case '>':
        html += "&gt;";
        break;
      case '"':
        html += "&quot;";
        break;
      default:
        html += c;
    }
  }
  return html;
}

std::string script_json(const nlohmann::ordered_json& json) {
  const std::string text = json_text(json, -1);
  std::string safe;
  safe.reserve(text.size());
  for (const char c : text) {  // "<" is escaped, so that </script> and <!-- cannot occur
    if (c == '<') {
      safe += "\\u003c";
    } else {
      safe += c;
    }
  }
  return safe;
}

std::string byte_element(std::string_view name, std::span<const std::byte> bytes) {
  return fmt::format("<script type=\"application/octet-stream\" id=\"{}\">{}</script>\n", name,
                     base64(bytes));
}

std::string with_separators(std::size_t number) {
  std::string text = std::to_string(number);
  for (auto at = static_cast<int>(text.size()) - 3; at > 0; at -= 3) {
    text.insert(static_cast<std::size_t>(at), ",");
  }
  return text;
}

std::string html_warnings(std::span<const std::string> warnings) {
  std::string html;
  for (const std::string& warning : warnings) {
    html += fmt::format("<p class=\"warning\">{}</p>\n", html_text(warning));
  }
  return html;
}

std::string html_facts(std::span<const std::pair<std::string, std::string>> facts) {
  std::string html = "<table>\n";
  for (const auto& [name, value] : facts) {
    html += fmt::format("<tr><td>{}</td><td>{}</td></tr>\n", html_text(name), html_text(value));
  }
  return html + "</table>\n";
}

}  // namespace phyxel::app
