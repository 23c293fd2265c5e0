#!/usr/bin/env python3
"""Solves bodies at rest by CalculiX and by phyxel, and writes docs/results/calculix.csv: errors beside CPU seconds and memory.

    bench/compare/calculix.py path/to/phyxel [--cases gravity plate] [--out FILE]

The cases are gravity, shear, elastica and cook of `phyxel accuracy`, and the plate with a hole of bench/references. Each run is
a process with one thread on one core. CPU seconds (user and system) and the peak resident set size come from the kernel's
accounting of the whole process; the least of the repeats counts. CalculiX reads a mesh that has been made before; phyxel makes
its own points.

Needs CalculiX (Debian: calculix-ccx), numpy, and for the plate scipy and h5py.
"""
import argparse
import csv
import datetime
import io
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

import calculix_cases
import calculix_model
from calculix_model import Cost, ModelError, least, run_accounted
from lammps import RESULTS, processor

REFERENCES = pathlib.Path(__file__).resolve().parents[1] / "references"
COLUMNS = ["case", "quantity", "program", "discretisation", "mesh", "solver", "refinement", "unknowns", "value", "reference",
           "error", "cpu_seconds", "memory_mib"]
#: Clouds of phyxels with the closure that scenes have by default.
CLOUDS = {"nodes": 0, "mesh": 0.01}
#: Cells across the thinner sides; phyxels of the plate.
SIZES = {"gravity": [4, 6, 8, 12, 16, 24], "shear": [4, 6, 8, 12, 16, 24], "elastica": [4, 6, 8, 12, 16],
         "cook": [11, 22, 44, 88], "plate": [2000, 5000, 10000, 20000, 40000, 80000]}


def table_row(case, quantity, setting, refinement, unknowns, value, cost):
    """A row of the table."""
    reference = calculix_cases.CASES[case].references[quantity]
    return [case, quantity, *setting, refinement, unknowns, f"{value:.9g}", f"{reference:.9g}", f"{value / reference - 1:.4e}",
            f"{cost.seconds:.4g}", f"{cost.mebibytes:.4g}"]


# --- CalculiX ---------------------------------------------------------------------------------------

def runs_of_calculix(name):
    """Yields mesh, element, refinement and solver. Of large displacements and of graded meshes only the direct solver is
    measured: the iterative one is several times slower there, and less accurate."""
    case = calculix_cases.CASES[name]
    for (mesh, element), refinements in case.meshes.items():
        for solver in calculix_model.SOLVERS:
            if solver == "direct" or (mesh == "uniform" and not case.nonlinear):
                for refinement in refinements:
                    yield mesh, element, refinement, solver


def calculix_rows(options, name):
    for mesh, element, refinement, solver in runs_of_calculix(name):
        analyses = calculix_cases.CASES[name].analyses(element, mesh, refinement)
        unknowns = analyses[0].model.unknowns()
        if unknowns > options.most:
            continue
        label = f"{name}, {mesh} {element}, refinement {refinement}, {solver} solver"
        values, costs = {}, []
        for analysis in analyses:
            found, cost = calculix_model.solve(options.ccx, analysis.model, solver, options.core, label, repeats=options.repeats)
            values.update(analysis.values(found))
            costs.append(cost)
        cost = Cost(sum(c.seconds for c in costs), max(c.mebibytes for c in costs))
        for quantity, value in values.items():
            yield table_row(name, quantity, ["CalculiX", element, mesh, solver], refinement, unknowns, value, cost)


# --- phyxel -----------------------------------------------------------------------------------------

def repeated(options, command, folder, label):
    """Standard output of the last run of a command, and the least cost of all."""
    runs = [run_accounted(command, folder, options.core, label) for _ in range(options.repeats)]
    return runs[-1][0], least([cost for _, cost in runs])


def accuracy_rows(options, name, cloud, across, folder):
    """The rows of one run of `phyxel accuracy`."""
    command = [options.phyxel, "accuracy", name, "--across", across, "--lattice", cloud, "--jitter", "0", "--hourglass", "0.1",
               "--closure", CLOUDS[cloud]]
    said, cost = repeated(options, command, folder, f"{name}, {cloud}, {across} across")
    table = csv.DictReader(io.StringIO("".join(line for line in said.splitlines(True) if not line.startswith("#"))))
    for row in table:
        if row["quantity"] not in calculix_cases.CASES[name].references:
            raise ModelError(f"{name}: phyxel has measured \"{row['quantity']}\"; known: "
                             f"{', '.join(calculix_cases.CASES[name].references)}")
        yield table_row(name, row["quantity"], ["phyxel", cloud, "", "Newton"], across, 3 * int(row["phyxels"]),
                       float(row["value"]), cost)


def plate_row(options, count, folder):
    """The row of one run of the plate's scene, whose end is measured as bench/references does."""
    sys.path.insert(0, str(REFERENCES))
    try:
        import compare
        import h5py
    except ImportError as error:
        raise ModelError(f"plate: {error} (Debian: python3-scipy python3-h5py)") from None
    reference = json.loads((REFERENCES / "references.json").read_text())["plate_hole"]
    text = compare.scene_of("plate_hole", reference, "face", '"auto"', "", count)
    text = re.sub(r"(?m)^surface = .*", "surface = false", text).split("[[probe]]")[0]
    compare.write_meshes(folder, None, [])
    (folder / "scene.toml").write_text(text)
    command = [options.phyxel, "run", "scene.toml", "--out", "frames", "--force", "--quiet", "--no-pictures", "--threads", "1"]
    _, cost = repeated(options, command, folder, f"plate, {count} phyxels")
    first, last = sorted((folder / "frames").glob("phyxels_*.hdf"))
    with h5py.File(first) as rest, h5py.File(last) as frame:
        end = compare.end_of(rest["VTKHDF/Points"][:].astype(float), frame["VTKHDF/PointData/displacement"][:].astype(float),
                             reference)
    return table_row("plate", "mean end displacement", ["phyxel", "mesh", "", "Newton"], count, 3 * count, end[0], cost)


def phyxel_rows(options, name):
    for cloud in CLOUDS:
        for size in SIZES[name]:
            with tempfile.TemporaryDirectory(prefix="calculix.") as folder:
                folder = pathlib.Path(folder)
                if name != "plate":
                    rows = accuracy_rows(options, name, cloud, size, folder) if size <= options.most_across else []
                else:
                    rows = [plate_row(options, size, folder)] if cloud == "mesh" and 3 * size <= options.most else []
                yield from rows


# --- the command ------------------------------------------------------------------------------------

def facts_of(options):
    def version(*command):
        return " ".join(subprocess.run(command, capture_output=True, text=True).stdout.split())
    peer = re.sub(r"^This is Version", "CalculiX", version(options.ccx, "-v"))
    return {"program": version(options.phyxel, "--version"), "peer": peer, "hardware": processor(),
            "repeats": options.repeats, "date": datetime.date.today().isoformat()}


def checked(parser, options):
    """The options with programs as absolute paths. Ends the command if they are no programs."""
    for name, what in (("phyxel", "a built phyxel"), ("ccx", "CalculiX; Debian: calculix-ccx")):
        found = shutil.which(getattr(options, name))
        if not found:
            parser.error(f"{getattr(options, name)}: no such program; needed: {what}")
        setattr(options, name, os.path.abspath(found))
    cores = sorted(os.sched_getaffinity(0))
    options.core = cores[-1] if options.core is None else options.core
    if options.core not in cores:
        parser.error(f"--core {options.core}: not allowed; allowed: {', '.join(map(str, cores))}")
    if options.repeats < 1:
        parser.error(f"--repeats {options.repeats}: not allowed; allowed: 1 and more")
    return options


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("phyxel", help="the program")
    parser.add_argument("--ccx", default="ccx", help="CalculiX (default: %(default)s)")
    parser.add_argument("--cases", nargs="+", choices=list(calculix_cases.CASES), default=list(calculix_cases.CASES),
                        help="default: all")
    parser.add_argument("--core", type=int, help="core to run on (default: the last allowed one)")
    parser.add_argument("--repeats", type=int, default=3, help="runs of which the least cost counts (default: %(default)s)")
    parser.add_argument("--most", type=int, default=400_000, help="unknowns of the largest model (default: %(default)s)")
    parser.add_argument("--most-across", type=int, default=100, help="cells across the finest lattice of phyxels "
                                                                     "(default: %(default)s)")
    parser.add_argument("--out", type=pathlib.Path, default=RESULTS / "calculix.csv", help="table to write")
    options = checked(parser, parser.parse_args(arguments))
    text = io.StringIO()
    text.writelines(f"# {name}: {value}\n" for name, value in facts_of(options).items())
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(COLUMNS)
    try:
        for name in options.cases:
            for source in (calculix_rows, phyxel_rows):
                for row in source(options, name):
                    rows.writerow(row)
                    print(*row, flush=True)
        options.out.write_text(text.getvalue(), encoding="utf-8")
    except (ModelError, OSError) as error:
        print(f"calculix.py: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
