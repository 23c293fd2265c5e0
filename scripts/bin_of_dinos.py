#!/usr/bin/env python3
"""Writes a scene of many dinos, each turned at random, that fall into a bin: 575 phyxels each.

    scripts/bin_of_dinos.py bin.toml                     10 x 10 x 10 dinos: 575,000 phyxels, for a GPU
    scripts/bin_of_dinos.py bin.toml --count 3 3 3       27 dinos: a minute or two on a CPU
    phyxel run bin.toml

Dinos begin at the points of a cubic grid that is so wide that they do not overlap, however they are turned. The same seed gives
the same scene. examples/bin_of_dinos has six of them, with a surface to look at.
"""
import argparse
import math
import pathlib
import random

#: The smallest ball around the surface of a dino: its centre and radius [m].
CENTRE, RADIUS = (-0.187, 0.0, 0.149), 0.9203
SPACING = 1.86  # of the grid [m]: two radii and 2 cm
FLOOR_GAP = 0.02  # [m]


def random_turn(draw):
    """Axis times angle [degrees] of a rotation, uniform among all rotations (Shoemake 1992)."""
    u, v, w = draw.random(), 2 * math.pi * draw.random(), 2 * math.pi * draw.random()
    axis = [math.sqrt(1 - u) * math.cos(v), math.sqrt(u) * math.sin(w), math.sqrt(u) * math.cos(w)]
    scalar = math.sqrt(1 - u) * math.sin(v)
    sine = math.hypot(*axis)
    angle = 2 * math.atan2(sine, scalar)
    return [round(math.degrees(angle) * x / sine, 6) for x in axis]


def turned(x, degrees):
    """A point turned about the origin by axis times angle: Rodrigues' formula."""
    angle = math.radians(math.hypot(*degrees))
    k = [d / math.hypot(*degrees) for d in degrees]
    along = sum(a * b for a, b in zip(k, x))
    across = [k[1] * x[2] - k[2] * x[1], k[2] * x[0] - k[0] * x[2], k[0] * x[1] - k[1] * x[0]]
    return [c * math.cos(angle) + s * math.sin(angle) + a * along * (1 - math.cos(angle)) for a, c, s in zip(k, x, across)]


def bodies(count, draw):
    """A table of the scene for each dino, from below upwards."""
    grid = [(i, j, k) for k in range(count[2]) for j in range(count[1]) for i in range(count[0])]
    for number, cell in enumerate(grid, 1):
        middle = [SPACING * (c - (n - 1) / 2) for c, n in zip(cell[:2], count)] + [RADIUS + FLOOR_GAP + SPACING * cell[2]]
        turn = random_turn(draw)
        place = [round(m - x, 6) for m, x in zip(middle, turned(CENTRE, turn))]
        yield f"""
[[body]]
name = "dino {number}"
shape = "dino"
rotation = {turn}
translation = {place}
material = {{ law = "neo-hookean", young = YOUNG, poisson = 0.3, density = 1000, viscosity = 1e-3, damping = DAMPING }}
"""


def scene(options):
    nx, ny, nz = options.count
    dinos = nx * ny * nz
    wide, deep, high = (SPACING * n + 0.1 for n in (nx, ny, nz))
    high *= 1.5
    head = f"""# {dinos:,} dinos fall into a bin: {575 * dinos:,} phyxels. Made by scripts/bin_of_dinos.py, seed {options.seed}.
title = "{dinos:,} dinos in a bin"
gravity = [0, 0, -9.81]        # m/s^2

[time]
end = {options.end:g}                      # s

[output]
frames_per_second = 20
surface = {"true" if dinos <= 64 else "false"}                # 53,504 surfels for each dino

[contact]
friction = 0.3

[[obstacle]]
name = "bin"
shape = "box"
size = [{wide:.3f}, {deep:.3f}, {high:.3f}]
hollow = true
translation = [0, 0, {high / 2:.4f}]
friction = 0.3

# damping: they sink at {9.81 / options.damping if options.damping else math.inf:.3g} m/s at most, as in a liquid, well below the speed of sound in them.
"""
    text = head + "".join(bodies(options.count, random.Random(options.seed)))
    return text.replace("YOUNG", f"{options.young:g}").replace("DAMPING", f"{options.damping:g}")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("file", type=pathlib.Path, help="scene to write")
    parser.add_argument("--count", type=int, nargs=3, default=(10, 10, 10), metavar="N", help="dinos along x, y and z")
    parser.add_argument("--seed", type=int, default=1, help="of the turns")
    parser.add_argument("--young", type=float, default=1e5, help="Young's modulus [Pa]")
    parser.add_argument("--damping", type=float, default=2.5, help="damping of all motion [1/s]")
    parser.add_argument("--end", type=float, default=8, help="simulated time [s]")
    options = parser.parse_args()
    options.file.write_text(scene(options))


if __name__ == "__main__":
    main()
