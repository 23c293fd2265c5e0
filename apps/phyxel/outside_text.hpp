/// Text that comes from outside (cells of tables, names of files and folders, titles of scenes) on
/// its way into JSON, Markdown and gnuplot's scripts.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>

namespace phyxel::app {

/// The text with U+FFFD for every byte that is no UTF-8, as a file's name may have.
std::string valid_utf8(const std::string& text);

/// JSON as a text. Bytes that are no UTF-8 become U+FFFD: no name ends a command whose work is
/// done.
/// @param indent spaces of a level; -1: all on one line
std::string json_text(const nlohmann::ordered_json& json, int indent = 2);

/// A text on one line in which Markdown finds no markup and HTML no element.
std::string markdown_text(const std::string& text);

/// A string of gnuplot, in single quotes: between those it expands no backquotes, macros or
/// escapes. Line ends and other control characters become spaces.
std::string gnuplot_string(const std::string& text);

}  // namespace phyxel::app
