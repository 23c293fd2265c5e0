/// Valid scenes with one more entry.
#pragma once

#include "scene/scene_schema.hpp"
#include "support/scene_text.hpp"

namespace phyxel {

/// A scene whose last lines are `lines`, the first of them on line 12.
inline std::string after_beam(const std::string& lines) {
  return time_section + "\n" + beam + material + lines;  // 2 + 1 + 4 + 4 lines
}

/// A scene that sets `key` to `text` and is valid up to that line.
inline std::string scene_with(const SceneKey& key, const std::string& text) {
  const std::string line = key.name + " = " + text + "\n";
  const std::string& section = key.section;
  if (section.empty()) return line + (key.name == "body" ? "" : dino);
  if (section == "time") return "[time]\n" + line + dino;
  if (section == "body") return time_section + "[[body]]\n" + line;
  if (section == "selection") return after_beam("[[body.fixed]]\n" + line);
  if (section == "selection.ball") return after_beam("[[body.fixed]]\n[body.fixed.ball]\n" + line);
  std::string header = scene_section(section).header;
  if (section == "obstacle.motion") header = "[[obstacle]]\nshape = 'plane'\n" + header;
  return time_section + "[[body]]\nshape = 'dino'\n" +
         (section == "body.material" ? "" : material) + header + "\n" + line;
}

/// The key as messages name it.
inline std::string path_in_file(const SceneKey& key) {
  std::string section = key.section;
  if (section.starts_with("selection")) section.replace(0, 9, "body.fixed");
  return section.empty() ? key.name : section + "." + key.name;
}

}  // namespace phyxel
