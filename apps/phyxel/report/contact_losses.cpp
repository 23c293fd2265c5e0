#include "report/contact_losses.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <vector>

#include "phyxel/error.hpp"

namespace phyxel::app {
namespace {

/// The cells of a line of a CSV file, in which a cell may be quoted (RFC 4180).
std::vector<std::string> cells_of(const std::string& line) {
  std::vector<std::string> cells(1);
  bool quoted = false;
  for (const char c : line) {
    if (c == '"') {
      quoted = !quoted;  // a doubled quote within quotes ends and begins them: it is dropped
    } else if (c == ',' && !quoted) {
      cells.emplace_back();
    } else {
      cells.back() += c;
    }
  }
  return cells;
}

}  // namespace

std::unordered_map<std::string, ContactLosses> read_contact_losses(
    const std::filesystem::path& file) {
  std::ifstream in(file);
  std::string line;
  std::getline(in, line);
  const std::vector<std::string> columns = cells_of(line);
  const auto column = [&](const char* name) {
    const auto found = std::find(columns.begin(), columns.end(), name);
    if (found == columns.end()) {
      throw InputError(fmt::format("{}: no column \"{}\"", file.string(), name));
    }
    return static_cast<std::size_t>(found - columns.begin());
  };
  const std::size_t time = column("time [s]"), heat = column("friction_heat [J]"),
                    impact = column("impact_loss [J]");
  std::unordered_map<std::string, ContactLosses> losses;
  while (std::getline(in, line)) {
    const std::vector<std::string> cells = cells_of(line);
    if (cells.size() != columns.size()) continue;
    ContactLosses& sum = losses[cells[time]];
    sum.friction_heat += std::strtod(cells[heat].c_str(), nullptr);
    sum.impact_loss += std::strtod(cells[impact].c_str(), nullptr);
  }
  return losses;
}

}  // namespace phyxel::app
