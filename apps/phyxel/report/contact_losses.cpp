#include "report/contact_losses.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <vector>

#include "csv.hpp"
#include "phyxel/error.hpp"

namespace phyxel::app {

std::unordered_map<std::string, ContactLosses> read_contact_losses(
    const std::filesystem::path& file) {
  std::ifstream in(file);
  std::string line;
  std::getline(in, line);
  const std::vector<std::string> columns = csv_cells(line);
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
    const std::vector<std::string> cells = csv_cells(line);
    if (cells.size() != columns.size()) continue;
    ContactLosses& sum = losses[cells[time]];
    sum.friction_heat += std::strtod(cells[heat].c_str(), nullptr);
    sum.impact_loss += std::strtod(cells[impact].c_str(), nullptr);
  }
  return losses;
}

}  // namespace phyxel::app
