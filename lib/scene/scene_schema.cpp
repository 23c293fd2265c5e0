#include "scene/scene_schema.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <stdexcept>
#include <string>

namespace phyxel {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

/// How a key that holds tables is written in a file.
std::string header_of(const SceneKey& key) {
  const std::string path = key.section.empty() ? key.name : key.section + "." + key.name;
  return scene_section(path).header;
}

std::string plain_words(const SceneKey& key) {
  switch (key.type) {
    case KeyType::text:
      return "text, 1 to 1000 bytes on one line";
    case KeyType::path:
      return "a path, 1 to 1000 bytes";
    case KeyType::integer:
      return "an integer";
    case KeyType::number:
      return "a number";
    case KeyType::number_or_word:
      return fmt::format("\"{}\" or a number", key.words.front());
    case KeyType::boolean:
      return "true or false";
    case KeyType::choice:
      return fmt::format("\"{}\"", fmt::join(key.words, "\", \""));
    case KeyType::choices:
      return fmt::format("a list of \"{}\", each at most once", fmt::join(key.words, "\", \""));
    case KeyType::vector:
      return "[x, y, z]";
    case KeyType::counts:
      return "three integers";
    case KeyType::indices:
      return "a list of integers";
    case KeyType::box:
      return "[[x, y, z], [x, y, z]]";
    case KeyType::curve:
      return fmt::format(
          "[[{}, {}], ...], 1 to {} points, {}", key.curve.x, key.curve.y, key.curve.most_points,
          key.curve.x_words.empty() ? key.curve.x_range.in_words(key.curve.x) + " [s], times ascend"
                                    : key.curve.x_words);
    case KeyType::table:
      return header_of(key);
    case KeyType::tables:
      break;
  }
  return header_of(key) + ", once or more";
}

}  // namespace

bool Range::contains(double value) const {
  return open ? value > low && value < high : value >= low && value <= high;
}

std::string Range::in_words(const std::string& name) const {
  const char* less = open ? "<" : "<=";
  const auto shown = [](double bound) {
    const std::string brief = fmt::format("{:g}", bound);
    return std::abs(bound) >= 1e7 && std::stod(brief) == bound ? brief : fmt::format("{}", bound);
  };
  if (low > -infinity && high < infinity) {
    return fmt::format("{} {} {} {} {}", shown(low), less, name, less, shown(high));
  }
  if (low > -infinity) return fmt::format("{} {} {}", name, open ? ">" : ">=", shown(low));
  return "";
}

std::optional<std::size_t> wrong_point(std::span<const LoadCurve::Point> points,
                                       const SceneKey& key) {
  for (std::size_t k = 0; k < points.size(); ++k) {
    const auto [x, y] = points[k];
    const bool ascends = k == 0 ? !key.curve.from_zero || x == 0 : x > points[k - 1].time;
    if (!ascends || !key.curve.x_range.contains(x) || !key.range.contains(y)) return k;
  }
  return std::nullopt;
}

const SceneSection& scene_section(const std::string& path) {
  for (const SceneSection& section : scene_sections()) {
    if (section.path == path) return section;
  }
  throw std::logic_error("no section \"" + path + "\" in the table of scene keys");
}

std::vector<const SceneKey*> keys_of(const std::string& section) {
  std::vector<const SceneKey*> found;
  const std::string& base = scene_section(section).base;
  for (const SceneKey& key : scene_keys()) {
    if (key.section == section || (!base.empty() && key.section == base)) found.push_back(&key);
  }
  return found;
}

std::string allowed_words(const SceneKey& key) {
  const bool several =
      key.type == KeyType::vector || key.type == KeyType::counts || key.type == KeyType::indices;
  const std::string one = key.type == KeyType::curve ? key.curve.y : key.name;
  const std::string range = key.range.in_words(several ? "each" : one);
  std::string words = plain_words(key);
  if (!range.empty()) words += ", " + range;
  if (!key.unit.empty()) words += " [" + key.unit + "]";
  return words;
}

}  // namespace phyxel
