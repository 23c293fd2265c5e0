#!/usr/bin/env python3
"""Solves the coarsest mesh of a case by CalculiX, too, and prints the differences from the elements of fem.py.

    check_calculix.py [--meshes FOLDER] [--case sphere]

Needs what make_references.py needs, and `calculix-ccx` 2.20 from Debian 12.
"""
import argparse
import os
import subprocess
import tempfile

import numpy as np

import cases
import fem
import surfaces

ORDER = [0, 1, 2, 3, 4, 7, 5, 6, 8, 9]  # nodes of C3D10 among those of fem.quadratic


def calculix(nodes, cells, held, gravity):
    """Displacements (n, 3) [m] by CalculiX."""
    with tempfile.TemporaryDirectory() as folder:
        with open(os.path.join(folder, "case.inp"), "w") as file:
            file.write("*NODE, NSET=NALL\n")
            file.writelines("{},{:.12g},{:.12g},{:.12g}\n".format(i + 1, *x) for i, x in enumerate(nodes))
            file.write("*ELEMENT, TYPE=C3D10, ELSET=EALL\n")
            file.writelines(",".join(map(str, [i + 1, *row])) + "\n" for i, row in enumerate(cells[:, ORDER] + 1))
            file.write("*NSET, NSET=HELD\n")
            file.writelines(f"{i + 1}\n" for i in np.flatnonzero(held))
            size = np.linalg.norm(gravity)
            file.write(f"*MATERIAL, NAME=M\n*ELASTIC\n{cases.YOUNG},{cases.POISSON}\n*DENSITY\n{cases.DENSITY}\n"
                       "*SOLID SECTION, ELSET=EALL, MATERIAL=M\n*BOUNDARY\nHELD,1,3\n*STEP\n*STATIC\n*DLOAD\n"
                       "EALL,GRAV,{},{},{},{}\n*NODE PRINT, NSET=NALL\nU\n*END STEP\n".format(size, *gravity / size))
        subprocess.run(["ccx", "case"], cwd=folder, check=True, stdout=subprocess.DEVNULL)
        with open(os.path.join(folder, "case.dat")) as file:
            rows = [line.split() for line in file]
    u = np.zeros((len(nodes), 3))
    for row in rows:
        if len(row) == 4 and row[0].isdigit():
            u[int(row[0]) - 1] = [float(v) for v in row[1:]]
    return u


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--meshes", default=".", help="folder of fandisk.obj and spot.obj")
    parser.add_argument("--case", default="sphere", choices=list(cases.BODIES))
    options = parser.parse_args()
    body = cases.Body(options.case, options.meshes)
    mesh = surfaces.tetrahedra(body.cut_vertices, body.cut_faces, body.rim, body.levels[0] * body.longest,
                               0.15 * body.longest)
    gravity = np.array(next(iter(body.loads.values())), float)
    nodes, cells, (force,), (u,) = fem.solve_tetrahedra(*mesh, body.held, cases.YOUNG, cases.POISSON,
                                                        [cases.DENSITY * gravity])
    other = calculix(nodes, cells, body.held(nodes), gravity)
    print(len(cells), "elements, compliance", (force * u).sum(), "J; CalculiX", (force * other).sum(), "J; difference",
          (force * other).sum() / (force * u).sum() - 1)
    print("largest difference of a displacement by the largest one:", np.abs(other - u).max() / np.abs(u).max())


if __name__ == "__main__":
    main()
