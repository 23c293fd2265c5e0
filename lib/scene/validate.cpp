/// One check of scenes, read from files or made in code, against the table of keys.
#include <fmt/format.h>

#include <map>
#include <string>
#include <type_traits>

#include "phyxel/error.hpp"
#include "phyxel/law_table.hpp"
#include "scene/scene_contact.hpp"
#include "scene/scene_fracture.hpp"
#include "scene/scene_obstacles.hpp"
#include "scene/scene_parameters.hpp"
#include "scene/scene_schema.hpp"

namespace phyxel {
namespace {

/// The key of a name, or null: a parameter that no law has.
const SceneKey* key_of(std::string_view section, std::string_view name) {
  using Table = std::map<std::pair<std::string_view, std::string_view>, const SceneKey*>;
  static const Table table = [] {
    Table all;
    for (const SceneKey& key : scene_keys()) all[{key.section, key.name}] = &key;
    return all;
  }();
  const auto at = table.find({section, name});
  return at == table.end() ? nullptr : at->second;
}

/// Checks that a material's law exists and has the parameters that are given.
void check_law(const BodyRequest& body, const Material& material, const std::string& where) {
  if (material.custom_law) return;
  Material complete = material;
  complete.law = law_of(body, material);
  try {
    chosen_law(complete);
  } catch (const InputError& error) {
    throw InputError(fmt::format("{}{}material of body \"{}\": {}", where,
                                 where.empty() ? "" : ": ", body.name, error.what()));
  }
}

/// "scene.toml:7:1: key body.material.young of body "beam""
std::string place_of(const ParameterOwner& owner, const SceneKey& key) {
  const std::string path = key.section.empty() ? key.name : key.section + "." + key.name;
  const std::string where =
      owner.where && !owner.where->empty() ? *owner.where + ": " : std::string();
  if (owner.body) return fmt::format("{}key {} of body \"{}\"", where, path, owner.body->name);
  return owner.entry > 0 ? fmt::format("{}key {} of {} {}", where, path, owner.list, owner.entry)
                         : fmt::format("{}key {}", where, path);
}

void check_number(const ParameterOwner& owner, const SceneKey* key, double value) {
  if (!key || key->range.contains(value)) return;
  throw InputError(
      fmt::format("{}: {} found; allowed: {}", place_of(owner, *key), value, allowed_words(*key)));
}

void check_curve(const ParameterOwner& owner, const SceneKey& key,
                 const std::vector<LoadCurve::Point>& points) {
  const std::string allowed = allowed_words(key);
  if (points.size() > LoadCurve::most_points) {
    throw InputError(fmt::format("{}: {} points found; allowed: {}", place_of(owner, key),
                                 points.size(), allowed));
  }
  const auto wrong = wrong_point(points, key);
  if (!wrong) return;
  const auto [time, factor] = points[*wrong];
  throw InputError(fmt::format("{}: point {} is [{}, {}]; allowed: {}", place_of(owner, key),
                               *wrong + 1, time, factor, allowed));
}

/// Checks that a load has one way to change with time, and that no gas has a negative pressure.
void check_growth(const BodyRequest& body, const std::string& section, const Selection& select,
                  double ramp, const std::vector<LoadCurve::Point>& curve, bool is_gas) {
  const auto refuse = [&](const std::string& problem) {
    const std::string& where = select.where.empty() ? body.where : select.where;
    throw InputError(fmt::format("{}{}key {}.curve of body \"{}\": {}", where,
                                 where.empty() ? "" : ": ", section, body.name, problem));
  };
  if (ramp > 0 && !curve.empty()) refuse("found together with ramp; allowed: only one");
  for (const auto [time, factor] : curve) {
    if (is_gas && factor < 0) {
      refuse(fmt::format("a factor of {:g} found at {:g} s; allowed with gas: none below 0", factor,
                         time));
    }
  }
}

void check_one_choice(const BodyRequest& body, const Selection& select) {
  const int set =
      static_cast<int>(select.region.has_value()) + static_cast<int>(select.indices.has_value()) +
      static_cast<int>(select.box.has_value()) + static_cast<int>(select.ball.has_value()) +
      static_cast<int>(!select.mesh.empty()) + static_cast<int>(select.all);
  if (set == 1) return;
  throw InputError(fmt::format(
      "{}: a selection of body \"{}\" has {} of region, indices, box, ball, mesh and all; allowed: "
      "exactly one",
      select.where.empty() ? body.where : select.where, body.name, set));
}

}  // namespace

void validate(const Scene& scene) {
  if (scene.bodies.empty()) {
    throw InputError("the scene has no bodies; needed: at least one");
  }
  for_each_parameter(scene, [](const ParameterOwner& owner, const char* section, const char* name,
                               const auto& value) {
    using Value = std::decay_t<decltype(value)>;
    if constexpr (std::is_same_v<Value, Vec3d>) {
      for (const double x : {value.x, value.y, value.z}) {
        check_number(owner, key_of(section, name), x);
      }
    } else if constexpr (std::is_same_v<Value, std::vector<LoadCurve::Point>>) {
      check_curve(owner, *key_of(section, name), value);
    } else if constexpr (std::is_arithmetic_v<Value> && !std::is_same_v<Value, bool>) {
      check_number(owner, key_of(section, name), static_cast<double>(value));
    }
  });
  for (const ObstacleRequest& obstacle : scene.obstacles) check_obstacle(obstacle);
  if (scene.contact) check_contact(*scene.contact, scene.bodies);
  check_penalties(scene);
  check_fracture_request(scene);
  for (const BodyRequest& body : scene.bodies) {
    check_law(body, body.material, body.where);
    for (const InclusionRequest& inclusion : body.inclusions) {
      check_law(body, inclusion.material, inclusion.select.where);
    }
    detail::visit_lists(body, [&](std::size_t, const char*, const Selection& select, auto&&) {
      check_one_choice(body, select);
    });
    for (const LoadRequest& load : body.loads) {
      check_growth(body, "body.load", load.select, load.ramp, load.curve, false);
    }
    for (const TractionRequest& t : body.tractions) {
      check_growth(body, "body.traction", t.select, t.ramp, t.curve, t.gas.has_value());
    }
    for (const ProbeRequest& probe : body.probes) {
      if (probe.select) check_one_choice(body, *probe.select);
      if (probe.select.has_value() != probe.points.empty()) {
        throw InputError(fmt::format(
            "{}{}probe \"{}\" of body \"{}\" has {} points and {} selection; allowed: either",
            probe.where, probe.where.empty() ? "" : ": ", probe.name, body.name,
            probe.points.size(), probe.select ? "a" : "no"));
      }
    }
  }
}

}  // namespace phyxel
