/// All keys of a scene file: one entry each.
#include <fmt/format.h>

#include <algorithm>
#include <cstdint>

#include "phyxel/law_table.hpp"
#include "phyxel/point_fields.hpp"
#include "scene/key_parts.hpp"

namespace phyxel {
namespace {

using namespace ranges;

// One line for each field would make the table twice as long.
// clang-format off

std::vector<std::string> law_names() {
  std::vector<std::string> names;
  for (const LawEntry& law : law_table()) names.emplace_back(law.name);
  return names;
}

std::string law_meanings() {
  std::string all = "How stress follows from strain; at small strains all are Hooke's law.";
  for (const LawEntry& law : law_table()) all += fmt::format(" \"{}\": {}.", law.name, law.meaning);
  return all;
}

std::string default_laws() {
  return fmt::format("\"{}\"; \"{}\" for the paper's bodies", usual_law,
                     StVenantKirchhoff<double>::name);
}

std::vector<std::string> field_names() {
  std::vector<std::string> names{"displacement", "velocity", "mass", "volume", "body", "history"};
  for (const PointField& field : point_fields()) names.emplace_back(field.name);
  return names;
}

std::string field_meanings() {
  std::string all =
      "What each phyxel carries beside its position: displacement [m], velocity [m/s], mass [kg], volume "
      "[m^3], number of its body, and what its material remembers";
  for (const PointField& field : point_fields()) all += fmt::format("; `{}`: {}", field.name, field.meaning);
  return all + ". The points of the surface have them, too, from the phyxels around them, but for mass and volume.";
}

/// The parameters that laws have beside `young` and `poisson`, as keys of a section. Laws that share
/// a parameter share its key.
std::vector<SceneKey> law_keys(const std::string& section) {
  std::vector<SceneKey> keys;
  for (const LawEntry& law : law_table()) {
    for (const LawParameter& p : law.parameters) {
      const auto is_it = [&](const SceneKey& key) { return key.name == p.name; };
      if (!is_own_parameter(p) || std::any_of(keys.begin(), keys.end(), is_it)) continue;
      std::string otherwise = fmt::format("law {} needs it", laws_with(p.name));
      if (section != "body.material") {
        otherwise = "the body's";
      } else if (p.count == 3) {
        const double* v = p.vector_fallback;
        otherwise = ParameterValue(Vec3d{v[0], v[1], v[2]}).text();
      } else if (!p.required()) {
        otherwise = fmt::format("{:g}", p.fallback);
      }
      SceneKey key{.section = section, .name = p.name,
                   .type = p.count == 3 ? KeyType::vector : KeyType::number, .unit = p.unit,
                   .otherwise = otherwise,
                   .range = {p.low, p.high, p.open},
                   .meaning = fmt::format("With law = {}: {}", laws_with(p.name), p.meaning)};
      if (p.is_curve()) {
        key.type = KeyType::curve;
        key.curve = {.x = "x", .y = "y", .x_words = fmt::format("x ({}) ascends from {}0", p.argument, p.starts_above_zero ? "above " : ""),
                     .x_range = {0, 1e18, false}, .from_zero = !p.starts_above_zero,
                     .most_points = static_cast<std::size_t>(p.points)};
      }
      keys.push_back(std::move(key));
    }
  }
  return keys;
}

std::vector<SceneKey> top_keys() {
  return {
      {.name = "title", .type = KeyType::text, .otherwise = "none",
       .meaning = "Shown in summaries and kept in the output."},
      {.name = "gravity", .type = KeyType::vector, .unit = "m/s^2", .fallback = "[0, 0, 0]",
       .range = within(1e12), .meaning = "Acceleration of every free phyxel. The Earth's is [0, 0, -9.81]."},
      {.name = "time", .type = KeyType::table, .otherwise = "see meaning",
       .meaning = "Duration and steps. Required, but for the method \"equilibrium\"."},
      {.name = "solver", .type = KeyType::table, .otherwise = "its defaults",
       .meaning = "Device and precision."},
      {.name = "output", .type = KeyType::table, .otherwise = "its defaults",
       .meaning = "Trajectory and checkpoints."},
      {.name = "render", .type = KeyType::table, .otherwise = "its defaults",
       .meaning = "Pictures."},
      {.name = "body", .type = KeyType::tables, .required = true,
       .meaning = "The bodies; at most 10000, copies included."},
      {.name = "obstacle", .type = KeyType::tables, .otherwise = "none",
       .meaning = "Rigid bodies that others cannot enter; at most 1000."},
      {.name = "contact", .type = KeyType::table, .otherwise = "bodies pass through each other",
       .meaning = "How bodies touch each other."},
      {.name = "probe", .type = KeyType::tables, .otherwise = "none",
       .meaning = "Places whose values are logged."},
  };
}

std::vector<SceneKey> run_keys() {
  return {
      {.section = "time", .name = "end", .unit = "s", .required = true, .range = {0, 1e9, true},
       .meaning = "Simulated time."},
      {.section = "time", .name = "step", .type = KeyType::number_or_word, .unit = "s",
       .fallback = "\"adaptive\"", .range = time_span(), .words = {"adaptive", "auto"},
       .meaning = "Time step. \"adaptive\" (or \"auto\"): `safety` times the largest stable step, which "
           "is found from the stiffness of the bodies; three digits of it. It is halved where a law "
           "stiffens, and doubled again later. A given step is only halved; one above the largest "
           "is refused. The method \"implicit\" needs one, of any size."},
      {.section = "time", .name = "safety", .fallback = "0.8", .range = strictly_between(0, 1),
       .meaning = "Fraction of the largest stable step; not with a given `step`."},

      {.section = "solver", .name = "method", .type = KeyType::choice, .fallback = "\"verlet\"",
       .words = {"verlet", "implicit", "equilibrium"},
       .meaning = "\"verlet\": explicit steps. \"implicit\": steps of `time.step`, however stiff "
           "the bodies are; what is faster than a step is damped away. \"equilibrium\": where the "
           "scene comes to rest under its whole loads, without steps; `[time]`, velocities and "
           "damping play no part, frame 0 is the start and frame 1 rest."},
      {.section = "solver", .name = "device", .type = KeyType::choice, .fallback = "\"auto\"",
       .words = {"auto", "cpu", "cuda"},
       .meaning = "\"auto\": a GPU if there is one and phyxel was built for it, else the CPU."},
      {.section = "solver", .name = "precision", .type = KeyType::choice, .fallback = "\"float\"",
       .words = {"float", "double", "mixed"},
       .meaning = "\"mixed\": positions in double, forces in float. The methods \"implicit\" and "
           "\"equilibrium\" compute in double, which is then the default."},
      {.section = "solver", .name = "threads", .type = KeyType::integer, .fallback = "0",
       .range = between(0, 4096),
       .meaning = "CPU threads; 0: all. The results are the same on any number."},

      {.section = "output", .name = "directory", .type = KeyType::path, .otherwise = "see meaning",
       .meaning = "Folder for everything written, resolved from the scene file's folder. Without "
           "it: `out/<name>` in the folder the program runs in, where the name is the "
           "file's, or its folder's if the file is called `scene.toml`."},
      {.section = "output", .name = "frames_per_second", .unit = "1/s", .fallback = "25",
       .range = between(0, 1e6), .meaning = "Frames per simulated second; 0: only the last frame."},
      {.section = "output", .name = "phyxels", .type = KeyType::boolean, .fallback = "true",
       .meaning = "Write the phyxels."},
      {.section = "output", .name = "surface", .type = KeyType::boolean, .fallback = "true",
       .meaning = "Write the deformed surface, if a body has surfels."},
      {.section = "output", .name = "fields", .type = KeyType::choices,
       .fallback = "[\"displacement\", \"velocity\"]",
       .words = field_names(), .meaning = field_meanings()},
      {.section = "output", .name = "recovery", .type = KeyType::boolean, .fallback = "true",
       .meaning = "Recovers the gradients of phyxels on the surface for stresses and strains of frames and "
           "probes, and keeps the tractions that the balance of forces gives. Phyxels that have yielded "
           "keep their own gradients. false: all phyxels keep them."},
      {.section = "output", .name = "checkpoint_every", .unit = "s", .fallback = "300",
       .range = between(0, 1e9),
       .meaning = "Wall-clock time between checkpoints; 0: only one, at the end."},

      {.section = "render", .name = "pictures", .type = KeyType::boolean, .fallback = "false",
       .meaning = "Write pictures (PNG). `view`, `up` and `camera` also serve `phyxel render` and `phyxel report`."},
      {.section = "render", .name = "count", .type = KeyType::integer, .fallback = "6",
       .range = between(1, 100000),
       .meaning = "How many, spread evenly over the frames, first and last included."},
      {.section = "render", .name = "width", .type = KeyType::integer, .unit = "pixels",
       .fallback = "960", .range = between(16, 8192), .meaning = "Width of a picture."},
      {.section = "render", .name = "height", .type = KeyType::integer, .unit = "pixels",
       .fallback = "720", .range = between(16, 8192), .meaning = "Height of a picture."},
      {.section = "render", .name = "view", .type = KeyType::vector, .otherwise = "[-1, 2, -0.6], turned as z is to `up`",
       .range = within(longest), .meaning = "Direction the camera looks along."},
      {.section = "render", .name = "up", .type = KeyType::vector, .otherwise = "against `gravity`; [0, 0, 1] if there is none",
       .range = within(longest), .meaning = "Direction that points up in the picture; not parallel to `view`."},
      {.section = "render", .name = "camera", .type = KeyType::table, .otherwise = "it sees the whole motion along `view`",
       .meaning = "Place and movement of the camera."},

      {.section = "render.camera", .name = "position", .type = KeyType::vector, .unit = "m", .otherwise = "where it sees all bodies",
       .range = within(longest), .meaning = "Place of the camera. With a `target` it looks towards that, without one along `view`."},
      {.section = "render.camera", .name = "target", .type = KeyType::vector, .unit = "m", .otherwise = "the middle of the motion",
       .range = within(longest), .meaning = "Point in the middle of the picture, about which an orbit goes. Without a `position` the camera looks along `view` from where it sees all bodies."},
      {.section = "render.camera", .name = "field_of_view", .unit = "degrees", .fallback = "30",
       .range = between(1, 150), .meaning = "Angle of view along the shorter side of the picture."},
      {.section = "render.camera", .name = "orbit", .unit = "degrees", .fallback = "0",
       .range = between(-36000, 36000), .meaning = "Angle by which the camera turns about `up` around its target, from the first picture to the last. A report opens without a turn."},
      {.section = "render.camera", .name = "follow", .type = KeyType::text, .otherwise = "none",
       .meaning = "Name of a body: camera and target move with the centre of its points, or of mass of a free rigid body, from where they are at the first frame."},
  };
}

std::vector<SceneKey> body_keys() {
  return {
      {.section = "body", .name = "name", .type = KeyType::text,
       .otherwise = "the shape's or file's name",
       .meaning = "For messages and summaries. No two bodies share one."},
      {.section = "body", .name = "shape", .type = KeyType::text, .otherwise = "none",
       .meaning = "A built-in shape: beam, block, cylinder, sphere, alien_head, horn_bug, dino."},
      {.section = "body", .name = "mesh", .type = KeyType::path, .otherwise = "none",
       .meaning = "A closed surface to fill with phyxels: OBJ, PLY or STL. Its vertices become "
           "the surfels. Resolved from the scene file's folder."},
      {.section = "body", .name = "file", .type = KeyType::path, .otherwise = "none",
       .meaning = "A body made by `phyxel sample`. Resolved from the scene file's folder."},
      {.section = "body", .name = "cloud", .type = KeyType::text, .otherwise = "none",
       .meaning = "The name of a cloud that a program passes; not for `phyxel run`."},
      {.section = "body", .name = "phyxels", .type = KeyType::integer, .otherwise = "none",
       .range = between(1, largest_index),
       .meaning = "How many: exactly for a mesh or a fitted shape, about for a lattice."},
      {.section = "body", .name = "spacing", .unit = "m", .otherwise = "from `phyxels`",
       .range = length(), .meaning = "Distance between the phyxels of a shape."},
      {.section = "body", .name = "size", .type = KeyType::vector, .unit = "m",
       .otherwise = "none", .range = length(),
       .meaning = "Extents along x, y and z of a beam or block."},
      {.section = "body", .name = "radius", .unit = "m", .otherwise = "none", .range = length(),
       .meaning = "Of a cylinder or sphere."},
      {.section = "body", .name = "length", .unit = "m", .otherwise = "none", .range = length(),
       .meaning = "Of a cylinder."},
      {.section = "body", .name = "lattice", .type = KeyType::choice, .otherwise = "the most accurate: nodes in beams and blocks; fitted in cylinders and spheres, "
           "and where a ball, or a box turned against the body, holds or moves a part; cells in what is "
           "thinner than a spacing, and with `volumes = \"kernel\"`",
       .words = {"cells", "nodes", "fitted"},
       .meaning = "Phyxels of a shape: \"cells\", in the middle of each cell of a lattice; \"nodes\", on flat faces "
           "too, in a beam and block at the cells' corners (not in a sphere); \"fitted\", on all faces, as in "
           "a body from a mesh, not in a lattice: exactly `phyxels` of them, or one for each cube of `spacing`; needs "
           "surfels, and no jitter. In a lattice, a ball, a turned box, and a box that cuts a round side hold the phyxels that "
           "they contain; fitted shapes have phyxels on their boundaries."},
      {.section = "body", .name = "jitter", .fallback = "0", .range = between(0, 0.5),
       .meaning = "Each phyxel of a lattice is moved at random by up to this many spacings."},
      {.section = "body", .name = "seed", .type = KeyType::integer, .fallback = "1",
       .range = at_least(0), .meaning = "Of the random numbers; the same seed, the same body."},
      {.section = "body", .name = "relaxations", .type = KeyType::integer, .fallback = "30",
       .range = between(0, 10000), .meaning = "Sweeps that spread the phyxels of a mesh evenly."},
      {.section = "body", .name = "on_surface", .type = KeyType::boolean, .otherwise = "if the mesh allows it, and not with `volumes = \"kernel\"`",
       .meaning = "Whether phyxels of a mesh lie on its surface, too, on its corners and along its "
           "sharp edges: far more accurate in bending, with `closure` above all. Needs a closed "
           "mesh that does not overlap itself, and enough phyxels."},
      {.section = "body", .name = "grading", .type = KeyType::table, .otherwise = "one distance between phyxels everywhere",
       .meaning = "Where the phyxels of a mesh, or of a fitted shape, are nearer to each other than elsewhere."},
      {.section = "body", .name = "surfels", .type = KeyType::boolean, .fallback = "true",
       .meaning = "Whether a built-in shape gets its surfels."},
      {.section = "body", .name = "scale", .fallback = "1", .range = length(),
       .meaning = "Applied first, about the origin."},
      {.section = "body", .name = "rotation", .type = KeyType::vector, .unit = "degrees",
       .fallback = "[0, 0, 0]",
       .range = within(largest_angle), .meaning = "Axis times angle, applied second: [0, 0, 90] turns x towards y."},
      {.section = "body", .name = "translation", .type = KeyType::vector, .unit = "m",
       .fallback = "[0, 0, 0]", .range = within(longest), .meaning = "Applied last."},
      {.section = "body", .name = "velocity", .type = KeyType::vector, .unit = "m/s",
       .fallback = "[0, 0, 0]", .range = within(fastest), .meaning = "At the start."},
      {.section = "body", .name = "spin", .type = KeyType::vector, .unit = "rad/s",
       .fallback = "[0, 0, 0]",
       .range = within(fastest), .meaning = "Angular velocity about the centre of mass at the start."},
      {.section = "body", .name = "volumes", .type = KeyType::choice, .fallback = "\"automatic\"",
       .words = {"automatic", "geometry", "kernel"},
       .meaning = "Phyxel volumes: \"geometry\" takes those the body carries, \"kernel\" the rule "
           "of Müller et al. 2004 (mass over kernel density, as in Farias et al. 2008); "
           "\"automatic\" is geometry where the body has volumes, else kernel. Masses have each "
           "material's density."},
      {.section = "body", .name = "closure", .type = KeyType::number_or_word,
       .fallback = "\"auto\"", .range = between(0, 1), .words = {"auto"},
       .meaning = "Closes the sums of gradients over neighbourhoods to within this share of the "
           "surface's areas, so that a uniform stress leaves no forces inside, however irregular "
           "the phyxels are: without it, irregular bodies are some percent off, however many "
           "phyxels they have. 1e-3 is plenty. 0: as they come. Needs a closed surface, and "
           "symmetric lists. \"auto\": 0.01 for bodies that have both; 0 for all other bodies, "
           "for lattices without jitter, for the paper's bodies, and with the kernel's volumes."},
      {.section = "body", .name = "material", .type = KeyType::table, .required = true,
       .meaning = "What the body is made of."},
      {.section = "body", .name = "neighbours", .type = KeyType::table,
       .otherwise = "its defaults", .meaning = "Which phyxels interact."},
      {.section = "body", .name = "array", .type = KeyType::table, .otherwise = "one body",
       .meaning = "Repeats the body on a grid."},
      {.section = "body", .name = "inclusion", .type = KeyType::tables, .otherwise = "none",
       .meaning = "Phyxels of another material."},
      {.section = "body", .name = "fixed", .type = KeyType::tables, .otherwise = "none",
       .meaning = "Phyxels held where they are."},
      {.section = "body", .name = "symmetry", .type = KeyType::tables, .otherwise = "none",
       .meaning = "Planes of symmetry at which the body ends."},
      {.section = "body", .name = "motion", .type = KeyType::tables, .otherwise = "none",
       .meaning = "Phyxels moved along a path."},
      {.section = "body", .name = "load", .type = KeyType::tables, .otherwise = "none",
       .meaning = "Forces on phyxels."},
      {.section = "body", .name = "traction", .type = KeyType::tables, .otherwise = "none",
       .meaning = "Forces and pressures on the surface."},
      {.section = "body", .name = "fracture", .type = KeyType::table, .otherwise = "the body does not break",
       .meaning = "How the body breaks."},
      {.section = "body", .name = "notch", .type = KeyType::tables, .otherwise = "none",
       .meaning = "Discs and surfaces along which the body is cut before it moves."},

      {.section = "body.material", .name = "young", .unit = "Pa", .otherwise = "required by laws that have it",
       .range = between(1e-12, stiffest), .meaning = "Young's modulus E: rubber 1e6, jelly 1e4."},
      {.section = "body.material", .name = "poisson", .otherwise = "required by laws that have it",
       .range = strictly_between(-1, 0.5),
       .meaning = "Poisson's ratio; 0.3 for most solids, near 0.5 for what keeps its volume."},
      {.section = "body.material", .name = "density", .unit = "kg/m^3", .required = true,
       .range = between(1e-12, stiffest), .meaning = "Mass density at rest: water 1000."},
      {.section = "body.material", .name = "law", .type = KeyType::choice,
       .otherwise = default_laws(), .words = law_names(), .meaning = law_meanings()},
      {.section = "body.material", .name = "volume_stiffness", .unit = "Pa", .fallback = "0",
       .range = between(0, stiffest),
       .meaning = "Extra resistance to a change of volume (Müller et al. 2004); 0: none."},
      {.section = "body.material", .name = "damping", .unit = "1/s", .fallback = "0",
       .range = between(0, 1e12),
       .meaning = "Slows every velocity v by damping * v each second; 0: none."},
      {.section = "body.material", .name = "viscosity", .unit = "s", .fallback = "0",
       .range = between(0, 1e9),
       .meaning = "Kelvin-Voigt damping, in proportion to the stiffness: a relaxation time tau. A "
           "mode of angular frequency omega is damped by the share tau omega / 2 of critical "
           "damping; rigid motion is not damped. 0: none."},
      {.section = "body.material", .name = "hourglass", .otherwise = "0.1; 0 for the paper's bodies, and with one-sided lists", .range = between(0, 1e6),
       .meaning = "Strength of hourglass control, as a share of E (`young`, or what follows from "
           "the parameters of a law without it): energy of what does not "
           "follow the linear fit of its neighbourhood; 0.1 holds the modes that a phyxel does not "
           "see; 0: none. Needs symmetric lists. With inclusions, a share of the smallest "
           "E."},

      {.section = "body.inclusion", .name = "young", .unit = "Pa", .otherwise = "the body's",
       .range = between(1e-12, stiffest), .meaning = "Young's modulus E."},
      {.section = "body.inclusion", .name = "poisson", .otherwise = "the body's",
       .range = strictly_between(-1, 0.5), .meaning = "Poisson's ratio."},
      {.section = "body.inclusion", .name = "density", .unit = "kg/m^3", .otherwise = "the body's",
       .range = between(1e-12, stiffest), .meaning = "Mass density at rest."},
      {.section = "body.inclusion", .name = "law", .type = KeyType::choice,
       .otherwise = "the body's", .words = law_names(),
       .meaning = "As in `[body.material]`."},
      {.section = "body.inclusion", .name = "volume_stiffness", .unit = "Pa",
       .otherwise = "the body's", .range = between(0, stiffest), .meaning = "As in `[body.material]`."},
      {.section = "body.inclusion", .name = "damping", .unit = "1/s", .otherwise = "the body's",
       .range = between(0, 1e12), .meaning = "As in `[body.material]`."},
      {.section = "body.inclusion", .name = "viscosity", .unit = "s", .otherwise = "the body's",
       .range = between(0, 1e9), .meaning = "As in `[body.material]`."},

      {.section = "body.neighbours", .name = "support", .type = KeyType::choice,
       .fallback = "\"automatic\"", .words = {"automatic", "uniform", "adaptive", "pairwise"},
       .meaning = "\"uniform\": one radius for the body; \"adaptive\": each phyxel its own, for "
           "bodies with thin parts or uneven clouds, without hourglass control and closed "
           "gradients; \"pairwise\": each phyxel its own, and each pair the mean of two, for graded "
           "clouds; \"automatic\": pairwise for clouds with spacings of their own, else uniform."},
      {.section = "body.neighbours", .name = "nearest", .type = KeyType::integer, .fallback = "10",
       .range = between(1, 1000),
       .meaning = "How many nearest phyxels the mean distance is taken over."},
      {.section = "body.neighbours", .name = "factor", .fallback = "1.8", .range = between(1, 20),
       .meaning = "Support radius over that mean distance. 1.8 gives about 32 neighbours; not "
           "with `radius`."},
      {.section = "body.neighbours", .name = "radius", .unit = "m",
       .otherwise = "from `factor` and `nearest`", .range = length(),
       .meaning = "The support radius itself."},
      {.section = "body.neighbours", .name = "max_neighbours", .type = KeyType::integer,
       .otherwise = "no limit", .range = between(1, 1000000),
       .meaning = "Keeps only the nearest ones, the maxNeighbors of Farias et al. 2008."},

      {.section = "body.array", .name = "count", .type = KeyType::counts, .required = true,
       .range = between(1, 10000), .meaning = "Copies along x, y and z."},
      {.section = "body.array", .name = "spacing", .type = KeyType::vector, .unit = "m",
       .required = true, .range = within(longest), .meaning = "Distance from copy to copy along x, y and z; not 0 where "
           "there is more than one."},
  };
}

std::vector<SceneKey> grading_keys() {
  return {
      {.section = "body.grading", .name = "ratio", .fallback = "4", .range = between(1, 10),
       .meaning = "Largest over smallest distance between neighbours."},
      {.section = "body.grading", .name = "growth", .fallback = "0.25", .range = between(0.05, 0.5),
       .meaning = "How fast the distance between neighbours grows along a path, by the path's length, at most."},
      {.section = "body.grading", .name = "per_radius", .otherwise = "8; 0 with finer regions", .range = between(0, 1000),
       .meaning = "Phyxels over a radius of curvature of the surface; 0: however it curves. Edges "
           "sharper than 40 degrees are no curvature."},
      {.section = "body.grading", .name = "across", .otherwise = "5; 2 with finer regions", .range = between(0, 1000),
       .meaning = "Phyxels through thin places, as far as `ratio` allows; at least 2, whatever is asked."},
      {.section = "body.grading", .name = "finer", .type = KeyType::tables, .otherwise = "none",
       .meaning = "Regions in which phyxels are nearer to each other."},
      {.section = "body.grading.finer", .name = "by", .otherwise = "`ratio`", .range = between(1, 10),
       .meaning = "Largest distance between neighbours over the one in the region; at most `ratio`."},
  };
}

std::vector<SceneKey> boundary_keys() {
  const std::vector<std::string> axes = {"x", "y", "z", "xy", "xz", "yz", "xyz"};
  return {
      {.section = "body.fixed", .name = "axes", .type = KeyType::choice, .fallback = "\"xyz\"",
       .words = axes,
       .meaning = "Along which axes they are held; along the others they are free, as on rollers."},

      {.section = "body.symmetry", .name = "normal", .type = KeyType::choice, .required = true,
       .words = {"x", "y", "z"}, .meaning = "Normal of the plane, an axis of the scene."},
      {.section = "body.symmetry", .name = "at", .unit = "m", .fallback = "0", .range = within(10 * longest),
       .meaning = "Coordinate of the plane along its normal, once the body is in place. The body ends there."},

      {.section = "body.motion", .name = "axes", .type = KeyType::choice, .fallback = "\"xyz\"",
       .words = axes,
       .meaning = "Along which axes they are moved; along the others they are free."},

      {.section = "body.load", .name = "force", .type = KeyType::vector, .unit = "N",
       .fallback = "[0, 0, 0]", .range = within(largest_force), .meaning = "Total, shared among the phyxels by mass."},
      {.section = "body.load", .name = "force_density", .type = KeyType::vector, .unit = "N/m^3",
       .fallback = "[0, 0, 0]", .range = within(largest_force), .meaning = "Force per volume at rest."},
      {.section = "body.load", .name = "ramp", .unit = "s", .fallback = "0", .range = between(0, 1e9),
       .meaning = "Time over which the force grows from zero; 0: at once."},
      {.section = "body.load", .name = "curve", .type = KeyType::curve, .otherwise = "none", .range = within(largest_factor),
       .meaning = "Factor of the force by time, in place of `ramp`: linear between the points, constant before the first and "
           "after the last. [[0, 0], [1, 2], [3, -1]] grows to twice the force in 1 s and turns round in the next 2 s. The "
           "method \"equilibrium\" takes the last factor."},

      {.section = "body.traction", .name = "traction", .type = KeyType::vector, .unit = "Pa",
       .fallback = "[0, 0, 0]", .range = within(stiffest), .meaning = "Force per area at rest."},
      {.section = "body.traction", .name = "pressure", .unit = "Pa", .fallback = "0", .range = within(stiffest),
       .meaning = "Force per area against the outward normal; negative: along it."},
      {.section = "body.traction", .name = "follower", .type = KeyType::boolean, .fallback = "false",
       .meaning = "Whether the pressure acts on the deformed surface, against its normals, as that of a gas or a liquid; "
           "else its force stays as it is at rest."},
      {.section = "body.traction", .name = "gas", .otherwise = "none", .range = between(0, 100),
       .meaning = "Exponent g of a gas in a cavity of the body, whose whole surface is selected: its pressure is `pressure` "
           "times (volume at rest / volume)^g, on the deformed surface. 1: at constant temperature; 1.4: air that changes fast."},
      {.section = "body.traction", .name = "normal", .type = KeyType::vector, .otherwise = "everywhere",
       .range = within(longest),
       .meaning = "Only where the outward normal at rest has nearly this direction."},
      {.section = "body.traction", .name = "angle", .unit = "degrees", .fallback = "45", .range = between(0, 180),
       .meaning = "Largest angle between the normal and that direction."},
      {.section = "body.traction", .name = "ramp", .unit = "s", .fallback = "0", .range = between(0, 1e9),
       .meaning = "Time over which the force grows from zero; 0: at once."},
      {.section = "body.traction", .name = "curve", .type = KeyType::curve, .otherwise = "none", .range = within(largest_factor),
       .meaning = "Factor of the force by time, in place of `ramp`: linear between the points, constant before the first and "
           "after the last. [[0, 0], [1, 2], [3, -1]] grows to twice the force in 1 s and turns round in the next 2 s. The "
           "method \"equilibrium\" takes the last factor. Of a gas no factor is negative."},

  };
}

std::vector<SceneKey> place_keys() {
  return {
      {.section = "probe", .name = "name", .type = KeyType::text, .otherwise = "\"probe 1\", \"probe 2\", ...",
       .meaning = "The probe's name in `probes.csv`."},
      {.section = "probe", .name = "body", .type = KeyType::text, .otherwise = "the only body",
       .meaning = "The name of the body that the probe is in."},
      {.section = "probe", .name = "point", .type = KeyType::vector, .unit = "m", .otherwise = "none",
       .range = within(10 * longest), .meaning = "At rest; not farther from a phyxel of the body than half a support radius, about a spacing."},
      {.section = "probe", .name = "from", .type = KeyType::vector, .unit = "m", .otherwise = "none",
       .range = within(10 * longest), .meaning = "Start of a line of points, as near to a phyxel as a `point`."},
      {.section = "probe", .name = "to", .type = KeyType::vector, .unit = "m", .otherwise = "none",
       .range = within(10 * longest), .meaning = "End of the line."},
      {.section = "probe", .name = "points", .type = KeyType::integer, .fallback = "11",
       .range = between(2, 1000), .meaning = "Number of points on the line, ends included."},

      {.section = "selection", .name = "region", .type = KeyType::text, .otherwise = "none",
       .meaning = "A named region of the body: \"x-\", \"x+\", \"y-\", \"y+\", \"z-\", \"z+\" are "
           "the outermost layers of a beam or block, \"z-\" and \"z+\" the ends of a "
           "cylinder; the alien head has a \"neck\", the horn bug a \"leg\", the dino a "
           "\"mouth\". Of a mesh, a named group of its triangles."},
      {.section = "selection", .name = "indices", .type = KeyType::indices, .otherwise = "none",
       .range = between(0, largest_index), .meaning = "Phyxels of the body, counted from 0."},
      {.section = "selection", .name = "box", .type = KeyType::box, .unit = "m",
       .otherwise = "none", .range = within(10 * longest), .meaning = "Lowest and highest corner."},
      {.section = "selection", .name = "ball", .type = KeyType::table, .otherwise = "none",
       .meaning = "Centre and radius."},
      {.section = "selection", .name = "mesh", .type = KeyType::path, .otherwise = "none",
       .meaning = "A file with a closed surface (OBJ, PLY or STL), scaled, rotated and translated as the body is: what "
           "lies inside or on it, such as the core of another material. Not for tractions."},
      {.section = "selection", .name = "all", .type = KeyType::boolean, .otherwise = "none",
       .meaning = "Only `true`: the whole body."},

      {.section = "selection.ball", .name = "centre", .type = KeyType::vector, .unit = "m",
       .required = true, .range = within(10 * longest), .meaning = "Of the ball."},
      {.section = "selection.ball", .name = "radius", .unit = "m", .required = true,
       .range = between(shortest, 10 * longest), .meaning = "Of the ball."},
  };
}

// clang-format on

}  // namespace

std::span<const SceneKey> scene_keys() {
  static const std::vector<SceneKey> all = [] {
    std::vector<SceneKey> keys;
    for (const auto& part : {top_keys(), run_keys(), body_keys(), law_keys("body.material"),
                             law_keys("body.inclusion"), grading_keys(), path_keys("body.motion"),
                             boundary_keys(), fracture_keys(), path_keys("obstacle.motion"),
                             obstacle_keys(), contact_keys(), place_keys()}) {
      keys.insert(keys.end(), part.begin(), part.end());
    }
    return keys;
  }();
  return all;
}

}  // namespace phyxel
