#include "scene/scene_table.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "phyxel/error.hpp"

namespace phyxel {
namespace {

constexpr std::size_t longest_text = 1000;  // bytes; allowed_words says so
constexpr std::size_t longest_shown = 60;   // bytes of a value in a message

double as_number(const toml::node& node) {
  if (const auto* integer = node.as_integer()) return static_cast<double>(integer->get());
  return node.as_floating_point()->get();
}

std::string text_of(const toml::node& node) { return node.as_string()->get(); }

Vec3d as_vector(const toml::node& node) {
  const toml::array& list = *node.as_array();
  return {as_number(*list.get(0)), as_number(*list.get(1)), as_number(*list.get(2))};
}

bool is_text(const toml::node& node) {
  if (!node.is_string()) return false;
  const std::string& text = node.as_string()->get();
  return !text.empty() && text.size() <= longest_text &&
         std::none_of(text.begin(), text.end(),
                      [](unsigned char c) { return c < 0x20 || c == 0x7f; });
}

bool is_word_of(const toml::node& node, const std::vector<std::string>& words) {
  return node.is_string() && std::find(words.begin(), words.end(), text_of(node)) != words.end();
}

bool is_number_in(const toml::node& node, const Range& range) {
  return node.is_number() && std::isfinite(as_number(node)) && range.contains(as_number(node));
}

bool is_integer_in(const toml::node& node, const Range& range) {
  return node.is_integer() && range.contains(as_number(node));
}

/// The node itself if it is not a list of `size` elements (0: any but none), else the first
/// element that `accepts` refuses; null if all is well.
template <class Accepts>
const toml::node* offender_in(const toml::node& node, std::size_t size, Accepts&& accepts) {
  const toml::array* list = node.as_array();
  if (!list || list->empty() || (size > 0 && list->size() != size)) return &node;
  for (const toml::node& element : *list) {
    if (!accepts(element)) return &element;
  }
  return nullptr;
}

const toml::node* offender_in_choices(const toml::node& node, const SceneKey& key) {
  if (node.is_array() && node.as_array()->empty()) return nullptr;
  std::set<std::string> seen;
  return offender_in(node, 0, [&](const toml::node& element) {
    return is_word_of(element, key.words) && seen.insert(text_of(element)).second;
  });
}

const toml::node* offender_in_vector(const toml::node& node, const Range& range) {
  return offender_in(node, 3, [&](const toml::node& x) { return is_number_in(x, range); });
}

const toml::node* offender_in_box(const toml::node& node, const Range& range) {
  const toml::node* deep = nullptr;
  const toml::node* found = offender_in(node, 2, [&](const toml::node& corner) {
    deep = offender_in_vector(corner, range);
    return deep == nullptr;
  });
  return deep ? deep : found;
}

std::vector<LoadCurve::Point> as_curve(const toml::array& list) {
  std::vector<LoadCurve::Point> points;
  for (const toml::node& point : list) {
    const toml::array& pair = *point.as_array();
    points.push_back({as_number(*pair.get(0)), as_number(*pair.get(1))});
  }
  return points;
}

const toml::node* offender_in_curve(const toml::node& node, const SceneKey& key) {
  const toml::node* found = offender_in(node, 0, [](const toml::node& point) {
    return !offender_in(point, 2, [](const toml::node& x) { return x.is_number(); });
  });
  if (found) return found;
  const toml::array& list = *node.as_array();
  if (list.size() > key.curve.most_points) return &node;
  const auto wrong = wrong_point(as_curve(list), key);
  return wrong ? list.get(*wrong) : nullptr;
}

/// The part of `node` that is not what `key` allows, or null.
const toml::node* offender(const toml::node& node, const SceneKey& key) {
  const auto unless = [&](bool good) { return good ? nullptr : &node; };
  const auto integer = [&](const toml::node& x) { return is_integer_in(x, key.range); };
  switch (key.type) {
    case KeyType::text:
    case KeyType::path:
      return unless(is_text(node));
    case KeyType::integer:
      return unless(integer(node));
    case KeyType::number:
      return unless(is_number_in(node, key.range));
    case KeyType::number_or_word:
      return unless(is_word_of(node, key.words) || is_number_in(node, key.range));
    case KeyType::boolean:
      return unless(node.is_boolean());
    case KeyType::choice:
      return unless(is_word_of(node, key.words));
    case KeyType::choices:
      return offender_in_choices(node, key);
    case KeyType::vector:
      return offender_in_vector(node, key.range);
    case KeyType::counts:
      return offender_in(node, 3, integer);
    case KeyType::indices:
      return offender_in(node, 0, integer);
    case KeyType::box:
      return offender_in_box(node, key.range);
    case KeyType::curve:
      return offender_in_curve(node, key);
    case KeyType::table:
      return unless(node.is_table());
    case KeyType::tables:
      break;
  }
  return offender_in(node, 0, [](const toml::node& x) { return x.is_table(); });
}

std::string shown_number(double value) {
  const std::string shown = fmt::format("{}", value);
  return shown.find_first_of(".en") == std::string::npos ? shown + ".0" : shown;
}

std::string shown(const toml::node& node) {
  if (const auto* text = node.as_string()) return in_quotes(text->get());
  if (const auto* integer = node.as_integer()) return fmt::format("{}", integer->get());
  if (const auto* number = node.as_floating_point()) return shown_number(number->get());
  if (const auto* boolean = node.as_boolean()) return boolean->get() ? "true" : "false";
  if (node.is_table()) return "a table";
  const toml::array* list = node.as_array();
  if (!list) return "a date or time";
  if (list->empty()) return "an empty list";
  const bool short_list = list->size() <= 4 && std::all_of(list->begin(), list->end(), [](auto& x) {
                            return x.is_number() || x.is_boolean();
                          });
  if (!short_list) return fmt::format("a list of {}", list->size());
  std::vector<std::string> elements;
  for (const toml::node& element : *list) elements.push_back(shown(element));
  return fmt::format("[{}]", fmt::join(elements, ", "));
}

/// " (did you mean ...)" for a word that is none of the key's.
std::string suggestion(const toml::node& node, const SceneKey& key) {
  if (key.words.empty() || !is_text(node) || is_word_of(node, key.words)) return "";
  return did_you_mean(text_of(node).substr(0, longest_shown), key.words);
}

std::string in_section(const std::string& section) {
  return section.empty() ? "at the top of the file" : "in " + scene_section(section).header;
}

/// The sections that do have a key of this name.
std::vector<std::string> homes_of(const std::string& name) {
  std::vector<std::string> homes;
  for (const SceneSection& section : scene_sections()) {
    if (section.path == "selection") continue;  // no section of a file
    for (const SceneKey* key : keys_of(section.path)) {
      if (key->name == name) homes.push_back(in_section(section.path));
    }
  }
  return homes;
}

}  // namespace

std::string in_quotes(std::string_view word) {
  std::string text = "\"";
  for (const char c : word.substr(0, longest_shown)) {
    const auto byte = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') text += '\\';
    if (byte < 0x20 || byte == 0x7f) {
      text += fmt::format("\\x{:02x}", byte);
    } else {
      text += c;
    }
  }
  if (word.size() > longest_shown) {
    while ((static_cast<unsigned char>(text.back()) & 0xc0) == 0x80) text.pop_back();
    if (static_cast<unsigned char>(text.back()) >= 0xc0) text.pop_back();  // a cut UTF-8 sequence
    text += "...";
  }
  return text + '"';
}

SceneTable::SceneTable(const toml::table& root, const std::filesystem::path& file)
    : table_(&root), file_(&file), position_{1, 1} {
  check();
}

SceneTable::SceneTable(const toml::table& table, const SceneTable& parent, std::string section,
                       std::string path)
    : table_(&table),
      file_(parent.file_),
      section_(std::move(section)),
      path_(std::move(path)),
      position_(parent.position_of(table)) {
  check();
}

SceneTable SceneTable::child(const toml::table& table, const char* name) const {
  // Selection keys live in several sections but are described once.
  const std::string below = std::string(name) == "ball" ? "selection" : section_;
  return {table, *this, below.empty() ? name : below + "." + name, path_of(name)};
}

bool SceneTable::is_number(const char* name) const {
  return has(name) && table_->get(name)->is_number();
}

SceneTable SceneTable::table(const char* name) const {
  return child(*table_->get_as<toml::table>(name), name);
}

std::vector<SceneTable> SceneTable::tables(const char* name) const {
  std::vector<SceneTable> result;
  if (!has(name)) return result;
  for (const toml::node& element : *table_->get_as<toml::array>(name)) {
    result.push_back(child(*element.as_table(), name));
  }
  return result;
}

void SceneTable::check_known() const {
  std::vector<std::string> allowed;
  for (const SceneKey* key : keys_of(section_)) allowed.push_back(key->name);
  for (const auto& [key, value] : *table_) {
    const std::string name(key.str());
    if (std::find(allowed.begin(), allowed.end(), name) != allowed.end()) continue;
    const std::vector<std::string> homes = homes_of(name);
    const std::string hint = homes.empty()
                                 ? did_you_mean(name.substr(0, longest_shown), allowed)
                                 : fmt::format(" here, but known {}", fmt::join(homes, " and "));
    const bool bare = name.size() <= longest_shown && !name.empty() &&
                      std::all_of(name.begin(), name.end(), [](unsigned char c) {
                        return std::isalnum(c) || c == '_' || c == '-';
                      });
    throw InputError(fmt::format("{}: key {}: unknown{}; allowed {}: {}", place(key.source().begin),
                                 path_of(bare ? name : in_quotes(name)), hint, in_section(section_),
                                 fmt::join(allowed, ", ")));
  }
}

void SceneTable::check() const {
  check_known();
  for (const SceneKey* key : keys_of(section_)) {
    const toml::node* node = table_->get(key->name);
    const toml::node* wrong = node ? offender(*node, *key) : nullptr;
    if (!wrong) continue;
    throw InputError(fmt::format("{}: key {}: {} found{}; allowed: {}", place(position_of(*wrong)),
                                 path_of(key->name), shown(*wrong), suggestion(*wrong, *key),
                                 allowed_words(*key)));
  }
  for (const SceneKey* key : keys_of(section_)) {
    if (key->required) expect(key->name.c_str());
  }
}

void SceneTable::expect(const char* name) const {
  if (has(name)) return;
  for (const SceneKey* key : keys_of(section_)) {
    if (key->name != name) continue;
    throw InputError(fmt::format("{}: key {}: missing; needed: {}", where(), path_of(key->name),
                                 allowed_words(*key)));
  }
}

std::size_t SceneTable::word_index(const char* name) const {
  const std::string word = text_of(*table_->get(name));
  for (const SceneKey* key : keys_of(section_)) {
    const auto found = std::find(key->words.begin(), key->words.end(), word);
    if (key->name == name) return static_cast<std::size_t>(found - key->words.begin());
  }
  throw std::logic_error(fmt::format("no key {} in [{}]", name, section_));
}

void SceneTable::read(const char* name, bool& value) const {
  if (has(name)) value = table_->get(name)->as_boolean()->get();
}

void SceneTable::read(const char* name, int& value) const {
  if (has(name)) value = static_cast<int>(table_->get(name)->as_integer()->get());
}

void SceneTable::read(const char* name, std::uint64_t& value) const {
  if (has(name)) value = static_cast<std::uint64_t>(table_->get(name)->as_integer()->get());
}

void SceneTable::read(const char* name, double& value) const {
  if (has(name)) value = as_number(*table_->get(name));
}

void SceneTable::read(const char* name, Vec3d& value) const {
  if (has(name)) value = as_vector(*table_->get(name));
}

void SceneTable::read(const char* name, std::string& value) const {
  if (has(name)) value = text_of(*table_->get(name));
}

void SceneTable::read(const char* name, std::filesystem::path& value) const {
  if (has(name)) value = (file_->parent_path() / text_of(*table_->get(name))).lexically_normal();
}

void SceneTable::read(const char* name, std::array<int, 3>& value) const {
  if (!has(name)) return;
  for (std::size_t k = 0; k < 3; ++k) {
    value[k] = static_cast<int>(table_->get(name)->as_array()->get(k)->as_integer()->get());
  }
}

void SceneTable::read(const char* name, std::vector<Index>& value) const {
  if (!has(name)) return;
  value.clear();
  for (const toml::node& element : *table_->get(name)->as_array()) {
    value.push_back(static_cast<Index>(element.as_integer()->get()));
  }
}

void SceneTable::read(const char* name, std::vector<std::string>& value) const {
  if (!has(name)) return;
  value.clear();
  for (const toml::node& element : *table_->get(name)->as_array()) {
    value.push_back(text_of(element));
  }
}

void SceneTable::read(const char* name, Selection::Box& value) const {
  if (!has(name)) return;
  const toml::array& corners = *table_->get(name)->as_array();
  value = {as_vector(*corners.get(0)), as_vector(*corners.get(1))};
}

void SceneTable::read(const char* name, std::vector<LoadCurve::Point>& value) const {
  if (has(name)) value = as_curve(*table_->get(name)->as_array());
}

void SceneTable::read(const char* name, ParameterValue::Curve& value) const {
  if (!has(name)) return;
  value.clear();
  for (const auto [x, y] : as_curve(*table_->get(name)->as_array())) value.push_back({x, y});
}

std::string SceneTable::where() const { return place(position_); }

std::string SceneTable::where(const char* name) const {
  return has(name) ? place(position_of(*table_->get(name))) : where();
}

void SceneTable::refuse(const char* name, const std::string& problem) const {
  throw InputError(fmt::format("{}: key {}: {}", where(name), path_of(name), problem));
}

void SceneTable::expect_one_of(const std::vector<const char*>& names) const {
  const char* first = nullptr;
  for (const char* name : names) {
    if (!has(name)) continue;
    if (first) {
      refuse(name, fmt::format("found together with {}; allowed: exactly one of: {}", first,
                               fmt::join(names, ", ")));
    }
    first = name;
  }
  if (!first) {
    throw InputError(fmt::format("{}: {}: a key is missing; needed: exactly one of: {}", where(),
                                 path_, fmt::join(names, ", ")));
  }
}

void SceneTable::expect_together(const char* a, const char* b) const {
  if (has(a) && !has(b)) refuse(a, fmt::format("found without {}; allowed: both or neither", b));
  if (has(b) && !has(a)) refuse(b, fmt::format("found without {}; allowed: both or neither", a));
}

void SceneTable::expect_apart(const char* a, const char* b) const {
  if (has(a) && has(b)) refuse(a, fmt::format("found together with {}; allowed: only one", b));
}

std::string SceneTable::path_of(const std::string& name) const {
  return path_.empty() ? name : path_ + "." + name;
}

std::string SceneTable::place(const toml::source_position& position) const {
  return fmt::format("{}:{}:{}", file_->empty() ? "scene" : file_->string(), position.line,
                     position.column);
}

toml::source_position SceneTable::position_of(const toml::node& node) const {
  return node.source().begin ? node.source().begin : position_;  // implied tables have none
}

}  // namespace phyxel
