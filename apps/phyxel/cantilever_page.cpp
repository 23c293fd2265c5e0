#include "cantilever_page.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "cantilever.hpp"
#include "markdown.hpp"
#include "phyxel/error.hpp"

namespace phyxel::app {
namespace {

/// Rows of one support and precision, from the coarsest cloud to the finest; at least one.
std::vector<std::size_t> refinement(const CsvTable& t, const std::string& factor,
                                    const std::string& precision) {
  std::vector<std::size_t> rows;
  for (std::size_t r = 0; r < t.rows.size(); ++r) {
    if (t.matches(r, {{"factor", factor}, {"precision", precision}})) rows.push_back(r);
  }
  if (rows.empty()) {
    throw InputError(
        fmt::format("cantilever, factor {}, {}: no row; allowed: a table of a bench that ended",
                    factor, precision));
  }
  std::sort(rows.begin(), rows.end(), [&](std::size_t a, std::size_t b) {
    return t.number(a, "across") < t.number(b, "across");
  });
  return rows;
}

/// That of scenes that say nothing, if it was measured.
std::string usual_factor(const CsvTable& t) {
  const std::string usual = fmt::format("{:g}", NeighbourhoodRule{}.factor);
  return t.find({{"factor", usual}}) ? usual : t.values("factor")[0];
}

/// Those that are compared with double.
std::vector<std::string> rounded_precisions(const CsvTable& t) {
  std::vector<std::string> precisions = t.values("precision");
  std::erase(precisions, "double");
  return precisions;
}

}  // namespace

std::string cantilever_words(const CsvTable& t) {
  std::string text = fmt::format(
      "A square beam on a regular lattice, {:g} heights long, Poisson's ratio {:g}, held at one "
      "end, under a shear at the other that bends it by {:.2g} of its length; damped critically "
      "until its deflection changes by less than {:g} of itself while the first mode decays by e. "
      "*Discretisation* is the difference from the known deflection, {:.4g} of Timoshenko's (who "
      "lets the held end contract sideways, as held phyxels cannot); *rounding* is the largest "
      "difference of a displacement from that in double on the same cloud after as many steps, "
      "over the largest displacement. Times are those of the steps.\n\n",
      cantilever_length / cantilever_height, cantilever_material.poisson,
      known_deflection() / cantilever_length, cantilever_settled,
      known_deflection() / timoshenko_deflection());
  const std::string usual = usual_factor(t);
  const std::vector<std::size_t> clouds = refinement(t, usual, "double");
  const std::size_t coarse = clouds.front(), fine = clouds.back();
  const auto error = [&](std::size_t r) { return t.number(r, "discretisation_error"); };
  const auto seconds = [&](std::size_t r) { return t.number(r, "seconds"); };
  if (coarse != fine) {
    text += fmt::format(
        "From {} to {} phyxels across, {} neighbours in the end: discretisation falls from "
        "{:.2g}% to {:.2g}%, with order {:.2f}.\n\n",
        t.text(coarse, "across"), t.text(fine, "across"), t.text(fine, "neighbours"),
        100 * error(coarse), 100 * error(fine),
        std::log(error(coarse) / error(fine)) /
            std::log(t.number(fine, "across") / t.number(coarse, "across")));
  }
  for (const std::string& factor : t.values("factor")) {
    if (factor == usual) continue;
    const std::size_t r = refinement(t, factor, "double").back();
    text += fmt::format(
        "{} neighbours, {} across: discretisation of {:.2g}%, in {:.2g} of the time that {} "
        "neighbours take.\n\n",
        t.text(r, "neighbours"), t.text(r, "across"), 100 * error(r), seconds(r) / seconds(fine),
        t.text(fine, "neighbours"));
  }
  for (const std::string& precision : rounded_precisions(t)) {
    double largest = 0, least = HUGE_VAL;
    for (std::size_t r = 0; r < t.rows.size(); ++r) {
      if (t.text(r, "precision") != precision) continue;
      const double rounding = t.number(r, "rounding_error");
      largest = std::max(largest, rounding);
      least = std::min(least, error(r) / rounding);
    }
    const std::size_t same = refinement(t, usual, precision).back();
    text += fmt::format(
        "{}: rounding is {:.1e} at most, and discretisation at least {:.0e} times as much; {} "
        "across, with {} neighbours, settles in {:.2g} of double's time.\n\n",
        precision, largest, least, t.text(same, "across"), t.text(same, "neighbours"),
        seconds(same) / seconds(fine));
  }
  return text;
}

LineChart cantilever_chart(const CsvTable& t) {
  LineChart chart{.title = "A cantilever: error against time to solution",
                  .x_label = "time to solution [s]",
                  .y_label = "error",
                  .log_x = true,
                  .log_y = true,
                  .curves = {}};
  const auto add = [&](const std::string& what, const std::string& factor,
                       const std::string& precision, int colour) {
    const std::vector<std::size_t> rows = refinement(t, factor, precision);
    const bool rounding = what == "rounding_error";
    const std::string label = fmt::format("{}{}, {:.0f} neighbours", rounding ? "rounding, " : "",
                                          precision, t.number(rows.back(), "neighbours"));
    Curve& curve = chart.curves.emplace_back(Curve{label, {}, {}, colour, rounding});
    for (const std::size_t r : rows) {
      curve.x.push_back(t.number(r, "seconds"));
      curve.y.push_back(t.number(r, what));
    }
  };
  const std::string usual = usual_factor(t);
  int colour = 1;
  add("discretisation_error", usual, "double", colour);
  const std::vector<std::string> rounded = rounded_precisions(t);
  for (const std::string& precision : rounded) {
    ++colour;
    add("discretisation_error", usual, precision, colour);
    add("rounding_error", usual, precision, colour);
  }
  for (const std::string& factor : t.values("factor")) {
    if (factor != usual) {
      add("discretisation_error", factor, rounded.empty() ? "double" : rounded[0], ++colour);
    }
  }
  return chart;
}

std::string cantilever_table(const CsvTable& t) {
  const std::vector<std::string> precisions = t.values("precision");
  std::vector<std::string> head{"across", "phyxels",         "neighbours",
                                "steps",  "of Timoshenko's", "discretisation"};
  for (const std::string& p : rounded_precisions(t)) head.push_back("rounding, " + p);
  for (const std::string& p : precisions) head.push_back("s, " + p);
  for (const std::string& p : precisions) head.push_back("10⁹ phyxel-steps/s, " + p);
  std::vector<std::vector<std::string>> rows;
  for (std::size_t r = 0; r < t.rows.size(); ++r) {
    if (t.text(r, "precision") != "double") continue;
    std::vector<std::string>& row = rows.emplace_back();
    for (const char* column :
         {"across", "phyxels", "neighbours", "steps", "over_timoshenko", "discretisation_error"}) {
      row.push_back(t.text(r, column));
    }
    const auto in = [&](const std::string& precision) {
      return Match{{"across", t.text(r, "across")},
                   {"factor", t.text(r, "factor")},
                   {"precision", precision}};
    };
    for (const std::string& p : rounded_precisions(t)) {
      row.push_back(cell(t, "rounding_error", in(p)));
    }
    for (const std::string& p : precisions) row.push_back(cell(t, "seconds", in(p)));
    for (const std::string& p : precisions) {
      const auto found = t.find(in(p));
      row.push_back(found ? fmt::format("{:.3g}", t.number(*found, "phyxel_steps_per_s") * 1e-9)
                          : "–");
    }
  }
  return table_text(head, rows);
}

}  // namespace phyxel::app
