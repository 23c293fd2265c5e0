"""The cases: bodies, materials, loads, clamps, and the points at which references are given. SI units."""
import hashlib
import os

import numpy as np

import surfaces

YOUNG, POISSON, DENSITY = 1e6, 0.3, 1000.0
FIXED_BELOW = -10.0  # lower corner of a box that holds everything below a plane

# Plate with a hole: the force is uniform in the box x >= LOAD_FROM.
PLATE, HOLE, PULL, LOAD_FROM = (0.4, 0.2, 0.02), 0.05, 0.4, 0.38

# Bars: length, side, gravity. The first has the proportions of `phyxel accuracy gravity` and `bending`.
BARS = {"bar_5": (1.0, 0.2, 0.1), "bar": (1.0, 0.1, 0.01)}

# Bodies cut by a plane at a share of their extent along an axis. `loads`: case and gravity. `levels`: sizes of elements
# by the longest side.
BODIES = {
    "sphere": dict(axis=2, share=0.2, scale=1.0, loads={"sphere": (1.0, 0, 0)}, levels=(0.06, 0.04, 0.027)),
    "fandisk": dict(axis=1, share=0.15, scale=0.1, loads={"fandisk": (0, 0, -0.1)}, levels=(0.06, 0.042, 0.03)),
    "spot": dict(axis=1, share=0.15, scale=0.5, loads={"spot": (0, -0.2, 0), "spot_sideways": (0.05, 0, 0)},
                 levels=(0.045, 0.03, 0.022)),
}


class Body:
    """A body of BODIES: its whole surface, the cut part, and its plane."""

    def __init__(self, name, meshes):
        self.name = name
        for key, value in BODIES[name].items():
            setattr(self, key, value)
        if name == "sphere":
            self.vertices, self.faces = surfaces.ball(0.1)
            self.sha256 = None
        else:
            path = os.path.join(meshes, name + ".obj")
            vertices, self.faces = surfaces.read_obj(path)
            self.vertices = vertices * self.scale
            with open(path, "rb") as file:
                self.sha256 = hashlib.sha256(file.read()).hexdigest()
        low, high = self.vertices.min(0), self.vertices.max(0)
        self.longest = (high - low).max()
        # Nine digits, so that scenes hold the same number.
        self.plane = round(low[self.axis] + self.share * (high - low)[self.axis], 9)
        self.cut_vertices, self.cut_faces, rim = surfaces.cut(self.vertices, self.faces, self.axis, self.plane)
        # Where stresses are singular: the border of the clamped section, and re-entrant edges.
        self.rim = np.concatenate([rim, surfaces.creases(self.cut_vertices, self.cut_faces)])

    def held(self, x):
        return x[:, self.axis] < self.plane + 1e-9 * self.longest

    def named_points(self):
        """The vertex farthest from the clamp, and the outermost ones along the other axes."""
        free = self.vertices[self.vertices[:, self.axis] > self.plane + 0.08 * self.longest]
        found = {"far end": free[np.argmax(free[:, self.axis])]}
        for c in (c for c in range(3) if c != self.axis):
            found["least " + "xyz"[c]] = free[np.argmin(free[:, c])]
            found["largest " + "xyz"[c]] = free[np.argmax(free[:, c])]
        return found

    def inner_points(self, inside, count=200):
        """Points at least 8% of the longest side from the clamp and 2% inside the surface; `inside(x)`: a mask."""
        random, found = np.random.default_rng(2024), np.empty((0, 3))
        low, high = self.cut_vertices.min(0), self.cut_vertices.max(0)
        low[self.axis] = self.plane + 0.08 * self.longest
        while len(found) < count:
            x = np.round(low + random.random((count, 3)) * (high - low), 6)
            x = x[inside(x)]
            x = x[surfaces.distance_to(x, self.vertices, self.faces) > 0.02 * self.longest]
            found = np.concatenate([found, x])
        return found[:count]


def plate_points(count=200):
    """Points of the plate at least 0.01 m from the held face and from the loaded box, and inside its surface."""
    random, found = np.random.default_rng(2024), []
    while len(found) < count:
        x = np.round(np.array([0.01, -0.095, -0.008]) + random.random(3) * [0.36, 0.19, 0.016], 6)
        if np.hypot(x[0] - PLATE[0] / 2, x[1]) > HOLE + 0.005:
            found.append(x)
    return np.array(found)


PLATE_POINTS = {"end": (0.4, 0, 0), "end corner": (0.4, 0.1, 0.01), "hole side": (0.2, 0.05, 0),
                "hole front": (0.25, 0, 0), "hole back": (0.15, 0, 0)}
