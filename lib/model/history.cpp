#include "phyxel/history.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "phyxel/error.hpp"
#include "phyxel/law_table.hpp"

namespace phyxel {

std::vector<std::string> history_columns(const Model& model) {
  std::vector<std::string> columns;
  for (const Part& part : model.parts) {
    for (std::string& name : history_names(part.material)) {
      if (std::find(columns.begin(), columns.end(), name) == columns.end()) {
        columns.push_back(std::move(name));
      }
    }
  }
  return columns;
}

std::vector<HistoryColumn> virgin_history(const Model& model) {
  std::vector<HistoryColumn> history;
  for (std::string& name : history_columns(model)) {
    history.push_back(
        {std::move(name), std::vector<double>(static_cast<std::size_t>(model.size()), 0)});
  }
  return history;
}

std::vector<std::size_t> columns_of(const Material& material,
                                    const std::vector<std::string>& columns) {
  std::vector<std::size_t> places;
  for (const std::string& name : history_names(material)) {
    places.push_back(static_cast<std::size_t>(std::find(columns.begin(), columns.end(), name) -
                                              columns.begin()));
  }
  return places;
}

std::vector<const HistoryColumn*> checked_history(const State& state,
                                                  const std::vector<std::string>& columns,
                                                  Index phyxels) {
  std::vector<const HistoryColumn*> ordered;
  if (state.history.empty()) return ordered;
  const auto refuse = [&](const std::string& what) {
    throw InputError(fmt::format("history of a state: {}; allowed: {}", what,
                                 columns.empty()
                                     ? "none, as the materials of this model remember "
                                       "nothing"
                                     : fmt::format("none, or {}", fmt::join(columns, ", "))));
  };
  for (const HistoryColumn& column : state.history) {
    if (std::find(columns.begin(), columns.end(), column.name) == columns.end()) {
      refuse(fmt::format("column \"{}\" found", column.name));
    }
    if (column.values.size() != static_cast<std::size_t>(phyxels)) {
      refuse(fmt::format("column \"{}\" has {} values for {} phyxels", column.name,
                         column.values.size(), phyxels));
    }
    const auto bad = std::find_if_not(column.values.begin(), column.values.end(),
                                      [](double value) { return std::isfinite(value); });
    if (bad != column.values.end()) {
      refuse(fmt::format("column \"{}\" is not finite at phyxel {}", column.name,
                         bad - column.values.begin()));
    }
  }
  for (const std::string& name : columns) {
    const auto at = std::find_if(state.history.begin(), state.history.end(),
                                 [&](const HistoryColumn& c) { return c.name == name; });
    if (at == state.history.end()) refuse(fmt::format("column \"{}\" is missing", name));
    ordered.push_back(&*at);
  }
  return ordered;
}

}  // namespace phyxel
