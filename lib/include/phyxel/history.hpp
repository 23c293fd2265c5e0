/// History variables of phyxels, such as plastic strain. Laws name the numbers (`HistoryNumber`),
/// and a state has a column for each.
#pragma once

#include <string>
#include <vector>

#include "phyxel/model.hpp"
#include "phyxel/state.hpp"

namespace phyxel {

/// The names of a model's history columns: those of all its parts' materials, each name once, in
/// the order of the parts. Empty for a model without history.
/// @throws InputError as `chosen_law`
std::vector<std::string> history_columns(const Model& model);

/// The history of the virgin material: the columns of a model, all zero.
std::vector<HistoryColumn> virgin_history(const Model& model);

/// Indices of the columns of a part's law among those of its model, in the law's order.
/// @param columns result of `history_columns`
std::vector<std::size_t> columns_of(const Material& material,
                                    const std::vector<std::string>& columns);

/// The history of a state in the order of a model's columns; virgin if the state has none.
/// @throws InputError if a column is missing, unknown, not finite, or of the wrong length
std::vector<const HistoryColumn*> checked_history(const State& state,
                                                  const std::vector<std::string>& columns,
                                                  Index phyxels);

}  // namespace phyxel
