#include "accuracy/page.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "accuracy/accuracy.hpp"
#include "accuracy/hard_cases.hpp"
#include "accuracy/pictures.hpp"
#include "accuracy/studies.hpp"
#include "csv.hpp"
#include "files/atomic_file.hpp"
#include "markdown.hpp"
#include "outside_text.hpp"
#include "plot.hpp"

namespace phyxel::app {
namespace {

namespace fs = std::filesystem;

/// How a row was discretised, but for its resolution.
std::string way_of(const CsvTable& t, std::size_t r) {
  std::string way = t.text(r, "lattice");
  if (t.number(r, "jitter") > 0) way += fmt::format(", jitter {}", t.text(r, "jitter"));
  if (t.number(r, "factor") != NeighbourhoodRule{}.factor) {
    way += fmt::format(", factor {}", t.text(r, "factor"));
  }
  const bool held = t.number(r, "hourglass") > 0, closed = t.number(r, "closure") > 0;
  if (held) way += fmt::format(", α = {}", t.text(r, "hourglass"));
  if (closed) way += ", closed";
  if (closed && t.number(r, "closure") != 1e-3) way += fmt::format(" to {}", t.text(r, "closure"));
  return held || closed ? way : way + ", plain";
}

/// From the scene to the answer [s].
double time_of(const CsvTable& t, std::size_t r) {
  return t.number(r, "seconds") + t.number(r, "setup_seconds");
}
double error_of(const CsvTable& t, std::size_t r) { return std::abs(t.number(r, "error")); }

/// A row that no other one of these is both faster and more accurate than.
std::vector<std::size_t> front_of(const CsvTable& t, std::vector<std::size_t> rows) {
  std::sort(rows.begin(), rows.end(),
            [&](std::size_t a, std::size_t b) { return time_of(t, a) < time_of(t, b); });
  std::vector<std::size_t> front;
  double best = std::numeric_limits<double>::infinity();
  for (const std::size_t r : rows) {
    if (!(error_of(t, r) < best)) continue;
    best = error_of(t, r);
    front.push_back(r);
  }
  return front;
}

/// Its letters and digits, words apart.
std::string file_name_of(const std::string& quantity) {
  std::string name;
  for (std::size_t k = 0; k < quantity.size(); ++k) {
    if (quantity.compare(k, 2, "ν") == 0) {
      name += "nu";
      ++k;
    } else {
      const char c = quantity[k];
      const bool kept = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
      name += kept ? c : '-';
    }
  }
  return name;
}

/// As a reader takes it in: percents where they say something.
std::string short_error(double error) {
  error = std::abs(error);
  if (!std::isfinite(error)) return "flew apart";
  if (error < 1e-4) return fmt::format("{:.0e}", error);
  return error < 0.095 ? fmt::format("{:.2g}%", 100 * error) : fmt::format("{:.0f}%", 100 * error);
}

/// The chart's curve of that label, a new one if there is none.
Curve& curve_named(LineChart& chart, const std::string& label) {
  const auto known = std::find_if(chart.curves.begin(), chart.curves.end(),
                                  [&](const Curve& curve) { return curve.label == label; });
  return known != chart.curves.end() ? *known : chart.curves.emplace_back(Curve{label, {}, {}});
}

class AccuracyPage {
 public:
  AccuracyPage(const fs::path& results, const fs::path& page)
      : results_(results),
        link_(markdown_link(fs::relative(results, page.parent_path()) / "")),
        table_(read_page_table(results / "accuracy.csv")) {}

  std::string text() {
    text_ = fmt::format(
        "# Accuracy\n\nWritten by `phyxel accuracy page` from the table of `phyxel accuracy` in "
        "`docs/results/`: problems with known answers, solved on the CPU in double (*inf*: it flew "
        "apart). *Cells*: a "
        "phyxel in the middle of each cell of a lattice; *nodes*: one at each corner, so on faces, "
        "edges and corners of the body, too; *mesh*: spread on and in the body's surface as "
        "`phyxel sample --on-surface` does, as many as there are nodes. *Jitter*: phyxels moved at "
        "random by up to so many "
        "spacings, with the volumes of the lattice. α: strength of hourglass control; *closed*: "
        "with "
        "closed gradients; *plain*: with neither. "
        "*Order*: by which "
        "power of the spacing the error fell since the row before. *Evaluations*: of all phyxels' "
        "forces, in Newton's method and what it needs. *Set-up*: from the scene to the first of "
        "them; "
        "bold rows and charts count both times. Errors are relative to the reference, or to "
        "what the quantity says.\n\nMeasured by {} on {}; {}; {}{}.\n\n",
        table_.fact("program"), table_.fact("hardware"), table_.fact("compiler"),
        table_.fact("date"), measured_apart());
    summary();
    peers_section();
    hourglass_section();
    for (const AccuracyCase& c : accuracy_cases()) {
      for (const std::string& quantity : table_.values("quantity", {{"case", c.name}})) {
        section(c, quantity);
      }
    }
    for (const Study& study : studies()) study_section(study);
    hard_section();
    return text_;
  }

 private:
  /// The finest of each way, side by side.
  /// Cases that another program has measured since.
  std::string measured_apart() const {
    std::string text;
    for (const AccuracyCase& c : accuracy_cases()) {
      if (const std::string program = table_.fact(c.name); !program.empty()) {
        text += fmt::format("; {} by {}", c.name, program);
      }
    }
    return text;
  }

  void summary() {
    const std::string ways[] = {"cells, plain",
                                "nodes, plain",
                                "nodes, α = 0.1",
                                "nodes, jitter 0.2, plain",
                                "nodes, jitter 0.2, α = 0.1, closed",
                                "mesh, plain",
                                "mesh, α = 0.1",
                                "mesh, α = 0.1, closed"};
    std::vector<std::string> head{"", "phyxels"};
    for (const std::string& way : ways) {
      for (std::size_t r = 0; r < table_.rows.size(); ++r) {
        if (way_of(table_, r) != way) continue;
        head.push_back(way);
        break;
      }
    }
    if (head.size() < 4) return;  // nothing to compare
    std::vector<std::vector<std::string>> cells;
    for (const AccuracyCase& c : accuracy_cases()) {
      for (const std::string& quantity : table_.values("quantity", {{"case", c.name}})) {
        auto& row = cells.emplace_back(
            std::vector<std::string>{fmt::format("{}: {}", c.name, quantity), ""});
        double most = 0;
        for (std::size_t k = 2; k < head.size(); ++k) {
          std::string found = "–";
          double finest = 0;
          for (std::size_t r = 0; r < table_.rows.size(); ++r) {
            if (!table_.matches(r, {{"case", c.name}, {"quantity", quantity}}) ||
                way_of(table_, r) != head[k] || table_.number(r, "across") < finest) {
              continue;
            }
            finest = table_.number(r, "across");
            most = std::max(most, table_.number(r, "phyxels"));
            found = short_error(table_.number(r, "error"));
          }
          row.push_back(found);
        }
        row[1] = fmt::format("{:g}", most);
      }
    }
    text_ +=
        "## What is reached\n\nErrors at the finest resolution of each problem, with up to so "
        "many phyxels (cells have fewer). Scenes that say nothing have nodes (cells in round "
        "bodies), or meshes, with α = 0.1.\n\n" +
        table_text(head, cells);
  }

  /// What hourglass control holds, and what it takes.
  void hourglass_section() {
    std::vector<std::string> names, shown;
    for (const AccuracyPicture& picture : accuracy_pictures()) {
      if (!fs::exists(results_ / picture.file)) continue;
      names.push_back(picture.what);
      shown.push_back(fmt::format("![{}]({}{})", picture.what, link_, picture.file));
    }
    const std::pair<const char*, const char*> files[] = {{"CPU", "cpu_terms.csv"},
                                                         {"GPU", "gpu_terms.csv"}};
    std::vector<std::vector<std::string>> costs;
    for (const auto& [device, file] : files) {
      if (!fs::exists(results_ / file)) continue;
      const CsvTable t = read_page_table(results_ / file);
      for (const char* precision : {"double", "mixed", "float"}) {
        const auto plain = t.find({{"terms", "green"}, {"precision", precision}});
        if (!plain) continue;
        std::vector<std::string> row{device, precision, t.text(*plain, "phyxels")};
        for (const char* terms : {"hourglass", "closure"}) {
          const auto with = t.find({{"terms", terms}, {"precision", precision}});
          row.push_back(with ? fmt::format("{:+.0f}%", 100 * (t.number(*plain, "steps_per_s") /
                                                                  t.number(*with, "steps_per_s") -
                                                              1))
                             : "–");
        }
        costs.push_back(row);
      }
    }
    if (shown.empty() && costs.empty()) return;
    text_ += "## What hourglass control holds, and what it costs\n\n";
    if (!shown.empty()) {
      text_ +=
          "A soft bar of neo-Hookean material, clamped at its upper end, after it was let go: "
          "its phyxels as they lie, drawn by `phyxel accuracy pictures`.\n\n" +
          table_text(names, {shown});
    }
    if (!costs.empty()) {
      text_ +=
          "Time of a step beside one without, from `phyxel bench step`:\n\n" +
          table_text({"", "precision", "phyxels", "hourglass control", "closed gradients"}, costs);
    }
  }

  /// LAMMPS on the same beam and the same cores.
  void peers_section() {
    const fs::path file = results_ / "accuracy_lammps.csv";
    if (!fs::exists(file)) return;
    const CsvTable t = read_page_table(file);
    LineChart chart{.title = "frequency of a bending bar",
                    .x_label = "time for ten periods [s]",
                    .y_label = "error",
                    .log_x = true,
                    .log_y = true,
                    .curves = {}};
    std::vector<std::vector<std::string>> cells;
    for (std::size_t r = 0; r < t.rows.size(); ++r) {
      const std::string way = t.text(r, "program") + ", " + t.text(r, "discretisation");
      Curve& curve = curve_named(chart, way);
      curve.x.push_back(t.number(r, "seconds"));
      curve.y.push_back(error_of(t, r));
      cells.push_back({way, t.text(r, "across"), t.text(r, "phyxels"),
                       short_error(t.number(r, "error")), t.text(r, "seconds")});
    }
    text_ += fmt::format(
        "## Beside LAMMPS\n\nThe bar of *bending* below rings for ten periods, on the same cores: "
        "what its frequency is off by, and how long it takes. {}. "
        "`bench/compare/lammps_bending.py` "
        "runs both, with the largest stable step of LAMMPS and without its set-up, with phyxel's "
        "own step and its set-up. {} on {}; {}.\n\n",
        t.fact("what"), t.fact("program"), t.fact("hardware"), t.fact("date"));
    draw(chart, "accuracy_lammps");
    text_ += table_text({"", "across", "phyxels", "error", "s"}, cells);
  }

  void study_section(const Study& study) {
    const fs::path file = results_ / fmt::format("accuracy_{}.csv", study.name);
    if (!fs::exists(file)) return;
    const CsvTable t = read_page_table(file);
    text_ += fmt::format("## {}\n\n{} By `phyxel accuracy {}`: {} on {}; {}; {}.\n\n", study.name,
                         study.what, study.name, t.fact("program"), t.fact("hardware"),
                         t.fact("compiler"), t.fact("date"));
    LineChart chart{.title = study.name,
                    .x_label = study.x_label,
                    .y_label = "error",
                    .log_x = true,
                    .log_y = true,
                    .curves = {}};
    std::vector<std::vector<std::string>> cells;
    for (std::size_t r = 0; r < t.rows.size(); ++r) {
      const std::string way = t.text(r, "way");
      Curve& curve = curve_named(chart, way);
      curve.x.push_back(t.number(r, study.by_time ? "seconds" : study.x));
      curve.y.push_back(std::max(1e-17, t.number(r, "error")));
      cells.push_back({way, t.text(r, study.x), t.text(r, "error"), t.text(r, "evaluations"),
                       t.text(r, "seconds")});
    }
    draw(chart, "accuracy_" + study.name);
    text_ += table_text({"", study.x, "error", "evaluations", "s"}, cells);
    text_ += "\n";
  }
  /// Into the results' folder, where it can be drawn; shown where it is there.
  void draw(const LineChart& chart, const std::string& name) {
    const fs::path file = results_ / (name + ".svg");
    if (can_plot()) draw_svg(script_of(chart), file);
    if (fs::exists(file)) {
      text_ += fmt::format("![{}]({}{}.svg)\n\n", chart.title, link_, name);
    }
  }

  /// What a table of `phyxel accuracy hard` says of a case, precision by precision.
  static std::string found_in(const CsvTable& t, const std::string& name) {
    std::string text;
    for (std::size_t r = 0; r < t.rows.size(); ++r) {
      if (t.text(r, "case") != name) continue;
      const bool refused = t.text(r, "found") == "refusal";
      text += fmt::format("{}{} {}{}", text.empty() ? "" : "; ", t.text(r, "precision"),
                          refused ? "refused" : t.text(r, "error"),
                          t.text(r, "good") == "yes" ? "" : " **(wrong)**");
    }
    return text.empty() ? "not run" : text;
  }
  static std::string refusal_in(const CsvTable& t, const std::string& name) {
    for (std::size_t r = 0; r < t.rows.size(); ++r) {
      if (t.text(r, "case") == name && !t.text(r, "message").empty()) return t.text(r, "message");
    }
    return "";
  }

  void hard_section() {
    const std::pair<const char*, const char*> files[] = {{"CPU", "hard_cases_cpu.csv"},
                                                         {"GPU", "hard_cases_gpu.csv"}};
    std::vector<std::string> columns{"case", "what", "allowed"};
    std::vector<CsvTable> tables;
    std::string measured;
    for (const auto& [device, file] : files) {
      if (!fs::exists(results_ / file)) continue;
      const CsvTable& t = tables.emplace_back(read_page_table(results_ / file));
      columns.push_back(device);
      measured += fmt::format("{}: {} on {}; {}; {}. ", device, t.fact("program"),
                              t.fact("hardware"), t.fact("compiler"), t.fact("date"));
    }
    if (tables.empty()) return;
    std::vector<std::vector<std::string>> cells;
    std::string refusals;
    for (const HardCase& hard : hard_cases()) {
      auto& row = cells.emplace_back(std::vector<std::string>{
          hard.name, hard.what,
          hard.tolerance > 0 ? fmt::format("{:g}", hard.tolerance) : "refusal"});
      for (const CsvTable& t : tables) row.push_back(found_in(t, hard.name));
      const std::string refusal = refusal_in(tables[0], hard.name);
      if (!refusal.empty()) refusals += fmt::format("- {}: {}\n", hard.name, refusal);
    }
    text_ += fmt::format(
        "## Hard cases\n\nFrom `phyxel accuracy hard`: each is answered within what is allowed, or "
        "refused with its cause. {}\n\n",
        measured);
    text_ += table_text(columns, cells);
    if (!refusals.empty()) text_ += "\nWhat refusals say:\n\n" + refusals;
  }
  void section(const AccuracyCase& c, const std::string& quantity) {
    text_ += fmt::format("## {}: {}\n\n{}\n\n", c.name, quantity, c.what);
    std::vector<std::size_t> rows;
    for (std::size_t r = 0; r < table_.rows.size(); ++r) {
      if (table_.matches(r, {{"case", c.name}, {"quantity", quantity}})) rows.push_back(r);
    }
    for (const bool irregular : {false, true}) chart(c, quantity, rows, irregular);
    const std::vector<std::size_t> front = front_of(table_, rows);
    std::vector<std::vector<std::string>> cells;
    for (const std::size_t r : rows) {
      const bool best = std::find(front.begin(), front.end(), r) != front.end();
      cells.push_back(
          {best ? "**" + way_of(table_, r) + "**" : way_of(table_, r), table_.text(r, "across"),
           table_.text(r, "phyxels"), table_.text(r, "neighbours"), table_.text(r, "value"),
           table_.text(r, "error"), table_.text(r, "order"), table_.text(r, "evaluations"),
           table_.text(r, "seconds"), table_.text(r, "setup_seconds")});
    }
    text_ += "In bold: nothing measured here is both faster and more accurate.\n\n";
    text_ += table_text({"discretisation", "across", "phyxels", "neighbours", "value", "error",
                         "order", "evaluations", "s", "set-up s"},
                        cells);
  }

  /// Error against time, a curve for each way on regular lattices or on irregular ones, and the
  /// front.
  void chart(const AccuracyCase& c, const std::string& quantity,
             const std::vector<std::size_t>& rows, bool irregular) {
    LineChart chart{.title = fmt::format("{}: {}, {} lattices", c.name, quantity,
                                         irregular ? "irregular" : "regular"),
                    .x_label = "time from the scene to the answer [s]",
                    .y_label = "error",
                    .log_x = true,
                    .log_y = true,
                    .curves = {}};
    std::vector<std::size_t> shown;
    for (const std::size_t r : rows) {
      const double error = error_of(table_, r);
      const bool is_irregular =
          table_.number(r, "jitter") > 0 || table_.text(r, "lattice") == "mesh";
      if (is_irregular != irregular || !(error > 0) || !std::isfinite(error)) continue;
      shown.push_back(r);
      Curve& curve = curve_named(chart, way_of(table_, r));
      curve.x.push_back(time_of(table_, r));
      curve.y.push_back(error_of(table_, r));
    }
    // Rounding has no order, and one resolution no curve.
    if (shown.size() < 2 || c.name == "rotation" || c.across.size() < 2) return;
    Curve front{"Pareto front", {}, {}, 0, true};
    for (const std::size_t r : front_of(table_, shown)) {
      front.x.push_back(time_of(table_, r));
      front.y.push_back(error_of(table_, r));
    }
    chart.curves.push_back(front);
    draw(chart, fmt::format("accuracy_{}_{}_{}", c.name, file_name_of(quantity),
                            irregular ? "irregular" : "regular"));
  }

  fs::path results_;
  std::string link_;
  CsvTable table_;
  std::string text_;
};

}  // namespace

void write_accuracy_page(const fs::path& results, const fs::path& page) {
  write_whole_file(page, AccuracyPage(results, page).text(), Durable::no);
}

}  // namespace phyxel::app
