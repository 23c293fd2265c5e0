"""Runs the scenes of contact_scenes.py with phyxel, on one core."""
import csv
import io
import os
import pathlib
import resource
import subprocess
import tempfile

import contact_scenes as scenes
import numpy as np

#: Discretisations of the balls.
WAYS = {"fitted": ["--lattice", "mesh", "--closure", "0.001"], "fitted; not closed": ["--lattice", "mesh", "--closure", "0"],
        "cells": ["--lattice", "cells", "--closure", "0"]}
SCENE = """gravity = [0, 0, -{gravity}]
[time]
end = {end}
[solver]
precision = "{precision}"
threads = 1
[output]
directory = "out"
frames_per_second = {frames}
fields = ["velocity", "mass", "body", "volume"]
surface = false
recovery = false
checkpoint_every = 0
{contact}
"""
BODY = """[[body]]
name = "{k}"
shape = "sphere"
radius = {radius}
phyxels = {phyxels}
translation = [{x}, {y}, {z}]
velocity = [{speed}, 0, 0]
material = {{ law = "{law}", young = {young}, poisson = {poisson}, density = {density}, damping = {damping} }}
"""
BOX = """{contact}
[[obstacle]]
name = "box"
shape = "box"
hollow = true
size = [{room}, {room}, 4]
translation = [{half}, {half}, 2]
"""


def run(command, folder=None):
    """The output of a command on one thread, and its time on the core, with its set-up [s]."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    out = subprocess.run(command, capture_output=True, text=True, cwd=folder,
                         env={**os.environ, "OMP_NUM_THREADS": "1"}, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return out, after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime


def balls(phyxel, across, way):
    out, seconds = run([phyxel, "accuracy", "balls", "--across", str(across), *WAYS[way]])
    out.check_returncode()
    rows = list(csv.DictReader(io.StringIO("\n".join(line for line in out.stdout.splitlines() if not line.startswith("#")))))
    value = {row["quantity"]: float(row["value"]) for row in rows}
    return {"duration": value["time of contact"], "approach": value["approach"], "restitution": value["restitution"],
            "points": int(rows[0]["phyxels"]), "step": "", "seconds": seconds}


def body(name, young, phyxels, centre, law="neo-hookean", speed=0.0, damping=0.0):
    return BODY.format(k=name, radius=scenes.RADIUS, phyxels=phyxels, x=centre[0], y=centre[1], z=centre[2], young=young,
                       poisson=scenes.POISSON, density=scenes.DENSITY, damping=damping, law=law, speed=speed)


def read_frames(folder):
    """The points, velocities, masses and volumes of all frames, body by body."""
    import h5py
    found = {"Points": [], "velocity": []}
    for file in sorted(pathlib.Path(folder).glob("phyxels_*.hdf")):
        with h5py.File(file) as frame:
            data = frame["VTKHDF"]
            found["Points"].append(data["Points"][:])
            found["velocity"].append(data["PointData/velocity"][:])
            masses, volumes, count = data["PointData/mass"][:], data["PointData/volume"][:], len(set(data["PointData/body"][:]))
    return (*(np.array(found[name]).reshape(len(found[name]), count, -1, 3) for name in ("Points", "velocity")),
            masses.reshape(count, -1), volumes.reshape(count, -1))


def fitted_ball(phyxel, phyxels):
    """Points and volumes of a fitted ball."""
    with tempfile.TemporaryDirectory() as folder:
        scene = SCENE.format(gravity=0, end=1e-6, precision="double", frames=0, contact="")
        (pathlib.Path(folder) / "ball.toml").write_text(scene + body("ball", scenes.E, phyxels, (0, 0, 0)))
        run([phyxel, "run", "ball.toml"], folder)[0].check_returncode()
        points, _, _, volumes = read_frames(pathlib.Path(folder) / "out")
    return points[0, 0], volumes[0]


def balls_of_scene(phyxel, phyxels, contact):
    """One impact of fitted balls by `phyxel run`: the measures, by looks at frames. @param contact the section [contact]"""
    looks_per_second = 200 / scenes.DURATION
    with tempfile.TemporaryDirectory() as folder:
        scene = SCENE.format(gravity=0, end=1.5 * scenes.DURATION, precision="double", frames=looks_per_second, contact=contact)
        for name, side in (("left", -1), ("right", 1)):
            scene += body(name, scenes.E, phyxels, (side * scenes.RADIUS, 0, 0), "small-strain", -0.5 * side * scenes.SPEED)
        (pathlib.Path(folder) / "balls.toml").write_text(scene)
        out, seconds = run([phyxel, "run", "balls.toml"], folder)
        out.check_returncode()
        x, v, masses, _ = read_frames(pathlib.Path(folder) / "out")
        with open(pathlib.Path(folder) / "out/contacts.csv", encoding="utf-8") as file:
            impulses = [float(row["impulse_x [N s]"]) for row in csv.DictReader(file) if row["obstacle"] == "right"]
        step = float(out.stdout.split("time step")[1].split()[0])
    weights = masses / masses.sum(axis=1, keepdims=True)
    centres, speeds = ((weights * values[..., 0]).sum(axis=2) for values in (x, v))
    times = np.arange(len(x)) / looks_per_second
    pushes = np.append(np.diff(impulses), 0) * looks_per_second  # mean forces from each frame to the next
    least = 1e-6 * scenes.MASS * scenes.SPEED / scenes.DURATION
    found = scenes.impact(np.column_stack([times, centres, speeds]), least - pushes)
    return {**found, "points": 2 * phyxels, "step": step, "seconds": seconds}


def drop(phyxel, phyxels, contact, precision):
    """One drop: the measures. @param contact the section [contact]"""
    box = BOX.format(room=scenes.ROOM, half=scenes.ROOM / 2, contact=contact)
    with tempfile.TemporaryDirectory() as folder:
        scene = SCENE.format(gravity=scenes.GRAVITY, end=scenes.DROP_END, precision=precision, frames=scenes.FRAMES, contact=box)
        scene += "".join(body(k, scenes.DROP_E, phyxels, centre, damping=scenes.DAMPING)
                         for k, centre in enumerate(scenes.drop_centres(), 1))
        (pathlib.Path(folder) / "drop.toml").write_text(scene)
        out, seconds = run([phyxel, "run", "drop.toml"], folder)
        if out.returncode:
            why = out.stderr.split("error: ")[-1].split(",")[0].replace('"', "").strip()
            return {"stable": "no", "points": 27 * phyxels, "step": "", "why": why}
        points, velocities, masses, _ = read_frames(pathlib.Path(folder) / "out")
        step = out.stdout.split("time step")[1].split()[0]
    found = scenes.drop_measures(np.arange(len(points)) / scenes.FRAMES, points, velocities, masses, 0, 0)
    return {**found, "points": 27 * phyxels, "step": float(step), "seconds": seconds / scenes.DROP_END}
