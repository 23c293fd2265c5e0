/// The one table of everything a scene file may say. Checks, messages and docs/scenes.md all come
/// from it.
#pragma once

#include <cstddef>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "phyxel/load_curve.hpp"

namespace phyxel {

/// What a key's value looks like in TOML.
enum class KeyType {
  text,
  path,  ///< Text, resolved from the scene file's folder.
  integer,
  number,          ///< An integer or a float; never NaN or infinite.
  number_or_word,  ///< A number or one of `words`, which mean the same.
  boolean,
  choice,   ///< One of `words`.
  choices,  ///< A list of `words`, each at most once.
  vector,   ///< [x, y, z]
  counts,   ///< [x, y, z], integers.
  indices,  ///< A list of integers, at least one.
  box,      ///< [[x, y, z], [x, y, z]]
  curve,    ///< [[x, y], ...], of which `curve` says more; `range` is that of y.
  table,
  tables,  ///< [[...]], one or more.
};

/// Allowed values of a number, of each element of a vector or of each index.
struct Range {
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
  bool open = false;  ///< Whether `low` and `high` themselves are excluded.
  bool contains(double value) const;
  /// "-1 < poisson < 0.5"; "" if anything goes.
  std::string in_words(const std::string& name) const;
};

/// The form of a key that is a curve [[x, y], ...]; by default a factor by time.
struct CurveForm {
  std::string x = "t", y = "f";  ///< Their names in messages.
  std::string x_words{};         ///< How x go, where their range is not all: "x ascends from 0".
  Range x_range{0, 1e9, false};
  bool from_zero = false;  ///< True if the first x has to be 0.
  std::size_t most_points = LoadCurve::most_points;
};

struct SceneKey {
  std::string section{};  ///< "body.material"; "" at the top of the file.
  std::string name{};     ///< "young"
  KeyType type = KeyType::number;
  std::string unit{};  ///< "Pa"; "" if it has none.
  bool required = false;
  std::string fallback{};   ///< Default as TOML; "" if there is no such literal.
  std::string otherwise{};  ///< What happens without the key, where `fallback` cannot say.
  Range range{};
  std::vector<std::string>
      words{};  ///< Of a choice; in the order of the enumeration, if there is one.
  std::string meaning{};
  CurveForm curve{};
};

struct SceneSection {
  std::string path;    ///< "body.material"
  std::string header;  ///< How the section begins in a file: "[body.material]".
  std::string base;    ///< Section whose keys it has too; "" if none.
  std::string meaning;
};

/// Returns the number of the first point of a curve that may not stand there: x ascend strictly
/// within the range of the key's curve, y lie in that of the key. Unset if all may.
std::optional<std::size_t> wrong_point(std::span<const LoadCurve::Point> points,
                                       const SceneKey& key);

/// All sections and all keys, in the order of the documentation.
std::span<const SceneSection> scene_sections();
std::span<const SceneKey> scene_keys();

const SceneSection& scene_section(const std::string& path);
/// The keys a section may have, those of its base last.
std::vector<const SceneKey*> keys_of(const std::string& section);

/// What is allowed, for messages and the documentation: "a number, young > 0 [Pa]".
std::string allowed_words(const SceneKey& key);

}  // namespace phyxel
