#!/usr/bin/env python3
"""Times LAMMPS's smd/tlsph on the cube of `phyxel bench step` and writes docs/results/lammps_tlsph.csv.

    bench/compare/lammps_tlsph.py path/to/lmp [--what "LAMMPS built with ..."] [--repeat 5]

Needs mpirun. The loop time that LAMMPS prints is used, without set-up; medians over the repeats.
"""
import argparse
import csv
import datetime
import re
import statistics

from lammps import RESULTS, loop_time, output_of, processor

SIZES = {10: 4000, 22: 400, 47: 40, 100: 5}  # particles along an edge: timed steps


def measure(lmp, edge, steps, ranks):
    """Loop time [s] and neighbours."""
    output = output_of(lmp, "lammps_tlsph.in", ranks, n=edge, steps=steps)
    neighbours = re.search(r"average # of neighbors/particle in group \S+ = (\S+)", output)[1]
    return loop_time(output), float(neighbours)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("lmp")
    parser.add_argument("--what", default="LAMMPS.")
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--ranks", type=int, nargs="+", default=[1, 2])
    options = parser.parse_args()
    with open(RESULTS / "lammps_tlsph.csv", "w", newline="", encoding="utf-8") as out:
        out.write(f"# what: {options.what}\n# hardware: {processor()}\n# date: {datetime.date.today()}\n")
        rows = csv.writer(out)
        rows.writerow("particles ranks neighbours particle_steps_per_s spread".split())
        for edge, steps in SIZES.items():
            for ranks in options.ranks:
                rates, neighbours = [], 0
                for _ in range(options.repeat):
                    seconds, neighbours = measure(options.lmp, edge, steps, ranks)
                    rates.append(edge**3 * steps / seconds)
                median = statistics.median(rates)
                rows.writerow([edge**3, ranks, f"{neighbours:.1f}", f"{median:.6g}",
                               f"{(max(rates) - min(rates)) / median:.3f}"])
                out.flush()
                print(edge**3, ranks, f"{median:.4g} particle-steps/s", flush=True)


if __name__ == "__main__":
    main()
