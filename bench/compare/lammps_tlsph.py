#!/usr/bin/env python3
"""Times LAMMPS's smd/tlsph on the cube of `phyxel bench step` and writes docs/results/lammps_tlsph.csv.

    bench/compare/lammps_tlsph.py path/to/lmp [--what "LAMMPS built with ..."] [--repeat 5]

Needs mpirun. The loop time that LAMMPS prints is used, without set-up; medians over the repeats.
"""
import argparse
import csv
import datetime
import pathlib
import re
import statistics
import subprocess

HERE = pathlib.Path(__file__).resolve().parent
OUT = HERE.parent.parent / "docs" / "results" / "lammps_tlsph.csv"
SIZES = {10: 4000, 22: 400, 47: 40, 100: 5}  # particles along an edge: timed steps


def loop_time(lmp, edge, steps, ranks):
    command = ["mpirun", "--allow-run-as-root", "--bind-to", "core", "-np", str(ranks), lmp, "-in",
               str(HERE / "lammps_tlsph.in"), "-log", "none", "-var", "n", str(edge), "-var", "steps", str(steps)]
    output = subprocess.run(command, capture_output=True, text=True, check=True,
                            env={"OMP_NUM_THREADS": "1", "PATH": "/usr/bin:/bin", "HOME": "/tmp"}).stdout
    neighbours = re.search(r"average # of neighbors/particle in group \S+ = (\S+)", output)[1]
    timed = output[output.index("=== timed"):]
    return float(re.search(r"Loop time of (\S+)", timed)[1]), float(neighbours)


def processor():
    return re.search(r"model name\s*: (.*)", pathlib.Path("/proc/cpuinfo").read_text())[1]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("lmp")
    parser.add_argument("--what", default="LAMMPS.")
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--ranks", type=int, nargs="+", default=[1, 2])
    options = parser.parse_args()
    with open(OUT, "w", newline="", encoding="utf-8") as out:
        out.write(f"# what: {options.what}\n# hardware: {processor()}\n# date: {datetime.date.today()}\n")
        rows = csv.writer(out)
        rows.writerow("particles ranks neighbours particle_steps_per_s spread".split())
        for edge, steps in SIZES.items():
            for ranks in options.ranks:
                rates, neighbours = [], 0
                for _ in range(options.repeat):
                    seconds, neighbours = loop_time(options.lmp, edge, steps, ranks)
                    rates.append(edge**3 * steps / seconds)
                median = statistics.median(rates)
                rows.writerow([edge**3, ranks, f"{neighbours:.1f}", f"{median:.6g}",
                               f"{(max(rates) - min(rates)) / median:.3f}"])
                out.flush()
                print(edge**3, ranks, f"{median:.4g} particle-steps/s", flush=True)


if __name__ == "__main__":
    main()
