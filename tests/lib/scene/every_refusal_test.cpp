/// Wrong scenes of every kind, made from the table of keys and taken as far as `phyxel run
/// --dry-run` takes them: the error names the file, the key or body, and the value.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "phyxel/backend.hpp"
#include "phyxel/body_file.hpp"
#include "phyxel/model.hpp"
#include "phyxel/probes.hpp"
#include "phyxel/solver.hpp"
#include "scene/scene_error.hpp"
#include "support/clouds.hpp"
#include "support/scene_with.hpp"

namespace phyxel {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

class EveryRefusal : public SceneFiles {
 protected:
  /// What is said of a scene up to its plan, and of a search for equilibrium up to its end.
  std::string refusal_of(const std::string& text) {
    const fs::path file = write("wrong.toml", text);
    try {
      const Scene scene = read_scene(file);
      const Model model = build_model(scene);
      const auto backend = make_cpu_backend(model, scene.solver.precision, 1);
      const Probes probes(model);
      const StepPlan plan = plan_steps(scene, model, *backend);
      const State start = initial_state(model, scene, plan.dt);
      if (scene.solver.method != Method::equilibrium) return "accepted";
      Solver solver(model, *backend, start, scene.solver.method);
      naming(scene, [&] { solver.step(); });
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::bad_input) << error.what();
      return error.what();
    }
    return "accepted";
  }
  /// The refusal names the file first and what is wrong, in one line.
  void expect_named(const std::string& text, const std::vector<std::string>& names) {
    const std::string message = refusal_of(text);
    EXPECT_THAT(message, StartsWith((folder_ / "wrong.toml").string() + ":")) << text;
    for (const std::string& name : names) EXPECT_THAT(message, HasSubstr(name)) << text;
    EXPECT_THAT(message, Not(HasSubstr("\n"))) << text;
    ++refused_;
  }
  int refused_ = 0;
};

/// Values as TOML, with the types that take them.
struct Value {
  const char* text;
  const char* shown;
  std::set<KeyType> taken_by;
};

const std::vector<Value>& values() {
  using enum KeyType;
  static const std::vector<Value> all = {
      {"true", "true", {boolean}},
      {"'nonsense'", "\"nonsense\"", {text, path, choice}},
      {"''", "\"\"", {choice}},
      {"3.25", "3.25", {number, number_or_word}},
      {"nan", "nan", {}},
      {"-inf", "-inf", {}},
      {"[]", "empty list", {choices}},
      {"[1, 2]", "[1, 2]", {indices}},
      {"[1, 2, 3, 4]", "[1, 2, 3, 4]", {indices}},
      {"[1, 2, 'x']", "\"x\"", {}},
      {"[[0, 0, 0], [1, 1]]", "[1, 1]", {}},
      {"{a = 1}", "", {table, tables}},
      {"1979-05-27", "a date or time", {}},
  };
  return all;
}

TEST_F(EveryRefusal, OfAWrongTypeNamesFileKeyAndValue) {
  for (const SceneKey& key : scene_keys()) {
    for (const Value& value : values()) {
      if (value.taken_by.contains(key.type)) continue;
      expect_named(scene_with(key, value.text), {"key " + path_in_file(key), " found"});
    }
  }
  EXPECT_GT(refused_, 700);
}

TEST_F(EveryRefusal, OfAMisspeltOrRepeatedKeyNamesFileAndKey) {
  for (const SceneKey& key : scene_keys()) {
    SceneKey misspelt = key;
    misspelt.name += "q";
    expect_named(scene_with(misspelt, "1"),
                 {"key " + path_in_file(misspelt) + ": unknown", "did you mean \"" + key.name});
    const std::string line = key.name + " = 1\n";
    std::string twice = scene_with(key, "1");
    twice.insert(twice.find(line), line);
    expect_named(twice, {"cannot redefine existing integer", key.name});
  }
  EXPECT_GT(refused_, 150);
}

const std::string still = "[time]\nend = 1e-3\n[solver]\nthreads = 1\n";
const std::string bar = "[[body]]\nshape = 'beam'\nsize = [0.4, 0.1, 0.1]\nspacing = 0.05\n";

/// A scene of one bar with these lines after its material.
std::string with_bar(const std::string& lines, const std::string& time = still) {
  return time + bar + material + lines;
}
/// A scene whose body is these lines.
std::string with_body(const std::string& lines) {
  return still + "[[body]]\n" + lines + "\n" + material;
}

struct Late {
  std::string text;
  std::vector<std::string> names;
};

/// Tractions, and loads that act nowhere.
std::vector<Late> refused_loads() {
  const std::string step = "[time]\nend = 1.0\nstep = 1e-4\n";
  return {
      {with_bar("[[body.traction]]\nregion = 'end'\npressure = 1\n"),
       {":14:", "the surface of body \"beam\" has no group \"end\"; it has: x+, x-"}},
      {with_bar("[[body.traction]]\nall = true\n"), {":13:", "traction, pressure"}},
      {with_bar("[[body.traction]]\nall = true\npressure = 1\ntraction = [1, 0, 0]\n"),
       {"found together with", "exactly one of: traction, pressure"}},
      {with_bar("[[body.traction]]\nall = true\npressure = nan\n"), {":15:", "pressure"}},
      {with_bar("[[body.traction]]\nall = true\ntraction = [1, 0, 0]\nfollower = true\n"),
       {":16:", "follower", "found without pressure"}},
      {with_bar("[[body.traction]]\nall = true\ntraction = [1, 0, 0]\ngas = 1.4\n"),
       {":16:", "gas", "found without pressure"}},
      {with_bar("[[body.traction]]\nall = true\npressure = -1\ngas = 1.4\n"),
       {":16:", "gas", "pressure = -1", "a pressure > 0"}},
      {with_bar("[[body.traction]]\nall = true\npressure = 1\ngas = 1.4\nfollower = false\n"),
       {":16:", "gas", "follower = false"}},
      {with_bar("[[body.traction]]\nall = true\npressure = 1\ngas = 1.4\n"),
       {":14:", "body.traction.gas", "not around a cavity", "the whole surface of a cavity"}},
      {with_bar("[[body.traction]]\nall = true\npressure = 1\ngas = 1.4\nnormal = [1, 0, 0]\n"),
       {":14:", "body.traction.gas", "are not closed"}},
      {with_bar("[[body.traction]]\nall = true\npressure = 1\nangle = 3\n"),
       {":16:", "angle", "found without normal"}},
      {with_bar("[[body.traction]]\nall = true\npressure = 1\nnormal = [0, 0, 0]\n"),
       {":16:", "allowed: a direction"}},
      {with_bar("[[body.traction]]\nbox = [[7, 7, 7], [8, 8, 8]]\npressure = 1\n"),
       {":14:", "acts on no part of the surface of body \"beam\""}},
      {with_bar("[[body.load]]\nbox = [[0.4, -9, -9], [0.4, 9, 9]]\nforce_density = [1, 0, 0]\n"),
       {":14:", "holds no part of the inside of body \"beam\""}},
      {step + bar + material + "[[body.traction]]\nall = true\npressure = 1\nramp = 1e-5\n",
       {"time.step = 0.0001 s", "body.traction.ramp = 1e-05 s"}},
      {step + bar + material +
           "[[body.traction]]\nall = true\npressure = 1\ncurve = [[0, 2], [1e-5, 0]]\n",
       {"time.step = 0.0001 s", "body.traction.curve", "1e-05 s"}},
      {with_bar("[[body.load]]\nall = true\nforce = [1, 0, 0]\ncurve = [[0, 2], [0, 1]]\n"),
       {":16:", "body.load.curve", "[0, 1] found", "times ascend"}},
      {with_bar("[[body.traction]]\nall = true\npressure = 1\ngas = 1\ncurve = [[0, -2]]\n"),
       {":14:", "body.traction.curve", "-2 found at 0 s", "allowed with gas: none below 0"}}};
}

/// Planes of symmetry at which no body ends.
std::vector<Late> refused_planes() {
  const std::string one = "[[body.symmetry]]\n";
  return {{with_bar(one), {":13:", "body.symmetry.normal", "missing"}},
          {with_bar(one + "normal = 'x'\nat = 0.1\n"),
           {":15:6: key body.symmetry.at", "x = 0.1 m cuts the body",
            "extends 0.1 m to x- and 0.3 m to x+", "an end of body \"beam\", x = 0 or 0.4 m"}},
          {with_bar(one + "normal = 'y'\n"), {":13:", "y = 0 m cuts the body", "0.05 m to y-"}},
          {with_bar(one + "normal = 'z'\nat = 3\n"),
           {":15:", "z = 3 m is 2.95 m away from the body", "z = -0.05 or 0.05 m"}}};
}

/// Probes that are nowhere, or of nothing.
std::vector<Late> refused_probes() {
  const std::string one = "[[probe]]\n";
  return {{with_bar(one),
           {":13:", "exactly one of: point, from, region, indices, box, ball, mesh, all"}},
          {with_bar(one + "point = [0, 0, 0]\nall = true\n"), {"exactly one of"}},
          {with_bar(one + "from = [0, 0, 0]\n"), {"from", "to"}},
          {with_bar(one + "point = [0, 0, 0]\npoints = 4\n"), {":15:", "points", "from and to"}},
          {with_bar(one + "from = [0, 0, 0]\nto = [0.1, 0, 0]\npoints = 1\n"), {":16:", "points"}},
          {with_bar(one + "point = [0, 0, 0]\nbody = 'cow'\n"), {":15:", "\"cow\"", "\"beam\""}},
          {with_bar(one + "point = [0, 0, 0]\n[[probe]]\nname = 'probe 1'\nall = true\n"),
           {":16:", "\"probe 1\"", "a name of its own"}},
          {with_bar(one + "point = [0, 0, 0.3]\n"),
           {":14:9: ", "probe \"probe 1\"", "[0, 0, 0.3]", "nearest phyxel of body \"beam\"",
            "at most"}},
          {with_bar(one + "region = 'left'\n"), {":14:", "no region \"left\""}},
          {with_bar(one + "box = [[7, 7, 7], [8, 8, 8]]\n"), {":14:", "selects no phyxel"}}};
}

/// Obstacles of no shape, or with keys that do not go together.
std::vector<Late> refused_obstacles() {
  const std::string one = "[[obstacle]]\n", floor = one + "shape = 'plane'\n";
  const std::string ball = one + "shape = 'sphere'\n", far = "translation = [0, 0, -9]\n";
  return {
      {with_bar(one), {":13:", "obstacle.shape", "missing"}},
      {with_bar(one + "shape = 'cone'\n"),
       {":14:", "cone", R"("plane", "sphere", "box", "cylinder", "capsule", "mesh")"}},
      {with_bar(ball + far), {":14:", "obstacle.radius", "missing", "shape = \"sphere\" needs it"}},
      {with_bar(ball + far + "radius = 0\n"), {":16:", "radius", "0 found"}},
      {with_bar(ball + far + "radius = -1\n"), {":16:", "radius", "-1 found"}},
      {with_bar(ball + far + "radius = 1\nlength = 2\n"),
       {":17:", "length", "shape = \"sphere\" does not use it", "allowed with it: radius"}},
      {with_bar(floor + far + "size = [1, 1, 1]\n"),
       {":16:", "size", "allowed with it: no length"}},
      {with_bar(one + "shape = 'mesh'\n" + far),
       {":14:", "obstacle.mesh", "missing", "shape = \"mesh\" needs it"}},
      {with_bar(floor + far + "mesh = 'ball.obj'\n"),
       {":16:", "mesh", "shape = \"plane\" does not use it"}},
      {with_bar(floor + far + "scale = 2\n"), {":16:", "scale", "allowed with a mesh only"}},
      {with_bar(one + "shape = 'mesh'\nmesh = 'gone.obj'\n"),
       {":15:", "gone.obj found, but there is no such file"}},
      {with_bar(one + "shape = 'mesh'\nmesh = 'flat.obj'\n"),
       {":13:1", "flat.obj: the surface is not closed"}},
      {with_bar(one + "shape = 'mesh'\nmesh = 'ball.obj'\nscale = 0\n"), {":16:", "scale"}},
      {with_bar(one + "shape = 'box'\nsize = [1, 0, 1]\n" + far), {":15:", "size"}},
      {with_bar(ball + far + "radius = 1\nnormal = [0, 0, 1]\n"),
       {":17:", "normal", "shape = \"sphere\"", "\"plane\""}},
      {with_bar(floor + far + "normal = [0, 0, 0]\n"), {":13:", "normal", "a direction"}},
      {with_bar(floor + far + "normal = [0, 0, 1]\nrotation = [9, 0, 0]\n"),
       {"normal", "rotation"}},
      {with_bar(floor + far + "friction = -0.1\n"), {":16:", "friction", "-0.1 found"}},
      {with_bar(floor + far + "restitution = 1.1\n"), {":16:", "restitution", "1.1 found"}},
      {with_bar(floor + far + "friction = 0.1\nkinetic_friction = 0.2\n"),
       {":13:", "kinetic_friction", "0.2 found, above a friction of 0.1"}},
      {with_bar(floor + far + "[obstacle.motion]\n"), {":16:", "motion"}},
      {with_bar(floor + far + "name = 'a'\n" + floor + far + "name = 'a'\n"),
       {":20:", "\"a\" found", "a name of its own"}},
      {with_bar(floor),
       {":13:1", "body \"beam\" is", "m deep in obstacle \"obstacle 1\"",
        "allowed: to touch it, or to begin outside"}},
      {still + bar + "surfels = false\n" + material + floor + far,
       {":5:1", "body \"beam\" has no surface"}}};
}

/// Contact of bodies that are not there, or of keys that do not go together.
std::vector<Late> refused_contacts() {
  const std::string contact = "[contact]\n", pair = contact + "[[contact.pair]]\n";
  return {{with_bar(contact + "friction = -0.1\n"), {":14:", "contact.friction", "-0.1 found"}},
          {with_bar(contact + "restitution = 2\n"), {":14:", "contact.restitution", "2 found"}},
          {with_bar(contact + "sweeps = 0\n"), {":14:", "contact.sweeps", "0 found"}},
          {with_bar(contact + "kinetic_friction = 0.1\n"),
           {":13:", "contact.kinetic_friction", "0.1 found, above a friction of 0"}},
          {with_bar(contact + "method = 'soft'\n"),
           {":14:", "contact.method", "\"soft\" found", R"("projected", "penalty")"}},
          {with_bar(contact + "stiffness = 0\n"), {":14:", "contact.stiffness", "0 found"}},
          {with_bar(contact + "method = 'penalty'\nrestitution = 0.5\n"),
           {":13:", "contact.restitution", "0.5 found with method = \"penalty\"", "allowed: 0"}},
          {with_bar(contact + "all = false\n"), {":13:", "contact.all", "nothing touches"}},
          {with_bar(pair + "first = 'beam'\n"), {":14:", "contact.pair.second", "missing"}},
          {with_bar(pair + "first = 'beam'\nsecond = 'bar'\n"),
           {":14:", "contact.pair.second", "\"bar\" found", "allowed: \"beam\""}},
          {with_bar(pair + "first = 'beam'\nsecond = 'beam'\n"),
           {":14:", "contact.pair.second", "\"beam\" found, the first body, too"}},
          {still + bar + "surfels = false\n" + material + contact + "self = true\n",
           {":5:1", "body \"beam\" has no surface"}}};
}

/// Gradings of bodies that cannot have them, and finer regions.
std::vector<Late> refused_gradings() {
  return {
      {with_body("mesh = 'flat.obj'\nphyxels = 50\n[body.grading]"),
       {":5:1", "flat.obj: ", "encloses no"}},
      {with_body("mesh = 'ball.obj'\nphyxels = 50\non_surface = false\n[body.grading]"),
       {":8:14", "on_surface", "false found", "no grading"}},
      {with_body("mesh = 'ball.obj'\nphyxels = 2147483647\n[body.grading]\nratio = 10"),
       {":5:1", "ball.obj: 2147483647", "GiB"}},
      {with_body("shape = 'beam'\nsize = [1, 1, 1]\nspacing = 0.5\n[body.grading]"),
       {":9:1", "grading", "lattice", "allowed: lattice = \"fitted\""}},
      {with_body("mesh = 'ball.obj'\nphyxels = 50\n[body.grading]\nratio = 3\n"
                 "[[body.grading.finer]]\nregion = 'x+'"),
       {":10:1", "box", "ball"}},
      {with_body("mesh = 'ball.obj'\nphyxels = 50\n[body.grading]\nratio = 3\n"
                 "[[body.grading.finer]]\nall = true\nball = {centre = [0, 0, 0], radius = 1}"),
       {":11:7", "body.grading.finer.all"}},
      {with_body("mesh = 'ball.obj'\nphyxels = 50\n[body.grading]\nratio = 3\n"
                 "[[body.grading.finer]]\nball = {centre = [0, 0, 0], radius = 1}\nby = 4"),
       {":12:6", "body.grading.finer.by", "4 found", "the ratio of the grading, 3"}},
  };
}

/// Shapes, meshes and files of which no body can be made.
std::vector<Late> refused_bodies() {
  const std::string fitted = "shape = 'sphere'\nradius = 1\nspacing = 0.2\nlattice = 'fitted'\n";
  const std::string mesh = "mesh = 'ball.obj'\nphyxels = 50\n";
  return {
      {with_body("shape = 'beam'\nsize = [1, 1, 1]\nspacing = 3"), {":5:1", "spacing = 3 m"}},
      {with_body(fitted + "jitter = 0.1"),
       {":9:11", "key body.lattice", "\"fitted\" found", "jitter = 0.1", "allowed: \"cells\""}},
      {with_body(fitted + "surfels = false"),
       {":9:11", "key body.lattice", "\"fitted\" found", "allowed: \"cells\", or surfels = true"}},
      {with_body(fitted + "volumes = 'kernel'"),
       {"key body.lattice", "\"fitted\"", "allowed: \"cells\""}},
      {with_body("shape = 'sphere'\nradius = 1\nspacing = 0.2\nlattice = 'nodes'"),
       {":9:11", "key body.lattice", "\"nodes\" found", "allowed: \"fitted\" or \"cells\""}},
      {with_body("shape = 'beam'\nsize = [1, 1, 1]\nspacing = 1e-6"), {":5:1", "phyxels"}},
      {with_body("shape = 'beam'\nsize = [1, 1, 1]\nphyxels = 2147483647"), {":5:1", "GiB"}},
      {with_body("mesh = 'ball.obj'\nphyxels = 2147483647"),
       {":5:1", "ball.obj: 2147483647", "GiB"}},
      {with_body("mesh = 'empty.obj'\nphyxels = 50"), {":5:1", "empty.obj: the file is empty"}},
      {with_body("mesh = 'flat.obj'\nphyxels = 50"), {":5:1", "flat.obj: the surface encloses no"}},
      {with_body("mesh = 'ball.txt'\nphyxels = 50"), {":5:1", "ball.txt: the extension"}},
      {with_body("mesh = 'flat.obj'\nphyxels = 50\non_surface = true"), {":5:1", "flat.obj: "}},
      {with_body(mesh + "on_surface = true"), {":5:1", "ball.obj: "}},
      {with_body("file = 'ball.obj'"), {":5:1", "ball.obj: not a file written by phyxel"}},
      {with_body("cloud = 'mine'"), {":5:1", "key body.cloud: \"mine\" found"}},
      {with_body("mesh = 'gone.obj'\nphyxels = 5"), {":6:8", "gone.obj"}},
  };
}

/// What only shows when the model is built or its steps are planned.
std::vector<Late> late_refusals() {
  const std::string implicit = "[solver]\nmethod = 'implicit'\nprecision = 'double'\n";
  const std::string rest = "[solver]\nmethod = 'equilibrium'\nprecision = 'double'\n";
  const auto step = [](const char* size) {
    return fmt::format("[time]\nend = 1.0\nstep = {}\n", size);
  };
  const std::string shake =
      "[[body.motion]]\nregion = 'x-'\namplitude = [0.01, 0, 0]\nfrequency = 2000\n";
  return {
      // Selections
      {with_bar("[[body.fixed]]\nregion = 'left'\n"), {":14:", "no region \"left\"", "x-"}},
      {with_bar("[[body.fixed]]\nindices = [77777]\n"), {":14:", "77777", "allowed 0 to"}},
      {with_bar("[[body.fixed]]\nbox = [[7, 7, 7], [8, 8, 8]]\n"), {":14:", "selects no phyxel"}},
      {with_bar(
           "[[body.motion]]\nball = {centre = [9, 0, 0], radius = 0.1}\nvelocity = [1, 0, 0]\n"),
       {":14:", "selects no phyxel"}},
      {with_bar("[[body.load]]\nregion = 'top'\nforce = [1, 0, 0]\n"), {":14:", "\"top\""}},
      {with_bar("[[body.fixed]]\nindices = [0]\n[[body.fixed]]\nregion = 'x-'\n"),
       {":14:", "selects no phyxel", "another support holds all", "leave this entry out"}},
      {with_bar("[[body.fixed]]\nregion = 'x-'\n" + shake),
       {":16:", "already fixed or moved by fixed 1"}},
      {with_bar("[[body.fixed]]\nbox = [[-1, -1, -1], [0.2, 1, 1]]\naxes = 'xy'\n"
                "[[body.fixed]]\nbox = [[0.2, -1, -1], [1, 1, 1]]\naxes = 'yz'\n"),
       {":17:", "fixed 2 of body \"beam\" shares phyxels with fixed 1", "\"xy\"", "\"yz\"",
        "allowed: "}},
      {with_bar("[[body.fixed]]\nbox = [[-1, -1, -1], [0.2, 1, 1]]\n"
                "[[body.motion]]\nbox = [[0.2, -1, -1], [1, 1, 1]]\nvelocity = [1, 0, 0]\n"),
       {":16:", "motion 1 of body \"beam\" shares a face with fixed 1", "\"xyz\"", "allowed: "}},
      // Inclusions
      {with_bar("[[body.inclusion]]\nbox = [[7, 7, 7], [8, 8, 8]]\nyoung = 1e6\n"),
       {":14:", "selects no phyxel"}},
      {with_bar("[[body.inclusion]]\nall = true\nyoung = 1e6\n"), {":14:", "no phyxel is left"}},
      // Steps
      {step("1.0") + bar + material, {"time.step = 1 s", "largest stable step"}},
      {step("1e-4") + bar + material + shake, {"time.step = 0.0001 s", "frequency = 2000 Hz"}},
      {step("1e-4") + bar + material +
           "[[body.load]]\nregion = 'x-'\nforce = [1, 0, 0]\nramp = 1e-5\n",
       {"time.step = 0.0001 s", "body.load.ramp = 1e-05 s"}},
      {step("1e-4") + bar + material + "damping = 1e6\n",
       {"time.step = 0.0001 s", "damping = 1e+06 1/s"}},
      {step("0.1") + implicit + bar + material + shake, {"time.step = 0.1 s", "2000 Hz"}},
      {"[time]\nend = 1.0\n" + implicit + bar + material, {"time.step = \"adaptive\""}},
      {"[time]\nend = 9e8\n" + bar +
           "[body.material]\nyoung = 1e18\npoisson = 0.3\ndensity = 1e-6\n",
       {"time.end = 9e+08 s", "below 1e15"}},
      {with_bar("volume_stiffness = 1e17\n"), {"body \"beam\"", "volume_stiffness = 1e+17 Pa"}},
      {with_bar("hourglass = 1e5\n"), {"body \"beam\"", "hourglass = 100000"}},
      // Searches for equilibrium
      {rest + bar + material + "[[body.load]]\nregion = 'x-'\nforce = [1, 0, 0]\n",
       {"body \"beam\""}},
      {rest + bar + material + shake, {"velocity or an amplitude never ends"}},
      // Supports, volumes, closed gradients
      {with_bar("hourglass = 0.1\n[body.neighbours]\nsupport = 'adaptive'\n"),
       {":5:1", "hourglass control (0.1)", "\"uniform\""}},
      {with_bar("[body.neighbours]\nsupport = 'pairwise'\nmax_neighbours = 20\n"),
       {"\"pairwise\"", "max_neighbours", "allowed: only one"}},
      {still + bar + "closure = 0.01\n" + material + "[body.neighbours]\nsupport = 'adaptive'\n",
       {":5:1", "closed gradients (0.01)"}},
      {with_body("file = 'bare.h5'\nvolumes = 'geometry'"), {":5:1", "volumes = \"geometry\""}},
      {with_body("file = 'bare.h5'\nclosure = 0.1"), {":5:1", "closure = 0.1"}},
      {with_body("shape = 'beam'\nsize = [1, 1, 1]\nphyxels = 1\nvolumes = 'kernel'"),
       {":5:1", "a single phyxel"}},
  };
}

TEST_F(EveryRefusal, BeyondTheParserNamesFileBodyAndValue) {
  write("ball.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n");
  write("flat.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  write("empty.obj", "");
  write("ball.txt", "v 0 0 0\n");
  Cloud bare = testing::lattice(4, 4, 4, 0.1);
  bare.volume.clear();
  write_body(folder_ / "bare.h5", bare, false);
  ASSERT_EQ(refusal_of(with_bar("")), "accepted");
  for (const std::vector<Late>& refusals :
       {late_refusals(), refused_bodies(), refused_gradings(), refused_loads(), refused_planes(),
        refused_probes(), refused_obstacles(), refused_contacts()}) {
    for (const Late& late : refusals) expect_named(late.text, late.names);
  }
  EXPECT_GT(refused_, 30);
}

TEST(SceneError, IsNamedOnce) {
  Scene scene;
  EXPECT_EQ(named(scene, "no"), "no");  // made in code
  scene.text = "x";
  EXPECT_EQ(named(scene, "no"), "scene: no");  // read from text
  scene.file = "a/b.toml";
  EXPECT_EQ(named(scene, "no"), "a/b.toml: no");
  EXPECT_EQ(named(scene, "a/b.toml:3:1: no"), "a/b.toml:3:1: no");
  BodyRequest body;
  EXPECT_EQ(named(body, "no"), "no");
  EXPECT_EQ(named(body, ": no"), "no");  // a selection without a place
  body.where = "a/b.toml:3:1";
  body.name = "bar";
  EXPECT_EQ(named(body, "no"), "a/b.toml:3:1: body \"bar\": no");
  EXPECT_EQ(named(body, "body \"bar\": no"), "a/b.toml:3:1: body \"bar\": no");
  EXPECT_EQ(named(body, "a/b.toml:9:2: no"), "a/b.toml:9:2: no");
  EXPECT_EQ(named(body, ": no"), "a/b.toml:3:1: body \"bar\": no");
  EXPECT_THROW(naming(scene, []() -> int { throw DivergedError("x"); }), DivergedError);
  try {
    naming(scene, [] { throw AgreedError(ExitCode::bad_input, "no"); });
    FAIL();
  } catch (const AgreedError& error) {
    EXPECT_STREQ(error.what(), "a/b.toml: no");
  }
  try {
    naming(scene, [] { throw InterruptedError("searching"); });
    FAIL();
  } catch (const InterruptedError& error) {
    EXPECT_STREQ(error.what(), "searching");
  }
}

}  // namespace
}  // namespace phyxel
