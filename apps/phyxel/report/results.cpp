/// Measurements as a page.
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "csv.hpp"
#include "report/page.hpp"
#include "report/report.hpp"
#include "version.hpp"

namespace phyxel::app {

Report results_page(const std::vector<std::filesystem::path>& tables) {
  using Json = nlohmann::ordered_json;
  Json data = Json::array();
  std::size_t rows = 0;
  for (const std::filesystem::path& file : tables) {
    const CsvTable table = read_csv(file);
    rows += table.rows.size();
    data.push_back({{"name", file.filename().string()},
                    {"facts", table.facts},
                    {"columns", table.columns},
                    {"rows", table.rows}});
  }
  const std::string title = tables.size() == 1
                                ? tables.front().stem().string()
                                : fmt::format("{} tables of measurements", tables.size());
  Report report;
  report.html = filled_page(
      "results.html",
      {{"title", html_text(title)},
       {"summary",
        fmt::format("{} rows. Charts show any two columns; points tell their rows.", rows)},
       {"data", script_json({{"tables", data}})},
       {"footer", html_text(fmt::format("Written by {}.", program_version()))}});
  return report;
}

}  // namespace phyxel::app
