"""Impacts by both methods of contact, "projected" and "penalty": what measure_contact_examples.py measures of them.

The scenes are about those of tests/lib/solver/penalty_contacts_test.cpp: balls of the radius 0.1 m, 7 phyxels across, and bars of 5
nodes across, with E = 0.1 MPa and a density of 1000 kg/m³, in double.
"""
import math

YOUNG, POISSON, DENSITY, SPACING = 1e5, 0.3, 1000, 0.03  # [Pa], [1], [kg/m^3], [m]
METHODS = {"projected": "", "penalty": "method = 'penalty'\n"}
STIFFNESS = 0.1  # the default of penalties


def scene(end, frames_per_second, *parts):
    return (f"[time]\nend = {end}\n[solver]\nprecision = 'double'\ndevice = 'cpu'\n[output]\n"
            f"frames_per_second = {frames_per_second}\nfields = ['displacement']\n" + "".join(parts))


def body(name, shape, more, poisson=POISSON):
    return (f"[[body]]\nname = '{name}'\n{shape}{more}"
            f"material = {{ young = {YOUNG}, poisson = {poisson}, density = {DENSITY} }}\n")


def ball(name, more, spacing=SPACING):
    return body(name, f"shape = 'sphere'\nradius = 0.1\nspacing = {spacing}\n", more)


def falling_ball(method, spacing, frames_per_second):
    return scene(0.2, frames_per_second, f"[[obstacle]]\nname = 'floor'\nshape = 'plane'\n{METHODS[method]}",
                 ball("ball", "translation = [0, 0, 0.101]\nvelocity = [0, 0, -0.4]\n", spacing))


def meeting_balls(contact):
    return scene(0.2, 10, f"[contact]\n{contact}", ball("left", "translation = [-0.101, 0, 0]\nvelocity = [0.5, 0, 0]\n"),
                 ball("right", "translation = [0.101, 0.03, 0.01]\nvelocity = [-0.5, 0, 0]\n"))


BAR = {"length": 2, "width": 0.2, "spacing": 0.05, "speed": 0.1}


def meeting_bars(method):
    shape = "shape = 'beam'\nsize = [{length}, {width}, {width}]\nspacing = {spacing}\nlattice = 'nodes'\n".format(**BAR)
    return scene(0.6, 1000, f"[contact]\n{METHODS[method]}",
                 body("first", shape, f"translation = [{-BAR['length'] - 1e-4}, 0, 0]\nvelocity = [{BAR['speed']}, 0, 0]\n", 0),
                 body("second", shape, "", 0),
                 *(f"[[probe]]\nname = '{name}'\nbody = '{name}'\nall = true\n" for name in ("first", "second")))


def standing_block(method):
    return "gravity = [0, 0, -9.81]\n" + scene(
        2, 10, f"[[obstacle]]\nname = 'floor'\nshape = 'plane'\n{METHODS[method]}",
        "[[body]]\nname = 'block'\nshape = 'block'\nsize = [0.2, 0.2, 0.2]\nspacing = 0.05\nlattice = 'nodes'\n"
        "translation = [0, 0, 0.1]\n"
        f"material = {{ young = {YOUNG}, poisson = {POISSON}, density = {DENSITY}, damping = 20 }}\n")


def lost_share(run):
    energy = run.log("energy")
    return energy[-1]["contact_loss"] / energy[0]["total_energy"]


def energy_error(run):
    """The largest change of the total energy over that at the start."""
    total = run.column("energy", "total_energy")
    return max(abs(value - total[0]) for value in total) / total[0]


def time_of_contact(run):
    """The time from the first frame with a force to the last one, over that of a wave, there and back in a bar."""
    times = [c["time"] for c in run.log("contacts", obstacle="second") if c["force_x"] > 0]
    return (times[-1] - times[0]) / (2 * BAR["length"] / math.sqrt(YOUNG / DENSITY))


def speed_error(run):
    """The larger error of both speeds, which equal bars exchange, over the speed."""
    first, second = (run.column("probes", "velocity_x", probe=name)[-1] for name in ("first", "second"))
    return max(abs(first), abs(second - BAR["speed"])) / BAR["speed"]


def rows(run):
    """Rows of all quantities, and the summary of the last run. @param run runs the text of a scene"""
    found = []

    def add(quantity, value, unit="1", expected="", source=""):
        found.append([quantity, value, unit, expected, source])

    for half, spacing in (("", SPACING), ("; half the spacing", SPACING / 2)):
        add(f"projected: loss on an obstacle{half}",
            lost_share(run(falling_ball("projected", spacing, 20), "--step", "0.0005")))
    for finer, step in (("", 1e-3), ("; a quarter of the step", 2.5e-4)):
        add(f"penalty: error of the energy on an obstacle{finer}",
            energy_error(run(falling_ball("penalty", SPACING, round(1 / step)), "--step", str(step))))
    for name, keys in METHODS.items():
        add(f"{name}: loss of balls that meet", lost_share(run(meeting_balls(keys), "--step", "0.0005")))
    pressure = DENSITY * 9.81 * 0.2
    modulus = YOUNG * (1 - POISSON) / ((1 + POISSON) * (1 - 2 * POISSON))
    for name, expected, source in (("projected", "", ""), ("penalty", pressure / (STIFFNESS * modulus), "p/(β M)")):
        summary = run(standing_block(name)).summary
        add(f"{name}: depth under a block in spacings", summary["contacts"][0]["depth_m"] / 0.05, "1", expected, source)
    add("pressure under the block over the modulus", pressure / modulus)
    steps = {keys: run(meeting_balls(keys), "--until", "0.01").summary["largest_stable_step_s"]
             for keys in (*METHODS.values(), METHODS["penalty"] + "stiffness = 1\n")}
    projected, soft, stiff = steps.values()
    add("penalty: largest step over that without contact", soft / projected)
    add("penalty: largest step over that without contact; stiffness 1", stiff / projected)
    for name in METHODS:
        bars = run(meeting_bars(name), "--step", "0.0005")
        add(f"{name}: time of contact of bars over that of waves", time_of_contact(bars), "1", 1.0, "2 L/c (Goldsmith 1960)")
        add(f"{name}: error of speeds that bars exchange", speed_error(bars))
    return found, bars.summary
