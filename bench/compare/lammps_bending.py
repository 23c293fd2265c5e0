#!/usr/bin/env python3
"""Times LAMMPS's smd/tlsph and phyxel on the bar of `phyxel accuracy bending`, ten periods of it, and writes
docs/results/accuracy_lammps.csv: errors of the frequency beside seconds, on the same cores.

    bench/compare/lammps_bending.py path/to/lmp path/to/phyxel [--what "LAMMPS built with ..."]

Needs mpirun. LAMMPS takes the largest of the steps tried that stays stable, its set-up is not counted;
phyxel takes its own, its set-up is counted.
"""
import argparse
import csv
import datetime
import io
import math
import os
import re
import subprocess

from lammps import RESULTS, SHARES, loop_time, output_of, processor

FREQUENCY = 0.99945  # [Hz]: finite elements, as in `phyxel accuracy bending`
PERIODS = 10
WAVE = math.sqrt(1e6 * 0.7 / (1.3 * 0.4) / 1000)  # speed of pressure waves [m/s]


def frequency(looks):
    """The frequency from the upward zero crossings of the end [Hz]."""
    rises = []
    for (t0, z0), (t1, z1) in zip(looks, looks[1:]):
        if z0 < 0 <= z1:
            rises.append(t0 + (t1 - t0) * z0 / (z0 - z1))
    rises = rises[:PERIODS + 1]
    return (len(rises) - 1) / (rises[-1] - rises[0]) if len(rises) > PERIODS else 0


def lammps_rows(lmp, across, ranks):
    for share in SHARES:
        step = share * 0.2 / across / WAVE
        # Long enough for ten periods of the softer, coarse bars.
        steps = int((PERIODS + 1.2) * (1.8 if across < 6 else 1.4) / FREQUENCY / step)
        try:
            out = output_of(lmp, "lammps_bending.in", ranks, across=across, step=step, steps=steps,
                            every=max(1, int(0.01 / step)))
        except subprocess.CalledProcessError:
            continue
        looks = [(float(t), float(z)) for t, z in re.findall(r"^=== (\S+) (\S+)$", out, re.M)]
        largest = max(abs(z) for _, z in looks) if looks else math.inf
        found = frequency(looks) if largest < 1e-3 else 0  # the amplitude is 2e-4
        if found == 0:
            continue
        # The time of the counted periods.
        seconds = loop_time(out) * ((PERIODS + 1) / found) / looks[-1][0]
        particles = int(re.search(r"Created (\d+) atoms", out)[1])
        yield ["LAMMPS smd/tlsph", "cells", across, particles, f"{step:.4g}", f"{found:.6g}",
               f"{found / FREQUENCY - 1:.3e}", f"{seconds:.4g}"]
        return


def phyxel_rows(phyxel, across, cores):
    for way, options in {"cells": ["--lattice", "cells", "--hourglass", "0"],
                         "cells α = 0.1": ["--lattice", "cells", "--hourglass", "0.1"],
                         "nodes": ["--lattice", "nodes", "--hourglass", "0"],
                         "nodes α = 0.1": ["--lattice", "nodes", "--hourglass", "0.1"]}.items():
        out = subprocess.run([phyxel, "accuracy", "bending", "--across", str(across), "--jitter", "0", "--closure",
                              "0"] + options, capture_output=True, text=True, check=True,
                             env={**os.environ, "OMP_NUM_THREADS": str(cores)}).stdout
        row = next(csv.DictReader(io.StringIO("\n".join(l for l in out.splitlines() if not l.startswith("#")))))
        seconds = float(row["seconds"]) + float(row["setup_seconds"])
        yield ["phyxel", way, across, row["phyxels"], "", row["value"], row["error"], f"{seconds:.4g}"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("lmp")
    parser.add_argument("phyxel")
    parser.add_argument("--what", default="LAMMPS smd/tlsph.")
    parser.add_argument("--cores", type=int, default=2)
    parser.add_argument("--across", type=int, nargs="+", default=[4, 6, 8])
    options = parser.parse_args()
    version = subprocess.run([options.phyxel, "--version"], capture_output=True, text=True, check=True).stdout.strip()
    with open(RESULTS / "accuracy_lammps.csv", "w", newline="", encoding="utf-8") as out:
        out.write(f"# program: {version}\n# what: {options.what}\n# hardware: {processor()}, {options.cores} cores\n"
                  f"# date: {datetime.date.today()}\n")
        rows = csv.writer(out, lineterminator="\n")
        rows.writerow("program discretisation across phyxels step_s frequency_Hz error seconds".split())
        for across in options.across:
            for row in [*lammps_rows(options.lmp, across, options.cores),
                        *phyxel_rows(options.phyxel, across, options.cores)]:
                rows.writerow(row)
                out.flush()
                print(*row, flush=True)


if __name__ == "__main__":
    main()
