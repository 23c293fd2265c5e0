"""Runs the scenes of contact_scenes.py with LAMMPS, on one core."""
import math
import pathlib
import re
import subprocess
import tempfile

import contact_scenes as scenes
import numpy as np
from lammps import SHARES, command, loop_time


def write_particles(file, bodies, shares, spacing, low, high):
    """A data file of particles, a type and a molecule for each body.
    @param shares of a ball's mass, for each of its particles; low, high of space"""
    points = [(k + 1, x, share * scenes.MASS) for k, body in enumerate(bodies) for x, share in zip(body, shares)]
    support, reach = 1.005 * spacing, 0.5 * spacing  # halves: the 6 + 12 + 8 + 6 nearest lattice points, and contact
    lines = ["contact_peers.py", "", f"{len(points)} atoms", f"{len(bodies)} atom types"]
    lines += [f"{a} {b} {axis}lo {axis}hi" for axis, a, b in zip("xyz", low, high)]
    lines += ["", "Atoms # smd", ""]
    for number, (body, x, mass) in enumerate(points, 1):
        place = " ".join(f"{c:.12g}" for c in x)
        lines.append(f"{number} {body} {body} {mass / scenes.DENSITY:.12g} {mass:.12g} {support:.9g} {reach:.9g} {place} {place}")
    pathlib.Path(file).write_text("\n".join(lines) + "\n")


def output_of(lmp, script, **variables):
    """The output of LAMMPS for a script of this folder, on the core of this process."""
    return subprocess.run(command(lmp, script, **variables), capture_output=True, text=True, check=True).stdout


def busy(output):
    """The time of the last run on the core, without set-up [s]: other programs may have used it, too."""
    return loop_time(output) * float(re.findall(r"(\S+)% CPU use", output)[-1]) / 100


def balls(lmp, across, stiffness, cloud=None):
    """One impact with the largest step tried that stays stable: the measures, or None.
    @param stiffness of E; cloud: points and volumes of a ball, in place of the middles of cells"""
    ball, s = scenes.ball_of_cells(across)
    shares = np.full(len(ball), 1 / len(ball))
    apart = scenes.RADIUS
    if cloud:
        ball, shares = cloud[0], cloud[1] / cloud[1].sum()
        apart += 0.5 * s
    bodies = [ball - [apart, 0, 0], ball * [-1, 1, 1] + [apart, 0, 0]]
    for share in SHARES:
        step = share * s / scenes.WAVE
        with tempfile.TemporaryDirectory() as folder:
            data = pathlib.Path(folder) / "balls.data"
            write_particles(data, bodies, shares, s, [-0.5, -0.3, -0.3], [0.5, 0.3, 0.3])
            try:
                out = output_of(lmp, "contact_balls.in", data=data, step=step, steps=int(1.9 * scenes.DURATION / step),
                                speed=scenes.SPEED, stiffness=stiffness * scenes.E, skin=0.5 * s)
            except subprocess.CalledProcessError:
                continue
        looks = [[float(x) for x in line.split()] for line in re.findall(r"^=== (.*)$", out, re.M)]
        found = scenes.impact(looks)
        if found and math.isfinite(found["approach"]) and abs(found["restitution"]) < 1.05:
            return {**found, "points": 2 * len(ball), "step": step,
                    "seconds": busy(out) * 1.5 * scenes.DURATION / looks[-1][0]}
    return None


def read_frames(file, bodies):
    """Times are those of frames: points and velocities (frames, bodies, n, 3)."""
    frames = []
    for part in pathlib.Path(file).read_text().split("ITEM: ATOMS")[1:]:
        rows = part.split("ITEM: TIMESTEP")[0].splitlines()[1:]
        frames.append(np.array([row.split() for row in rows], float)[:, 1:])
    whole = [frame for frame in frames if len(frame) == len(frames[0])]
    state = np.array(whole).reshape(len(whole), bodies, -1, 6)
    return state[..., :3], state[..., 3:], len(whole) == len(frames)


def drop(lmp, across, stiffness, share=0.3):
    """One drop: the measures. @param stiffness of contact, of E, and of walls, of E times the spacing"""
    ball, s = scenes.ball_of_cells(across)
    bodies = [ball + centre for centre in scenes.drop_centres()]
    every = math.ceil(1 / scenes.FRAMES / (share * s / scenes.DROP_WAVE))
    step = 1 / scenes.FRAMES / every
    told = {"points": 27 * len(ball), "step": step}
    mass = scenes.MASS / len(ball)
    with tempfile.TemporaryDirectory() as folder:
        data, frames = pathlib.Path(folder) / "drop.data", pathlib.Path(folder) / "drop.txt"
        write_particles(data, bodies, np.full(len(ball), 1 / len(ball)), s, [0, 0, 0], [scenes.ROOM, scenes.ROOM, 2])
        try:
            out = output_of(lmp, "contact_drop.in", data=data, frames=frames, step=step, every=every,
                            steps=round(scenes.DROP_END * scenes.FRAMES) * every, stiffness=stiffness * scenes.DROP_E,
                            wall=stiffness * scenes.DROP_E * s, reach=0.5 * s, room=scenes.ROOM,
                            drag=scenes.DAMPING * mass, skin=0.5 * s)
        except subprocess.CalledProcessError as error:
            return {**told, "stable": "no", "why": (re.findall(r"ERROR.*", error.stdout or "") or ["it stopped"])[0]}
        points, velocities, whole = read_frames(frames, 27)
    if not whole:
        return {**told, "stable": "no", "why": "particles are lost"}
    times = np.arange(len(points)) / scenes.FRAMES
    found = scenes.drop_measures(times, points, velocities, np.full(points.shape[1:3], mass), s, 0.5 * s)
    return {**told, **found, "seconds": busy(out) / scenes.DROP_END}
