#!/usr/bin/env python3
"""Computes the references of this folder from scratch and writes them to references.json.

    make_references.py [--meshes FOLDER] [--cases plate_hole sphere ...]

Needs Python 3.11 with numpy 2.4.6, scipy 1.17.1 and pypardiso 0.4.7 (mkl 2026.2.0) from PyPI, and `tetgen` 1.5.0
from Debian 12. FOLDER holds fandisk.obj and spot.obj. Takes about 20 minutes on two cores and 6 GiB of memory.
Cases that are not named keep their numbers.
"""
import argparse
import json
import os
import time

import numpy as np
from scipy.optimize import brentq

import bricks
import cases
import fem
import surfaces

HERE = os.path.dirname(os.path.abspath(__file__))
FILE = os.path.join(HERE, "references.json")


def extrapolated(values, elements):
    """Limit, uncertainty and order of three values on meshes of these numbers of elements.

    The observed order p solves (v0 - v1) / (v1 - v2) = (h0^p - h1^p) / (h1^p - h2^p), h = elements^(-1/3); at most 3 is
    taken. Uncertainty: the extrapolation's step, at least half of the last difference. Without an order of at least
    0.7, the last value, within the larger of the last two differences.
    """
    (a, b, c), h = values, np.asarray(elements, float) ** (-1 / 3)
    ratio = lambda p: (h[0] ** p - h[1] ** p) / (h[1] ** p - h[2] ** p)
    found = (a - b) / (b - c) if b != c else 0
    if found <= ratio(0.7):
        return c, max(abs(c - b), abs(b - a)), None
    p = 3.0 if found >= ratio(3) else brentq(lambda p: ratio(p) - found, 0.7, 3)
    step = (c - b) / ((h[1] / h[2]) ** p - 1)
    return c + step, max(abs(step), abs(c - b) / 2), p


def quantity(values, elements, unit):
    value, uncertainty, order = extrapolated(values, elements)
    return {"unit": unit, "values": list(map(float, values)), "value": float(value),
            "uncertainty": float(uncertainty / abs(value)), "order": order and round(order, 2)}


def vectors(points, values, elements):
    """Displacements at named points; uncertainties are relative to their lengths."""
    rows = {}
    for i, (name, x) in enumerate(points.items()):
        each = [extrapolated([v[i][c] for v in values], elements) for c in range(3)]
        u = np.array([e[0] for e in each])
        rows[name] = {"position": list(map(float, x)), "values": [v[i].tolist() for v in values], "value": u.tolist(),
                      "uncertainty": float(np.linalg.norm([e[1] for e in each]) / np.linalg.norm(u))}
    return rows


def stress_rows(points, values):
    """Von Mises stresses at points that are known within 1%: the last value, with the larger of the last difference
    and a quarter of the one before as its uncertainty."""
    a, b, c = values
    uncertainty = np.maximum(np.abs(c - b), np.abs(b - a) / 4) / c
    good = uncertainty < 0.01
    rows = [[*x, *v, u] for x, v, u in zip(points[good].tolist(), np.array(values).T[good].tolist(),
                                          uncertainty[good].tolist())]
    return {"unit": "Pa", "columns": ["x", "y", "z", "coarse", "medium", "fine", "uncertainty"],
            "left_out": int((~good).sum()), "rows": rows}


def symmetric_solution(element, nodes, cells, force, planes):
    """Stiffness, free unknowns and displacements of a quarter; `planes`: components that vanish at y = 0 and z = 0."""
    matrix = fem.stiffness(element, nodes, cells, cases.YOUNG, cases.POISSON)
    held = np.zeros((len(nodes), 3), bool)
    held[np.isclose(nodes[:, 0], 0)] = True
    for axis, components in planes.items():
        held[np.ix_(np.isclose(nodes[:, axis], 0), components)] = True
    free = ~held.reshape(-1)
    return matrix, free, fem.direct(matrix, force, free).reshape(-1, 3)


def bar(name):
    length, side, gravity = cases.BARS[name]
    rows, elements = [], []
    for level in ((1, 1), (2, 2), (3, 3)):
        element, nodes, cells = bricks.bar(level, length, side)
        force = fem.body_force(element, nodes, cells, [0, 0, -cases.DENSITY * gravity])
        matrix, free, u = symmetric_solution(element, nodes, cells, force, {1: [1], 2: [0, 1]})
        weight = bricks.end_weights(element, nodes, cells, length)
        end_force = np.zeros_like(u)
        end_force[:, 2] = -weight / 4
        shear = fem.direct(matrix, end_force.reshape(-1), free).reshape(-1, 3)
        mass = fem.mass(element, nodes, cells, cases.DENSITY)
        rows.append((weight @ u[:, 2], 4 * force @ u.reshape(-1), fem.first_frequency(matrix, mass, free)[0],
                     weight @ shear[:, 2]))
        elements.append(len(cells))
        print(name, elements[-1], *rows[-1], flush=True)
    names = (("end_deflection", "m"), ("compliance", "J"), ("first_bending_frequency", "Hz"),
             ("end_deflection_by_1_N_at_the_end", "m"))
    return {name: {
        "young": cases.YOUNG, "poisson": cases.POISSON, "density": cases.DENSITY, "gravity": [0, 0, -gravity],
        "size": [length, side, side], "element": "hexahedron of order 3, a quarter of the bar", "elements": elements,
        "quantities": {n: quantity([r[i] for r in rows], elements, unit) for i, (n, unit) in enumerate(names)}}}


def peak(element, nodes, cells, u):
    """Largest von Mises stress on the hole's surface [Pa], near its sides."""
    angle, z = np.meshgrid(np.linspace(np.pi / 3, 2 * np.pi / 3, 61), np.linspace(0, cases.PLATE[2] / 2, 11))
    x = np.column_stack([cases.PLATE[0] / 2 + cases.HOLE * np.cos(angle.reshape(-1)),
                         cases.HOLE * np.sin(angle.reshape(-1)), z.reshape(-1)])
    where = fem.locate(x, element, nodes, cells)
    return fem.von_mises(fem.stress_in(where, element, nodes, cells, u, cases.YOUNG, cases.POISSON)).max()


def plate_hole():
    size, points = cases.PLATE, cases.plate_points()
    density = cases.PULL / ((size[0] - cases.LOAD_FROM) * size[1] * size[2])
    rows, displacements, stress, elements = [], [], [], []
    for level in ((3, 2), (4, 3), (5, 3)):
        element, nodes, cells = bricks.plate(level, size, cases.HOLE, cases.LOAD_FROM)
        loaded = cells[nodes[cells][..., 0].min(1) > cases.LOAD_FROM - 1e-9]
        force = fem.body_force(element, nodes, loaded, [density, 0, 0])
        u = symmetric_solution(element, nodes, cells, force, {1: [1], 2: [2]})[2]
        weight = bricks.end_weights(element, nodes, cells, size[0])
        rows.append((weight @ u[:, 0], 4 * force @ u.reshape(-1), peak(element, nodes, cells, u)))
        where = fem.locate(list(cases.PLATE_POINTS.values()), element, nodes, cells)
        displacements.append(fem.interpolate(where, element, cells, u))
        where = fem.locate(np.abs(points), element, nodes, cells)
        stress.append(fem.von_mises(fem.stress_in(where, element, nodes, cells, u, cases.YOUNG, cases.POISSON)))
        elements.append(len(cells))
        print("plate_hole", elements[-1], *rows[-1], flush=True)
    names = (("mean_end_displacement", "m"), ("compliance", "J"), ("peak_von_mises", "Pa"))
    return {"plate_hole": {
        "young": cases.YOUNG, "poisson": cases.POISSON, "density": cases.DENSITY, "size": size, "radius": cases.HOLE,
        "load": {"force": [cases.PULL, 0, 0], "from_x": cases.LOAD_FROM},
        "element": "hexahedron of order 3, a quarter of the plate", "elements": elements,
        "quantities": {n: quantity([r[i] for r in rows], elements, unit) for i, (n, unit) in enumerate(names)},
        "displacements": vectors(cases.PLATE_POINTS, displacements, elements), "von_mises": stress_rows(points, stress)}}


def inside_of(nodes, cells):
    """A function that says which points are in a mesh of tetrahedra."""
    def inside(points):
        mask = []
        for x in points:
            try:
                fem.locate([x], fem.Tet(1), nodes, cells)
                mask.append(True)
            except ValueError:
                mask.append(False)
        return np.array(mask)
    return inside


def cut_body(name, meshes):
    body, mesh, points = cases.Body(name, meshes), None, None
    named = body.named_points()
    found = {load: ([], [], []) for load in body.loads}
    elements = []
    for largest in body.levels:
        start = time.time()
        mesh = surfaces.tetrahedra(body.cut_vertices, body.cut_faces, body.rim, largest * body.longest,
                                   0.15 * body.longest, mesh)
        if points is None:
            points = body.inner_points(inside_of(*mesh))
        elements.append(len(mesh[1]))
        nodes, cells, forces, solutions = fem.solve_tetrahedra(
            *mesh, body.held, cases.YOUNG, cases.POISSON,
            [cases.DENSITY * np.array(g, float) for g in body.loads.values()])
        at = fem.locate(list(named.values()), fem.Tet(1), *mesh)
        for (rows, displacements, stress), f, u in zip(found.values(), forces, solutions):
            rows.append(((f * u).sum(),))
            displacements.append(fem.interpolate(at, fem.Tet(2), cells, u))
            stress.append(fem.von_mises(fem.stress_at(points, fem.Tet(2), nodes, cells, u, cases.YOUNG, cases.POISSON)))
            print(name, elements[-1], rows[-1][0], "J, largest displacement", np.abs(u).max(), "m, largest stress there",
                  stress[-1].max(), "Pa,", round(time.time() - start), "s", flush=True)
    return {load: {
        "young": cases.YOUNG, "poisson": cases.POISSON, "density": cases.DENSITY, "gravity": list(body.loads[load]),
        "mesh": name + ".obj", "mesh_sha256": body.sha256, "scale": body.scale, "axis": "xyz"[body.axis],
        "plane": body.plane, "longest_side": float(body.longest),
        "volume": float(surfaces.volume(body.cut_vertices, body.cut_faces)),
        "element": "quadratic tetrahedron", "elements": elements,
        "quantities": {"compliance": quantity([r[0] for r in rows], elements, "J")},
        "displacements": vectors(named, displacements, elements), "von_mises": stress_rows(points, stress)}
        for load, (rows, displacements, stress) in found.items()}


def write(data):
    """JSON with one line for each list of numbers."""
    def text(value, indent):
        if isinstance(value, dict):
            inner = ",\n".join(f"{indent}  {json.dumps(k)}: {text(v, indent + '  ')}" for k, v in value.items())
            return "{\n" + inner + "\n" + indent + "}"
        if isinstance(value, (list, tuple)) and value and isinstance(value[0], list):
            return "[\n" + ",\n".join(f"{indent}  {text(v, '')}" for v in value) + "\n" + indent + "]"
        if isinstance(value, (list, tuple)):
            return "[" + ", ".join(text(v, "") for v in value) + "]"
        return f"{value:.9g}" if isinstance(value, float) else json.dumps(value)
    with open(FILE, "w") as file:
        file.write(text(data, "") + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--meshes", default=".", help="folder of fandisk.obj and spot.obj")
    parser.add_argument("--cases", nargs="+", default=["bar_5", "bar", "plate_hole", "sphere", "fandisk", "spot"])
    options = parser.parse_args()
    for name in options.cases:
        found = (bar(name) if name in cases.BARS else plate_hole() if name == "plate_hole"
                 else cut_body(name, options.meshes))
        data = {}
        if os.path.exists(FILE):
            with open(FILE) as file:
                data = json.load(file)
        write({**data, **found})


if __name__ == "__main__":
    main()
