#include "scene/scene_error.hpp"

#include <fmt/format.h>

namespace phyxel {
namespace {

/// "scene.toml" of "scene.toml:7:1".
std::string file_of(const std::string& place) {
  return place.substr(0, place.rfind(':', place.rfind(':') - 1));
}

}  // namespace

std::string named(const Scene& scene, const std::string& message) {
  const std::string name = !scene.file.empty()   ? scene.file.string()
                           : !scene.text.empty() ? "scene"
                                                 : "";
  if (name.empty() || message.starts_with(name + ":")) return message;
  return fmt::format("{}: {}", name, message);
}

std::string named(const BodyRequest& body, const std::string& message) {
  // A selection made in code says no place of its own.
  if (message.starts_with(": ")) return named(body, message.substr(2));
  if (body.where.empty() || message.starts_with(file_of(body.where) + ":")) return message;
  const std::string name = fmt::format("body \"{}\"", body.name);
  if (message.starts_with(name)) return fmt::format("{}: {}", body.where, message);
  return fmt::format("{}: {}: {}", body.where, name, message);
}

}  // namespace phyxel
