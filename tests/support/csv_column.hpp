/// Columns of the logs that a run writes.
#pragma once

#include <sstream>
#include <string>
#include <vector>

namespace phyxel::test {

/// Returns the values of the first column whose name begins with `name`, at those lines of a
/// comma-separated table that have `word`.
inline std::vector<double> csv_column(const std::string& table, const std::string& name,
                                      const std::string& word = ",") {
  std::istringstream text(table);
  std::string line;
  std::getline(text, line);
  const auto cells = [](const std::string& whole) {
    std::vector<std::string> all;
    std::istringstream row(whole);
    for (std::string cell; std::getline(row, cell, ',');) all.push_back(cell);
    return all;
  };
  const std::vector<std::string> names = cells(line);
  std::size_t at = 0;
  while (at < names.size() && !names[at].starts_with(name)) ++at;
  std::vector<double> found;
  while (std::getline(text, line)) {
    if (line.find(word) != std::string::npos) found.push_back(std::stod(cells(line).at(at)));
  }
  return found;
}

}  // namespace phyxel::test
