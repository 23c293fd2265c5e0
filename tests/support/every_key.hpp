/// A scene with every key, for tests that change one after the other.
#pragma once

#include <string>

namespace phyxel::testing {

/// Every key of the table once: a line, which of its keys to change, and the line with another
/// value.
inline const std::string every_key = R"(# title => title = 'other'
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
# render.view => view = [0, 1, 0]
up = [0, 0, 1] # render.up => up = [0, 0.1, 1]
[render.camera]
position = [-5, 0, 0] # render.camera.position => position = [-6, 0, 0]
# render.camera.target => target = [0, 0, 1]
field_of_view = 30 # render.camera.field_of_view => field_of_view = 40
orbit = 90 # render.camera.orbit => orbit = 180
follow = 'third' # render.camera.follow => follow = 'fourth'
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
[[body]]
name = 'eighth'
cloud = 'd'
[body.material]
law = 'j2-curve'
young = 1e5
poisson = 0.3
flow_curve = [[0, 1e3], [0.1, 2e3]] # body.material.flow_curve => flow_curve = [[0, 1e3], [0.1, 3e3]]
density = 1000
[[body.inclusion]]
region = 'x-'
flow_curve = [[0, 1e3], [0.1, 2e3]] # body.inclusion.flow_curve => flow_curve = [[0, 1e3], [0.1, 3e3]]
[[body]]
name = 'ninth'
cloud = 'd'
[body.material]
law = 'johnson-cook'
young = 1e5
poisson = 0.3
yield_stress = 1e3
hardening_modulus = 1e3 # body.material.hardening_modulus => hardening_modulus = 2e3
hardening_exponent = 0.3 # body.material.hardening_exponent => hardening_exponent = 0.4
rate_factor = 0.02 # body.material.rate_factor => rate_factor = 0.03
reference_rate = 1 # body.material.reference_rate => reference_rate = 2
specific_heat = 400 # body.material.specific_heat => specific_heat = 500
heat_fraction = 0.9 # body.material.heat_fraction => heat_fraction = 0.8
temperature = 300 # body.material.temperature => temperature = 310
reference_temperature = 290 # body.material.reference_temperature => reference_temperature = 280
melting_temperature = 1300 # body.material.melting_temperature => melting_temperature = 1400
softening_exponent = 1 # body.material.softening_exponent => softening_exponent = 1.1
density = 1000
[[body.inclusion]]
region = 'x-'
hardening_modulus = 1e3 # body.inclusion.hardening_modulus => hardening_modulus = 2e3
hardening_exponent = 0.3 # body.inclusion.hardening_exponent => hardening_exponent = 0.4
rate_factor = 0.02 # body.inclusion.rate_factor => rate_factor = 0.03
reference_rate = 1 # body.inclusion.reference_rate => reference_rate = 2
specific_heat = 400 # body.inclusion.specific_heat => specific_heat = 500
heat_fraction = 0.9 # body.inclusion.heat_fraction => heat_fraction = 0.8
temperature = 300 # body.inclusion.temperature => temperature = 310
reference_temperature = 290 # body.inclusion.reference_temperature => reference_temperature = 280
melting_temperature = 1300 # body.inclusion.melting_temperature => melting_temperature = 1400
softening_exponent = 1 # body.inclusion.softening_exponent => softening_exponent = 1.1
[[body]]
name = 'tenth'
cloud = 'd'
[body.material]
law = 'clay'
young = 1e5
poisson = 0.3
yield_strain = 0.01 # body.material.yield_strain => yield_strain = 0.02
creep_time = 0.1 # body.material.creep_time => creep_time = 0.2
plastic_limit = 0.5 # body.material.plastic_limit => plastic_limit = 0.6
plastic_volume = 0 # body.material.plastic_volume => plastic_volume = 1
density = 1000
[[body.inclusion]]
region = 'x-'
yield_strain = 0.01 # body.inclusion.yield_strain => yield_strain = 0.02
creep_time = 0.1 # body.inclusion.creep_time => creep_time = 0.2
plastic_limit = 0.5 # body.inclusion.plastic_limit => plastic_limit = 0.6
plastic_volume = 0 # body.inclusion.plastic_volume => plastic_volume = 1
[[body]]
name = 'eleventh'
cloud = 'd'
[body.material]
law = 'maxwell'
young = 1e5
poisson = 0.3
relaxation = [[0.1, 0.2], [1, 0.3]] # body.material.relaxation => relaxation = [[0.1, 0.2], [2, 0.3]]
density = 1000
[[body.inclusion]]
region = 'x-'
relaxation = [[0.1, 0.2], [1, 0.3]] # body.inclusion.relaxation => relaxation = [[0.1, 0.2], [1, 0.4]]
[[body]]
name = 'twelfth'
cloud = 'd'
[body.material]
young = 1e5
poisson = 0.3
density = 1000
[body.fracture]
energy_release_rate = 5 # body.fracture.energy_release_rate => energy_release_rate = 6
strength = 1e6 # body.fracture.strength => strength = 2e6
scatter = 10 # body.fracture.scatter => scatter = 11
seed = 3 # body.fracture.seed => seed = 4
[[body.fracture.unbreakable]]
box = [[0, 0, 0], [1, 1, 1]]
[[body.notch]]
centre = [0, 0, 1] # body.notch.centre => centre = [0, 0, 2]
normal = [0, 0, 1] # body.notch.normal => normal = [0, 1, 1]
radius = 2 # body.notch.radius => radius = 3
[[body.notch]]
mesh = 'a.obj' # body.notch.mesh => mesh = 'b.obj'
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

}  // namespace phyxel::testing
