/// Output of tables of measurements.
#pragma once

#include <fstream>

#include "cli_forward.hpp"
#include "csv.hpp"

namespace phyxel::app {

/// Destinations of a table.
struct TableOptions {
  std::string csv;     ///< CSV file; "" for none.
  bool force = false;  ///< True if the file may be replaced.
  bool json = false;   ///< True for JSON on stdout instead of CSV.
  bool quiet = false;  ///< True for nothing on stdout.
};
void add_table_options(CLI::App& command, TableOptions& options);

/// A table whose rows are printed as they are added. The CSV file, if any, is rewritten atomically
/// after each row; a FIFO or a character device receives row after row. JSON output is one object,
/// {"facts": {...}, "rows": [{...}, ...]}, whose cells are numbers if possible and null if empty.
class PrintedTable {
 public:
  /// @param more facts that follow those of the machine
  /// @param cores number of cores, as in `machine_facts`
  /// @throws InputError if the file exists and must not be replaced
  PrintedTable(TableOptions options, const std::vector<std::string>& columns, Facts more = {},
               int cores = 0);
  ~PrintedTable();  ///< Closes the JSON, also after an error.
  PrintedTable(const PrintedTable&) = delete;
  PrintedTable& operator=(const PrintedTable&) = delete;
  void row(const std::vector<std::string>& cells);

 private:
  void print_head() const;
  void print(const std::vector<std::string>& cells) const;
  void write();

  TableOptions options_;
  std::ofstream stream_;      ///< Open if the CSV is a FIFO or a character device.
  std::size_t streamed_ = 0;  ///< Number of bytes written to it.
  CsvTable table_;
};

}  // namespace phyxel::app
