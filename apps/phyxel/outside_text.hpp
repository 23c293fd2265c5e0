/// Escapes of external text (cells of tables, names of files and folders, titles of scenes) in
/// JSON, Markdown and gnuplot scripts.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>

namespace phyxel::app {

/// The text with each byte that is not UTF-8 replaced by U+FFFD; names of files may have such
/// bytes.
std::string valid_utf8(const std::string& text);

/// JSON as text. Bytes that are not UTF-8 become U+FFFD, so that no name makes a command fail after
/// its work is done. @param indent spaces of a level; -1 for one line
std::string json_text(const nlohmann::ordered_json& json, int indent = 2);

/// The text on one line, with markup of Markdown and HTML escaped.
std::string markdown_text(const std::string& text);

/// The text as a string of gnuplot in single quotes, in which backquotes, macros and escapes are
/// not expanded. Control characters become spaces.
std::string gnuplot_string(const std::string& text);

}  // namespace phyxel::app
