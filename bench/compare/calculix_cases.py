"""Finite-element models of the cases that calculix.py compares: materials, supports, loads and measured quantities of
`phyxel accuracy` and, of the plate, of bench/references. SI units.

Meshes of quadratic elements are uniform, or graded towards edges where stresses are singular, as an expert would make them. A
refinement is the number of cells across a body, or the number of times that a graded mesh is refined.
"""
import dataclasses
import math

import numpy as np

from calculix_model import Model, lattice, merged

YOUNG, POISSON = 1e6, 0.3


@dataclasses.dataclass
class Analysis:
    """A model with its measured quantities: weights of nodes, axis of their displacements, and a factor of the weighted sum."""
    model: Model
    quantities: dict

    def values(self, displacements):
        """The quantities. @param displacements of the measured nodes, by index"""
        return {name: factor * sum(weight * displacements[node][axis] for node, weight in weights.items())
                for name, (weights, axis, factor) in self.quantities.items()}


@dataclasses.dataclass
class Case:
    """A problem with a known answer."""
    references: dict  #: quantity: known answer
    nonlinear: bool   #: True for large displacements
    meshes: dict      #: (mesh, element): refinements
    analyses: object  #: function of element, mesh and refinement that returns a list of Analysis, all of which are solved


def box(element, *borders):
    """The mesh of a box with the given borders of cells along each axis."""
    def place(at):
        return np.stack([np.interp(at[:, axis], np.arange(len(b)), b) for axis, b in enumerate(borders)], 1)
    return lattice(element, [len(b) - 1 for b in borders], place)


def graded(length, cells, cuts, ratio=0.3):
    """Borders of equal cells on [0, length], of which the first is cut towards 0, a number of times, at a ratio."""
    borders = np.linspace(0, length, cells + 1)
    return np.concatenate([[0], borders[1] * ratio ** np.arange(cuts, 0, -1), borders[1:]])


def graded_both(length, cells, cuts):
    """Borders on [-length/2, length/2], graded towards both ends. @param cells number in each half"""
    half = length / 2 - graded(length / 2, cells, cuts)[::-1]
    return np.concatenate([-half[::-1], half[1:]])


def clamped(mesh):
    """Supports that fix the side x = 0."""
    return dict.fromkeys(range(3), mesh.nodes_at(0, 0.0))


def bar_mesh(element, kind, refinement, length, side):
    """A bar along x. Uniform: `refinement` cells across, which are cubes. Long: `refinement` cells along, and the fewest across
    that CalculiX solves, two bricks or one cell of tetrahedra. Graded: two cells across and one to each side's length; the
    cells at the clamped face and those at the long edges are cut in turn."""
    if kind != "graded":
        cells = refinement if kind == "uniform" else {"C3D20R": 2, "C3D10": 1}[element]
        across = np.linspace(-side / 2, side / 2, cells + 1)
        along = round(refinement * length / side) if kind == "uniform" else refinement
        return box(element, np.linspace(0, length, along + 1), across, across)
    across = graded_both(side, 1, refinement // 2)
    return box(element, graded(length, round(length / side), (refinement + 1) // 2), across, across)


def end_mean(mesh, axis, factor):
    """The quantity "mean displacement of the side x = largest"."""
    return mesh.end, axis, factor


def gravity(element, kind, refinement):
    mesh = bar_mesh(element, kind, refinement, 1, 0.2)
    model = Model(mesh, YOUNG, POISSON, fixed=clamped(mesh), gravity=(0, 0, -0.1), measured=list(mesh.end))
    return [Analysis(model, {"deflection": end_mean(mesh, 2, -1)})]


def shear(element, kind, refinement):
    mesh = bar_mesh(element, kind, refinement, 1, 0.2)
    model = Model(mesh, YOUNG, POISSON, fixed=clamped(mesh), end_force=(0, 0, -1), measured=list(mesh.end))
    return [Analysis(model, {"deflection": end_mean(mesh, 2, -1)})]


def elastica(element, kind, refinement):
    length, side = 2, 0.1
    mesh = bar_mesh(element, kind, refinement, length, side)
    force = -2 * YOUNG * side ** 4 / 12 / length ** 2
    model = Model(mesh, YOUNG, 0.0, fixed=clamped(mesh), end_force=(0, 0, force), nonlinear=True, measured=list(mesh.end))
    return [Analysis(model, {"down": end_mean(mesh, 2, -1 / length), "back": end_mean(mesh, 0, -1 / length)})]


def cook(element, kind, refinement):
    """Cook's membrane, one cell thick, in plane strain, for both of the ratios of Poisson."""
    length, left, strain = 48.0, 44.0, 1e-5
    if kind == "uniform":
        thickness = left / refinement
        along = np.linspace(0, length, refinement + 1)
        across = np.linspace(-left / 2, left / 2, refinement + 1)
    else:
        cells = 2 + refinement
        thickness = left / cells / 2
        along, across = graded_both(length, cells, refinement) + length / 2, graded_both(left, cells, refinement)
    mesh = box(element, along, across, [0, thickness])
    x, y = mesh.nodes[:, 0], mesh.nodes[:, 1]
    mesh = dataclasses.replace(mesh, nodes=np.stack(
        [x, left * x / length + (y / left + 0.5) * (left - 28 * x / length), mesh.nodes[:, 2]], 1))
    side, top = mesh.nodes_at(0, 0.0), mesh.nodes[:, 1].max()
    corner = {n: 1.0 for n in mesh.end if math.isclose(mesh.nodes[n, 1], top)}
    corner = dict.fromkeys(corner, 1 / len(corner))
    return [Analysis(Model(mesh, YOUNG, poisson, fixed={0: side, 1: side, 2: list(range(len(mesh.nodes)))},
                       end_force=(0, strain * YOUNG * thickness, 0), measured=list(mesh.end)),
                 {f"side at ν = {poisson:g}": end_mean(mesh, 1, 1 / strain),
                  f"corner at ν = {poisson:g}": (corner, 1, 1 / strain)}) for poisson in (0.3, 0.499)]


def sector(element, turns, half, radius, radial, around, thick):
    """A quarter of a square with a round hole, turned by quarter turns: from the hole to one side of the square."""
    def place(at):
        s = np.interp(at[:, 1], np.arange(len(around)), around)
        t = np.interp(at[:, 0], np.arange(len(radial)), radial)
        rim = np.stack([np.full(len(s), half), half * s], 1)
        hole = radius * rim / np.linalg.norm(rim, axis=1, keepdims=True)
        x, y = ((1 - t[:, None]) * hole + t[:, None] * rim).T
        for _ in range(turns):
            x, y = -y, x
        return np.stack([x + 2 * half, y, np.interp(at[:, 2], np.arange(len(thick)), thick)], 1)
    return lattice(element, [len(radial) - 1, len(around) - 1, len(thick) - 1], place)


def plate(element, _, refinement):
    """The plate with a hole: a square about the hole in four sectors, each with a number of cells from the hole outwards, and
    what is left and right of it. The last cells before the end carry the load."""
    length, width, thickness, radius, load_from = 0.4, 0.2, 0.02, 0.05, 0.38
    n, half = refinement, width / 2
    y = np.linspace(-half, half, 2 * n + 1)
    thick = np.linspace(-thickness / 2, thickness / 2, math.ceil(n / 4) + 1)
    right = np.append(np.linspace(3 * half, load_from, n + 1), length)
    radial = np.linspace(0, 1, n + 1) ** 1.3
    # Turned by half a turn, as the sector beside it is, so that tetrahedra of both cut the faces between them alike.
    left = box(element, np.linspace(0, half, n + 1), y, thick)
    left = dataclasses.replace(left, nodes=[half, 0, 0] + left.nodes * [-1, -1, 1])
    mesh = merged([*(sector(element, turns, half, radius, radial, y / half, thick) for turns in range(4)),
                   left, box(element, right, y, thick)])
    loaded = np.flatnonzero(mesh.middles()[:, 0] > load_from).tolist()
    model = Model(mesh, YOUNG, POISSON, fixed=clamped(mesh), measured=list(mesh.end),
                  body_force=(loaded, 0.4 / ((length - load_from) * width * thickness)))
    return [Analysis(model, {"mean end displacement": end_mean(mesh, 0, 1)})]


CASES = {
    "gravity": Case({"deflection": 3.83980e-3}, False,
                    {("uniform", "C3D20R"): [1, 2, 3, 4, 6, 8], ("graded", "C3D20R"): [0, 1, 2, 3, 4, 5, 6],
                     ("uniform", "C3D10"): [1, 2, 3, 4, 6, 8]}, gravity),
    "shear": Case({"deflection": 2.5440e-3}, False,
                  {("uniform", "C3D20R"): [1, 2, 3, 4, 6, 8], ("graded", "C3D20R"): [0, 1, 2, 3, 4, 5, 6],
                   ("uniform", "C3D10"): [1, 2, 3, 4, 6, 8]}, shear),
    "elastica": Case({"down": 0.49457, "back": 0.16133}, True,
                     {("uniform", "C3D20R"): [2, 3, 4], ("long", "C3D20R"): [3, 4, 6, 10, 20], ("uniform", "C3D10"): [1, 2, 3],
                      ("long", "C3D10"): [4, 6, 10, 20, 40]}, elastica),
    "cook": Case({"side at ν = 0.3": 22.01224, "corner at ν = 0.3": 23.05673, "side at ν = 0.499": 18.58810,
                  "corner at ν = 0.499": 19.45008}, False,
                 {("uniform", "C3D20R"): [2, 4, 8, 16, 32], ("graded", "C3D20R"): [0, 1, 2, 3, 4, 5],
                  ("uniform", "C3D10"): [2, 4, 8, 16, 32]}, cook),
    "plate": Case({"mean end displacement": 5.50967554e-05}, False,
                  {("uniform", "C3D20R"): [1, 2, 3, 4, 6, 8], ("uniform", "C3D10"): [1, 2, 3, 4, 6, 8]}, plate),
}
