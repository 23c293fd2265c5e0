/// Tables of measurements on Markdown pages.
#pragma once

#include <fmt/format.h>

#include <string>
#include <vector>

#include "csv.hpp"
#include "outside_text.hpp"

namespace phyxel::app {

/// Reads a table and escapes its cells and facts by `markdown_text`, which leaves numbers and plain
/// words unchanged. @throws InputError as `read_csv`
inline CsvTable read_page_table(const std::filesystem::path& file) {
  CsvTable table = read_csv(file);
  for (auto& [name, value] : table.facts) value = markdown_text(value);
  for (auto& row : table.rows) {
    for (std::string& text : row) text = markdown_text(text);
  }
  return table;
}

inline std::string table_text(const std::vector<std::string>& head,
                              const std::vector<std::vector<std::string>>& rows) {
  std::string text = fmt::format("| {} |\n|", fmt::join(head, " | "));
  for (std::size_t k = 0; k < head.size(); ++k) text += " --- |";
  text += "\n";
  for (const auto& row : rows) text += fmt::format("| {} |\n", fmt::join(row, " | "));
  return text + "\n";
}

/// The cell of the matching row; a dash if there is none.
inline std::string cell(const CsvTable& table, const std::string& column, const Match& match) {
  const auto row = table.find(match);
  return row && !table.text(*row, column).empty() ? table.text(*row, column) : "–";
}

}  // namespace phyxel::app
