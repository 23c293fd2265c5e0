"""Finite-element models for CalculiX: structured meshes of quadratic bricks or tetrahedra, input files, and runs.

A structured mesh of nx x ny x nz cells has nodes at the corners and half-way between them; a function maps it to the body. A
cell is one brick (C3D20R), with nodes at corners and middles of edges, or six tetrahedra (C3D10), with nodes at middles of
faces, too.
"""
import dataclasses
import itertools
import math
import os
import pathlib
import re
import subprocess
import sys
import tempfile

import numpy as np

#: Corners of a brick in CalculiX's order, in units of half a cell.
_CORNERS = np.array([(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2)])
_BRICK_EDGES = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
_TET_EDGES = [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]
#: Shares of a uniform load on a face at its nodes: corners, then middles of edges.
_FACE_SHARES = {"C3D20R": [-1 / 12] * 4 + [1 / 3] * 4, "C3D10": [0] * 3 + [1 / 3] * 3}
SOLVERS = {"direct": "SPOOLES", "iterative": "ITERATIVE CHOLESKY"}


class ModelError(Exception):
    """A run failed. The message names the case and the cause."""


def _with_middles(corners, edges):
    """Corners followed by the middles of edges."""
    return np.concatenate([corners, [(corners[a] + corners[b]) // 2 for a, b in edges]])


def _templates(element):
    """The nodes of the elements of one cell, in units of half a cell (elements, nodes, 3)."""
    if element == "C3D20R":
        return np.array([_with_middles(_CORNERS, _BRICK_EDGES)])
    cells = []
    for axes in itertools.permutations(range(3)):  # from corner to opposite corner along the axes in this order
        corners = np.zeros((4, 3), int)
        for step, axis in enumerate(axes, 1):
            corners[step:, axis] = 2
        if np.linalg.det(corners[1:] - corners[:1]) < 0:
            corners[[1, 2]] = corners[[2, 1]]
        cells.append(_with_middles(corners, _TET_EDGES))
    return np.array(cells)


def _face_templates(element):
    """The nodes of the element faces on the side x = 2 of a cell: corners, then middles of edges."""
    if element == "C3D20R":
        return np.array([_with_middles(_CORNERS[[1, 2, 6, 5]], [(0, 1), (1, 2), (2, 3), (3, 0)])])
    corner = np.array([(2, 0, 0), (2, 2, 0), (2, 2, 2), (2, 0, 2)])
    return np.array([_with_middles(corner[list(face)], [(0, 1), (1, 2), (2, 0)]) for face in ((0, 1, 2), (0, 2, 3))])


def _planar_area(corners):
    """Areas of planar polygons (faces, corners, 3)."""
    spokes = corners[:, 1:] - corners[:, :1]
    return 0.5 * np.linalg.norm(np.cross(spokes[:, :-1], spokes[:, 1:]).sum(1), axis=-1)


@dataclasses.dataclass
class Mesh:
    """Nodes and elements of a body. `end` maps the nodes of its side x = largest to their weights in the mean over that side,
    which are also their shares of a uniform load on it."""
    element: str
    nodes: np.ndarray      #: (n, 3)
    elements: np.ndarray   #: (m, 20) or (m, 10), indices of nodes
    end: dict

    def nodes_at(self, axis, value):
        """Indices of the nodes in a plane across an axis."""
        return np.flatnonzero(abs(self.nodes[:, axis] - value) < 1e-9 * np.ptp(self.nodes)).tolist()

    def middles(self):
        """The means of the nodes of each element (m, 3)."""
        return self.nodes[self.elements].mean(1)


def lattice(element, shape, place):
    """A structured mesh.

    @param element C3D20R or C3D10
    @param shape number of cells along each axis
    @param place maps positions in units of cells (n, 3) to positions in space
    """
    points = [2 * n + 1 for n in shape]
    index = np.arange(np.prod(points)).reshape(points)
    cells = 2 * np.array(list(itertools.product(*(range(n) for n in shape))))

    def ids(templates, origins):
        at = origins[:, None, None] + templates
        return index[at[..., 0], at[..., 1], at[..., 2]].reshape(-1, templates.shape[1])

    elements = ids(_templates(element), cells)
    faces = ids(_face_templates(element), cells[cells[:, 0] == 2 * (shape[0] - 1)])
    used, compact = np.unique(elements, return_inverse=True)
    nodes = place(np.array(list(itertools.product(*(range(n) for n in points))))[used] / 2)
    new = np.full(index.size, -1)
    new[used] = np.arange(len(used))
    faces = new[faces]
    shares = np.array(_FACE_SHARES[element])
    area = _planar_area(nodes[faces[:, :len(shares) // 2]])
    weight = np.zeros(len(nodes))
    np.add.at(weight, faces, area[:, None] * shares)
    on_end = np.unique(faces)
    return Mesh(element, nodes, compact.reshape(elements.shape),
                dict(zip(on_end.tolist(), (weight[on_end] / area.sum()).tolist())))


def merged(meshes):
    """One mesh of several: coincident nodes become one. Its end is that of the last."""
    nodes = np.concatenate([mesh.nodes for mesh in meshes])
    starts = np.cumsum([0, *(len(mesh.nodes) for mesh in meshes)])
    _, first, same = np.unique(np.round(nodes / np.ptp(nodes) * 1e8).astype(np.int64), axis=0, return_index=True,
                               return_inverse=True)
    same = same.reshape(-1)
    elements = np.concatenate([same[mesh.elements + start] for mesh, start in zip(meshes, starts)])
    return Mesh(meshes[-1].element, nodes[first], elements,
                {int(same[starts[-2] + k]): weight for k, weight in meshes[-1].end.items()})


@dataclasses.dataclass
class Model:
    """A static problem: a mesh with its material, supports and loads."""
    mesh: Mesh
    young: float
    poisson: float
    density: float = 1000.0
    fixed: dict = dataclasses.field(default_factory=dict)  #: axis, 0 to 2: indices of nodes without displacement along it
    gravity: tuple = (0, 0, 0)                             #: acceleration of gravity [m/s²]
    end_force: tuple = (0, 0, 0)                          #: uniform on the end, of constant direction [N]
    body_force: tuple = (None, 0)                         #: indices of elements, and their force along x [N/m³]
    nonlinear: bool = False                                   #: True for large displacements (NLGEOM)
    measured: list = dataclasses.field(default_factory=list)  #: nodes whose displacements are printed

    def unknowns(self):
        """Number of displacement components, fixed ones included."""
        return 3 * len(self.mesh.nodes)


def _list_of(values):
    return "".join(", ".join(map(str, values[k:k + 12])) + "\n" for k in range(0, len(values), 12))


def input_text(model, solver, increment=1.0):
    """The input file of a model.

    @param solver direct or iterative
    @param increment share of the load in the first increment of a nonlinear step
    """
    mesh = model.mesh
    lines = ["*NODE, NSET=ALL\n"]
    lines += ["{}, {:.12g}, {:.12g}, {:.12g}\n".format(k, *x) for k, x in enumerate(mesh.nodes.tolist(), 1)]
    lines.append(f"*ELEMENT, TYPE={mesh.element}, ELSET=BODY\n")
    for k, row in enumerate((mesh.elements + 1).tolist(), 1):
        lines.append(f"{k}, {', '.join(map(str, row[:10]))}{',' if len(row) > 10 else ''}\n")
        if len(row) > 10:
            lines.append(", ".join(map(str, row[10:])) + "\n")
    lines.append(f"*MATERIAL, NAME=M\n*ELASTIC\n{model.young!r}, {model.poisson!r}\n*DENSITY\n{model.density!r}\n"
                 "*SOLID SECTION, ELSET=BODY, MATERIAL=M\n")
    for axis, nodes in model.fixed.items():
        lines.append(f"*NSET, NSET=FIXED{axis}\n" + _list_of([n + 1 for n in nodes]) +
                     f"*BOUNDARY\nFIXED{axis}, {axis + 1}, {axis + 1}\n")
    lines.append("*NSET, NSET=MEASURED\n" + _list_of([n + 1 for n in model.measured]))
    loaded, force = model.body_force
    if loaded is not None:
        lines.append("*ELSET, ELSET=LOADED\n" + _list_of([e + 1 for e in loaded]))
    lines.append(f"*STEP{', NLGEOM, INC=1000' if model.nonlinear else ''}\n*STATIC, SOLVER={SOLVERS[solver]}\n")
    if model.nonlinear:
        lines.append(f"{increment!r}, 1.\n")
    size = math.sqrt(sum(g * g for g in model.gravity))
    if size > 0:
        lines.append("*DLOAD\nBODY, GRAV, {:.12g}, {:.12g}, {:.12g}, {:.12g}\n".format(size, *(g / size for g in model.gravity)))
    if loaded is not None:
        lines.append(f"*DLOAD\nLOADED, BX, {force:.12g}\n")
    if any(model.end_force):
        lines.append("*CLOAD\n")
        lines += [f"{n + 1}, {axis + 1}, {share * f:.12g}\n" for n, share in mesh.end.items() if share != 0
                  for axis, f in enumerate(model.end_force) if f != 0]
    lines.append("*NODE PRINT, NSET=MEASURED, FREQUENCY=1000000\nU\n*END STEP\n")
    return "".join(lines)


def displacements(text):
    """The displacements of the last table of a .dat file, by the index of the node."""
    found = {}
    for line in text.splitlines():
        if "displacements" in line:
            found = {}
        words = line.split()
        if len(words) == 4 and words[0].isdigit():
            found[int(words[0]) - 1] = np.array([float(w) for w in words[1:]])
    return found


#: Starts a program and prints its resource usage. The script runs in an interpreter of its own without imports: a process
#: inherits the peak memory of its parent, which therefore has to be smaller than what is measured.
_LAUNCHER = """import os, sys
os.sched_setaffinity(0, {int(sys.argv[1])})
child = os.posix_spawnp(sys.argv[2], sys.argv[2:], os.environ, file_actions=[
    (os.POSIX_SPAWN_OPEN, 1, "out", os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600),
    (os.POSIX_SPAWN_OPEN, 2, "err", os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)])
_, status, usage = os.wait4(child, 0)
print(os.waitstatus_to_exitcode(status), usage.ru_utime + usage.ru_stime, usage.ru_maxrss)
"""


@dataclasses.dataclass
class Cost:
    """The resource usage of a process, from the kernel's accounting."""
    seconds: float    #: CPU time, user and system
    mebibytes: float  #: peak resident set size


def run_accounted(command, folder, core, name):
    """Runs a program on one core and thread. @returns its standard output and its Cost. @throws ModelError"""
    done = subprocess.run([sys.executable, "-I", "-S", "-c", _LAUNCHER, str(core), *map(str, command)], cwd=folder, text=True,
                          capture_output=True, env={**os.environ, "OMP_NUM_THREADS": "1"})
    if done.returncode != 0:
        raise ModelError(f"{name}: {command[0]} cannot be run: {done.stderr.strip().splitlines()[-1]}")
    code, seconds, kibibytes = done.stdout.split()
    said = (folder / "out").read_text(errors="replace")
    if code != "0":
        last = ((folder / "err").read_text(errors="replace").strip() or said.strip()).splitlines()[-3:]
        raise ModelError(f"{name}: {command[0]} ended with {code}: {' '.join(last)}")
    return said, Cost(float(seconds), int(kibibytes) / 1024)


def least(costs):
    """The least time and the least memory of repeated runs."""
    return Cost(min(cost.seconds for cost in costs), min(cost.mebibytes for cost in costs))


def solve(ccx, model, solver, core, name, increment=1.0, repeats=1):
    """Solves a model. @returns the displacements of the measured nodes by their index, and the least cost of the repeats."""
    with tempfile.TemporaryDirectory(prefix="calculix.") as made:
        folder = pathlib.Path(made)
        (folder / "case.inp").write_text(input_text(model, solver, increment))
        costs = []
        for _ in range(repeats):
            said, cost = run_accounted([ccx, "case"], folder, core, name)
            costs.append(cost)
        fault = re.search(r"\*ERROR[^\n]*", said)
        found = displacements((folder / "case.dat").read_text()) if (folder / "case.dat").exists() else {}
        if fault or len(found) != len(set(model.measured)):
            raise ModelError(f"{name}: CalculiX gave no answer: {fault[0] if fault else 'no displacements in its .dat file'}")
        return found, least(costs)
