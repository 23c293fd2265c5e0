#include "colouring.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "label.hpp"
#include "phyxel/law_table.hpp"
#include "phyxel/neighbourhood.hpp"

namespace phyxel::app {
namespace {

/// Components of a field at each point; 0 if it has a number of values that fits no point.
std::size_t components(const FrameData& frame, const std::vector<double>& values) {
  const std::size_t points = frame.point.size();
  return points > 0 && values.size() % points == 0 ? values.size() / points : 0;
}

/// Viridis in sRGB, by a polynomial of degree six: Zucker's fit, as on the page of a report.
std::array<double, 3> viridis(double t) {
  constexpr double c[3][7] = {
      {0.2777273, 0.1050930, -0.3308618, -4.6342305, 6.2282699, 4.7763850, -5.4354559},
      {0.0054073, 1.4046135, 0.2148476, -5.7991010, 14.1799334, -13.7451454, 4.6458526},
      {0.3340998, 1.3845902, 0.0950952, -19.3324410, 56.6905526, -65.3530326, 26.3124352}};
  std::array<double, 3> colour;
  for (std::size_t k = 0; k < 3; ++k) {
    double sum = 0;
    for (int n = 6; n >= 0; --n) sum = sum * t + c[k][n];
    colour[k] = std::clamp(sum, 0.0, 1.0);
  }
  return colour;
}

/// The lower edge of a colour bar [px], and the scale of its text.
struct BarEdge {
  int left, bottom, width;
  double scale;
};

/// Draws ticks below a bar, and their numbers where these do not touch the one before.
void draw_ticks(Image& image, const ColourRange& range, const BarEdge& bar) {
  constexpr std::uint8_t ink = 64;
  const int length = static_cast<int>(2 * bar.scale), thick = std::max(1, length / 2);
  const int right = image.width - static_cast<int>(2 * bar.scale);
  int free_from = 0;
  for (const double tick : ticks_of(range, 4)) {
    const double share = range.share_of(tick);
    const int x = bar.left + static_cast<int>(std::lround(share * (bar.width - thick)));
    for (int y = bar.bottom; y < bar.bottom + length; ++y) {
      std::fill_n(image.pixel(x, y), 3 * thick, ink);
    }
    const std::string number = short_number(tick);
    const int wide = static_cast<int>(6 * bar.scale * static_cast<double>(number.size()));
    const int from = std::min(x - wide / 2, right - wide);
    if (from < free_from) continue;
    draw_text(image, from, bar.bottom + static_cast<int>(4 * bar.scale), bar.scale, number);
    free_from = from + wide + static_cast<int>(3 * bar.scale);
  }
}

}  // namespace

std::string stored_name(const std::string& field) { return field == "speed" ? "velocity" : field; }

std::string unit_of(const std::string& field) {
  struct Unit {
    const char *field, *unit;
  };
  constexpr Unit units[] = {{"displacement", "m"},     {"velocity", "m/s"}, {"speed", "m/s"},
                            {"von_mises", "Pa"},       {"mass", "kg"},      {"volume", "m^3"},
                            {"principal_stress", "Pa"}};
  for (const Unit& known : units) {
    if (field == known.field) return known.unit;
  }
  for (const LawEntry& law : law_table()) {
    for (const HistoryNumber& number : law.history) {
      if (field == number.name) return number.unit;
    }
  }
  return "";
}

std::string field_title(const std::string& field) {
  const std::string unit = unit_of(field);
  return unit.empty() ? field : fmt::format("{} [{}]", field, unit);
}

std::vector<std::string> colour_fields(const FrameData& frame) {
  std::vector<std::string> names;
  for (const auto& [name, values] : frame.field) {
    const std::size_t each = components(frame, values);
    if (each != 1 && each != 3) continue;
    names.push_back(name);
    if (name == "velocity") names.push_back("speed");
  }
  return names;
}

std::vector<std::string> other_numbers(const FrameData& frame) {
  std::vector<std::string> names;
  for (const auto& [name, values] : frame.field) {
    const bool is_component = name.size() > 3 && name[name.size() - 3] == '_' &&
                              name.find_first_not_of("xyz", name.size() - 2) == std::string::npos;
    const bool is_known =
        name == "von_mises" || name == "volume_ratio" || name == "mass" || name == "volume";
    if (values.size() == frame.point.size() && !is_component && !is_known) names.push_back(name);
  }
  return names;
}

std::optional<std::vector<double>> field_values(const FrameData& frame, const std::string& field) {
  const auto found = frame.field.find(stored_name(field));
  if (found == frame.field.end()) return std::nullopt;
  const std::vector<double>& values = found->second;
  const std::size_t each = components(frame, values);
  if (each == 1) return values;
  if (each != 3) return std::nullopt;
  std::vector<double> lengths;
  for (std::size_t k = 0; k < values.size(); k += 3) {
    lengths.push_back(norm({values[k], values[k + 1], values[k + 2]}));
  }
  return lengths;
}

std::vector<double> shown_values(const FrameData* surface, const FrameData* phyxels,
                                 const Colouring& colouring) {
  const auto of = [&](const FrameData* frame) {
    return frame == nullptr ? std::nullopt : field_values(*frame, colouring.field);
  };
  if (surface == nullptr) return of(phyxels).value_or(std::vector<double>{});
  if (const auto own = of(surface)) return *own;
  const auto values = of(phyxels);
  const Carriers& carriers = colouring.carriers;
  if (!values || carriers.phyxel.size() != Carriers::each * surface->point.size()) return {};
  std::vector<double> shown;
  for (std::size_t k = 0; k < carriers.phyxel.size(); k += Carriers::each) {
    double sum = 0;
    for (std::size_t c = k; c < k + Carriers::each; ++c) {
      sum += carriers.weight[c] * (*values)[carriers.phyxel[c]];
    }
    shown.push_back(sum / 255);
  }
  return shown;
}

std::vector<double> inner_values(const FrameData& phyxels, Index body, const std::string& field,
                                 const std::vector<Vec3d>& places, double reach) {
  const auto all = field_values(phyxels, field);
  if (!all) return {};
  std::vector<Vec3d> point;
  std::vector<double> values;
  for (std::size_t i = 0; i < phyxels.point.size(); ++i) {
    if (phyxels.body.size() == phyxels.point.size() && phyxels.body[i] != body) continue;
    if (!std::isfinite((*all)[i])) continue;
    point.push_back(phyxels.point[i]);
    values.push_back((*all)[i]);
  }
  if (point.empty()) return {};
  const Csr rows = phyxels_near(places, point, std::vector<double>(point.size(), reach));
  std::vector<double> found;
  for (Index k = 0; k < rows.rows(); ++k) {
    double sum = 0, weights = 0;
    for (const Index i : rows.row(k)) {
      const double weight = carrier_weight(norm(point[i] - places[k]) / reach);
      sum += weight * values[i];
      weights += weight;
    }
    found.push_back(sum / weights);
  }
  return found;
}

Colour field_colour(double value, const Colouring& colouring) {
  const auto linear = [](double s) {  // of sRGB (IEC 61966-2-1)
    return static_cast<float>(s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4));
  };
  const auto [r, g, b] = viridis(colouring.range.share_of(value));
  return {linear(r), linear(g), linear(b)};
}

void draw_colour_bar(Image& image, const Colouring& colouring) {
  const double scale = text_scale(image);
  const int margin = static_cast<int>(9 * scale), line = static_cast<int>(11 * scale);
  const int width = std::max(image.width / 4, 2), height = static_cast<int>(6 * scale);
  const int left = image.width - margin - width, top = image.height - margin - line - height;
  if (left < 0 || top - line < 0) return;  // the picture has no room
  for (int x = 0; x < width; ++x) {
    const auto colour = viridis(static_cast<double>(x) / (width - 1));
    for (int y = top; y < top + height; ++y) {
      for (std::size_t k = 0; k < 3; ++k) {
        image.pixel(left + x, y)[k] = static_cast<std::uint8_t>(std::lround(255 * colour[k]));
      }
    }
  }
  draw_text(image, left, top - line, scale, field_title(colouring.field));
  draw_ticks(image, colouring.range, {left, top + height, width, scale});
}

}  // namespace phyxel::app
