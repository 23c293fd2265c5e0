#include "scene/scene_body.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "phyxel/error.hpp"
#include "phyxel/law_table.hpp"
#include "phyxel/shapes.hpp"
#include "scene/scene_error.hpp"
#include "scene/scene_fracture.hpp"
#include "scene/scene_source.hpp"

namespace phyxel {
namespace {

/// Reads the law and its parameters. A parameter that is not said is that of `material`, which has
/// the body's where the table is an inclusion's; `inherits` says whether it is.
void read_law(const SceneTable& table, Material& material, bool inherits) {
  const std::string of_body = material.law;
  table.read("law", material.law);
  std::map<std::string, ParameterValue> parameters;
  for (const LawEntry& entry : law_table()) {
    const bool is_it = material.law == entry.name;
    for (const LawParameter& parameter : entry.parameters) {
      const std::string name = parameter.name;
      if (name == material_density.name) continue;  // that of the material
      if (!is_it) {
        if (!table.has(parameter.name) || has_parameter(material.law, name)) continue;
        table.refuse(parameter.name,
                     fmt::format("found, which law \"{}\" does not have; allowed with law = {}",
                                 material.law, laws_with(name)));
      }
      const bool has_bodys = inherits && has_parameter(of_body, name);
      if (parameter.required() && !has_bodys) table.expect(parameter.name);
      if (name == young_modulus.name) {
        table.read(parameter.name, material.young);
      } else if (name == poisson_ratio.name) {
        table.read(parameter.name, material.poisson);
      } else {
        const auto bodys = material.parameters.find(name);
        if (bodys != material.parameters.end()) parameters.insert(*bodys);
        if (!table.has(parameter.name)) continue;
        if (parameter.is_curve()) {
          ParameterValue::Curve curve;
          table.read(parameter.name, curve);
          parameters[name] = curve;
        } else if (parameter.count == 3) {
          Vec3d vector;
          table.read(parameter.name, vector);
          parameters[name] = vector;
        } else {
          double number = 0;
          table.read(parameter.name, number);
          parameters[name] = number;
        }
      }
    }
  }
  material.parameters = std::move(parameters);
}

Material read_material(const SceneTable& table, const BodyRequest& body) {
  Material material;
  material.law = default_law(body);
  read_law(table, material, false);
  table.read("density", material.density);
  table.read("volume_stiffness", material.volume_stiffness);
  table.read("damping", material.damping);
  table.read("viscosity", material.viscosity);
  table.read("hourglass", material.hourglass);
  return material;
}

NeighbourhoodRule read_neighbours(const SceneTable& table) {
  NeighbourhoodRule rule;
  table.expect_apart("factor", "radius");
  table.expect_apart("support", "radius");
  table.read_choice("support", rule.support);
  table.read("nearest", rule.nearest);
  table.read("factor", rule.factor);
  table.read("radius", rule.radius);
  table.read("max_neighbours", rule.max_neighbours);
  if (rule.max_neighbours && rule.support == NeighbourhoodRule::Support::pairwise) {
    table.refuse("support",
                 "\"pairwise\" found together with max_neighbours, which makes lists one-sided; "
                 "allowed: only one");
  }
  return rule;
}

Selection::Ball read_ball(const SceneTable& table) {
  Selection::Ball ball;
  table.read("centre", ball.centre);
  table.read("radius", ball.radius);
  return ball;
}

InclusionRequest read_inclusion(const SceneTable& table, Material material) {
  const Selection select = read_selection(table);
  read_law(table, material, true);
  table.read("density", material.density);
  table.read("volume_stiffness", material.volume_stiffness);
  table.read("damping", material.damping);
  table.read("viscosity", material.viscosity);
  return {select, material};
}

Axes read_axes(const SceneTable& table) {
  std::string axes = "xyz";
  table.read("axes", axes);
  const auto has = [&](char axis) { return axes.find(axis) != std::string::npos; };
  return {has('x'), has('y'), has('z')};
}

MotionRequest read_motion(const SceneTable& table) {
  MotionRequest motion;
  motion.select = read_selection(table);
  motion.axes = read_axes(table);
  read_path(table, motion);
  return motion;
}

/// Reads how a load or traction changes with time.
template <class Request>
void read_growth(const SceneTable& table, Request& request) {
  table.expect_apart("curve", "ramp");
  table.read("ramp", request.ramp);
  table.read("curve", request.curve);
}

LoadRequest read_load(const SceneTable& table) {
  LoadRequest load;
  load.select = read_selection(table);
  table.expect_one_of({"force", "force_density"});
  table.read("force", load.force);
  table.read("force_density", load.force_density);
  read_growth(table, load);
  return load;
}

TractionRequest read_traction(const SceneTable& table) {
  TractionRequest traction;
  table.expect_one_of({"region", "box", "ball", "all"});
  traction.select = read_selection(table);
  table.expect_one_of({"traction", "pressure"});
  table.read("traction", traction.traction);
  table.read("pressure", traction.pressure);
  for (const char* key : {"follower", "gas"}) {
    if (table.has(key)) table.expect_together(key, "pressure");
  }
  table.read("follower", traction.follower);
  if (table.has("gas")) {
    if (table.has("follower") && !traction.follower) {
      table.refuse("gas",
                   "found with follower = false; allowed: true, as the pressure of a gas follows "
                   "the surface");
    }
    if (!(traction.pressure > 0)) {
      table.refuse("gas", fmt::format("found with pressure = {:g}; allowed: a pressure > 0",
                                      traction.pressure));
    }
    traction.follower = true;
    table.read("gas", traction.gas.emplace());
  }
  if (table.has("angle")) table.expect_together("angle", "normal");
  table.read("normal", traction.normal);
  if (table.has("normal") && traction.normal == Vec3d{}) {
    table.refuse("normal", "[0, 0, 0] found; allowed: a direction");
  }
  table.read("angle", traction.angle);
  read_growth(table, traction);
  return traction;
}

BodyRequest read_body_request(const SceneTable& table) {
  BodyRequest body;
  body.where = table.where();
  // Before the source, which may not be one that can be graded.
  std::optional<Grading> grading;
  if (table.has("grading")) {
    grading = read_grading(table.table("grading"));
    body.finer = read_finer(table.table("grading"), grading->ratio);
  }
  body.source = read_source(table);
  body.source.grading = grading;
  body.name = name_of_source(body.source);
  table.read("name", body.name);
  table.read("scale", body.scale);
  table.read("rotation", body.rotation);
  table.read("translation", body.translation);
  table.read("velocity", body.velocity);
  table.read("spin", body.spin);
  table.read_choice("volumes", body.volume_rule);
  if (table.is_number("closure")) table.read("closure", body.closure);
  if (table.has("neighbours")) body.neighbourhood = read_neighbours(table.table("neighbours"));
  body.material = read_material(table.table("material"), body);
  if (!body.material.hourglass) body.material.hourglass = default_hourglass(body);
  for (const SceneTable& inclusion : table.tables("inclusion")) {
    body.inclusions.push_back(read_inclusion(inclusion, body.material));
  }
  for (const SceneTable& fixed : table.tables("fixed")) {
    body.fixed.push_back({read_selection(fixed), read_axes(fixed)});
  }
  for (const SceneTable& symmetry : table.tables("symmetry")) {
    SymmetryRequest& plane = body.symmetries.emplace_back();
    symmetry.read_choice("normal", plane.normal);
    symmetry.read("at", plane.at);
    plane.where = symmetry.where("at");
  }
  for (const SceneTable& motion : table.tables("motion")) {
    body.motions.push_back(read_motion(motion));
  }
  naming(body, [&] { choose_placement(table, body); });
  if (table.has("fracture")) body.fracture = read_fracture(table.table("fracture"));
  for (const SceneTable& notch : table.tables("notch")) body.notches.push_back(read_notch(notch));
  for (const SceneTable& load : table.tables("load")) body.loads.push_back(read_load(load));
  for (const SceneTable& traction : table.tables("traction")) {
    body.tractions.push_back(read_traction(traction));
  }
  return body;
}

void move(Selection& select, Vec3d by) {
  if (select.box) select.box = {select.box->low + by, select.box->high + by};
  if (select.ball) select.ball->centre += by;
}

BodyRequest copy_at(const BodyRequest& body, Vec3d by, std::size_t number) {
  BodyRequest copy = body;
  copy.name = fmt::format("{} {}", body.name, number);
  copy.translation += by;
  for (InclusionRequest& inclusion : copy.inclusions) move(inclusion.select, by);
  for (FinerRequest& finer : copy.finer) move(finer.select, by);
  for (FixRequest& fix : copy.fixed) move(fix.select, by);
  for (SymmetryRequest& plane : copy.symmetries) {
    plane.at += component(by, static_cast<int>(plane.normal));
  }
  for (MotionRequest& motion : copy.motions) {
    move(motion.select, by);
    motion.about += by;
  }
  for (LoadRequest& load : copy.loads) move(load.select, by);
  for (TractionRequest& traction : copy.tractions) move(traction.select, by);
  move_fracture(copy, by);
  return copy;
}

std::vector<BodyRequest> copies(const BodyRequest& body, const SceneTable& array) {
  std::array<int, 3> count{};
  Vec3d spacing;
  array.read("count", count);
  array.read("spacing", spacing);
  const auto total = static_cast<double>(count[0]) * count[1] * count[2];
  if (total > static_cast<double>(most_bodies)) {
    array.refuse("count",
                 fmt::format("{:.0f} copies found; allowed: at most {}", total, most_bodies));
  }
  if ((count[0] > 1 && spacing.x == 0) || (count[1] > 1 && spacing.y == 0) ||
      (count[2] > 1 && spacing.z == 0)) {
    array.refuse("spacing", fmt::format("[{:g}, {:g}, {:g}] found, which puts copies in one place; "
                                        "allowed: not 0 where count is more than 1",
                                        spacing.x, spacing.y, spacing.z));
  }
  std::vector<BodyRequest> result;
  for (int k = 0; k < count[2]; ++k) {
    for (int j = 0; j < count[1]; ++j) {
      for (int i = 0; i < count[0]; ++i) {
        result.push_back(
            copy_at(body, {i * spacing.x, j * spacing.y, k * spacing.z}, result.size() + 1));
      }
    }
  }
  return result;
}

}  // namespace

Selection read_selection(const SceneTable& table) {
  const std::vector<const char*> kinds = {"region", "indices", "box", "ball", "mesh", "all"};
  table.expect_one_of(kinds);
  Selection select;
  for (const char* kind : kinds) {
    if (table.has(kind)) select.where = table.where(kind);
  }
  table.read("region", select.region);
  table.read("indices", select.indices);
  table.read("box", select.box);
  if (table.has("ball")) select.ball = read_ball(table.table("ball"));
  table.read("mesh", select.mesh);
  if (table.has("mesh")) check_file_exists(table, "mesh", select.mesh);
  table.read("all", select.all);
  if (table.has("all") && !select.all) {
    table.refuse("all", "false found, which selects nothing; allowed: true");
  }
  if (select.box) {
    const auto [low, high] = *select.box;
    if (low.x > high.x || low.y > high.y || low.z > high.z) {
      table.refuse("box", fmt::format("[[{:g}, {:g}, {:g}], [{:g}, {:g}, {:g}]] found; allowed: "
                                      "[lowest, highest] corner, lowest <= highest along each axis",
                                      low.x, low.y, low.z, high.x, high.y, high.z));
    }
  }
  return select;
}

void read_path(const SceneTable& table, MotionRequest& motion) {
  if (table.has("rotation")) {
    table.expect_together("rotation", "duration");
  } else {
    table.expect_together("displacement", "duration");
  }
  if (table.has("displacement")) table.expect_together("displacement", "duration");
  if (table.has("about")) table.expect_together("about", "rotation");
  table.expect_together("amplitude", "frequency");
  if (!table.has("displacement") && !table.has("rotation") && !table.has("velocity") &&
      !table.has("amplitude")) {
    throw InputError(
        fmt::format("{}: {}: a key is missing; needed: at least one of: "
                    "displacement, rotation, velocity, amplitude",
                    table.where(), table.path()));
  }
  table.read("displacement", motion.displacement);
  table.read("rotation", motion.rotation);
  table.read("about", motion.about);
  table.read("duration", motion.duration);
  table.read("velocity", motion.velocity);
  table.read("amplitude", motion.amplitude);
  table.read("frequency", motion.frequency);
}

double default_hourglass(const BodyRequest& body) {
  return is_paper_shape(body.source.shape.name) || body.neighbourhood.one_sided() ? 0 : 0.1;
}

const char* default_law(const BodyRequest& body) {
  return is_paper_shape(body.source.shape.name) ? StVenantKirchhoff<double>::name : usual_law;
}

std::string law_of(const BodyRequest& body, const Material& material) {
  if (!material.law.empty()) return material.law;
  return body.material.law.empty() ? default_law(body) : body.material.law;
}

std::vector<BodyRequest> body_requests(const SceneTable& table) {
  const BodyRequest body = read_body_request(table);
  if (!table.has("array")) return {body};
  return copies(body, table.table("array"));
}

std::string names_of(const std::vector<BodyRequest>& bodies) {
  std::string names;
  for (std::size_t b = 0; b < std::min<std::size_t>(bodies.size(), 8); ++b) {
    names += (b > 0 ? ", " : "") + in_quotes(bodies[b].name);
  }
  return bodies.size() > 8 ? names + ", ..." : names;
}

}  // namespace phyxel
