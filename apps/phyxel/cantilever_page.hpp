/// What the page about speed says of `phyxel bench cantilever`, made of its table.
#pragma once

#include <string>

#include "csv.hpp"
#include "plot.hpp"

namespace phyxel::app {

/// What was measured, and what it shows. Of the supports, the usual one stands for all where there
/// is room for one only. @throws InputError, as the others do, if rows are missing
std::string cantilever_words(const CsvTable& table);

/// Error against time: discretisation in each precision and with each support, and rounding.
LineChart cantilever_chart(const CsvTable& table);

/// A row for each cloud and support, the precisions side by side.
std::string cantilever_table(const CsvTable& table);

}  // namespace phyxel::app
