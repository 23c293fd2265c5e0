"""Where does a soft ring come to rest when it hangs from a nail?

The ring is a triangle mesh made with NumPy, filled with phyxels; Newton's method finds the
equilibrium, and the picture shows its surface, coloured by how far it has moved.

    python3 ring_at_rest.py [picture.png]
"""
import sys

import matplotlib
matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import phyxel


def torus(large, small, around, across):
    """Points and triangles of a ring about the y axis [m]."""
    p, t = np.meshgrid(np.arange(around) * 2 * np.pi / around,
                       np.arange(across) * 2 * np.pi / across, indexing="ij")
    r = large + small * np.cos(t)
    points = np.stack([r * np.cos(p), small * np.sin(t), r * np.sin(p)], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(around), np.arange(across), indexing="ij")
    corner = lambda a, b: ((a % around) * across + b % across).ravel()
    a, b, c, d = corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)
    return points, np.concatenate([np.stack([a, c, b], 1), np.stack([a, d, c], 1)])


ring = phyxel.sample(torus(0.4, 0.08, 96, 32), phyxels=4000)
simulation = phyxel.Simulation({
    "title": "A ring on a nail",
    "gravity": [0, 0, -9.81],
    "solver": {"method": "equilibrium"},
    "body": [{"cloud": "ring",
              "material": {"young": 1e5, "poisson": 0.45, "density": 1000, "law": "neo-hookean"},
              "fixed": [{"ball": {"centre": [0, 0, 0.36], "radius": 0.09}}]}],
}, clouds={"ring": ring})
simulation.run()

surfels, _ = simulation.surface()
moved = np.linalg.norm(surfels - ring.surfels, axis=1)
print(f"{len(simulation)} phyxels; the ring is {np.ptp(ring.surfels[:, 2]):.3f} m high at first "
      f"and {np.ptp(surfels[:, 2]):.3f} m hanging")

figure = plt.figure(figsize=(8, 4.5))
for k, (points, title) in enumerate([(ring.surfels, "as made"), (surfels, "at rest")]):
    axes = figure.add_subplot(1, 2, k + 1, projection="3d")
    drawn = axes.plot_trisurf(*points.T, triangles=ring.triangles, cmap="viridis", linewidth=0)
    drawn.set_array((moved if k else 0 * moved)[ring.triangles].mean(axis=1))
    drawn.set_clim(0, moved.max())
    axes.set(title=title, xlim=(-.5, .5), ylim=(-.5, .5), zlim=(-.85, .55))
    axes.set_box_aspect((1, 1, 1.35), zoom=1.3)
    axes.set_axis_off()
    axes.view_init(12, -60)
figure.colorbar(drawn, ax=figure.axes, label="displacement [m]", shrink=0.7)
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else "ring_at_rest.png", dpi=100)
