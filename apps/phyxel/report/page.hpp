/// Pages that are one file: HTML with its style, its script and its data.
#pragma once

#include <cstddef>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <string_view>

namespace phyxel::app {

/// What stands in for @name@.
using Fillings = std::map<std::string, std::string, std::less<>>;

/// A file of report/page whose @names@ are replaced: by a filling, or another file of that name.
/// What is filled in is not looked at again.
std::string filled_page(std::string_view name, const Fillings& fillings);

/// Text as HTML shows it.
std::string html_text(std::string_view text);
/// JSON that may stand in a page's script element.
std::string script_json(const nlohmann::ordered_json& json);
/// RFC 4648.
std::string base64(std::span<const std::byte> bytes);

/// An element for each warning.
std::string html_warnings(std::span<const std::string> warnings);
/// A table of names and values.
std::string html_facts(std::span<const std::pair<std::string, std::string>> facts);

}  // namespace phyxel::app
