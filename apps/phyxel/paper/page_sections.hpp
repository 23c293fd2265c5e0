/// Sections of the page that follow from one table alone, as Markdown.
#pragma once

#include <string>

#include "csv.hpp"

namespace phyxel::app {

/// A paragraph that says what measured a table, where and when.
std::string measured_by(const CsvTable& table);

/// What real time asks for, and how many objects of each kind keep to it. @param table frames
std::string real_time_section(const CsvTable& table);
/// A second of motion at both ends of Young's modulus.
std::string young_section(const CsvTable& table);
/// What ranks would send each other.
std::string exchange_section(const CsvTable& table);
/// What the compiler makes of 24-bit products.
std::string machine_code_section(const CsvTable& table);

}  // namespace phyxel::app
