#include "printed_table.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "files/atomic_file.hpp"
#include "outside_text.hpp"
#include "phyxel/error.hpp"

namespace phyxel::app {
namespace {

using Json = nlohmann::ordered_json;

Json value_of(const std::string& cell) {
  if (cell.empty()) return nullptr;
  const Json value = Json::parse(cell, nullptr, false);
  return value.is_number() ? value : Json(cell);
}

}  // namespace

void add_table_options(CLI::App& command, TableOptions& options) {
  command.add_option("--csv", options.csv, "Also write the table to this file");
  command.add_flag("--force", options.force, "Replace the CSV file");
  command.add_flag("--json", options.json, "The table as JSON, nothing else on stdout");
}

PrintedTable::PrintedTable(TableOptions options, const std::vector<std::string>& columns,
                           Facts more, int cores)
    : options_(std::move(options)), table_{machine_facts(cores), columns, {}} {
  table_.facts.insert(table_.facts.end(), more.begin(), more.end());
  if (!options_.csv.empty()) {
    check_output_file(options_.csv, options_.force, Output::file_or_stream);
    if (is_stream(options_.csv)) {
      stream_.open(options_.csv);
      if (!stream_) throw OutputError(fmt::format("{}: cannot be written", options_.csv));
    }
  }
  if (!options_.quiet) print_head();
  write();
}

void PrintedTable::print_head() const {
  if (!options_.json) return fmt::print("{}", csv_text(table_));
  Json facts;
  for (const auto& [name, value] : table_.facts) facts[name] = value;
  fmt::print("{{\"facts\": {},\n \"rows\": [", json_text(facts, -1));
}

PrintedTable::~PrintedTable() {
  if (options_.json && !options_.quiet) fmt::print("]}}\n");
}

void PrintedTable::row(const std::vector<std::string>& cells) {
  if (!options_.quiet) print(cells);
  table_.rows.push_back(cells);
  write();
}

void PrintedTable::print(const std::vector<std::string>& cells) const {
  if (options_.json) {
    Json row;
    for (std::size_t k = 0; k < cells.size(); ++k) row[table_.columns[k]] = value_of(cells[k]);
    fmt::print("{}\n  {}", table_.rows.empty() ? "" : ",", json_text(row, -1));
  } else {
    fmt::print("{}\n", csv_row(cells));
  }
  std::fflush(stdout);
}

void PrintedTable::write() {
  if (options_.csv.empty()) return;
  if (!stream_.is_open()) return write_csv(options_.csv, table_);
  // Rows are only appended.
  const std::string text = csv_text(table_);
  stream_ << std::string_view(text).substr(streamed_) << std::flush;
  streamed_ = text.size();
  if (!stream_) throw OutputError(fmt::format("{}: cannot be written", options_.csv));
}

}  // namespace phyxel::app
