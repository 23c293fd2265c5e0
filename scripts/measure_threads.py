#!/usr/bin/env python3
"""Measures steps per second with and without a limit on the spinning of waiting OpenMP threads, beside 0, 1 and 2 busy
programs.

    scripts/measure_threads.py [PROGRAM]     default: build/cpu/bin/phyxel

Policies run in turn, twice, so that other load affects them alike. The table docs/results/thread_policy.csv has a row for
each run of some seconds, with the speed that the program shows at its end.
"""
import csv
import os
import pathlib
import platform
import re
import signal
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[1]
POLICIES = {
    "libgomp's own": {"GOMP_SPINCOUNT": "300000"},
    "OMP_WAIT_POLICY=passive": {"OMP_WAIT_POLICY": "passive"},
    "GOMP_SPINCOUNT=100": {"GOMP_SPINCOUNT": "100"},
    "GOMP_SPINCOUNT=1000": {"GOMP_SPINCOUNT": "1000"},
    "GOMP_SPINCOUNT=10000": {"GOMP_SPINCOUNT": "10000"},
}
SCENE = """
[time]
end = 1000
[output]
frames_per_second = 0
[[body]]
shape = "block"
size = [0.4, 0.3, 0.2]
phyxels = {phyxels}
spin = [0, 0, 1]
[body.material]
young = 1e6
poisson = 0.3
density = 1000
"""


def speed(program, folder, phyxels, policy, seconds=2):
    """Steps per second of two threads, after `seconds`."""
    scene = pathlib.Path(folder) / "scene.toml"
    scene.write_text(SCENE.format(phyxels=phyxels))
    environment = {k: v for k, v in os.environ.items() if k not in ("OMP_WAIT_POLICY", "GOMP_SPINCOUNT")}
    run = subprocess.Popen([program, "run", scene, "--out", f"{folder}/out", "--force", "--threads", "2", "--no-pictures"],
                           env={**environment, **POLICIES[policy]}, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    time.sleep(seconds)
    run.send_signal(signal.SIGTERM)
    said = run.communicate()[0]
    shown = re.findall(r"([\d.e+]+) steps/s", said)
    if not shown:
        sys.exit(f"the program shows no speed:\n{said}")
    return float(shown[-1])


def main():
    program = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else ROOT / "build/cpu/bin/phyxel").resolve()
    version = subprocess.run([program, "--version"], capture_output=True, text=True, check=True).stdout.splitlines()[0]
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for turn in (1, 2):
            for busy in (0, 1, 2):
                others = [subprocess.Popen(["sh", "-c", "while :; do :; done"]) for _ in range(busy)]
                try:
                    for phyxels in (400, 2000, 20000):
                        for policy in POLICIES:
                            rows.append([turn, busy, phyxels, policy, speed(program, folder, phyxels, policy)])
                            print(*rows[-1], flush=True)
                finally:
                    for other in others:
                        other.kill()
                        other.wait()
    table = ROOT / "docs/results/thread_policy.csv"
    with table.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["turn", "busy programs", "phyxels", "policy", "steps/s", "cores", "machine", "program"])
        for row in rows:
            writer.writerow([*row, os.cpu_count(), platform.machine(), version])


if __name__ == "__main__":
    main()
