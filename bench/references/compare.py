#!/usr/bin/env python3
"""Runs phyxel on the scenes of this folder and prints its errors against references.json.

    compare.py path/to/phyxel [--meshes FOLDER] [--cases sphere ...] [--counts 2000 10000] [--out FILE.csv]
               [--grading "ratio = 4" ...]

Needs Python 3.11 with numpy, scipy and h5py 3.16.0 from PyPI. FOLDER holds fandisk.obj and spot.obj.

Clamp "box": the whole body, whose phyxels below the plane are held. Clamp "cut": the mesh is cut at the plane, and a
thin box holds the phyxels on the cut. Displacements and stresses at points are those of a linear fit over the twelve
nearest phyxels; the compliance is the sum of loads times displacements over phyxels. The peak stress at the hole is
that of the scene's probes, and the largest of the surface's vertices.
"""
import argparse
import csv
import glob
import itertools
import json
import os
import re
import subprocess
import sys
import tempfile

import h5py
import numpy as np
from scipy.spatial import cKDTree

import cases
import surfaces

HERE = os.path.dirname(os.path.abspath(__file__))
COLUMNS = ["case", "clamp", "closure", "grading", "phyxels", "held", "compliance", "end", "largest displacement",
           "median von Mises", "95% von Mises", "peak von Mises", "peak on the surface"]


def write_meshes(folder, meshes, names):
    """Writes the whole and the cut surface of each body, in the units of the whole one's file."""
    surfaces.write_obj(os.path.join(folder, "plate_hole.obj"), *surfaces.plate_surface(cases.PLATE, cases.HOLE))
    for name in names:
        body = cases.Body(name, meshes)
        surfaces.write_obj(os.path.join(folder, name + ".obj"), body.vertices / body.scale, body.faces)
        surfaces.write_obj(os.path.join(folder, name + "_cut.obj"), body.cut_vertices / body.scale, body.cut_faces)


def scene_of(case, reference, clamp, closure, grading, count):
    """The text of a case's scene with this clamp, closure, grading and number of phyxels."""
    with open(os.path.join(HERE, "scenes", case + ".toml")) as file:
        text = file.read()
    text = re.sub(r"(?m)^phyxels = .*", f"phyxels = {count}", text)
    text = re.sub(r"(?m)^closure = .*", f"closure = {closure}", text)
    if grading:
        lines = "\n".join(line.strip() for line in grading.split(","))
        text = text.replace("[body.material]", f"[body.grading]\n{lines}\n\n[body.material]", 1)
    if clamp == "cut":
        axis, slack = "xyz".index(reference["axis"]), 1e-4 * reference["longest_side"]
        low, high = [-10.0] * 3, [10.0] * 3
        low[axis], high[axis] = reference["plane"] - slack, reference["plane"] + slack
        text = re.sub(r"(?m)^box = .*", f"box = [{low}, {high}]", text)
        text = re.sub(r"(?m)^mesh = \"(\w+)\.obj\"", r'mesh = "\1_cut.obj"', text)
    return text


def run(phyxel, folder, text, threads):
    """Rest positions, displacements, masses and von Mises stresses of phyxels at rest, those of probes, and the largest
    of the surface; None if the scene has no surface frames."""
    scene, out = os.path.join(folder, "scene.toml"), os.path.join(folder, "out")
    with open(scene, "w") as file:
        file.write(text)
    done = subprocess.run([phyxel, "run", scene, "--out", out, "--force", "--quiet", "--no-pictures", "--threads",
                           str(threads)], capture_output=True, text=True)
    if done.returncode != 0:
        raise RuntimeError(done.stderr.strip() or done.stdout.strip())
    first, last = (sorted(glob.glob(os.path.join(out, "phyxels_*.hdf")))[i] for i in (0, -1))
    with h5py.File(first) as file:
        x = file["VTKHDF/Points"][:].astype(float)
    with open(os.path.join(out, "run.json")) as file:
        probes = [probe["von_mises_pa"] for probe in json.load(file)["probes"]]
    peak, surface = None, sorted(glob.glob(os.path.join(out, "surface_*.hdf")))
    if surface:
        with h5py.File(surface[-1]) as file:
            peak = float(file["VTKHDF/PointData/von_mises"][:].max())
    with h5py.File(last) as file:
        data = file["VTKHDF/PointData"]
        return x, *(data[name][:].astype(float) for name in ("displacement", "mass", "von_mises")), probes, peak


def fitted(points, x, values, near=12):
    """Values at points by linear least squares over the nearest phyxels."""
    found = []
    for p, some in zip(points, cKDTree(x).query(points, k=near)[1]):
        basis = np.column_stack([np.ones(near), x[some] - p])
        found.append(np.linalg.lstsq(basis, values[some], rcond=1e-6)[0][0])
    return np.array(found)


def end_of(x, u, reference):
    """Mean end displacement along its reference's direction, over the end face by a linear fit at a grid of points."""
    size = reference["size"]
    grid = np.meshgrid((np.arange(10) + 0.5) / 10 - 0.5, (np.arange(10) + 0.5) / 10 - 0.5)
    points = np.column_stack([np.full(100, size[0]), grid[0].reshape(-1) * size[1], grid[1].reshape(-1) * size[2]])
    return fitted(points, x, u).mean(0)


def errors(reference, x, u, mass, stress, probes, peak):
    """Relative errors by column of the table."""
    row, known = {}, reference["quantities"]
    if "load" in reference:
        share = mass * (x[:, 0] >= reference["load"]["from_x"])
        work = (share / share.sum() * (u @ reference["load"]["force"])).sum()
    else:
        work = (mass * (u @ reference["gravity"])).sum()
    row["compliance"] = work / known["compliance"]["value"] - 1
    for name, component in (("mean_end_displacement", 0), ("end_deflection", 2)):
        if name in known:
            row["end"] = end_of(x, u, reference)[component] / known[name]["value"] - 1
    if "displacements" in reference:
        rows = [r for r in reference["displacements"].values() if r["uncertainty"] < 1e-3]
    if "displacements" in reference and rows:
        right = np.array([r["value"] for r in rows])
        found = fitted(np.array([r["position"] for r in rows]), x, u)
        row["largest displacement"] = (np.linalg.norm(found - right, axis=1) / np.linalg.norm(right, axis=1)).max()
    if "von_mises" in reference:
        table = np.array(reference["von_mises"]["rows"])
        wrong = np.abs(fitted(table[:, :3], x, stress) / table[:, 5] - 1)
        row["median von Mises"], row["95% von Mises"] = np.percentile(wrong, [50, 95])
    if "peak_von_mises" in known:
        row["peak von Mises"] = np.mean(probes) / known["peak_von_mises"]["value"] - 1
        row["peak on the surface"] = peak / known["peak_von_mises"]["value"] - 1
    return row


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("phyxel")
    parser.add_argument("--meshes", default=".", help="folder of fandisk.obj and spot.obj")
    parser.add_argument("--cases", nargs="+", default=["plate_hole", "fandisk", "spot", "spot_sideways", "sphere", "bar_5",
                                                       "bar"])
    parser.add_argument("--counts", nargs="+", type=int, default=[2000, 10000])
    parser.add_argument("--closures", nargs="+", default=["0", '"auto"'], help="as scenes have them")
    parser.add_argument("--grading", nargs="+", default=[""], help='keys of [body.grading], e.g. "ratio = 4, across = 0"; "": none')
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--out", help="CSV file for the table")
    options = parser.parse_args()
    with open(os.path.join(HERE, "references.json")) as file:
        references = json.load(file)
    file = open(options.out, "w", newline="", buffering=1) if options.out else sys.stdout
    out = csv.writer(file, lineterminator="\n")
    columns = [c for c in COLUMNS if c != "grading" or any(options.grading)]
    out.writerow(columns)
    with tempfile.TemporaryDirectory() as folder:
        write_meshes(folder, options.meshes, {references[c]["mesh"][:-4] for c in options.cases if "mesh" in references[c]})
        for case in options.cases:
            reference = references[case]
            for clamp in (["box", "cut"] if "plane" in reference else ["face"]):
                for closure, grading, count in itertools.product(options.closures, options.grading, options.counts):
                    text = scene_of(case, reference, clamp, closure, grading, count)
                    try:
                        found = run(options.phyxel, folder, text, options.threads)
                    except RuntimeError as error:
                        print(f"{case}, {clamp}, closure {closure}, {count}: {error}", file=sys.stderr)
                        continue
                    x, u = found[:2]
                    row = {"case": case, "clamp": clamp, "closure": closure.strip('"'), "grading": grading, "phyxels": len(x),
                           "held": int((np.abs(u).max(1) == 0).sum()), **errors(reference, *found)}
                    out.writerow([f"{v:.2e}" if isinstance(v, float) else v for v in (row.get(c, "") for c in columns)])


if __name__ == "__main__":
    main()
