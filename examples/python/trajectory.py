"""From a scene to a plot: run it, read its trajectory back, and look at the energies.

    python3 trajectory.py [picture.png]
"""
import sys
import tempfile

import matplotlib
matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import phyxel

SCENE = """
title = "Spinning block"
time = { end = 4 }                                        # s
solver = { precision = "double" }
output = { frames_per_second = 25 }

[[body]]
shape = "block"                                           # centred on the origin
size = [0.4, 0.3, 0.2]                                    # m; y is the axis of the middle moment of inertia
phyxels = 1500                                            # about
spin = [0.1, 10, 0]                                       # rad/s; the first number tips it over
material = { young = 1e5, poisson = 0.3, density = 1000 } # Pa, 1, kg/m^3
"""

with tempfile.TemporaryDirectory() as folder:
    simulation = phyxel.Simulation(SCENE)
    simulation.record(folder + "/out")  # what `phyxel run` would write
    simulation.run()
    trajectory = phyxel.Trajectory(folder + "/out")
    energy = trajectory.energy
    surfaces = trajectory.surface[::max(1, len(trajectory) // 3)][:4]

total = energy["total_energy"]
print(f"{len(trajectory)} frames to t = {trajectory.times[-1]:g} s; energy drifts by "
      f"{np.ptp(total) / energy['kinetic_energy'].max():.1e} of the largest kinetic one")

figure = plt.figure(figsize=(8, 5), layout="constrained")
for k, frame in enumerate(surfaces):
    axes = figure.add_subplot(2, len(surfaces), k + 1, projection="3d")
    axes.plot_trisurf(*frame.points.T, triangles=frame.triangles, color="#4c8fc4", linewidth=0)
    axes.set(title=f"t = {frame.time:.3g} s", xticks=[], yticks=[], zticks=[])
    axes.set_aspect("equal")
axes = figure.add_subplot(2, 1, 2)
axes.plot(energy["time"], energy["kinetic_energy"], label="kinetic")
axes.plot(energy["time"], energy["strain_energy"], label="strain")
axes.plot(energy["time"], total, label="total")
axes.set(xlabel="time [s]", ylabel="energy [J]")
axes.legend()
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else "trajectory.png", dpi=100)
