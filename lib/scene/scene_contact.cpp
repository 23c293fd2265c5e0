#include "scene/scene_contact.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>
#include <utility>

#include "phyxel/error.hpp"
#include "scene/key_parts.hpp"

namespace phyxel {
namespace {

[[noreturn]] void refuse(const std::string& where, const char* key, const std::string& problem) {
  throw InputError(fmt::format("{}{}key {}: {}", where, where.empty() ? "" : ": ", key, problem));
}

void check_friction(const std::string& where, const char* key, double friction,
                    std::optional<double> kinetic) {
  if (!kinetic || *kinetic <= friction) return;
  refuse(where, key,
         fmt::format("{:g} found, above a friction of {:g}; allowed: at most that of a "
                     "point that sticks",
                     *kinetic, friction));
}

void check_name(const ContactPairRequest& pair, const char* key, const std::string& name,
                const std::vector<BodyRequest>& bodies) {
  const bool is_known = std::any_of(bodies.begin(), bodies.end(),
                                    [&](const BodyRequest& body) { return body.name == name; });
  if (is_known) return;
  constexpr std::size_t most = 10;
  std::vector<std::string> names;
  for (std::size_t b = 0; b < std::min(bodies.size(), most); ++b) {
    names.push_back(in_quotes(bodies[b].name));
  }
  refuse(pair.where, key,
         fmt::format("{} found, but no body has that name; allowed: {}{}", in_quotes(name),
                     fmt::join(names, ", "), bodies.size() > most ? ", ..." : ""));
}

/// The problem of a restitution above 0 beside penalties.
std::string refused_restitution(double restitution) {
  return fmt::format(
      "{:g} found with method = \"penalty\", whose springs give back all that they take; allowed: "
      "0, or method = \"projected\"",
      restitution);
}

}  // namespace

ContactRequest read_contact(const SceneTable& table, const std::vector<BodyRequest>& bodies) {
  ContactRequest contact{.where = table.where()};
  table.read("friction", contact.friction);
  table.read("kinetic_friction", contact.kinetic_friction);
  table.read("restitution", contact.restitution);
  table.read("self", contact.self);
  table.read("sweeps", contact.sweeps);
  table.read_choice("method", contact.method);
  table.read("stiffness", contact.stiffness);
  table.read("all", contact.all);
  if (table.has("pair")) {
    for (const SceneTable& of_pair : table.tables("pair")) {
      ContactPairRequest& pair = contact.pairs.emplace_back();
      pair.where = of_pair.where();
      of_pair.read("first", pair.first);
      of_pair.read("second", pair.second);
      of_pair.read("friction", pair.friction);
      of_pair.read("kinetic_friction", pair.kinetic_friction);
      of_pair.read("restitution", pair.restitution);
    }
  }
  check_contact(contact, bodies);
  return contact;
}

void check_contact(const ContactRequest& contact, const std::vector<BodyRequest>& bodies) {
  const bool is_penalty = contact.method == ContactMethod::penalty;
  if (is_penalty && contact.restitution > 0) {
    refuse(contact.where, "contact.restitution", refused_restitution(contact.restitution));
  }
  check_friction(contact.where, "contact.kinetic_friction", contact.friction,
                 contact.kinetic_friction);
  if (contact.all == false && contact.pairs.empty() && !contact.self) {
    refuse(
        contact.where, "contact.all",
        "false found without pairs, so that nothing touches; allowed: [[contact.pair]] beside it, "
        "self = true, or true");
  }
  std::map<std::pair<std::string, std::string>, std::string> places;
  for (const ContactPairRequest& pair : contact.pairs) {
    check_name(pair, "contact.pair.first", pair.first, bodies);
    check_name(pair, "contact.pair.second", pair.second, bodies);
    if (pair.first == pair.second) {
      refuse(
          pair.where, "contact.pair.second",
          fmt::format("{} found, the first body, too; allowed: two bodies; contact.self lets parts "
                      "of one body touch",
                      in_quotes(pair.second)));
    }
    check_friction(pair.where, "contact.pair.kinetic_friction",
                   pair.friction.value_or(contact.friction), pair.kinetic_friction);
    if (is_penalty && pair.restitution.value_or(0) > 0) {
      refuse(pair.where, "contact.pair.restitution", refused_restitution(*pair.restitution));
    }
    const auto [earlier, is_new] = places.emplace(std::minmax(pair.first, pair.second), pair.where);
    if (!is_new) {
      refuse(pair.where, "contact.pair",
             fmt::format("{} and {} found, a pair already{}{}; allowed: each pair once",
                         in_quotes(pair.first), in_quotes(pair.second),
                         earlier->second.empty() ? "" : " at ", earlier->second));
    }
  }
}

void check_penalties(const Scene& scene) {
  const ContactMethod shared = scene.contact ? scene.contact->method : ContactMethod::projected;
  for (const ObstacleRequest& obstacle : scene.obstacles) {
    const bool is_penalty = obstacle.method.value_or(shared) == ContactMethod::penalty;
    if (!is_penalty || !(obstacle.restitution > 0)) continue;
    refuse(obstacle.where, "obstacle.restitution",
           fmt::format("of obstacle \"{}\": {}", obstacle.name,
                       refused_restitution(obstacle.restitution)));
  }
}

}  // namespace phyxel
