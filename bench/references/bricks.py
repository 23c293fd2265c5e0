"""Meshes of graded hexahedra for the bar and the plate with a hole: a quarter of each, by symmetry."""
import itertools

import numpy as np

from fem import Hex


def graded(length, cells, layers, ratio=0.3):
    """Borders of cells on [0, length]: uniform ones, of which the first is divided towards 0 by a ratio."""
    borders = np.linspace(0, length, cells + 1)
    first = borders[1] * ratio ** np.arange(layers, 0, -1)
    return np.concatenate([[0], first, borders[1:]])


def line(borders, order):
    """Coordinates of all nodes on a line of elements."""
    inner = Hex(order).line[:-1]
    steps = borders[:-1, None] + np.diff(borders)[:, None] * inner
    return np.append(steps.reshape(-1), borders[-1])


def lattice(order, shape):
    """Nodes of each element in a lattice of (nx, ny, nz) elements, as indices of the lattice's nodes."""
    points = [order * n + 1 for n in shape]
    index = np.arange(np.prod(points)).reshape(points)
    steps = range(order + 1)
    grids = [order * np.arange(n) for n in shape]
    base = np.array(list(itertools.product(*grids)))
    local = np.array(list(itertools.product(steps, repeat=3)))
    at = base[:, None] + local
    return index[at[..., 0], at[..., 1], at[..., 2]]


def merged(parts):
    """One mesh of several (nodes, cells): coincident nodes become one."""
    nodes = np.concatenate([p[0] for p in parts])
    starts = np.cumsum([0] + [len(p[0]) for p in parts[:-1]])
    cells = np.concatenate([p[1] + s for p, s in zip(parts, starts)])
    scale = np.ptp(nodes, axis=0).max()
    _, first, same = np.unique(np.round(nodes / scale * 1e9).astype(np.int64), axis=0, return_index=True,
                               return_inverse=True)
    return nodes[first], same.reshape(-1)[cells].astype(np.int32)


def box(order, x, y, z):
    """Nodes and cells of a box, whose elements have the given borders."""
    grid = np.meshgrid(*(line(b, order) for b in (x, y, z)), indexing="ij")
    return np.stack([g.reshape(-1) for g in grid], 1), lattice(order, [len(b) - 1 for b in (x, y, z)])


def bar(level, length, side, order=3):
    """The quarter y >= 0, z >= 0 of a bar along x, graded towards the edges of its clamped end."""
    n, layers = level
    across = side / 2 - graded(side / 2, n, layers)[::-1]
    along = graded(length, int(round(n * length / side)), layers + 1)
    nodes, cells = box(order, along, across, across)
    return Hex(order), nodes, cells.astype(np.int32)


def ring(order, radius, half, ys, radial, tops, z):
    """Half of a square with a round hole, between rays from the hole's centre through the square's borders."""
    y, x = line(ys, order), line(np.linspace(half, -half, tops + 1), order)
    rim = np.concatenate([np.column_stack([np.full(len(y), half), y]), np.column_stack([x, np.full(len(x), half)])[1:],
                          np.column_stack([np.full(len(y), -half), y[::-1]])[1:]])
    hole = radius * rim / np.linalg.norm(rim, axis=1, keepdims=True)
    t = line(radial, order)[:, None, None]
    plane = (1 - t) * hole + t * rim  # radial, angular, xy
    high = line(z, order)
    nodes = np.concatenate([np.broadcast_to(plane[:, :, None], (*plane.shape[:2], len(high), 2)),
                            np.broadcast_to(high[:, None], (*plane.shape[:2], len(high), 1))], -1)
    return nodes.reshape(-1, 3), lattice(order, [len(radial) - 1, 2 * (len(ys) - 1) + tops, len(z) - 1])


def plate(level, size, radius, load_from, order=3):
    """The quarter y >= 0, z >= 0 of a plate with a hole in its middle, graded towards the edges of its clamped end."""
    n, layers = level
    length, half, thick = size[0], size[1] / 2, size[2] / 2
    y = half - graded(half, n, layers)[::-1]
    z = thick - graded(thick, max(1, n // 2), layers)[::-1]
    left = graded(length / 2 - half, n, layers + 1)
    right = np.concatenate([np.linspace(length / 2 + half, load_from, n), np.linspace(load_from, length, 1 + n // 2)[1:]])
    radial = np.linspace(0, 1, n + 2) ** 1.3
    middle, cells = ring(order, radius, half, y, radial, 2 * n, z)
    middle = middle + [length / 2, 0, 0]
    nodes, cells = merged([(middle, cells), box(order, left, y, z), box(order, right, y, z)])
    return Hex(order), nodes, cells


def end_weights(element, nodes, cells, x):
    """Weight of each node in the mean over the quarter's end face at x, whose elements are rectangles there."""
    p = element.order + 1
    face = cells.reshape(-1, p, p, p)[:, -1].reshape(-1, p * p)
    face = face[np.isclose(nodes[face][..., 0], x, atol=1e-9).all(1)]
    legendre = np.polynomial.legendre.Legendre.basis(element.order)
    w = 1 / (element.order * (element.order + 1) * legendre(2 * element.line - 1) ** 2)
    area = np.prod(np.ptp(nodes[face][..., 1:], axis=1), axis=1)
    weight = np.zeros(len(nodes))
    np.add.at(weight, face, area[:, None] * np.outer(w, w).reshape(-1))
    return weight / weight.sum()
