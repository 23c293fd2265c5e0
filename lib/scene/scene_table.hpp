/// One table of a scene file: checked against the table of keys, then read by key.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "phyxel/scene.hpp"
#include "phyxel/types.hpp"
#include "scene/scene_schema.hpp"
#include "scene/scene_toml.hpp"

namespace phyxel {

class SceneTable {
 public:
  /// The whole file. Every key of a table is checked when the table is made: known, of the right
  /// type, in range, and none missing. What no table of keys can say is left to the reader.
  /// @throws InputError
  SceneTable(const toml::table& root, const std::filesystem::path& file);

  bool has(const char* name) const { return table_->contains(name); }
  bool is_number(const char* name) const;
  SceneTable table(const char* name) const;
  std::vector<SceneTable> tables(const char* name) const;

  /// Each of these leaves `value` as it is when the key is absent.
  void read(const char* name, bool& value) const;
  void read(const char* name, int& value) const;
  void read(const char* name, std::uint64_t& value) const;
  void read(const char* name, double& value) const;
  void read(const char* name, Vec3d& value) const;
  void read(const char* name, std::string& value) const;
  void read(const char* name, std::filesystem::path& value) const;
  void read(const char* name, std::array<int, 3>& value) const;
  void read(const char* name, std::vector<Index>& value) const;
  void read(const char* name, std::vector<std::string>& value) const;
  void read(const char* name, Selection::Box& value) const;
  void read(const char* name, std::vector<LoadCurve::Point>& value) const;
  void read(const char* name, ParameterValue::Curve& value) const;
  template <class T>
  void read(const char* name, std::optional<T>& value) const {
    if (has(name)) read(name, value.emplace());
  }
  /// The words of a choice are in the order of its enumeration.
  template <class Enum>
  void read_choice(const char* name, Enum& value) const {
    if (has(name)) value = static_cast<Enum>(word_index(name));
  }

  /// "scene.toml:12:3": where the table begins, or the value of one of its keys.
  std::string where() const;
  std::string where(const char* name) const;

  /// "body.motion": what the table is called in messages.
  const std::string& path() const { return path_; }

  /// Throws an InputError: "scene.toml:12:3: key body.material.young: <problem>".
  [[noreturn]] void refuse(const char* name, const std::string& problem) const;
  /// Throws unless exactly one of `names` is there.
  void expect_one_of(const std::vector<const char*>& names) const;
  /// Throws an InputError unless the key is there.
  void expect(const char* name) const;
  /// Throws if only one of the two is there.
  void expect_together(const char* a, const char* b) const;
  /// Throws if both are there.
  void expect_apart(const char* a, const char* b) const;

 private:
  SceneTable(const toml::table& table, const SceneTable& parent, std::string section,
             std::string path);
  void check() const;
  void check_known() const;
  std::size_t word_index(const char* name) const;
  SceneTable child(const toml::table& table, const char* name) const;
  std::string path_of(const std::string& name) const;
  std::string place(const toml::source_position& position) const;
  toml::source_position position_of(const toml::node& node) const;

  const toml::table* table_;
  const std::filesystem::path* file_;
  std::string section_;  // in the table of keys: "selection.ball"
  std::string path_;     // in the file: "body.fixed.ball"
  toml::source_position position_;
};

/// A word from the file as messages show it: quoted, escaped, shortened.
std::string in_quotes(std::string_view word);

}  // namespace phyxel
