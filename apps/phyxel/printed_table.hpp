/// Tables of measurements, as the commands that measure show and keep them.
#pragma once

#include <CLI/CLI.hpp>

#include "csv.hpp"

namespace phyxel::app {

/// Where a table goes.
struct TableOptions {
  std::string csv;     ///< A file; "": none.
  bool force = false;  ///< Whether the file may be replaced.
  bool json = false;   ///< On the terminal: JSON instead of CSV.
};
void add_table_options(CLI::App& command, TableOptions& options);

/// A table whose rows go to the terminal as they come; the CSV file, if there is to be one, is
/// written whole after each; a FIFO or character device gets the rows one after another. As JSON it
/// is one object, {"facts": {...}, "rows": [{...}, ...]}, whose cells are numbers where they can be
/// and null where they are empty.
class PrintedTable {
 public:
  /// @param more facts after those of the machine
  /// @param cores of the machine, as in `machine_facts`
  /// @throws InputError if the file is there and must not be replaced
  PrintedTable(TableOptions options, const std::vector<std::string>& columns, Facts more = {},
               int cores = 0);
  ~PrintedTable();  ///< Closes the JSON, also after an error.
  PrintedTable(const PrintedTable&) = delete;
  PrintedTable& operator=(const PrintedTable&) = delete;
  void row(const std::vector<std::string>& cells);

 private:
  void write();

  TableOptions options_;
  std::ofstream stream_;      ///< Where the CSV is a FIFO or character device, which takes rows.
  std::size_t streamed_ = 0;  ///< Bytes it has.
  CsvTable table_;
};

}  // namespace phyxel::app
