/// Tables of measurements as CSV files, with facts about their origin.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace phyxel::app {

/// Pairs of names and values.
using Facts = std::vector<std::pair<std::string, std::string>>;
/// The facts of each measurement, in order: program, hardware, compiler, date.
/// @param cores number of cores; 0 for those that this process may use
Facts machine_facts(int cores = 0);

/// The "model name" of /proc/cpuinfo.
std::string processor_name();

/// Pairs of column and value that a row must have.
using Match = std::vector<std::pair<std::string, std::string>>;

/// A table of text cells under named columns, with facts on top.
struct CsvTable {
  Facts facts;
  std::vector<std::string> columns;
  std::vector<std::vector<std::string>> rows;

  bool has(const std::string& column) const;
  /// The text of a cell. @throws InputError for an unknown column
  const std::string& text(std::size_t row, const std::string& column) const;
  /// The number in a cell. @throws InputError if it is not a number
  double number(std::size_t row, const std::string& column) const;
  bool matches(std::size_t row, const Match& match) const;
  /// The first matching row.
  std::optional<std::size_t> find(const Match& match) const;
  /// Distinct values of a column in matching rows, in order of appearance.
  std::vector<std::string> values(const std::string& column, const Match& match = {}) const;
  /// The value of a fact; "" if it is missing.
  std::string fact(const std::string& name) const;
};

/// Writes facts as "# name: value", then the header, then the rows. Commas and line breaks in cells
/// become semicolons and spaces. @throws OutputError
void write_csv(const std::filesystem::path& file, const CsvTable& table);
std::string csv_text(const CsvTable& table);
/// The line of a row, without the line's end.
std::string csv_row(const std::vector<std::string>& cells);

/// The cells of a line, which may be quoted (RFC 4180).
std::vector<std::string> csv_cells(const std::string& line);

/// Reads a table. @throws InputError if the file cannot be read, or a row and the header differ in
///   the number of cells
CsvTable read_csv(const std::filesystem::path& file);

/// A median and the relative spread, (largest - smallest) / median.
struct Median {
  double value = 0, spread = 0;
};
Median median_of(std::vector<double> values);

}  // namespace phyxel::app
