/// Self-contained pages: HTML with its style, script and data in one file.
#pragma once

#include <map>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <string_view>

namespace phyxel::app {

/// Texts by the names that they replace.
using Fillings = std::map<std::string, std::string, std::less<>>;

/// A file of report/page in which each @name@ is replaced by a filling, or by the file of that
/// name. Replacements are not expanded again.
std::string filled_page(std::string_view name, const Fillings& fillings);

/// The text with HTML's special characters escaped.
std::string html_text(std::string_view text);
/// JSON for a script element of a page.
std::string script_json(const nlohmann::ordered_json& json);

/// An element of a page that holds an array of bytes, which its script finds by name.
std::string byte_element(std::string_view name, std::span<const std::byte> bytes);

/// A number with commas between thousands.
std::string with_separators(std::size_t number);

/// A paragraph for each warning.
std::string html_warnings(std::span<const std::string> warnings);
/// A table of names and values.
std::string html_facts(std::span<const std::pair<std::string, std::string>> facts);

}  // namespace phyxel::app
