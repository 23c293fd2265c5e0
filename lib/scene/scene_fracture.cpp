#include "scene/scene_fracture.hpp"

#include <fmt/format.h>

#include "phyxel/error.hpp"
#include "scene/scene_body.hpp"
#include "scene/scene_source.hpp"

namespace phyxel {
namespace {

[[noreturn]] void refuse(const std::string& where, const BodyRequest& body,
                         const std::string& problem) {
  throw InputError(
      fmt::format("{}{}body \"{}\": {}", where, where.empty() ? "" : ": ", body.name, problem));
}

}  // namespace

FractureRequest read_fracture(const SceneTable& table) {
  FractureRequest fracture{.where = table.where()};
  table.read("energy_release_rate", fracture.energy_release_rate);
  table.read("strength", fracture.strength);
  table.read("scatter", fracture.scatter);
  if (table.has("seed")) table.expect_together("seed", "scatter");
  table.read("seed", fracture.seed);
  for (const SceneTable& region : table.tables("unbreakable")) {
    region.expect_one_of({"box", "ball"});
    fracture.unbreakable.push_back(read_selection(region));
  }
  return fracture;
}

NotchRequest read_notch(const SceneTable& table) {
  NotchRequest notch{.where = table.where()};
  table.expect_one_of({"centre", "mesh"});
  table.expect_together("centre", "normal");
  table.expect_together("centre", "radius");
  table.read("mesh", notch.mesh);
  if (!notch.mesh.empty()) {
    check_file_exists(table, "mesh", notch.mesh);
    return notch;
  }
  table.read("centre", notch.centre);
  table.read("normal", notch.normal);
  table.read("radius", notch.radius);
  if (notch.normal == Vec3d{}) table.refuse("normal", "[0, 0, 0] found; allowed: a direction");
  return notch;
}

void move_fracture(BodyRequest& copy, Vec3d by) {
  for (NotchRequest& notch : copy.notches) notch.centre += by;
  if (!copy.fracture) return;
  for (Selection& select : copy.fracture->unbreakable) {
    if (select.box) select.box = {select.box->low + by, select.box->high + by};
    if (select.ball) select.ball->centre += by;
  }
}

void check_fracture_request(const Scene& scene) {
  for (const BodyRequest& body : scene.bodies) {
    for (const NotchRequest& notch : body.notches) {
      if (notch.normal != Vec3d{} || !notch.mesh.empty()) continue;
      refuse(notch.where, body, "key body.notch.normal: [0, 0, 0] found; allowed: a direction");
    }
    if (!body.fracture) continue;
    for (const Selection& select : body.fracture->unbreakable) {
      if (select.box || select.ball) continue;
      refuse(select.where.empty() ? body.fracture->where : select.where, body,
             "a selection of body.fracture.unbreakable has no box and no ball; allowed: either");
    }
    if (scene.solver.method != Method::equilibrium) continue;
    refuse(body.fracture->where, body,
           "body.fracture found with solver.method = \"equilibrium\"; allowed with this method: "
           "notches of bodies that do not break; allowed with body.fracture: \"verlet\" and "
           "\"implicit\"");
  }
}

}  // namespace phyxel
