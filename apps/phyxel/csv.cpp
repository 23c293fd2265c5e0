#include "csv.hpp"

#include <fmt/format.h>
#include <omp.h>

#include <algorithm>
#include <charconv>
#include <ctime>
#include <fstream>
#include <sstream>

#include "files/atomic_file.hpp"
#include "phyxel/error.hpp"
#include "version.hpp"

namespace phyxel::app {
namespace {

std::string today() {
  const std::time_t now = std::time(nullptr);
  char text[16];
  std::strftime(text, sizeof text, "%Y-%m-%d", std::gmtime(&now));
  return text;
}

std::string on_one_line(std::string text) {
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text;
}

std::string cell(std::string text) {
  std::replace(text.begin(), text.end(), ',', ';');
  return on_one_line(std::move(text));
}

}  // namespace

std::string processor_name() {
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);) {
    if (line.rfind("model name", 0) == 0) return line.substr(line.find(':') + 2);
  }
  return "unknown processor";
}

Facts machine_facts(int cores) {
  return {{"program", program_version()},
          {"hardware",
           fmt::format("{}, {} cores", processor_name(), cores > 0 ? cores : omp_get_num_procs())},
          {"compiler", compiler_name()},
          {"date", today()}};
}

bool CsvTable::has(const std::string& column) const {
  return std::find(columns.begin(), columns.end(), column) != columns.end();
}

const std::string& CsvTable::text(std::size_t row, const std::string& column) const {
  const auto found = std::find(columns.begin(), columns.end(), column);
  if (found == columns.end()) {
    throw InputError(
        fmt::format("no column \"{}\"; there are: {}", column, fmt::join(columns, ", ")));
  }
  return rows[row][static_cast<std::size_t>(found - columns.begin())];
}

double CsvTable::number(std::size_t row, const std::string& column) const {
  const std::string& value = text(row, column);
  double number = 0;
  const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), number);
  if (error != std::errc() || end != value.data() + value.size()) {
    throw InputError(
        fmt::format("column \"{}\", row {}: \"{}\" is not a number", column, row + 1, value));
  }
  return number;
}

bool CsvTable::matches(std::size_t row, const Match& match) const {
  return std::all_of(match.begin(), match.end(),
                     [&](const auto& cell) { return text(row, cell.first) == cell.second; });
}

std::optional<std::size_t> CsvTable::find(const Match& match) const {
  for (std::size_t r = 0; r < rows.size(); ++r) {
    if (matches(r, match)) return r;
  }
  return std::nullopt;
}

std::vector<std::string> CsvTable::values(const std::string& column, const Match& match) const {
  std::vector<std::string> found;
  for (std::size_t r = 0; r < rows.size(); ++r) {
    const std::string& value = text(r, column);
    if (matches(r, match) && std::find(found.begin(), found.end(), value) == found.end()) {
      found.push_back(value);
    }
  }
  return found;
}

std::string CsvTable::fact(const std::string& name) const {
  for (const auto& [key, value] : facts) {
    if (key == name) return value;
  }
  return "";
}

std::string csv_text(const CsvTable& table) {
  std::string text;
  for (const auto& [name, value] : table.facts)
    text += fmt::format("# {}: {}\n", name, on_one_line(value));
  text += fmt::format("{}\n", fmt::join(table.columns, ","));
  for (const auto& row : table.rows) text += csv_row(row) + '\n';
  return text;
}

std::string csv_row(const std::vector<std::string>& cells) {
  std::string text;
  for (std::size_t k = 0; k < cells.size(); ++k) text += (k ? "," : "") + cell(cells[k]);
  return text;
}

void write_csv(const std::filesystem::path& file, const CsvTable& table) {
  write_whole_file(file, csv_text(table), Durable::no);
}

std::vector<std::string> csv_cells(const std::string& line) {
  std::vector<std::string> cells(1);
  bool is_quoted = false;
  for (std::size_t k = 0; k < line.size(); ++k) {
    std::string& cell = cells.back();
    const bool begins = k == 0 || (!is_quoted && line[k - 1] == ',');
    if (line[k] == '"' && (is_quoted || begins)) {
      const bool is_doubled = is_quoted && k + 1 < line.size() && line[k + 1] == '"';
      if (is_doubled) {
        cell += line[++k];
      } else {
        is_quoted = !is_quoted;
      }
    } else if (line[k] == ',' && !is_quoted) {
      cells.emplace_back();
    } else {
      cell += line[k];
    }
  }
  return cells;
}

CsvTable read_csv(const std::filesystem::path& file) {
  std::istringstream in(read_text_file(file, std::size_t{64} << 20));
  CsvTable table;
  std::size_t number = 0;
  for (std::string line; std::getline(in, line);) {
    ++number;
    if (line.rfind("# ", 0) == 0) {
      const std::size_t colon = line.find(": ");
      if (colon != std::string::npos) {
        table.facts.emplace_back(line.substr(2, colon - 2), line.substr(colon + 2));
      }
    } else if (table.columns.empty()) {
      table.columns = csv_cells(line);
    } else if (!line.empty()) {
      table.rows.push_back(csv_cells(line));
      if (table.rows.back().size() != table.columns.size()) {
        throw InputError(fmt::format("{}:{}: {} cells under {} columns", file.string(), number,
                                     table.rows.back().size(), table.columns.size()));
      }
    }
  }
  return table;
}

Median median_of(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t half = values.size() / 2;
  const double middle = values.size() % 2 ? values[half] : 0.5 * (values[half - 1] + values[half]);
  return {middle, (values.back() - values.front()) / middle};
}

}  // namespace phyxel::app
