/// The keys of contact: obstacles, the paths of obstacles and of parts of bodies, and how bodies
/// touch each other.
#include <fmt/format.h>

#include "phyxel/physics/obstacles.hpp"
#include "scene/key_parts.hpp"

namespace phyxel {

using namespace ranges;

// One line for each field would make the table twice as long.
// clang-format off

std::vector<std::string> obstacle_names() {
  std::vector<std::string> names;
  ObstacleShapes::for_each([&]<class Shape>(std::type_identity<Shape>) { names.emplace_back(Shape::name); });
  return names;
}

namespace {

std::string obstacle_meanings() {
  std::string all = "The obstacle's shape, before it is turned and moved.";
  ObstacleShapes::for_each([&]<class Shape>(std::type_identity<Shape>) {
    all += fmt::format(" \"{}\": {}.", Shape::name, Shape::meaning);
  });
  return all;
}

}  // namespace

std::vector<SceneKey> path_keys(const std::string& section) {
  return {
      {.section = section, .name = "displacement", .type = KeyType::vector, .unit = "m",
       .fallback = "[0, 0, 0]", .range = within(longest), .meaning = "Reached after `duration`, then kept."},
      {.section = section, .name = "rotation", .type = KeyType::vector, .unit = "degrees",
       .fallback = "[0, 0, 0]",
       .range = within(largest_angle), .meaning = "Axis times angle, reached after `duration`, then kept: [1080, 0, 0] is three "
           "turns about x."},
      {.section = section, .name = "about", .type = KeyType::vector, .unit = "m",
       .fallback = "[0, 0, 0]", .range = within(longest), .meaning = "A point of the axis of `rotation`."},
      {.section = section, .name = "duration", .unit = "s", .otherwise = "none",
       .range = time_span(), .meaning = "Time to reach `displacement` and `rotation`."},
      {.section = section, .name = "velocity", .type = KeyType::vector, .unit = "m/s",
       .fallback = "[0, 0, 0]", .range = within(fastest), .meaning = "Of a steady motion."},
      {.section = section, .name = "amplitude", .type = KeyType::vector, .unit = "m",
       .fallback = "[0, 0, 0]", .range = within(longest), .meaning = "Of an oscillation."},
      {.section = section, .name = "frequency", .unit = "Hz", .otherwise = "none",
       .range = between(1e-9, 1e18), .meaning = "Of the oscillation."},
  };
}

std::vector<SceneKey> obstacle_keys() {
  return {
      {.section = "obstacle", .name = "name", .type = KeyType::text, .otherwise = "\"obstacle 1\", \"obstacle 2\", ...",
       .meaning = "The obstacle's name in `contacts.csv`."},
      {.section = "obstacle", .name = "shape", .type = KeyType::choice, .required = true,
       .words = obstacle_names(), .meaning = obstacle_meanings()},
      {.section = "obstacle", .name = "size", .type = KeyType::vector, .unit = "m", .otherwise = "none",
       .range = length(), .meaning = "Extents of a box along x, y and z."},
      {.section = "obstacle", .name = "radius", .unit = "m", .otherwise = "none", .range = length(),
       .meaning = "Of a sphere, cylinder or capsule."},
      {.section = "obstacle", .name = "length", .unit = "m", .otherwise = "none", .range = length(),
       .meaning = "Of a cylinder; of a capsule, between the centres of its ends."},
      {.section = "obstacle", .name = "mesh", .type = KeyType::path, .otherwise = "none",
       .meaning = "A file with a closed surface (OBJ, PLY or STL), of the shape \"mesh\". Resolved from the scene file's folder. What touches "
           "it sees edges that are rounded to about half a spacing of the phyxels."},
      {.section = "obstacle", .name = "scale", .fallback = "1", .range = length(),
       .meaning = "Of that surface, about its origin."},
      {.section = "obstacle", .name = "normal", .type = KeyType::vector, .otherwise = "[0, 0, 1], turned by `rotation`",
       .range = within(longest), .meaning = "Direction that a plane faces; not together with `rotation`."},
      {.section = "obstacle", .name = "hollow", .type = KeyType::boolean, .fallback = "false",
       .meaning = "Whether bodies are kept inside the obstacle, as in a bin, instead of outside."},
      {.section = "obstacle", .name = "rotation", .type = KeyType::vector, .unit = "degrees", .fallback = "[0, 0, 0]",
       .range = within(largest_angle), .meaning = "Axis times angle, applied first."},
      {.section = "obstacle", .name = "translation", .type = KeyType::vector, .unit = "m", .fallback = "[0, 0, 0]",
       .range = within(longest), .meaning = "Applied last. A plane goes through this point."},
      {.section = "obstacle", .name = "friction", .fallback = "0", .range = between(0, 1e6),
       .meaning = "Coulomb's coefficient: largest tangential over normal force of a point at rest on the obstacle."},
      {.section = "obstacle", .name = "kinetic_friction", .otherwise = "`friction`", .range = between(0, 1e6),
       .meaning = "The same of a point that slides; at most `friction`."},
      {.section = "obstacle", .name = "restitution", .fallback = "0", .range = between(0, 1),
       .meaning = "Speed of a point of a surface after an impact over that before. What a body as a whole gives back "
           "comes from its elasticity: 0 is right for most, and 1 returns no more than 0, as what is behind the layer hits it again."},
      {.section = "obstacle", .name = "method", .type = KeyType::choice, .otherwise = "that of [contact], or \"projected\"",
       .words = {"projected", "penalty"}, .meaning = "How phyxels are kept out in Verlet's steps, as in [contact]. The key is of this obstacle alone, "
           "and needs no [contact]."},
      {.section = "obstacle", .name = "stiffness", .otherwise = "that of [contact], or 0.1", .range = between(1e-6, 1e6),
       .meaning = "Of penalties, as in [contact]."},
      {.section = "obstacle", .name = "motion", .type = KeyType::table, .otherwise = "at rest",
       .meaning = "How the obstacle moves."},
      {.section = "obstacle", .name = "density", .unit = "kg/m^3", .otherwise = "none",
       .range = between(1e-12, stiffest), .meaning = "Makes it a free rigid body, whose mass and inertia are those of its shape: gravity, "
           "bodies and other obstacles move it. Of shapes that hold a volume, with Verlet's steps. For two rigid bodies, friction is the "
           "geometric mean of theirs, and restitution the larger one, of the bodies as a whole. Phyxels that supports hold or "
           "move along all axes stop it as an obstacle on a path does that is as sharp as their surface, with its own friction and restitution; "
           "it must not overlap them at the start. Where all of a normal lies along axes that a phyxel is held along, while others are free, "
           "the phyxel stops it by penalties alone."},
      {.section = "obstacle", .name = "velocity", .type = KeyType::vector, .unit = "m/s", .fallback = "[0, 0, 0]",
       .range = within(fastest), .meaning = "Of the centre of mass of a free body at the start."},
      {.section = "obstacle", .name = "spin", .type = KeyType::vector, .unit = "rad/s", .fallback = "[0, 0, 0]",
       .range = within(fastest), .meaning = "Angular velocity of a free body at the start."},
  };
}

std::vector<SceneKey> contact_keys() {
  return {
      {.section = "contact", .name = "friction", .fallback = "0", .range = between(0, 1e6),
       .meaning = "Coulomb's coefficient: largest tangential over normal force of a point that sticks."},
      {.section = "contact", .name = "kinetic_friction", .otherwise = "`friction`", .range = between(0, 1e6),
       .meaning = "The same of a point that slides; at most `friction`."},
      {.section = "contact", .name = "restitution", .fallback = "0", .range = between(0, 1),
       .meaning = "Speed of a point of a surface after an impact over that before, as of an obstacle."},
      {.section = "contact", .name = "self", .type = KeyType::boolean, .fallback = "false",
       .meaning = "Whether parts of one body touch each other, too: those that are two supports and more apart at rest."},
      {.section = "contact", .name = "sweeps", .type = KeyType::integer, .fallback = "4", .range = between(1, 1000),
       .meaning = "How often contact is resolved in each step. With 1, a step costs less, and what friction holds creeps; high stacks need more."},
      {.section = "contact", .name = "method", .type = KeyType::choice, .fallback = "\"projected\"",
       .words = {"projected", "penalty"}, .meaning = "How Verlet's steps keep bodies apart, and phyxels out of obstacles that have no `method` of their own. \"projected\": "
           "points are moved out of what a step has led them into; nothing has to be tuned, the layers that meet lose the energy of their impact. "
           "\"penalty\": springs push them back, so that what contact stores is given back, and total energy closes to second order in the step; "
           "bodies sink into each other a little, and steps are shorter. The methods \"implicit\" and \"equilibrium\" of [solver] always use penalties, of a stiffness of their own."},
      {.section = "contact", .name = "stiffness", .fallback = "0.1", .range = between(1e-6, 1e6),
       .meaning = "Of penalties: about that of the springs over that of a layer of phyxels. At a pressure p bodies sink into each other by about p/(`stiffness` E) "
           "distances between phyxels; a quarter of a support is allowed. Large values shorten the steps."},
      {.section = "contact", .name = "all", .type = KeyType::boolean, .otherwise = "true without pairs",
       .meaning = "Whether all bodies touch each other, not only those of `pair`."},
      {.section = "contact", .name = "pair", .type = KeyType::tables, .otherwise = "none",
       .meaning = "Bodies that touch, or whose contact differs from that of the others."},
      {.section = "contact.pair", .name = "first", .type = KeyType::text, .required = true, .meaning = "The name of a body."},
      {.section = "contact.pair", .name = "second", .type = KeyType::text, .required = true, .meaning = "The name of another body."},
      {.section = "contact.pair", .name = "friction", .otherwise = "that of [contact]", .range = between(0, 1e6),
       .meaning = "As in [contact]."},
      {.section = "contact.pair", .name = "kinetic_friction", .otherwise = "`friction`", .range = between(0, 1e6),
       .meaning = "As in [contact]."},
      {.section = "contact.pair", .name = "restitution", .otherwise = "that of [contact]", .range = between(0, 1),
       .meaning = "As in [contact]."},
  };
}

// clang-format on

}  // namespace phyxel
