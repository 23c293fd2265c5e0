#!/usr/bin/env python3
"""Measures the examples of contact: writes docs/results/contact_examples.csv, from which docs/contact.md is made.

    scripts/measure_contact_examples.py build/cpu/bin/phyxel                      all, in about two minutes
    scripts/measure_contact_examples.py build/cpu/bin/phyxel clap dice --out /tmp/contact.csv

Each row is a quantity of a case: an example of contact, or `methods`, impacts by both methods of contact. Columns: the measured
value, its unit, the value that mechanics expects, and the formula of that with its source. Scenes run as they are, on one
thread; the ball of `skittles` is measured in a copy without the skittles. tests/apps/contacts_run_test.cpp evaluates the same
quantities of coarser copies.
"""
import argparse
import csv
import datetime
import json
import math
import pathlib
import re
import resource
import shutil
import subprocess
import sys
import tempfile
import tomllib

sys.dont_write_bytecode = True
import contact_methods  # noqa: E402

ROOT = pathlib.Path(__file__).resolve().parent.parent
COLUMNS = ["case", "quantity", "value", "unit", "expected", "source"]
AXES = "xyz"


class Run:
    """A run of the program: its summary, the time that it took, and its logs."""

    def __init__(self, program, scene, out, *options):
        self.scene, self.out = tomllib.loads(scene.read_text()), out
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        done = subprocess.run([program, "run", scene, "--threads", "1", "--no-pictures", "--force", "--out", out, "--json",
                               *options], capture_output=True, text=True)
        self.seconds = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
        if done.returncode != 0:
            sys.exit(f"{scene}: {done.stderr.splitlines()[-1]}")
        self.summary = json.loads(done.stdout)

    def log(self, name, **match):
        """The rows of a log that have the given cells: dicts by the names of columns without units, numbers as floats."""
        with (self.out / f"{name}.csv").open(newline="") as file:
            rows = [{key.split(" [")[0]: value for key, value in row.items()} for row in csv.DictReader(file)]
        found = [row for row in rows if all(row[key] == value for key, value in match.items())]
        return [{key: as_number(value) for key, value in row.items()} for row in found]

    def column(self, log, name, **match):
        return [row[name] for row in self.log(log, **match)]

    def body(self, k=0):
        return self.scene["body"][k]

    def deepest(self):
        """The largest depth of a point in a body or an obstacle [m]."""
        return max(contact["deepest_m"] for contact in self.summary["contacts"])


class Examples:
    """Runs examples, each once, in a folder."""

    def __init__(self, program, folder):
        self.program, self.folder = program, folder

    def run(self, name, *options, without=None):
        """Runs a copy of an example. @param without a pattern of what is left out of the scene"""
        copy = self.folder / f"{name}{'-changed' if without else ''}"
        shutil.copytree(ROOT / "examples" / name, copy)
        scene = copy / "scene.toml"
        if without:
            text = re.sub(without, "", scene.read_text(), flags=re.DOTALL)
            scene.write_text(text)
        return Run(self.program, scene, copy / "out", *options)


def as_number(text):
    try:
        return float(text)
    except ValueError:
        return text


def vector(row, name):
    return [row[name.format(axis)] for axis in AXES]


def row(quantity, value, unit="1", expected="", source=""):
    return [quantity, value, unit, expected, source]


def deviation(values, reference):
    return max(abs(value - reference) for value in values)


def gravity_of(run):
    return -run.scene["gravity"][2]


def bouncing_ball(run):
    ball, g = run.body(), gravity_of(run)
    material, radius = ball["material"], ball["radius"]
    fall = ball["translation"][2] - radius
    flight = {round(p["time"], 6): p for p in run.log("probes")}

    def height(t):
        """The height of the apex of the flight at a time, above the place of the ball in an impact."""
        return fall + flight[t]["displacement_z"] + flight[t]["velocity_z"] ** 2 / (2 * g)

    def apex(t):
        return t + flight[t]["velocity_z"] / g

    first, second = 0.6, 1.0  # in the flights after the first and the second impact [s]
    mass = 4 * math.pi / 3 * radius ** 3 * material["density"]
    modulus = material["young"] / (1 - material["poisson"] ** 2)
    speed = math.sqrt(2 * g * height(first))
    touching = 2.868 * (mass ** 2 / (radius * modulus ** 2 * speed)) ** 0.2
    falls = [math.sqrt(2 * height(t) / g) for t in (first, second)]
    energy, force = run.log("energy"), run.column("contacts", "force_z", obstacle="floor")
    free = [e["total_energy"] for e, f in zip(energy, force) if f == 0 and e["time"] < second + 1e-6]
    return [row("fall", fall, "m"),
            row("height after the first impact", height(first), "m"),
            row("height after the second impact", height(second), "m"),
            row("loss of height in the first impact", 1 - height(first) / fall),
            row("loss of height in the second impact", 1 - height(second) / height(first)),
            row("time of contact", "", "s", touching, "Hertz: 2.868 (m²/(R E*² V))^⅕; Johnson 1985 section 11.4"),
            row("time between apexes", apex(second) - apex(first), "s", sum(falls) + touching,
                "√(2 H₁/g) + √(2 H₂/g) + time of contact"),
            row("energy of the fall", mass * g * fall, "J"),
            row("largest change of the total energy in flight over that of the fall",
                deviation(free, free[0]) / (mass * g * fall))]


def squeezed_bear(run):
    lower, upper = run.summary["contacts"][:2]
    mesh = ROOT / "examples/squeezed_bear" / run.body()["mesh"]
    z = [float(line.split()[3]) for line in mesh.read_text().splitlines() if line.startswith("v ")]
    faces = [o["translation"][2] + o["motion"]["displacement"][2] + sign * o["size"][2] / 2
             for o, sign in zip(run.scene["obstacle"], (1, -1))]
    paths = [abs(o["motion"]["displacement"][2]) for o in run.scene["obstacle"]]
    force = lower["force_n"][2]
    return [row("path of both plates", sum(paths), "m"),
            row("height of the bear", max(z) - min(z), "m"),
            row("distance of the plates at the end", faces[1] - faces[0], "m"),
            row("force of a plate", force, "N"),
            row("largest difference of forces over force",
                max(abs(a + b) for a, b in zip(lower["force_n"], upper["force_n"])) / force)]


def cradle(run):
    impulse = {c["obstacle"]: c["impulse_n_s"] for c in run.summary["contacts"] if c["shape"] == "body"}
    lost = -impulse["first"][0]
    between = [impulse[f"hanging {k}"][0] / lost for k in (1, 2, 3)]
    total = [sum(i[k] for i in impulse.values()) for k in range(3)]
    return [row("share of the momentum that the last ball takes", impulse["hanging 4"][0] / lost),
            row("smallest share of those between", min(between)),
            row("largest share of those between", max(between)),
            row("sum of impulses over that of the first ball", math.hypot(*total) / lost)]


def rubber_rings(run):
    energy, ring = run.log("energy"), run.body()
    speed = ring["velocity"][0]
    mass = energy[0]["kinetic_energy"] / speed ** 2  # of one: ½ m v² of both
    rebound = run.column("contacts", "impulse_x", obstacle="right")[-1] / mass - speed
    total = [e["total_energy"] for e in energy]
    momentum = max(math.hypot(*vector(e, "momentum_{}")) for e in energy)
    spacing = (mass / ring["material"]["density"] / ring["phyxels"]) ** (1 / 3)
    return [row("speed before", speed, "m/s"),
            row("speed after", rebound, "m/s"),
            row("largest momentum over that of one ring", momentum / (mass * speed)),
            row("change of the total energy", abs(total[-1] / total[0] - 1)),
            row("largest change of the total energy", deviation(total, total[0]) / total[0]),
            row("largest depth in spacings", run.deepest() / spacing)]


def clap(run):
    energy, material = run.log("energy"), run.body()["material"]
    tips = [run.log("probes", probe=f"{side} tip") for side in ("right", "left")]
    lost = run.column("contacts", "impact_loss")
    apart, closing = [], []
    for right, left in zip(*tips):
        places = [[x + u for x, u in zip(vector(tip, "{}"), vector(tip, "displacement_{}"))] for tip in (right, left)]
        line = [a - b for a, b in zip(*places)]
        speeds = [a - b for a, b in zip(vector(right, "velocity_{}"), vector(left, "velocity_{}"))]
        apart.append(math.hypot(*line))
        closing.append(-sum(a * b for a, b in zip(line, speeds)) / apart[-1])
    before = next(k for k, loss in enumerate(lost) if loss != 0) - 1
    momentum = [vector(e, "momentum_{}") for e in energy]
    pulled = max(load["curve"][-1][0] for load in run.body()["load"])
    turning = [e["angular_momentum_z"] for e in energy if e["time"] > pulled + 1e-6]
    mass = math.hypot(*momentum[0]) / run.body()["velocity"][0]
    spacing = (mass / material["density"] / run.body()["phyxels"]) ** (1 / 3)
    mesh = (ROOT / "examples/clap" / run.body()["mesh"]).read_text().splitlines()
    z = [float(line.split()[3]) for line in mesh if line.startswith("v ")]
    return [row("speed of the tips in the last frame before they touch", closing[before], "m/s"),
            row("speed of sound", math.sqrt(material["young"] / material["density"]), "m/s", "", "√(E/ρ)"),
            row("thickness of the arms", max(z) - min(z), "m"),
            row("smallest distance between the middles of the tips", min(apart), "m"),
            row("largest depth in spacings", run.deepest() / spacing),
            row("largest change of the momentum over it",
                max(math.dist(m, momentum[0]) for m in momentum) / math.hypot(*momentum[0])),
            row("largest change of the angular momentum after the pulls over it",
                deviation(turning, turning[-1]) / abs(turning[-1]))]


def skittles(run, alone):
    speed, g = run.body()["velocity"][0], gravity_of(run)
    friction = run.scene["obstacle"][0]["friction"]
    rolling = alone.column("probes", "velocity_x", probe="ball")
    return [row("speed of sliding", speed, "m/s"),
            row("time of sliding", "", "s", 2 * speed / (7 * friction * g), "2 v/(7 µ g): friction until the surface rests"),
            row("speed of rolling", rolling[-1], "m/s", speed * 5 / 7, "5/7 v: angular momentum about the lane"),
            row("speed of rolling over that expected", rolling[-1] / (speed * 5 / 7))]


def dice(run):
    edges = {o["name"]: o["size"][2] for o in run.scene["obstacle"] if "density" in o}
    bodies = run.summary["rigid_bodies"]
    return [row("largest distance of a middle from half an edge above the table",
                max(abs(b["place_m"][2] - edges[b["obstacle"]] / 2) for b in bodies), "m"),
            row("largest speed at the end", max(math.hypot(*b["velocity_m_s"]) for b in bodies), "m/s")]


MEASURES = {f.__name__: f for f in (bouncing_ball, squeezed_bear, cradle, rubber_rings, clap, skittles, dice)}


def measured(name, program, folder):
    """Runs a case and returns its rows and the summary of its last run."""
    if name == "methods":
        return contact_methods.rows(lambda text, *options: ran_text(program, folder, text, *options))
    examples = Examples(program, folder)
    run = examples.run(name)
    more = []
    if name == "skittles":
        more = [examples.run(name, "--until", "0.5", without=r'\[\[body\]\]\nname = "skittle".*')]
    return [row("processor time", run.seconds, "s"), *MEASURES[name](run, *more)], run.summary


def ran_text(program, folder, text, *options):
    scene = folder / "scene.toml"
    scene.write_text(text)
    return Run(program, scene, folder / "out", *options)


def processor():
    text = pathlib.Path("/proc/cpuinfo").read_text()
    found = re.search(r"^model name\s*: (.*)$", text, re.MULTILINE)
    return found[1] if found else "unknown processor"


def written(cell):
    return f"{cell:.6g}" if isinstance(cell, float) else str(cell)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program", type=pathlib.Path)
    parser.add_argument("cases", nargs="*", metavar="case", help=f"of: {', '.join([*MEASURES, 'methods'])} (default: all)")
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "docs/results/contact_examples.csv", help="table to write")
    options = parser.parse_args()
    rows = []
    for name in options.cases or [*MEASURES, "methods"]:
        if name not in (*MEASURES, "methods"):
            parser.error(f"case {name}: unknown; allowed: {', '.join([*MEASURES, 'methods'])}")
        print(name, file=sys.stderr, flush=True)
        with tempfile.TemporaryDirectory() as folder:
            found, summary = measured(name, options.program.resolve(), pathlib.Path(folder))
        rows += [[name, *cells] for cells in found]
    facts = {"program": summary["program"], "hardware": processor(), "threads": "1",
             "date": datetime.date.today().isoformat()}
    with options.out.open("w") as file:
        for name, value in facts.items():
            file.write(f"# {name}: {value}\n")
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows([[written(cell) for cell in cells] for cells in rows])
    print(options.out.read_text(), end="")


if __name__ == "__main__":
    main()
