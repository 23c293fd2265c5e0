#!/usr/bin/env python3
"""Measures explicit finite elements on the bar of `phyxel accuracy gravity`, on one GPU: writes docs/results/gpu_error_fem.csv,
with the columns of `phyxel bench error`, which finds the times to an error from it.

    bench/compare/explicit_fem.py path/to/explicit_fem [--most 32] [--out FILE]
    phyxel bench error --from docs/results/gpu_error_fem.csv --fastest docs/results/gpu_error_fem_fastest.csv

The program is bench/compare/explicit_fem/main.cu; `--from FILE` takes what its mode `beam` has printed earlier. *Lattice* names
the elements and the way they are stepped; of the two ways for any mesh, the faster one of each size is written.
"""
import argparse
import csv
import datetime
import pathlib
import subprocess

ROOT = pathlib.Path(__file__).resolve().parents[2]
COLUMNS = ["problem", "quantity", "lattice", "factor", "hourglass", "closure", "across", "phyxels", "neighbours", "error",
           "evaluations", "rest_seconds", "precision", "safety", "time_step_s", "step_seconds", "seconds_per_simulated_second"]
ON_LATTICE = {"lattice"}


def kind(row):
    """What a row is compared as: elements of any mesh, or of a lattice alone."""
    return f"{row['element']}: {'lattice alone' if row['path'] in ON_LATTICE else 'any mesh'}"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program", nargs="?", help="explicit_fem")
    parser.add_argument("--from", dest="earlier", type=pathlib.Path, help="output of its mode `beam`")
    parser.add_argument("--most", type=int, default=32, help="cells across the finest mesh")
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "docs/results/gpu_error_fem.csv", help="table to write")
    options = parser.parse_args()
    if bool(options.program) == bool(options.earlier):
        parser.error("either the program or --from is needed")
    text = options.earlier.read_text() if options.earlier else subprocess.run(
        [options.program, "beam", str(options.most)], check=True, capture_output=True, text=True).stdout
    lines = text.splitlines()
    facts = [line for line in lines if line.startswith("#")]
    fastest = {}
    for row in csv.DictReader(line for line in lines if line and not line.startswith("#")):
        key = kind(row), int(row["across"])
        seconds = float(row["seconds_per_simulated_second"])
        if key not in fastest or seconds < float(fastest[key]["seconds_per_simulated_second"]):
            fastest[key] = row
    with options.out.open("w") as file:
        file.write("# program: bench/compare/explicit_fem\n")
        file.write("".join(f"{line}\n" for line in facts))
        if not any(line.startswith("# date:") for line in facts):
            file.write(f"# date: {datetime.date.today().isoformat()}\n")
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        for (name, across), row in sorted(fastest.items()):
            writer.writerow(["gravity", "deflection", name, "", "", "", across, row["nodes"], "", row["error"], "",
                             "", "float", "", row["time_step_s"], row["step_seconds"], row["seconds_per_simulated_second"]])
    print(options.out.read_text(), end="")


if __name__ == "__main__":
    main()
