/// Sections of the page that follow from one table, as Markdown.
#pragma once

#include <string>

#include "csv.hpp"

namespace phyxel::app {

/// A paragraph about the origin of a table: program, machine and date.
std::string measured_by(const CsvTable& table);

/// The section about real time and the numbers of objects that reach it. @param table frames
std::string real_time_section(const CsvTable& table);
/// The section about a second of motion at both ends of the range of Young's modulus.
std::string young_section(const CsvTable& table);
/// The section about the communication volume of ranks.
std::string exchange_section(const CsvTable& table);
/// The section about 24-bit products in machine code.
std::string machine_code_section(const CsvTable& table);

}  // namespace phyxel::app
