#!/usr/bin/env python3
"""Solves a linear elastic ball in contact with rigid planes without friction, beside Hertz: the force and the largest
pressure if two planes press it, and the time and the depth of an impact of two such balls.

    ball_on_planes.py [--approach 0.04] [--speed 0.02] [--elements 6 12 24]

Quadratic axisymmetric elements on the meridian section, finer towards the pole, with small strains. The surface feels a
pressure of 10⁵ E/R times its depth in the plane at each Gauss point, so that it is 2·10⁻⁶ R deep at most.
In an impact, the ball is in balance with its uniform inertia at all times, and its centre of mass approaches the plane:
the force law of a table of such states is integrated in time. The speed is that of one ball relative to the other,
over √(E/ρ); the depth is the approach of both centres. Young's modulus, the radius and the density are 1, Poisson's
ratio 0.3. Needs numpy and scipy.
"""
import argparse
import math

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl

POISSON = 0.3
STIFFNESS = 1e5  # of contact [E/R]
LINE = np.array([0, 0.5, 1])


def shapes(x):
    """Shape functions on [0, 1] with nodes at 0, 1/2 and 1, and their derivatives."""
    return (np.stack([(1 - x) * (1 - 2 * x), 4 * x * (1 - x), x * (2 * x - 1)], -1),
            np.stack([4 * x - 3, 4 - 8 * x, 4 * x - 1], -1))


def blocks(n, whole):
    """Grids of three blocks of a quarter disc, or six of half a disc: (r, z) at (2 p + 1) × (2 q + 1) nodes each. The
    first has the pole."""
    def finer(count):  # towards 0, where elements are a twentieth of the mean
        t = np.linspace(0, 1, 2 * count + 1)
        t[1::2] = np.nan
        t = np.sinh(4.5 * t) / math.sinh(4.5)
        t[1::2] = 0.5 * (t[:-2:2] + t[2::2])
        return t

    half = 0.5  # side of the inner square
    angle, depth = finer(3 * n), finer(2 * n)  # from the pole and from the surface
    even = np.linspace(0, 1, 2 * n + 1)

    def to_sphere(side, t):
        """Places between the inner square (0) and the circle (1), for tan of the angle from z."""
        outer = np.stack([side, np.ones_like(side)], -1) / np.hypot(side, 1)[:, None]
        inner = half * np.stack([side, np.ones_like(side)], -1)
        return inner[:, None] + t[None, :, None] * (outer - inner)[:, None]

    out = 1 - depth[::-1]
    top = to_sphere(np.tan(math.pi / 4 * angle), out)
    right = to_sphere(np.tan(math.pi / 4 * even), out)[..., ::-1][::-1]
    square = half * np.stack(np.meshgrid(np.tan(math.pi / 4 * angle), np.tan(math.pi / 4 * even), indexing="ij"), -1)
    quarter = [top, right, square]
    return quarter + ([grid * [1, -1] for grid in quarter] if whole else [])


def mesh(n, whole):
    """Nodes (k, 2), elements (m, 9) and the elements' sides on the sphere above 45° (e, 3)."""
    places, number = [], {}

    def node(x):
        key = tuple(np.round(x, 9))
        if key not in number:
            number[key] = len(places)
            places.append(x)
        return number[key]

    cells, sides = [], []
    for which, grid in enumerate(blocks(n, whole)):
        ids = np.array([[node(x) for x in row] for row in grid])
        for i in range(0, ids.shape[0] - 1, 2):
            for j in range(0, ids.shape[1] - 1, 2):
                cells.append(ids[i:i + 3, j:j + 3].ravel())
        if which == 0:
            sides = [ids[i:i + 3, -1] for i in range(0, ids.shape[0] - 1, 2)]
    return np.array(places), np.array(cells), np.array(sides)


def matrices(nodes, cells):
    """The stiffness matrix, and the share of each node in a uniform body force."""
    gauss, weight = np.polynomial.legendre.leggauss(4)
    gauss, weight = (gauss + 1) / 2, weight / 2
    x, y = (g.ravel() for g in np.meshgrid(gauss, gauss, indexing="ij"))
    w = np.outer(weight, weight).ravel()
    (nx, dx), (ny, dy) = shapes(x), shapes(y)
    value = np.einsum("pi,pj->pij", nx, ny).reshape(-1, 9)
    slope = np.stack([np.einsum("pi,pj->pij", dx, ny).reshape(-1, 9), np.einsum("pi,pj->pij", nx, dy).reshape(-1, 9)], -1)
    jacobian = np.einsum("pkd,mkc->mpcd", slope, nodes[cells])
    determinant = np.abs(np.linalg.det(jacobian))
    gradient = np.einsum("pkd,mpdc->mpkc", slope, np.linalg.inv(jacobian))
    r = np.einsum("pk,mk->mp", value, nodes[cells][..., 0])
    b = np.zeros((*r.shape, 4, 9, 2))  # strains rr, zz, hoop, 2 rz
    b[:, :, 0, :, 0] = gradient[..., 0]
    b[:, :, 1, :, 1] = gradient[..., 1]
    b[:, :, 2, :, 0] = value / r[..., None]
    b[:, :, 3, :, 0] = gradient[..., 1]
    b[:, :, 3, :, 1] = gradient[..., 0]
    b = b.reshape(*r.shape, 4, 18)
    shear = 0.5 / (1 + POISSON)
    lame = POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
    law = np.diag([2 * shear, 2 * shear, 2 * shear, shear])
    law[:3, :3] += lame
    k = np.einsum("mpas,ab,mpbt,mp->mst", b, law, b, 2 * math.pi * r * determinant * w, optimize=True)
    unknown = (2 * cells[:, :, None] + np.arange(2)).reshape(len(cells), -1)
    rows, columns = np.repeat(unknown, 18, 1).ravel(), np.tile(unknown, (1, 18)).ravel()
    share = np.zeros(len(nodes))
    np.add.at(share, cells, np.einsum("pk,mp->mk", value, r * determinant * w))
    return sp.csr_matrix((k.ravel(), (rows, columns)), shape=(2 * len(nodes),) * 2), share


class Ball:
    """A ball, or the half of it above z = 0, whose pole may be in contact with a plane."""

    def __init__(self, n, whole):
        self.nodes, cells, self.sides = mesh(n, whole)
        self.stiffness, weight = matrices(self.nodes, cells)
        self.weight = np.zeros(2 * len(self.nodes))  # of nodes along z, in sum 1
        self.weight[1::2] = weight / weight.sum()
        x, w = np.polynomial.legendre.leggauss(5)
        self.value, slope = shapes((x + 1) / 2)
        self.place = np.einsum("pk,ekc->epc", self.value, self.nodes[self.sides])
        along = np.einsum("pk,ekc->epc", slope, self.nodes[self.sides])
        # The pressure acts along z, on the projected area at rest.
        self.area = 2 * math.pi * self.place[..., 0] * np.abs(along[..., 0]) * w / 2
        self.free = np.ones(2 * len(self.nodes), bool)
        self.free[2 * np.flatnonzero(self.nodes[:, 0] < 1e-9)] = False
        if not whole:
            self.free[2 * np.flatnonzero(self.nodes[:, 1] < 1e-9) + 1] = False

    def touched(self, plane, force=0.0):
        """Displacements and pressures with a plane at this height and a uniform body force of this sum along z."""
        u, active, up = np.zeros(2 * len(self.nodes)), self.place[..., 1] > min(plane, 0.999), 2 * self.sides + 1
        for _ in range(100):
            load = force * self.weight
            depth = np.where(active, self.place[..., 1] - plane, 0)
            np.add.at(load, up, -STIFFNESS * np.einsum("ep,pk->ek", self.area * depth, self.value))
            block = STIFFNESS * np.einsum("ep,pk,pl->ekl", self.area * active, self.value, self.value)
            rows, columns = np.repeat(up, 3, 1).ravel(), np.tile(up, (1, 3)).ravel()
            contact = sp.csr_matrix((block.ravel(), (rows, columns)), shape=self.stiffness.shape)
            u[self.free] = spl.spsolve((self.stiffness + contact)[self.free][:, self.free].tocsc(), load[self.free])
            depth = self.place[..., 1] + np.einsum("pk,ek->ep", self.value, u[up]) - plane
            if ((depth > 0) == active).all():
                return u, STIFFNESS * np.maximum(depth, 0)
            active = depth > 0
        raise SystemExit("no set of touching points is found")


def pressed(n, approach):
    """The force, the largest pressure and the radius of contact of a ball between two planes; the number of nodes."""
    ball = Ball(n, whole=False)
    _, pressure = ball.touched(1 - approach)
    r, active = ball.place[..., 0], pressure > 0
    # At the pole, of the parabola in r² through the points within a third of the contact.
    near = (r < 0.33 * math.sqrt(approach)) & active
    top = np.polynomial.Polynomial.fit(r[near] ** 2, pressure[near], 2)(0)
    return float((ball.area * pressure).sum()), float(top), float(r[active].max()), len(ball.nodes)


def hertz(approach):
    return 4 / 3 / (1 - POISSON**2) * approach**1.5


def impact(n, speed):
    """Time of contact [R √(ρ/E)] and largest approach of both centres [R]; and those of Hertz."""
    mass = 4 / 3 * math.pi
    most = (15 * mass * (speed / 2) ** 2 / (16 / (1 - POISSON**2))) ** 0.4  # of one ball, on a plane
    ball = Ball(n, whole=True)
    approach, share = [], []
    for part in (0.1, 0.3, 0.5, 0.7, 0.9, 1.1):
        force = hertz(part * most)
        u, _ = ball.touched(1.0, force)
        approach.append(float(ball.weight @ u))
        share.append(force / hertz(approach[-1]))
    law = np.polynomial.Polynomial.fit(np.sqrt(approach), share, 3)

    def integrated(of_hertz):
        """By steps of the velocity form of Verlet's method; the last one is cut where the ball leaves the plane."""
        step, x, v, t, deepest = 1e-3, 0.0, speed / 2, 0.0, 0.0
        pull = lambda x: -hertz(x) * of_hertz(x) / mass if x > 0 else 0.0
        a = pull(x)
        while True:
            before = x
            x += step * v + 0.5 * step * step * a
            b = pull(x)
            v += 0.5 * step * (a + b)
            a, deepest = b, max(deepest, x)
            if x <= 0:
                return t + step * before / (before - x), 2 * deepest
            t += step

    return integrated(lambda x: law(math.sqrt(x))), integrated(lambda x: 1.0), list(zip(approach, share))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--approach", type=float, default=0.04, help="of each plane, in radii")
    parser.add_argument("--speed", type=float, default=0.02, help="of an impact")
    parser.add_argument("--elements", type=int, nargs="+", default=[6, 12, 24], help="along the inner square")
    options = parser.parse_args()
    radius = math.sqrt(options.approach)
    force, top = hertz(options.approach), 2 * radius / math.pi / (1 - POISSON**2)
    print(f"Hertz: force {force:.6g} E R², largest pressure {top:.6g} E, radius of contact {radius:.6g} R")
    for n in options.elements:
        f, p, a, count = pressed(n, options.approach)
        print(f"{count} nodes: force {f:.7g} ({f / force - 1:+.4%}), largest pressure {p:.6g} ({p / top - 1:+.4%}), radius {a:.5g}")
    for n in options.elements:
        (t, x), (t_hertz, x_hertz), law = impact(n, options.speed)
        print(f"impact: time {t:.6g} ({t / t_hertz - 1:+.3%} of Hertz's {t_hertz:.6g}), approach {x:.6g} "
              f"({x / x_hertz - 1:+.3%} of Hertz's {x_hertz:.6g})")
        print("  force beside Hertz's by approach:", ", ".join(f"{a:.4g}: {s:.4f}" for a, s in law))


if __name__ == "__main__":
    main()
