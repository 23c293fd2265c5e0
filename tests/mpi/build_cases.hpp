/// Scenes whose shares ranks build together. Each has bodies that take another path through the
/// set-up.
#pragma once

#include <algorithm>
#include <ostream>
#include <set>
#include <string>
#include <vector>

#include "../partition/bodies.hpp"

namespace phyxel {

struct BuildCase {
  const char* name;
  Scene scene;
  std::vector<Cloud> clouds;  ///< Empty: from the scene's sources.
};
inline void PrintTo(const BuildCase& c, std::ostream* out) { *out << c.name; }

inline BodyRequest shape(const char* name, double spacing) {
  BodyRequest body;
  body.name = name;
  body.where = "test";
  body.source.shape.name = name;
  body.source.shape.spacing = spacing;
  body.source.shape.size = {3, 1, 1};
  body.source.shape.radius = 1;
  body.source.shape.jitter = 0.2;
  body.closure = 0;  // so that devices may search
  body.material = testing::rubber();
  return body;
}

inline BuildCase beam() {
  BodyRequest body = shape("beam", 0.09);
  body.rotation = {10, 20, 30};
  body.scale = 1.5;
  body.translation = {1, 2, 3};
  body.fixed.push_back({.select = {.region = "x-"}});
  body.motions.push_back(
      {.select = {.indices = std::vector<Index>{7, 1500, 2000}}, .velocity = {0.1, 0, 0}});
  body.loads.push_back({.select = {.region = "x+"}, .force = {3, 0, 1}, .ramp = 0.01});
  body.loads.push_back({.select = {.ball = Selection::Ball{{1, 2, 3}, 2}}, .force = {0, 0.1, 0}});
  body.loads.push_back({.select = {.all = true}, .force_density = {0, 0, 2}});
  return {"Beam", {.bodies = {body}}, {}};
}
/// One of each shape and rule.
inline BuildCase rules() {
  BuildCase c{"Rules", {}, {}};
  c.scene.bodies = {shape("sphere", 0.17), shape("cylinder", 0.2), shape("block", 0.21),
                    shape("horn_bug", 0), shape("beam", 0.16)};
  c.scene.bodies[0].neighbourhood.support = NeighbourhoodRule::Support::adaptive;
  c.scene.bodies[0].volume_rule = VolumeRule::kernel;
  c.scene.bodies[1].source.shape.length = 2;
  c.scene.bodies[2].neighbourhood.radius = 0.4;
  c.scene.bodies[2].volume_rule = VolumeRule::kernel;
  c.scene.bodies[2].neighbourhood.nearest = 30;
  c.scene.bodies[3].fixed.push_back({.select = {.indices = std::vector<Index>{0, 1, 100}}});
  c.scene.bodies[4].neighbourhood.nearest = 100;
  return c;
}
inline BuildCase nearest() {
  BuildCase c{"Nearest", {}, {}};
  c.scene.bodies = {shape("sphere", 0.15), shape("block", 0.2)};
  c.scene.bodies[0].neighbourhood.max_neighbours = 20;
  c.scene.bodies[1].volume_rule = VolumeRule::kernel;
  return c;
}
inline Scene plain(std::size_t bodies = 1) {
  Scene scene = testing::one_body();
  scene.bodies.resize(bodies, scene.bodies[0]);
  return scene;
}
inline BuildCase small() {
  return {"Small",
          plain(4),
          {testing::lattice(5, 1, 1, 0.1), testing::lattice(1, 1, 1, 0.1),
           testing::lattice(2, 1, 1, 0.1), testing::lattice(20, 12, 9, 0.1, 0.3)}};
}
/// Flat, and some twice at one place.
inline BuildCase degenerate() {
  Cloud sheet = testing::lattice(30, 20, 1, 0.1);
  for (const Index i : {3, 50, 420}) {
    sheet.position.push_back(sheet.position[i]);
    sheet.volume.push_back(sheet.volume[i]);
  }
  return {"Degenerate", plain(), {sheet}};
}
/// Neighbours exactly as far as the support, where only rounding says who is one.
inline BuildCase lattice() {
  BuildCase c{"Lattice", {}, {}};
  c.scene.bodies = {shape("beam", 0.13), shape("block", 0.37)};
  for (BodyRequest& body : c.scene.bodies) {
    body.source.shape.jitter = 0;
    body.translation = {1.8, 6.7, 0.908358};
  }
  c.scene.bodies[0].source.shape.size = {30 * 0.13, 7 * 0.13, 5 * 0.13};
  c.scene.bodies[0].neighbourhood.radius = 0.13;
  c.scene.bodies[1].source.shape.size = {20 * 0.37, 9 * 0.37, 8 * 0.37};
  c.scene.bodies[1].neighbourhood.radius = 2 * 0.37;
  return c;
}
/// Two lumps, the spacing of one ten times the other's, with surfels, some of them far away.
inline BuildCase lumps() {
  Cloud cloud = testing::lattice(14, 14, 14, 0.1, 0.2);
  for (const Vec3d& p : testing::lattice(6, 6, 6, 1, 0.2).position) {
    cloud.position.push_back(p + Vec3d{40, 0, 0});
    cloud.volume.push_back(1);
  }
  for (int k = 0; k < 300; ++k) {
    cloud.surface.position.push_back({0.15 * k, 0.6 + 0.001 * k, 0.7});
    cloud.surface.normal.push_back({0, 0, 1});
  }
  return {"Lumps", plain(), {cloud}};
}

/// A body whose surfels all lie on the phyxels of the next one, which do not carry them.
inline BuildCase astray() {
  std::vector<Cloud> clouds{testing::lattice(6, 6, 6, 0.1, 0.2),
                            testing::lattice(5, 5, 5, 0.1, 0.2),
                            testing::lattice(4, 4, 4, 0.1, 0.2)};
  for (Vec3d& p : clouds[1].position) p += Vec3d{7, 0, 0};
  clouds[0].surface.position = clouds[1].position;
  clouds[0].surface.normal.assign(clouds[1].position.size(), {0, 0, 1});
  return {"Astray", plain(3), clouds};
}

/// Two materials in one body, on which something pulls, beside another body.
inline BuildCase included() {
  BodyRequest body = shape("block", 0.17);
  Material stiff = body.material;
  stiff.young *= 10;
  stiff.density *= 3;
  body.inclusions.push_back(
      {.select = {.ball = Selection::Ball{{0.4, 0, 0}, 0.45}}, .material = stiff});
  body.fixed.push_back({.select = {.region = "x-"}});
  body.loads.push_back({.select = {.region = "x+"}, .force = {3, 0, 1}});
  return {"Included", {.bodies = {body, shape("beam", 0.2)}}, {}};
}
/// Closed gradients in a body of two materials, beside a body that has none.
inline BuildCase closed() {
  BuildCase c = included();
  c.name = "Closed";
  c.scene.bodies[0].closure = 1e-3;
  c.scene.bodies[0].loads.push_back({.select = {.all = true}, .force_density = {0, 0, 2}});
  return c;
}

/// Inclusions of which one covers another whole, and boundaries that list phyxels by number, which
/// are those of the cloud whatever the order by material.
inline BuildCase mixed() {
  BuildCase c{"Mixed", {.bodies = {shape("beam", 0.2), shape("block", 0.19)}}, {}};
  BodyRequest& body = c.scene.bodies[1];
  body.volume_rule = VolumeRule::kernel;
  Material soft = body.material, stiff = body.material;
  soft.young /= 3;
  stiff.young *= 2;
  stiff.density *= 5;
  body.inclusions.push_back(
      {.select = {.ball = Selection::Ball{{0, 0, 0}, 0.2}}, .material = soft});
  body.inclusions.push_back(
      {.select = {.indices = std::vector<Index>{2, 390, 3, 77}}, .material = soft});
  body.inclusions.push_back(
      {.select = {.box = Selection::Box{{-0.4, -0.4, -0.4}, {2, 2, 2}}}, .material = stiff});
  body.fixed.push_back(
      {.select = {.indices = std::vector<Index>{390, 0, 5}}, .axes = {true, false, false}});
  body.fixed.push_back({.select = {.region = "x-"}, .axes = {false, true, false}});
  body.motions.push_back(
      {.select = {.indices = std::vector<Index>{77, 150}}, .velocity = {0.1, 0, 0}});
  body.loads.push_back({.select = {.region = "x-"}, .force = {3, 0, 1}});
  body.loads.push_back({.select = {.ball = Selection::Ball{{1, 0, 0}, 0.8}}, .force = {0, 1, 1}});
  // Of which each rank takes a piece with phyxels of all materials.
  for (const BodyRequest& request : c.scene.bodies) c.clouds.push_back(make_cloud(request));
  return c;
}
/// A hundred regions that overlap, in bodies of one and of two materials.
inline BuildCase many_regions() {
  BuildCase c{"ManyRegions", {.bodies = {shape("beam", 0.2), shape("block", 0.19)}}, {}};
  Material stiff = c.scene.bodies[1].material;
  stiff.young *= 2;
  c.scene.bodies[1].inclusions.push_back(
      {.select = {.ball = Selection::Ball{{0, 0, 0}, 0.4}}, .material = stiff});
  for (BodyRequest& body : c.scene.bodies) {
    Cloud cloud = make_cloud(body);
    const auto size = static_cast<Index>(cloud.position.size());
    for (Index k = 0; k < 100; ++k) {
      const std::string name = "region " + std::to_string(k);
      const std::set<Index> members{k, (k * k) % size, (7 * k) % size, size - 1 - k};
      cloud.regions[name].assign(members.begin(), members.end());
      body.loads.push_back({.select = {.region = name}, .force = {0, 0, 1.0 + k}});
    }
    c.clouds.push_back(std::move(cloud));
  }
  return c;
}
/// Closed bodies of every kind of volume, one of which has a spike that no phyxel reaches.
inline BuildCase closed_alone() {
  BuildCase c{"ClosedAlone", {.bodies = {shape("sphere", 0.25), shape("beam", 0.25)}}, {}};
  for (BodyRequest& body : c.scene.bodies) body.closure = 1e-2;
  c.scene.bodies[1].volume_rule = VolumeRule::kernel;
  c.scene.bodies[1].loads.push_back({.select = {.region = "x+"}, .force_density = {1, 0, 2}});
  for (const BodyRequest& body : c.scene.bodies) c.clouds.push_back(make_cloud(body));
  Surface& surface = c.clouds[0].surface;
  const auto top = std::max_element(surface.position.begin(), surface.position.end(),
                                    [](Vec3d a, Vec3d b) { return a.z < b.z; });
  top->z += 1.5;
  return c;
}
/// Bodies that do not ask for closed gradients: one gets them, one cannot have them, as a phyxel is
/// far too large for its place, and one is a lattice.
inline BuildCase closed_by_default() {
  BuildCase c{"ClosedByDefault",
              {.bodies = {shape("block", 0.2), shape("block", 0.2), shape("beam", 0.25)}},
              {}};
  for (std::size_t b = 0; b < 3; ++b) {
    BodyRequest& body = c.scene.bodies[b];
    body.source.shape.jitter = b == 2 ? 0 : 0.2;
    body.closure.reset();
    c.clouds.push_back(make_cloud(body));
  }
  c.clouds[1].volume[7] *= 30;
  return c;
}

/// Graded clouds: with spacings of their own, a part of another material and a pull; closed; and
/// with supports and volumes that follow from the places of phyxels alone.
inline BuildCase graded_clouds() {
  BuildCase c{"Graded", plain(3), {testing::graded(11)}};
  BodyRequest& body = c.scene.bodies[0];
  Material stiff = body.material;
  stiff.young *= 3;
  body.inclusions.push_back(
      {.select = {.ball = Selection::Ball{{0.3, 0.5, 0.5}, 0.3}}, .material = stiff});
  body.loads.push_back({.select = {.all = true}, .force_density = {0, 0, 2}});
  for (BodyRequest& other : c.scene.bodies) other.material.hourglass = 0.1;
  Cloud cube = make_shape({.name = "block",
                           .size = {1, 1, 1},
                           .spacing = 0.1,
                           .jitter = 0.2,
                           .placement = ShapeRequest::Placement::cells});
  for (std::vector<Vec3d>* points : {&cube.position, &cube.surface.position}) {
    for (Vec3d& p : *points) p += Vec3d{0.5, 0.5, 0.5};
  }
  c.clouds.push_back(testing::inverted(cube, 1, 0.1));
  c.scene.bodies[1].closure = 1e-2;
  c.clouds.push_back(testing::graded(10));
  c.clouds[2].spacing.clear();
  c.scene.bodies[2].neighbourhood.support = NeighbourhoodRule::Support::pairwise;
  c.scene.bodies[2].volume_rule = VolumeRule::kernel;
  return c;
}

/// Lattices with layers on the faces of boxes that hold and move parts of them, on a floor; they
/// touch each other.
inline BuildCase supported() {
  BuildCase c{"Supported", {.bodies = {shape("beam", 0.12), shape("cylinder", 0.17)}}, {}};
  BodyRequest &beam = c.scene.bodies[0], &column = c.scene.bodies[1];
  beam.source.shape.placement = ShapeRequest::Placement::nodes;
  beam.source.shape.jitter = 0;
  beam.rotation = {0, 0, 90};
  beam.scale = 1.5;
  beam.fixed.push_back({.select = {.box = Selection::Box{{-9, -9, -9}, {9, 0.71, 9}}}});
  beam.motions.push_back(
      {.select = {.box = Selection::Box{{-9, 3.6, -9}, {9, 9, 0.11}}}, .velocity = {0.1, 0, 0}});
  column.source.shape.length = 2;
  column.translation = {5, 0, 0};
  column.fixed.push_back({.select = {.box = Selection::Box{{-9, -9, -9}, {9, 9, -0.37}}}});
  c.scene.contact = ContactRequest{.friction = 0.3};
  c.scene.obstacles = {
      {.name = "floor", .shape = "plane", .translation = {0, 0, -3}, .friction = 0.2},
      {.name = "post", .shape = "sphere", .radius = 1, .translation = {9, 9, 9}}};
  return c;
}

/// Supports whose faces touch each other, or move to other layers: in a body of one material, in
/// one with a stiffer part, and in a fitted one.
inline BuildCase faces_shared() {
  BuildCase c{"FacesShared",
              {.bodies = {shape("beam", 0.12), shape("beam", 0.13), shape("cylinder", 0.2)}},
              {}};
  constexpr Axes only_y{false, true, false}, x_and_y{true, true, false};
  const auto between = [](double begin, double end) {
    return Selection{.box = Selection::Box{{begin, -9, -9}, {end, 9, 9}}};
  };
  for (std::size_t b = 0; b < 2; ++b) {
    BodyRequest& beam = c.scene.bodies[b];
    beam.source.shape.placement = ShapeRequest::Placement::nodes;
    beam.source.shape.jitter = 0;
    const double length = beam.source.shape.size.x;
    beam.motions = {{.select = between(0.5 * length, 9), .velocity = {0.1, 0, 0}}};
    beam.fixed = {{between(0.3 * length, 0.5 * length), x_and_y},
                  {between(-9, 0.3 * length - 0.03), only_y}};
  }
  BodyRequest& column = c.scene.bodies[2];
  column.source.shape.length = 2;
  column.source.shape.jitter = 0;
  column.source.shape.placement = ShapeRequest::Placement::fitted;
  column.fixed = {{.select = {.box = Selection::Box{{-9, -9, -9}, {9, 9, 0.1}}}, .axes = only_y},
                  {.select = {.box = Selection::Box{{-9, -9, 0.1}, {9, 9, 9}}}}};
  Material stiff = c.scene.bodies[1].material;
  stiff.young *= 3;
  c.scene.bodies[1].inclusions.push_back(
      {.select = {.ball = Selection::Ball{{0.4, 0, 0}, 0.2}}, .material = stiff});
  return c;
}

/// Copies of bodies, whose supports move with them and are rounded otherwise: all have the cloud of
/// the first.
inline BuildCase copies() {
  BuildCase c{"Copies", {}, {}};
  const BodyRequest beam = shape("beam", 0.12), column = shape("cylinder", 0.2);
  for (const BodyRequest& body : {beam, column}) {
    for (int k = 0; k < 4; ++k) {
      const Vec3d by{97.3 * (3 - k), 0.7 * k, 33.1 * (3 - k)};  // the first one's digits are fewest
      BodyRequest copy = body;
      copy.name += std::to_string(k);
      copy.source.shape.jitter = 0;
      copy.source.shape.length = 2;
      copy.translation += by;
      if (body.name == beam.name) {
        copy.source.shape.placement = ShapeRequest::Placement::nodes;
        copy.fixed = {
            {.select = {.box = Selection::Box{Vec3d{-9, -9, -9} + by, Vec3d{0.71, 9, 9} + by}}}};
      } else {
        copy.source.shape.placement = ShapeRequest::Placement::fitted;
        copy.fixed = {{.select = {.ball = Selection::Ball{Vec3d{0.1, 0.2, 0.3} + by, 0.4}}}};
      }
      c.scene.bodies.push_back(copy);
    }
  }
  c.scene.obstacles = {{.name = "floor", .shape = "plane", .translation = {0, 0, -60}}};
  return c;
}

inline const std::vector<BuildCase>& build_cases() {
  static const std::vector<BuildCase> cases{beam(),          rules(),
                                            nearest(),       small(),
                                            degenerate(),    lumps(),
                                            astray(),        lattice(),
                                            included(),      closed(),
                                            mixed(),         closed_alone(),
                                            many_regions(),  closed_by_default(),
                                            graded_clouds(), supported(),
                                            faces_shared(),  copies()};
  return cases;
}

}  // namespace phyxel
