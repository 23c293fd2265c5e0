/// Tables of pages made from measurements.
#pragma once

#include <fmt/format.h>

#include <string>
#include <vector>

#include "csv.hpp"

namespace phyxel::app {

inline std::string table_text(const std::vector<std::string>& head,
                              const std::vector<std::vector<std::string>>& rows) {
  std::string text = fmt::format("| {} |\n|", fmt::join(head, " | "));
  for (std::size_t k = 0; k < head.size(); ++k) text += " --- |";
  text += "\n";
  for (const auto& row : rows) text += fmt::format("| {} |\n", fmt::join(row, " | "));
  return text + "\n";
}

/// The cell of the row that matches, or a dash.
inline std::string cell(const CsvTable& table, const std::string& column, const Match& match) {
  const auto row = table.find(match);
  return row && !table.text(*row, column).empty() ? table.text(*row, column) : "–";
}

}  // namespace phyxel::app
