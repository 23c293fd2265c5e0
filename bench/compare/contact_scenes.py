"""The two scenes of contact_peers.py, and what is measured in them, the same for all programs.

balls: those of `phyxel accuracy contact`. drop: 27 balls fall into a box, in three layers, and come to rest.
"""
import math

import numpy as np

E, POISSON, DENSITY = 1e6, 0.3, 1000  # [Pa], -, [kg/m³]
RADIUS = 0.1  # [m]
WAVE = math.sqrt(E * (1 - POISSON) / ((1 + POISSON) * (1 - 2 * POISSON)) / DENSITY)  # speed of pressure waves [m/s]
SPEED = 0.02 * math.sqrt(E / DENSITY)  # of one ball relative to the other [m/s]
# Of bench/references/ball_on_planes.py.
DURATION = 11.398 * RADIUS * math.sqrt(DENSITY / E)  # [s]
APPROACH = 0.07820 * RADIUS  # [m]
MASS = DENSITY * 4 / 3 * math.pi * RADIUS**3  # [kg]

DROP_E = 5e5  # [Pa]
DROP_WAVE = WAVE * math.sqrt(DROP_E / E)
GRAVITY = 9.81  # [m/s²]
DAMPING = 4.0  # share of the velocity that is lost each second [1/s]
DROP_END = 2.0  # [s]
FRAMES = 100  # per second
ROOM = 0.61  # width of the box [m]
PITCH, LAYER = 0.203, 0.21  # distances of the balls' centres at the start, sideways and upwards [m]
LIFT = 0.2  # height of the lowest balls above the floor [m]


def drop_centres():
    """Centres of the 27 balls at the start (27, 3) [m], each shifted at random, by up to 4 mm upwards and downwards and
    half a millimetre sideways. The box is from 0 to ROOM, its floor at 0."""
    shifts = np.random.default_rng(1).uniform(-1, 1, (27, 3)) * [0.0005, 0.0005, 0.004]
    places = np.array([[x - 1, y - 1, z] for z in range(3) for y in range(3) for x in range(3)])
    return places * [PITCH, PITCH, LAYER] + [ROOM / 2, ROOM / 2, LIFT + RADIUS] + shifts


def rest_height():
    """Height of the centre of mass at rest [m], if each column carries itself: Hertz's formula for each contact."""
    weight = MASS * GRAVITY

    def approach(force, stiffness, radius):
        return (force / (4 / 3 * stiffness * math.sqrt(radius))) ** (2 / 3)

    hard = DROP_E / (1 - POISSON**2)
    floor = approach(3 * weight, hard, RADIUS)
    lower, upper = (approach(k * weight, hard / 2, RADIUS / 2) for k in (2, 1))
    return 3 * RADIUS - floor - 2 / 3 * lower - 1 / 3 * upper


def ball_of_cells(across):
    """The middles of those cells of a lattice that lie in the ball (n, 3) [m], and the spacing [m]."""
    s = 2 * RADIUS / across
    line = s * (np.arange(across) + 0.5) - RADIUS
    points = np.stack(np.meshgrid(line, line, line, indexing="ij"), -1).reshape(-1, 3)
    return points[np.linalg.norm(points, axis=1) < RADIUS], s


def impact(looks, touching=None):
    """Duration [s], approach [m] and restitution of two balls that meet, from looks (t, x and v of both centres of mass),
    and from their gap in each look, if forces are too coarse to tell."""
    t, left, right, v_left, v_right = np.array(looks, float).T
    if touching is None:
        force = -np.gradient(v_left, t) * MASS
        touching = 1e-6 * MASS * SPEED / DURATION - force
    inside = np.flatnonzero(np.asarray(touching) < 0)
    if len(inside) == 0:
        return None
    first, last = inside[0], inside[-1]
    approach = left - right - (left - right)[max(0, first - 1)]
    return {"duration": t[last] - t[first] + (t[1] - t[0]), "approach": approach.max(),
            "restitution": (v_right[-1] - v_left[-1]) / SPEED, "ended": bool(last < len(t) - 2)}


def depth_in(points, hull):
    """How deep the deepest of the points is in a convex hull [m]; negative: the distance to it, or less."""
    return -(points @ hull.equations[:, :3].T + hull.equations[:, 3]).max(axis=1).min()


def depths(frames, gap, wall_gap):
    """The largest depths in the walls and in other bodies [m].
    @param frames points (frames, bodies, n, 3)
    @param gap distance of points from another body's hull at which bodies touch; wall_gap: from walls [m]"""
    from scipy.spatial import ConvexHull
    walls = max((wall_gap - frames).max(), (frames[..., :2] + wall_gap - ROOM).max())
    deepest = -math.inf
    for bodies in frames:
        centres = bodies.mean(axis=1)
        hulls = [ConvexHull(points) for points in bodies]
        for i, j in ((i, j) for i in range(len(bodies)) for j in range(len(bodies)) if i != j):
            if np.linalg.norm(centres[i] - centres[j]) < 2.2 * RADIUS:
                deepest = max(deepest, gap + depth_in(bodies[i], hulls[j]))
    return walls, deepest


def drop_measures(times, frames, velocities, masses, gap, wall_gap):
    """What a drop comes to.
    @param frames, velocities (frames, bodies, n, 3) [m], [m/s]
    @param masses of points (bodies, n) [kg]"""
    finite = np.isfinite(frames).all() and np.isfinite(velocities).all() and np.abs(frames).max() < 10
    if not finite:
        return {"stable": "no"}
    m = masses[None, :, :, None]
    total = masses.sum()
    kinetic = 0.5 * (m * velocities**2).sum(axis=(1, 2, 3))
    height = (m[..., 0] * frames[..., 2]).sum(axis=(1, 2)) / total
    mechanical = kinetic + total * GRAVITY * height
    fall = mechanical[0] - total * GRAVITY * rest_height()
    walls, bodies = depths(frames[::5], gap, wall_gap)
    late = times > times[-1] - 0.25
    return {"stable": "yes", "walls": walls, "bodies": bodies, "height": height[late].mean(),
            "highest": (mechanical.max() - mechanical[0]) / fall,
            "kinetic": kinetic[late].mean() / fall}
