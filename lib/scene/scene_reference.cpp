#include <fmt/format.h>

#include "phyxel/scene.hpp"
#include "scene/scene_schema.hpp"

namespace phyxel {
namespace {

std::string default_of(const SceneKey& key) {
  if (key.required) return "**required**";
  return key.fallback.empty() ? key.otherwise : "`" + key.fallback + "`";
}

std::string heading_of(const SceneSection& section) {
  const bool literal = section.header.find_first_of("[{") != std::string::npos;
  return literal ? "`" + section.header + "`" : section.header;
}

}  // namespace

std::string scene_reference() {
  std::string text;
  for (const SceneSection& section : scene_sections()) {
    text += fmt::format("### {}\n\n{}\n\n", heading_of(section), section.meaning);
    std::string rows;
    for (const SceneKey* key : keys_of(section.path)) {
      if (key->section != section.path) continue;  // its base has a section of its own
      rows += fmt::format("| `{}` | {} | {} | {} |\n", key->name, allowed_words(*key),
                          default_of(*key), key->meaning);
    }
    if (rows.empty()) continue;
    text += "| key | value [unit] | default | meaning |\n|---|---|---|---|\n" + rows + "\n";
  }
  text.pop_back();  // one newline at the end
  return text;
}

}  // namespace phyxel
