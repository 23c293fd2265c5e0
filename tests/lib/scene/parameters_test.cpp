/// Parameters and digests that checkpoints compare.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <sstream>

#include "phyxel/model.hpp"
#include "scene/scene_parameters.hpp"
#include "scene/scene_schema.hpp"
#include "support/clouds.hpp"
#include "support/scene_text.hpp"

namespace phyxel {
namespace {

using ::testing::HasSubstr;

// Every key of the table once: a line, which of its keys to change, and the line with another
// value.
const std::string every_key = R"(# title => title = 'other'
gravity = [0, 0, -9.81] # gravity => gravity = [0, 0, 9.81]
[time]
end = 2 # time.end => end = 3
# time.step => step = 1e-4
# time.safety => safety = 0.5
[solver]
method = 'verlet' # solver.method => method = 'implicit'
device = 'cpu' # solver.device => device = 'auto'
precision = 'double' # solver.precision => precision = 'mixed'
threads = 1 # solver.threads => threads = 2
[output]
directory = 'a' # output.directory => directory = 'b'
frames_per_second = 10 # output.frames_per_second => frames_per_second = 20
phyxels = true # output.phyxels => phyxels = false
surface = true # output.surface => surface = false
fields = ['displacement'] # output.fields => fields = ['displacement', 'mass']
recovery = true # output.recovery => recovery = false
checkpoint_every = 10 # output.checkpoint_every => checkpoint_every = 20
[render]
pictures = true # render.pictures => pictures = false
count = 2 # render.count => count = 3
width = 100 # render.width => width = 200
height = 100 # render.height => height = 200
view = [1, 0, 0] # render.view => view = [0, 1, 0]
up = [0, 0, 1] # render.up => up = [0, 0.1, 1]
[[body]]
name = 'first' # body.name => name = 'other'
shape = 'block' # body.shape => shape = 'beam'
size = [1, 1, 1] # body.size => size = [1, 1, 2]
spacing = 0.1 # body.spacing => spacing = 0.2
lattice = 'nodes' # body.lattice => lattice = 'cells'
jitter = 0.1 # body.jitter => jitter = 0.2
seed = 3 # body.seed => seed = 4
surfels = true # body.surfels => surfels = false
scale = 2 # body.scale => scale = 3
rotation = [0, 0, 90] # body.rotation => rotation = [0, 90, 0]
translation = [1, 0, 0] # body.translation => translation = [2, 0, 0]
velocity = [1, 0, 0] # body.velocity => velocity = [1, 0, 1]
spin = [0, 1, 0] # body.spin => spin = [0, 2, 0]
volumes = 'geometry' # body.volumes => volumes = 'kernel'
closure = 0.1 # body.closure => closure = 0.2
[body.material]
young = 1e5 # body.material.young => young = 2e5
poisson = 0.3 # body.material.poisson => poisson = 0.2
density = 1000 # body.material.density => density = 1001
law = 'st-venant-kirchhoff' # body.material.law => law = 'corotated'
volume_stiffness = 10 # body.material.volume_stiffness => volume_stiffness = 20
damping = 1 # body.material.damping => damping = 2
viscosity = 1 # body.material.viscosity => viscosity = 2
hourglass = 0.1 # body.material.hourglass => hourglass = 0.2
[body.neighbours]
support = 'adaptive' # body.neighbours.support => support = 'uniform'
nearest = 10 # body.neighbours.nearest => nearest = 11
factor = 1.8 # body.neighbours.factor => factor = 1.9
max_neighbours = 40 # body.neighbours.max_neighbours => max_neighbours = 41
[[body.inclusion]]
region = 'x-' # selection.region => region = 'x+'
young = 1e5 # body.inclusion.young => young = 2e5
poisson = 0.3 # body.inclusion.poisson => poisson = 0.2
density = 1000 # body.inclusion.density => density = 1001
law = 'st-venant-kirchhoff' # body.inclusion.law => law = 'neo-hookean'
volume_stiffness = 10 # body.inclusion.volume_stiffness => volume_stiffness = 20
damping = 1 # body.inclusion.damping => damping = 2
viscosity = 1 # body.inclusion.viscosity => viscosity = 2
[[body.fixed]]
indices = [1, 2] # selection.indices => indices = [1, 3]
axes = 'x' # body.fixed.axes => axes = 'xz'
[[body.symmetry]]
normal = 'x' # body.symmetry.normal => normal = 'y'
at = 0.5 # body.symmetry.at => at = 0.25
[[body.motion]]
box = [[0, 0, 0], [1, 1, 1]] # selection.box => box = [[0, 0, 0], [1, 1, 2]]
displacement = [1, 0, 0] # body.motion.displacement => displacement = [2, 0, 0]
rotation = [0, 0, 9] # body.motion.rotation => rotation = [0, 0, 8]
about = [0, 1, 0] # body.motion.about => about = [0, 2, 0]
duration = 1 # body.motion.duration => duration = 2
velocity = [1, 0, 0] # body.motion.velocity => velocity = [2, 0, 0]
amplitude = [1, 0, 0] # body.motion.amplitude => amplitude = [2, 0, 0]
frequency = 1 # body.motion.frequency => frequency = 2
axes = 'y' # body.motion.axes => axes = 'yz'
[[body.load]]
ball = {centre = [0, 0, 0], radius = 1} # selection.ball.centre => ball = {centre = [1, 0, 0], radius = 1}
force = [1, 0, 0] # body.load.force => force = [2, 0, 0]
ramp = 1 # body.load.ramp => ramp = 2
[[body.load]]
ball = {centre = [0, 0, 0], radius = 1} # selection.ball.radius => ball = {centre = [0, 0, 0], radius = 2}
force_density = [1, 0, 0] # body.load.force_density => force_density = [2, 0, 0]
curve = [[0, 0], [1, 1]] # body.load.curve => curve = [[0, 0], [1, 2]]
[[body.traction]]
all = true
traction = [1, 0, 0] # body.traction.traction => traction = [2, 0, 0]
normal = [1, 0, 0] # body.traction.normal => normal = [0, 1, 0]
angle = 30 # body.traction.angle => angle = 40
curve = [[0, 1]] # body.traction.curve => curve = [[1, 1]]
[[body.traction]]
all = true
pressure = 1 # body.traction.pressure => pressure = 2
follower = true # body.traction.follower => follower = false
ramp = 1 # body.traction.ramp => ramp = 2
[[body.traction]]
all = true
pressure = 1
gas = 1.4 # body.traction.gas => gas = 1
[[body]]
name = 'second'
mesh = 'a.obj' # body.mesh => mesh = 'b.obj'
phyxels = 100 # body.phyxels => phyxels = 200
relaxations = 10 # body.relaxations => relaxations = 20
on_surface = true # body.on_surface => on_surface = false
[body.material]
young = 1e5
poisson = 0.3
density = 1000
[body.neighbours]
radius = 0.3 # body.neighbours.radius => radius = 0.4
[[body.fixed]]
all = true # selection.all => region = 'x-'
[[body.load]]
mesh = 'a.obj' # selection.mesh => mesh = 'b.obj'
force = [1, 0, 0]
[body.array]
count = [2, 1, 1] # body.array.count => count = [3, 1, 1]
spacing = [5, 0, 0] # body.array.spacing => spacing = [6, 0, 0]
[[body]]
name = 'graded'
mesh = 'a.obj'
phyxels = 100
[body.grading]
ratio = 5 # body.grading.ratio => ratio = 6
growth = 0.2 # body.grading.growth => growth = 0.3
per_radius = 6 # body.grading.per_radius => per_radius = 0
across = 3 # body.grading.across => across = 4
[[body.grading.finer]]
ball = {centre = [0, 0, 0], radius = 1}
by = 2 # body.grading.finer.by => by = 3
[body.material]
young = 1e5
poisson = 0.3
density = 1000
[[body]]
name = 'third'
shape = 'cylinder'
radius = 1 # body.radius => radius = 2
length = 3 # body.length => length = 4
spacing = 0.2
[body.material]
young = 1e5
poisson = 0.3
density = 1000
[[body]]
name = 'fourth'
file = 'a.h5' # body.file => file = 'b.h5'
[body.material]
young = 1e5
poisson = 0.3
density = 1000
[[body]]
name = 'fifth'
cloud = 'a' # body.cloud => cloud = 'b'
[body.material]
law = 'mooney-rivlin'
c10 = 1e4 # body.material.c10 => c10 = 2e4
c01 = 1e3 # body.material.c01 => c01 = 2e3
bulk_modulus = 1e5 # body.material.bulk_modulus => bulk_modulus = 2e5
density = 1000
[[body.inclusion]]
region = 'x-'
c10 = 2e4 # body.inclusion.c10 => c10 = 3e4
c01 = 2e3 # body.inclusion.c01 => c01 = 3e3
bulk_modulus = 3e5 # body.inclusion.bulk_modulus => bulk_modulus = 4e5
[[body]]
name = 'sixth'
cloud = 'c'
[body.material]
law = 'orthotropic'
young1 = 1e5 # body.material.young1 => young1 = 2e5
young2 = 1e5 # body.material.young2 => young2 = 2e5
young3 = 1e5 # body.material.young3 => young3 = 2e5
poisson12 = 0.3 # body.material.poisson12 => poisson12 = 0.2
poisson13 = 0.3 # body.material.poisson13 => poisson13 = 0.2
poisson23 = 0.3 # body.material.poisson23 => poisson23 = 0.2
shear12 = 3e4 # body.material.shear12 => shear12 = 4e4
shear13 = 3e4 # body.material.shear13 => shear13 = 4e4
shear23 = 3e4 # body.material.shear23 => shear23 = 4e4
axis1 = [1, 0, 0] # body.material.axis1 => axis1 = [1, 0, 1]
axis2 = [0, 1, 0] # body.material.axis2 => axis2 = [0, 1, 1]
density = 1000
[[body.inclusion]]
region = 'x-'
young1 = 1e5 # body.inclusion.young1 => young1 = 2e5
young2 = 1e5 # body.inclusion.young2 => young2 = 2e5
young3 = 1e5 # body.inclusion.young3 => young3 = 2e5
poisson12 = 0.3 # body.inclusion.poisson12 => poisson12 = 0.2
poisson13 = 0.3 # body.inclusion.poisson13 => poisson13 = 0.2
poisson23 = 0.3 # body.inclusion.poisson23 => poisson23 = 0.2
shear12 = 3e4 # body.inclusion.shear12 => shear12 = 4e4
shear13 = 3e4 # body.inclusion.shear13 => shear13 = 4e4
shear23 = 3e4 # body.inclusion.shear23 => shear23 = 4e4
axis1 = [1, 0, 0] # body.inclusion.axis1 => axis1 = [1, 0, 1]
axis2 = [0, 1, 0] # body.inclusion.axis2 => axis2 = [0, 1, 1]
[[body]]
name = 'seventh'
cloud = 'd'
[body.material]
law = 'j2'
young = 1e5
poisson = 0.3
yield_stress = 1e3 # body.material.yield_stress => yield_stress = 2e3
hardening = 1e2 # body.material.hardening => hardening = 2e2
saturation_stress = 4e3 # body.material.saturation_stress => saturation_stress = 5e3
saturation_rate = 3 # body.material.saturation_rate => saturation_rate = 4
density = 1000
[[body.inclusion]]
region = 'x-'
yield_stress = 1e3 # body.inclusion.yield_stress => yield_stress = 2e3
hardening = 1e2 # body.inclusion.hardening => hardening = 2e2
saturation_stress = 4e3 # body.inclusion.saturation_stress => saturation_stress = 5e3
saturation_rate = 3 # body.inclusion.saturation_rate => saturation_rate = 4
[[probe]]
name = 'tip' # probe.name => name = 'top'
body = 'third' # probe.body => body = 'fourth'
point = [0, 0, 0] # probe.point => point = [0, 0, 1]
[[probe]]
body = 'third'
from = [0, 0, 0] # probe.from => from = [0, 0, 1]
to = [0, 1, 0] # probe.to => to = [0, 2, 0]
points = 3 # probe.points => points = 4
[[obstacle]]
name = 'post' # obstacle.name => name = 'pillar'
shape = 'cylinder' # obstacle.shape => shape = 'capsule'
radius = 1 # obstacle.radius => radius = 2
length = 3 # obstacle.length => length = 4
hollow = false # obstacle.hollow => hollow = true
rotation = [0, 90, 0] # obstacle.rotation => rotation = [0, 80, 0]
translation = [9, 0, 0] # obstacle.translation => translation = [8, 0, 0]
friction = 0.5 # obstacle.friction => friction = 0.6
kinetic_friction = 0.4 # obstacle.kinetic_friction => kinetic_friction = 0.3
restitution = 0 # obstacle.restitution => restitution = 0.2
method = 'projected' # obstacle.method => method = 'penalty'
stiffness = 0.2 # obstacle.stiffness => stiffness = 0.3
[obstacle.motion]
displacement = [1, 0, 0] # obstacle.motion.displacement => displacement = [2, 0, 0]
rotation = [0, 0, 9] # obstacle.motion.rotation => rotation = [0, 0, 8]
about = [0, 1, 0] # obstacle.motion.about => about = [0, 2, 0]
duration = 1 # obstacle.motion.duration => duration = 2
velocity = [1, 0, 0] # obstacle.motion.velocity => velocity = [2, 0, 0]
amplitude = [0, 1, 0] # obstacle.motion.amplitude => amplitude = [0, 2, 0]
frequency = 5 # obstacle.motion.frequency => frequency = 6
[[obstacle]]
shape = 'box'
size = [1, 2, 3] # obstacle.size => size = [1, 2, 4]
density = 7 # obstacle.density => density = 8
velocity = [1, 0, 0] # obstacle.velocity => velocity = [2, 0, 0]
spin = [0, 1, 0] # obstacle.spin => spin = [0, 2, 0]
[[obstacle]]
shape = 'plane'
normal = [0, 0, 1] # obstacle.normal => normal = [0, 1, 1]
[contact]
friction = 0.5 # contact.friction => friction = 0.6
kinetic_friction = 0.4 # contact.kinetic_friction => kinetic_friction = 0.3
restitution = 0 # contact.restitution => restitution = 0.2
method = 'projected' # contact.method => method = 'penalty'
stiffness = 0.2 # contact.stiffness => stiffness = 0.3
self = true # contact.self => self = false
sweeps = 2 # contact.sweeps => sweeps = 3
all = true # contact.all => all = false
[[contact.pair]]
first = 'third' # contact.pair.first => first = 'fourth'
second = 'seventh' # contact.pair.second => second = 'fifth'
friction = 0.2 # contact.pair.friction => friction = 0.3
kinetic_friction = 0.1 # contact.pair.kinetic_friction => kinetic_friction = 0
restitution = 0 # contact.pair.restitution => restitution = 0.4
[[obstacle]]
shape = 'mesh'
mesh = 'a.obj' # obstacle.mesh => mesh = 'b.obj'
scale = 2 # obstacle.scale => scale = 3
)";

/// The text with the value of one key changed, or of none.
std::string with_other(const std::string& wanted, int* changed = nullptr) {
  std::istringstream lines(every_key);
  std::string text;
  for (std::string line; std::getline(lines, line);) {
    const std::size_t mark = line.find("# "), arrow = line.find(" => ");
    if (mark == std::string::npos) {
      text += line + '\n';
      continue;
    }
    const bool this_one = line.substr(mark + 2, arrow - mark - 2) == wanted;
    if (this_one && changed) ++*changed;
    text += (this_one ? line.substr(arrow + 4) : line.substr(0, mark)) + '\n';
  }
  return text;
}

class Parameters : public SceneFiles {
 protected:
  Parameters() {
    for (const char* file : {"a.obj", "b.obj", "a.h5", "b.h5"}) write(file);
  }
  std::vector<Parameter> of(const std::string& text) const {
    return scene_parameters(parse_scene(text, folder_ / "scene.toml"));
  }
};

/// A key that is new in the table fails here until it says what a resumed run makes of it.
TEST_F(Parameters, EveryKeyIsComparedByNameOrFreeForAReason) {
  // Keys that become something else.
  const std::map<std::string, std::string> known_as = {
      {"body.array.count", "bodies: 9 then, 10 now"},
      {"body.array.spacing",
       "body.translation of body 3 (\"second 2\"): [5, 0, 0] then, "
       "[6, 0, 0] now"},
      {"probe.body", "probe.point of body 6 (\"fourth\"), probe 1: nothing then"},
      {"probe.from", "[0, 1, 0] then, [0, 0, 1], "},
      {"probe.to", "[0, 1, 0] then, [0, 0, 0], [0, 1, 0], [0, 2, 0] now"},
      {"probe.points", "[0, 1, 0] then, [0, 0, 0], [0, 0.3333333333333333, 0], "}};
  const std::vector<Parameter> base = of(with_other(""));
  EXPECT_EQ(parameter_differences(base, base), "");
  int compared = 0, free = 0;
  for (const SceneKey& key : scene_keys()) {
    if (key.type == KeyType::table || key.type == KeyType::tables) continue;
    const std::string path = key.section.empty() ? key.name : key.section + "." + key.name;
    int changed = 0;
    const std::string text = with_other(path, &changed);
    ASSERT_EQ(changed, 1) << path << " is not changed by this test";
    const std::string differences = parameter_differences(base, of(text));
    if (const char* why = free_on_resume(key.section, key.name)) {
      EXPECT_EQ(differences, "") << path << ", " << why;
      ++free;
      continue;
    }
    const auto known = known_as.find(path);
    EXPECT_THAT(differences, HasSubstr(known == known_as.end() ? path : known->second));
    EXPECT_THAT(differences, HasSubstr(" then, ")) << path;
    ++compared;
  }
  EXPECT_EQ(free, 17);  // all of the table of free keys are keys
  EXPECT_GT(compared, 60);
}

TEST_F(Parameters, OfManyBodiesAreAFewNamesAndAHash) {
  Scene scene = parse_scene(time_section + dino, "scene.toml");
  scene.bodies.resize(5000, scene.bodies[0]);
  const std::vector<Parameter> base = scene_parameters(scene);
  EXPECT_LT(base.size(), 3000u);
  scene.bodies[4321].velocity.y = 1e-9;
  EXPECT_THAT(parameter_differences(base, scene_parameters(scene)),
              HasSubstr("bodies 65 to 5000: hash"));
  scene.bodies[63].velocity.y = 1e-9;
  EXPECT_THAT(parameter_differences(base, scene_parameters(scene)),
              HasSubstr("body.velocity of body 64"));
}

TEST_F(Parameters, NamesOfBodiesCannotBreakLines) {
  Scene scene = testing::one_body();
  scene.bodies[0].name = "a\tb\n\"c\"";
  for (const Parameter& p : scene_parameters(scene)) {
    EXPECT_EQ((p.name + p.value).find_first_of("\t\n"), std::string::npos) << p.name;
  }
}

/// Each of these alone makes another model, whose checkpoints fit no other.
TEST(ModelDigest, TellsModelsApartByEveryValueTheyHave) {
  const auto digest_with = [](auto&& change) {
    Scene scene = testing::one_body();
    BodyRequest& body = scene.bodies[0];
    body.motions.push_back({.select = {.box = Selection::Box{{-1, -1, -1}, {1, 1, 0.1}}},
                            .displacement = {1, 0, 0},
                            .rotation = {0, 0, 9},
                            .about = {0, 1, 0},
                            .duration = 1,
                            .velocity = {1, 0, 0},
                            .amplitude = {1, 0, 0},
                            .frequency = 1});
    body.loads.push_back({.select = {.all = true}, .force = {1, 0, 0}, .ramp = 1});
    change(body);
    return model_digest(testing::model_of(scene, testing::lattice(3, 3, 3, 0.1)));
  };
  using Body = BodyRequest;
  const std::map<std::string, std::uint64_t> digests = {
      {"nothing", digest_with([](Body&) {})},
      {"young", digest_with([](Body& b) { b.material.young *= 2; })},
      {"poisson", digest_with([](Body& b) { b.material.poisson = 0.2; })},
      {"density", digest_with([](Body& b) { b.material.density *= 2; })},
      {"small-strain", digest_with([](Body& b) { b.material.law = "small-strain"; })},
      {"neo-hookean", digest_with([](Body& b) { b.material.law = "neo-hookean"; })},
      {"corotated", digest_with([](Body& b) { b.material.law = "corotated"; })},
      {"volume", digest_with([](Body& b) { b.material.volume_stiffness = 1; })},
      {"damping", digest_with([](Body& b) { b.material.damping = 1; })},
      {"hourglass", digest_with([](Body& b) { b.material.hourglass = 0.3; })},
      {"factor", digest_with([](Body& b) { b.neighbourhood.factor = 1.9; })},
      {"nearest", digest_with([](Body& b) { b.neighbourhood.nearest = 11; })},
      {"pairs", digest_with([](Body& b) {
         b.neighbourhood.support = NeighbourhoodRule::Support::pairwise;
       })},
      {"radius", digest_with([](Body& b) { b.neighbourhood.radius = 0.2; })},
      {"most", digest_with([](Body& b) { b.neighbourhood.max_neighbours = 20; })},
      {"displacement", digest_with([](Body& b) { b.motions[0].displacement.y = 1; })},
      {"rotation", digest_with([](Body& b) { b.motions[0].rotation.y = 1; })},
      {"about", digest_with([](Body& b) { b.motions[0].about.z = 1; })},
      {"duration", digest_with([](Body& b) { b.motions[0].duration = 2; })},
      {"velocity", digest_with([](Body& b) { b.motions[0].velocity.z = 1; })},
      {"amplitude", digest_with([](Body& b) { b.motions[0].amplitude.y = 1; })},
      {"frequency", digest_with([](Body& b) { b.motions[0].frequency = 2; })},
      {"axes x", digest_with([](Body& b) { b.motions[0].axes.x = false; })},
      {"axes y", digest_with([](Body& b) { b.motions[0].axes.y = false; })},
      {"axes z", digest_with([](Body& b) { b.motions[0].axes.z = false; })},
      {"moved", digest_with([](Body& b) { b.motions[0].select = {.all = true}; })},
      {"force", digest_with([](Body& b) { b.loads[0].force.z = 1; })},
      {"density of force", digest_with([](Body& b) { b.loads[0].force_density.x = 1; })},
      {"ramp", digest_with([](Body& b) { b.loads[0].ramp = 2; })},
      {"curve", digest_with([](Body& b) {
         b.loads[0].ramp = 0;
         b.loads[0].curve = {{0, 0}, {1, 2}};
       })},
      {"time of curve", digest_with([](Body& b) {
         b.loads[0].ramp = 0;
         b.loads[0].curve = {{0.5, 0}, {1, 2}};
       })},
      {"loaded", digest_with([](Body& b) {
         b.loads[0].select = {.indices = std::vector<Index>{1, 2}};
       })}};
  std::map<std::uint64_t, std::string> names;
  for (const auto& [name, digest] : digests) {
    const auto [other, is_new] = names.emplace(digest, name);
    EXPECT_TRUE(is_new) << name << " and " << other->second << " have one digest";
  }
}

}  // namespace
}  // namespace phyxel
