/// All sections of a scene file: one entry each.
#include <utility>

#include "scene/scene_schema.hpp"

namespace phyxel {
namespace {

// clang-format off

/// The sections of what acts on a body, and of probes.
std::vector<SceneSection> boundary_sections() {
  return {
      {"body.fixed", "[[body.fixed]]", "selection",
       "Phyxels held where they are, with one of the selection keys below, along all `axes` or "
       "some: `axes = \"z\"` of all phyxels is plane strain. Each entry of `fixed` and `motion` is a set "
       "of its own in `reactions.csv`, which has one line for each frame and set, named by its body and "
       "entry, e.g. `fixed 1`, `motion 2`: force [N] and torque [N m] of the support on the body, and the "
       "work [J] that it has done since t = 0; in Verlet's steps without the work against what its own "
       "phyxels touch, which `contacts.csv` has. The torque is taken about the set's centre of mass at "
       "rest, the last three columns. A phyxel that two entries hold along different axes has a part in "
       "both sets, along their axes."},
      {"body.symmetry", "[[body.symmetry]]", "",
       "A plane of symmetry, at which the body ends: half a body, a quarter or an eighth of it stands for the "
       "whole. Its phyxels on the plane, those within a hundredth of a spacing, are held along the normal and free in the plane. "
       "Where another entry holds or moves them along the normal, they are left to that. "
       "Bodies without phyxels on the plane, as with `lattice = \"cells\"`, are held by their outermost "
       "layer, less accurately, and with a warning. Each plane is a set of its own in `reactions.csv`, e.g. `symmetry 1`."},
      {"body.motion", "[[body.motion]]", "selection",
       "Phyxels moved along a given path, u(t) = displacement * smoothstep(t / duration) + "
       "velocity * t + amplitude * sin(2 pi frequency t), with smoothstep(s) = s^2 (3 - 2 s) up "
       "to s = 1, and turned by rotation * smoothstep(t / duration). At least one of the four terms "
       "is needed; `displacement` and `rotation` need `duration`, and `amplitude` and `frequency` "
       "go together."},
      {"body.load", "[[body.load]]", "selection",
       "A force on phyxels: exactly one of `force` and `force_density`. In a box or a ball it acts on "
       "the space there: its centroid, and with `force_density` its total, are those of the part of the "
       "body's inside that lies in the region, if the body has a closed surface and one material, and as far as the "
       "phyxels there are not in one plane; the plan of a run says where each load acts."},
      {"body.traction", "[[body.traction]]", "selection",
       "A force on the surface, with exactly one of `traction` and `pressure`, where the triangles of the "
       "body's surface lie in a `box` or a `ball`, on those of the group that `region` names, or on "
       "`all`. Groups are those of a mesh, the sides \"x-\" to \"z+\" of a beam or block, the ends \"z-\" and \"z+\" "
       "and the \"side\" of a cylinder. The force keeps its size and "
       "direction as the body deforms, unless `follower` is true. Phyxels get their shares such that total, centroid and torque are "
       "those on the triangles. The pressure [Pa] of a gas and the volume [m^3] of its cavity are "
       "written at each frame to `gas.csv`, with step, time, body and set, e.g. `traction 1`."},
      {"body.fracture", "[body.fracture]", "",
       "Brittle fracture: two neighbours of the body above break apart for good where their distance grows beyond a critical share, which follows "
       "from `energy_release_rate`, the stiffness and the distance between phyxels. Needs an elastic law with `young` and `poisson` from 0 to "
       "0.35, hourglass control of 0.05 to 0.2, symmetric lists, and `neighbours.factor` of 1.55 to 1.88; without viscosity and volume stiffness. "
       "It may touch obstacles; with `[contact]` of bodies it is refused, since its surface does not break. "
       "Where materials meet, the weaker phyxel of a pair decides. The energy that breaking takes is a column of `energy.csv`. Faces of cracks do not pass through each other, and do not rub."},
      {"body.fracture.unbreakable", "[[body.fracture.unbreakable]]", "selection",
       "A `box` or a `ball` whose phyxels never break from their neighbours."},
      {"body.notch", "[[body.notch]]", "",
       "A disc, or a surface from a file, along which the body above is cut before it moves: phyxels on different sides, whose connection crosses it, "
       "are no neighbours. A phyxel in its plane counts as above it. Faces of notches do not pass through each other, and do not rub."},
      {"obstacle", "[[obstacle]]", "",
       "A rigid body that others cannot enter: a floor, a wall, a bin, a punch, or, with a `density`, a free body. `shape` needs its lengths: `size` of a box, "
       "`radius` of a sphere, `radius` and `length` of a cylinder or capsule. It is turned, then moved into place, and rests "
       "there or moves along a path. The phyxels on the surface of each body, or, where none lie there, those beside it, are kept "
       "out of it by forces that act where a step would lead them, and that shorten no step. Bodies need a surface, and may touch "
       "obstacles at the start but not overlap them; what is held or moved along all axes may be inside, but a run stops where it is "
       "pressed in by a quarter of a support. Each frame adds a line for each "
       "obstacle to `contacts.csv`: force [N] and torque [N m] on the bodies at that time, and, since t = 0, impulse [N s], "
       "angular impulse [N m s], work of the obstacle on the bodies [J], heat of friction [J] and loss in impacts [J]; then the depth [m] of "
       "the phyxel that is deepest inside, and the obstacle's place at rest, about which torques are taken. A run stops if phyxels "
       "and an obstacle move by more than half the obstacle's inner radius, or half a support, against each other in a step. Each frame adds a line for each free body to `rigid.csv`: place of its centre of mass [m], "
       "rotation from its position at rest [rad], axis times angle, velocity [m/s], angular velocity [rad/s], kinetic energy [J]."},
      {"obstacle.motion", "[obstacle.motion]", "",
       "The path of the obstacle above, as that of a `[[body.motion]]`. At least one of `displacement`, `rotation`, `velocity` and "
       "`amplitude` is needed."},
      {"contact", "[contact]", "",
       "Contact of bodies with each other: with this section, which may be empty, no body enters another one. The phyxels on the surface of each "
       "body, or those beside it, are kept out of the other bodies as out of obstacles, by forces that act where a step would lead them, and "
       "back on the phyxels of the other surface near them, so that both momenta are kept. Bodies need closed surfaces, and may touch at the "
       "start but not overlap. Each frame adds a line for each body to `contacts.csv`, with force, torque, impulse, angular impulse and work of all other bodies on "
       "it; heat and losses of a body are its share, which may be negative: their sums over the bodies are what contact has taken from the motion. "
       "Restitution is that of Verlet's steps alone: in implicit steps and searches for equilibrium contact is elastic."},
      {"contact.pair", "[[contact.pair]]", "",
       "Two bodies that touch. Without `all = true`, bodies that are in no pair touch nothing but obstacles."},
      {"probe", "[[probe]]", "selection",
       "A place whose values are logged at each frame in `probes.csv`: exactly one of `point`, a line by `from` "
       "and `to`, and a selection, whose phyxels' values are averaged by volume. Each line of the file has the step, the "
       "time, the probe's name, the number of the point, its position at rest, displacement [m], velocity [m/s], "
       "Cauchy stress [Pa], its von Mises equivalent, and Green's strain. At a point the values are those of a "
       "quadratic polynomial through the phyxels within a support, which ends where materials and supports do."},
  };
}

/// The sections of selections.
std::vector<SceneSection> selection_sections() {
  return {
      {"selection", "Selections", "",
       "Each `[[body.inclusion]]`, `[[body.fixed]]`, `[[body.motion]]`, `[[body.load]]`, `[[body.traction]]` and each "
       "`[[probe]]` without points has exactly one of these keys. Positions are those at rest, after the body is placed.\n\n"
       "A box or ball that holds or moves a part of a body made from a `mesh`, or of a `fitted` shape, acts where it "
       "ends: phyxels lie on its boundary, and if all axes are held, strains end at it. A box thinner than 0.8 spacings "
       "has one layer of phyxels, in its middle; a ball that small has no phyxels of its own. A box in a lattice acts "
       "where it ends, too, if its faces are parallel to the layers: the distance of layers changes a little, so that "
       "layers lie on these faces. A face less than half a spacing from the layer of another box, or from an end of the "
       "body, moves there, and the plan of the run says so. In other bodies and regions, and where a layer of the body "
       "beside the boundary is too thin for phyxels on both, the support ends with the phyxels whose centres lie in it.\n\n"
       "Strains end at a box only if one region of space, by one entry or several, holds all axes. One that holds "
       "some axes, or of which two different boxes together hold all, acts deeper by up to 0.45 spacings: beams that it clamps bend "
       "15% to 20% more, at five phyxels across.\n\n"
       "Phyxels that two supports share are held by the one that holds more axes, if these include the other's; by both, "
       "if they have no axis in common; and by either, if they have the same axes. Supports that move share only faces, "
       "along which their boxes or balls touch, and with the same axes only if they move alike. Other pairs are refused, "
       "whatever the order of entries."},
      {"selection.ball", "ball = {centre = [x, y, z], radius = r}", "", "A ball of a selection."},
  };
}

std::vector<SceneSection> make_sections() {
  std::vector<SceneSection> all = {
      {"", "At the top of the file", "", "Before the first section."},
      {"time", "[time]", "", "How long to simulate, and in which steps."},
      {"solver", "[solver]", "", "What computes, and in which precision."},
      {"output", "[output]", "", "What is written, where and how often."},
      {"render", "[render]", "", "Pictures made at the end of a run."},
      {"render.camera", "[render.camera]", "", "Camera of pictures, of `phyxel render`, whose options override it, and of the opening view of `phyxel report`. Without it the camera sees the whole motion."},
      {"body", "[[body]]", "",
       "One such section for each body. Exactly one of `shape`, `mesh`, `file` and `cloud` says "
       "where its rest shape comes from:\n\n"
       "- `shape = \"beam\"` and `\"block\"` need `size`, `\"cylinder\"` needs `radius` and "
       "`length`, `\"sphere\"` needs `radius`; each also needs exactly one of `spacing` and "
       "`phyxels`, and may have `lattice`, `jitter`, `seed` (with `jitter`, or if fitted), `surfels` and `grading` (if fitted). The beam lies "
       "along x from the origin, with its axis on the x axis; the others are centred on the "
       "origin, the cylinder along z.\n"
       "- `shape = \"alien_head\"`, `\"horn_bug\"` and `\"dino\"` are the bodies of Farias et al. "
       "2008; their counts of phyxels and surfels are fixed, and only `surfels` may be added.\n"
       "- `mesh` needs `phyxels`, and may have `seed`, `relaxations`, `on_surface` and `grading`. Named groups of its triangles "
       "are regions: an OBJ file's groups, objects and materials, the solids of an STL file, and colours: "
       "`\"#ff0000\"` of the faces of a PLY file, `\"attribute 31\"` of the triangles of a binary STL file. A region has "
       "the phyxels on its triangles; if all phyxels lie inside, those within a spacing of them.\n"
       "- `file` needs nothing else.\n"
       "- `cloud` names what a program that links phyxel, or uses it from Python, passes along with "
       "the scene: it needs nothing else either.\n\n"
       "The shape is scaled, then rotated, then translated."},
      {"body.material", "[body.material]", "", "What the body is made of. Required."},
      {"body.inclusion", "[[body.inclusion]]", "selection",
       "Phyxels of another material: what is not said here is as in `[body.material]`, and so is "
       "the strength of hourglass control. Where several hold a phyxel, the last counts. The "
       "phyxels of a body with inclusions are numbered material by material."},
      {"body.grading", "[body.grading]", "",
       "Distances between the phyxels of a mesh or a `fitted` shape that differ from place to place: smaller where "
       "the surface curves, where the body is thin, and in finer regions, and growing from there. How many phyxels "
       "there are is still said by `phyxels`. The smallest distance sets the time step. Needs a surface that phyxels "
       "can lie on."},
      {"body.grading.finer", "[[body.grading.finer]]", "selection",
       "A `box` or a `ball` in which phyxels are nearer to each other."},
      {"body.neighbours", "[body.neighbours]", "",
       "Which phyxels interact: those closer than the support radius h. Either `radius` gives h, "
       "or it is `factor` times the mean distance to the `nearest` nearest phyxels."},
      {"body.array", "[body.array]", "",
       "Repeats the body on a grid, with everything it has: the copies of `name = \"dino\"` are "
       "called \"dino 1\", \"dino 2\", ..., x counting fastest, and each is a body of its own. "
       "Box and ball selections move along with each copy."},
  };
  for (SceneSection& section : boundary_sections()) all.push_back(std::move(section));
  for (SceneSection& section : selection_sections()) all.push_back(std::move(section));
  return all;
}

// clang-format on

}  // namespace

std::span<const SceneSection> scene_sections() {
  static const std::vector<SceneSection> sections = make_sections();
  return sections;
}

}  // namespace phyxel
