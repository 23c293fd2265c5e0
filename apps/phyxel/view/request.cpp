#include "view/request.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "outside_text.hpp"
#include "phyxel/error.hpp"

namespace phyxel::app {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::array<std::pair<const char*, RequestKind>, 11> kinds{{
    {"grab", RequestKind::grab},
    {"move", RequestKind::move},
    {"drop", RequestKind::drop},
    {"set", RequestKind::set},
    {"reset", RequestKind::reset},
    {"save", RequestKind::save},
    {"play", RequestKind::play},
    {"pause", RequestKind::pause},
    {"step", RequestKind::step},
    {"pace", RequestKind::pace},
    {"show", RequestKind::show},
}};

/// A value as messages quote it.
std::string quoted(const Json& value) {
  std::string text = json_text(value, -1);
  constexpr std::size_t most = 80;
  if (text.size() > most) text = text.substr(0, most) + "...";
  return text;
}

/// The keys of a request, each of which is read once.
class Keys {
 public:
  explicit Keys(const Json& object) : object_(object) {}

  const Json* find(const char* key) {
    const auto found = object_.find(key);
    if (found == object_.end()) return nullptr;
    ++read_;
    return &*found;
  }
  const Json& at(const char* key) {
    if (const Json* found = find(key)) return *found;
    throw InputError(fmt::format("request {}: key \"{}\" is missing", quoted(object_), key));
  }
  double number(const Json& value, const char* key, double least, double most) const {
    const double number = value.is_number() ? value.get<double>() : NAN;
    if (number >= least && number <= most) return number;
    throw InputError(
        fmt::format("request: {} = {}: out of range: allowed a number from {:g} to {:g}", key,
                    quoted(value), least, most));
  }
  double number(const char* key, double least, double most) {
    return number(at(key), key, least, most);
  }
  double count(const char* key, double most) {
    const double number = this->number(key, 0, most);
    if (number == std::floor(number)) return number;
    throw InputError(fmt::format("request: {} = {:g}: allowed a whole number", key, number));
  }
  Vec3d vector(const Json& value, const char* key, double most) const {
    if (!value.is_array() || value.size() != 3) {
      throw InputError(fmt::format("request: {} = {}: allowed three numbers", key, quoted(value)));
    }
    const auto part = [&](std::size_t axis) { return number(value[axis], key, -most, most); };
    return {part(0), part(1), part(2)};
  }
  void finish() const {
    if (read_ == object_.size()) return;
    throw InputError(
        fmt::format("request {}: it has a key that this kind does not know", quoted(object_)));
  }

 private:
  const Json& object_;
  std::size_t read_ = 0;
};

/// Largest size of a request: deeper nesting would exhaust the stack.
constexpr std::size_t most_bytes = 4096;
/// The largest length [m] and acceleration [m/s²] of requests.
constexpr double most_metres = 1e9, most_gravity = 1e5;

Settings settings_of(Keys& keys) {
  Settings settings;
  if (const Json* value = keys.find("gravity")) {
    settings.gravity = keys.vector(*value, "gravity", most_gravity);
  }
  const auto number = [&](const char* key, double least, double most) -> std::optional<double> {
    const Json* value = keys.find(key);
    if (!value) return std::nullopt;
    return keys.number(*value, key, least, most);
  };
  settings.stiffness = number("stiffness", 1e-3, 1e3);
  settings.damping = number("damping", 0, 1e6);
  settings.friction = number("friction", 0, 100);
  return settings;
}

RequestKind kind_of(const Json& object) {
  std::string allowed;
  for (const auto& [name, kind] : kinds) {
    if (object.is_object() && object.contains("do") && object["do"] == name) return kind;
    allowed += fmt::format("{}{}", allowed.empty() ? "" : ", ", name);
  }
  throw InputError(fmt::format("request {}: allowed an object whose \"do\" is one of {}",
                               quoted(object), allowed));
}

Json numbers(Vec3d v) { return Json{v.x, v.y, v.z}; }

}  // namespace

void Settings::take(const Settings& later) {
  if (later.gravity) gravity = later.gravity;
  if (later.stiffness) stiffness = later.stiffness;
  if (later.damping) damping = later.damping;
  if (later.friction) friction = later.friction;
}

bool is_act(RequestKind kind) { return kind <= RequestKind::save; }

Request parse_request(std::string_view text) {
  if (text.size() > most_bytes) {
    throw InputError(fmt::format("request: {} bytes; allowed: up to {}", text.size(), most_bytes));
  }
  const Json object = Json::parse(text, nullptr, false);
  Request request;
  request.kind = kind_of(object);
  Keys keys(object);
  keys.at("do");
  switch (request.kind) {
    case RequestKind::grab:
      request.phyxel = static_cast<Index>(keys.count("phyxel", 2147483646));
      break;
    case RequestKind::move:
      request.by = keys.vector(keys.at("by"), "by", most_metres);
      break;
    case RequestKind::set:
      request.settings = settings_of(keys);
      break;
    case RequestKind::step:
      request.number = keys.count("count", 1e6);
      break;
    case RequestKind::pace:
      request.number = keys.number("factor", 1e-6, 1e3);
      break;
    case RequestKind::show: {
      const Json& name = keys.at("field");
      if (!name.is_string()) {
        throw InputError(fmt::format("request: field = {}: allowed a name", quoted(name)));
      }
      request.field = name.get<std::string>();
      break;
    }
    default:
      break;
  }
  keys.finish();
  return request;
}

Json json_of(const Request& request) {
  Json object;
  for (const auto& [name, kind] : kinds) {
    if (kind == request.kind) object["do"] = name;
  }
  const Settings& settings = request.settings;
  switch (request.kind) {
    case RequestKind::grab:
      object["phyxel"] = request.phyxel;
      break;
    case RequestKind::move:
      object["by"] = numbers(request.by);
      break;
    case RequestKind::set:
      if (settings.gravity) object["gravity"] = numbers(*settings.gravity);
      if (settings.stiffness) object["stiffness"] = *settings.stiffness;
      if (settings.damping) object["damping"] = *settings.damping;
      if (settings.friction) object["friction"] = *settings.friction;
      break;
    case RequestKind::step:
      object["count"] = request.number;
      break;
    case RequestKind::pace:
      object["factor"] = request.number;
      break;
    case RequestKind::show:
      object["field"] = request.field;
      break;
    default:
      break;
  }
  return object;
}

}  // namespace phyxel::app
