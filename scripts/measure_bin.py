#!/usr/bin/env python3
"""Measures how fast dinos fall into a bin: writes a row of docs/results/gpu_bin.csv, from which docs/performance.md is made.

    scripts/measure_bin.py build/cuda/bin/phyxel                      1,000 dinos, 4 s, 4 frames a second
    scripts/measure_bin.py build/cuda/bin/phyxel --count 3 3 3 --end 2 --out /tmp/bin.csv

The scene is that of scripts/bin_of_dinos.py. The row has what the program reports of its run, and the deepest overlap of bodies.
"""
import argparse
import csv
import datetime
import json
import pathlib
import re
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
COLUMNS = ["dinos", "phyxels", "end_s", "steps", "step_s", "steps_seconds", "setup_seconds", "readings_seconds",
           "readings", "deepest_m", "impact_loss_j", "friction_heat_j"]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program", type=pathlib.Path)
    parser.add_argument("--count", type=int, nargs=3, default=(10, 10, 10), metavar="N", help="dinos along x, y and z")
    parser.add_argument("--end", type=float, default=4, help="simulated time [s]")
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "docs/results/gpu_bin.csv", help="table to write")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        scene = pathlib.Path(folder) / "bin.toml"
        subprocess.run([sys.executable, ROOT / "scripts/bin_of_dinos.py", scene, "--end", str(options.end),
                        "--count", *map(str, options.count)], check=True)
        text = scene.read_text()
        scene.write_text(re.sub(r"frames_per_second = \d+", "frames_per_second = 4", text))
        subprocess.run([options.program, "run", scene, "--out", f"{folder}/out"], check=True, stdout=subprocess.DEVNULL)
        run = json.loads((pathlib.Path(folder) / "out/run.json").read_text())
    bodies = [c for c in run["contacts"] if c["shape"] == "body"]
    facts = {"program": run["program"], "date": datetime.date.today().isoformat(), "gpu": run["device"].split(",")[0],
             "device": run["device"].replace(",", ";")}
    row = [len(bodies), run["phyxels"], run["time_s"], run["steps"], run["time_step_s"], run["step_seconds"],
           run["setup_seconds"], run["seconds"]["energies"], run["frames"], max(c["deepest_m"] for c in bodies),
           sum(c["impact_loss_j"] for c in bodies), sum(c["friction_heat_j"] for c in bodies)]
    with options.out.open("w") as file:
        for name, value in facts.items():
            file.write(f"# {name}: {value}\n")
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerow([f"{v:.6g}" if isinstance(v, float) else v for v in row])
    print(options.out.read_text(), end="")


if __name__ == "__main__":
    main()
