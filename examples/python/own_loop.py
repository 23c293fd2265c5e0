"""A step loop of your own: a plucked bar, in vacuum and in honey.

A pull at the tip bends it until it is let go. The loop then looks at the live state without a
copy, and sets a drag force of its own before every step. The period found is held against the
theory of slender beams.

    python3 own_loop.py [picture.png]
"""
import sys

import matplotlib
matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import phyxel

LENGTH, THICKNESS, YOUNG, DENSITY = 1.0, 0.1, 1e7, 1000.0  # [m], [m], [Pa], [kg/m^3]
bar = phyxel.shape("beam", size=(LENGTH, THICKNESS, THICKNESS), spacing=THICKNESS / 4)
scene = {
    "time": {"end": 1},
    "solver": {"device": "cpu", "precision": "double"},
    "body": [{"cloud": "bar", "closure": 0.01,
              "material": {"young": YOUNG, "poisson": 0, "density": DENSITY},
              "fixed": [{"region": "x-"}]}],
}

pull = {"region": "x+", "force": [0, 0, 5]}  # [N]
bent = phyxel.Simulation(scene | {"body": [scene["body"][0] | {"load": [pull]}]}, clouds={"bar": bar},
                         method="equilibrium")
bent.run()


def plucked(drag, steps=6000):
    """Times [s] and heights of the tip [m]. drag: [1/s], a force per mass and speed."""
    simulation = phyxel.Simulation(scene, clouds={"bar": bar})
    simulation.set_state(displacement=bent.displacement)
    tip = bar.regions["x+"][0]
    live = simulation.live  # shows every step, without a copy
    height = live.displacement[live.pack[tip], 2]  # of all lanes
    times, heights = [], []
    for _ in range(steps):
        if drag:
            velocity = live.velocity[live.pack, :, live.lane]
            simulation.external_forces = -drag * simulation.mass[:, None] * velocity
        simulation.step()
        times.append(simulation.time)
        heights.append(height[live.lane[tip]])
    return np.array(times), np.array(heights)


def period(times, heights):
    """From where it crosses zero upwards [s]."""
    up = np.flatnonzero((heights[:-1] < 0) & (heights[1:] >= 0))
    crossings = times[up] - heights[up] * np.diff(times)[up] / np.diff(heights)[up]
    return np.mean(np.diff(crossings))


vacuum, honey = plucked(0), plucked(12)
theory = 2 * np.pi / (1.875104**2 * np.sqrt(YOUNG * THICKNESS**2 / (12 * DENSITY * LENGTH**4)))
print(f"period {period(*vacuum):.4f} s; slender beams have {theory:.4f} s, thick ones a little more")

figure, axes = plt.subplots(figsize=(8, 3.6), layout="constrained")
axes.plot(*vacuum, label="in vacuum")
axes.plot(*honey, label="with a drag of its own")
axes.set(xlabel="time [s]", ylabel="height of the tip [m]")
axes.legend(loc="upper right")
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else "own_loop.png", dpi=100)
