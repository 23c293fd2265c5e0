/// Measurements as CSV files that say where they come from.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace phyxel::app {

/// Names and values.
using Facts = std::vector<std::pair<std::string, std::string>>;
/// What every measurement is labelled with, in order: program, hardware, compiler, date.
/// @param cores 0: those that this process may use
Facts machine_facts(int cores = 0);

/// "model name" of /proc/cpuinfo.
std::string processor_name();

/// Column and value, all of which a row must have.
using Match = std::vector<std::pair<std::string, std::string>>;

/// A table of text cells under named columns, with facts on top.
struct CsvTable {
  Facts facts;
  std::vector<std::string> columns;
  std::vector<std::vector<std::string>> rows;

  bool has(const std::string& column) const;
  /// @throws InputError for a column that is not there.
  const std::string& text(std::size_t row, const std::string& column) const;
  /// @throws InputError if the cell is no number.
  double number(std::size_t row, const std::string& column) const;
  bool matches(std::size_t row, const Match& match) const;
  /// The first row that matches.
  std::optional<std::size_t> find(const Match& match) const;
  /// Distinct values of a column among the rows that match, in order of appearance.
  std::vector<std::string> values(const std::string& column, const Match& match = {}) const;
  /// "" if there is no such fact.
  std::string fact(const std::string& name) const;
};

/// Facts as "# name: value", then the header, then the rows. Cells must hold no comma and no line
/// break; those in `rows` that do are written with a semicolon or a space instead.
/// @throws OutputError
void write_csv(const std::filesystem::path& file, const CsvTable& table);
std::string csv_text(const CsvTable& table);
/// One row as it stands in the file, without the line's end.
std::string csv_row(const std::vector<std::string>& cells);

/// @throws InputError if the file cannot be read, or a row has another number of cells than the
///   header.
CsvTable read_csv(const std::filesystem::path& file);

/// The median and the spread, (largest - smallest) / median. @param values at least one
struct Median {
  double value = 0, spread = 0;
};
Median median_of(std::vector<double> values);

}  // namespace phyxel::app
