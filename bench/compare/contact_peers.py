#!/usr/bin/env python3
"""Simulates two scenes of contact with phyxel, LAMMPS (smd/tlsph and smd/hertz) and Newton, each program on one core, and
writes docs/results/contact_peers.csv: errors beside seconds.

    bench/compare/contact_peers.py path/to/lmp path/to/phyxel [--what "LAMMPS built with ..."] [--cores 0 1]

balls: those of `phyxel accuracy balls`. drop: 27 balls fall into a box and come to rest (contact_scenes.py). Settings are
tried one after the other, and all are written. Times are those of the core, so that other programs beside it count little;
those of phyxel have its set-up, the others have not. Runs with Python that has newton, gmsh, h5py and scipy.
"""
import argparse
import concurrent.futures
import csv
import datetime
import importlib.metadata
import multiprocessing
import os
import pathlib
import subprocess
import sys
import tempfile

import contact_scenes as scenes
import lammps_contact
import numpy as np
import phyxel_contact
from lammps import HERE, RESULTS, processor

FILE = RESULTS / "contact_peers.csv"
PHYXELS_DROP, ACROSS_DROP = 300, 8
METHODS = {"projected": "[contact]", "penalties of 0.1": '[contact]\nmethod = "penalty"',
           "penalties of 1": '[contact]\nmethod = "penalty"\nstiffness = 1'}


def points_of(across):
    """How many points a ball has that is so many cells across, as in `phyxel accuracy`."""
    return round(np.pi / 6 * across**3)


def newton(scene, *settings):
    """Runs newton_contact.py: the arrays it writes, or why it failed."""
    with tempfile.TemporaryDirectory() as folder:
        out = pathlib.Path(folder) / "out.npz"
        ran = subprocess.run([sys.executable, str(HERE / "newton_contact.py"), scene, str(out), *map(str, settings)],
                             capture_output=True, text=True, check=False)
        if ran.returncode or not out.exists():
            return {"why": ran.stderr.strip().splitlines()[-1]}
        with np.load(out) as file:
            return {name: file[name] for name in file.files}


def newton_balls(solver, across, stiffness, shares, *settings):
    """One impact with the largest step tried that stays stable. @param stiffness of E times an edge"""
    for share in shares:
        out = newton("balls", "--solver", solver, "--nodes", points_of(across), "--share", share, "--stiffness", stiffness,
                     *settings)
        if not out.get("stable", False):
            continue
        found = scenes.impact(out["looks"], out["gaps"])
        if found and abs(found["restitution"]) < 1.05:
            return {**found, "points": 2 * int(out["nodes"]), "step": float(out["step"]),
                    "seconds": float(out["seconds"] * 1.5 * scenes.DURATION / out["end"])}
    return None


def newton_drop(solver, stiffness, share, *settings):
    """One drop, or its beginning."""
    out = newton("drop", "--solver", solver, "--nodes", PHYXELS_DROP, "--share", share, "--stiffness", stiffness, *settings)
    if "frames" not in out:
        return {"stable": "no", "points": "", "step": "", "why": out["why"]}
    told = {"points": 27 * int(out["nodes"]), "step": float(out["step"])}
    seconds, reach = float(out["seconds"] / out["end"]), float(out["reach"])
    times = np.arange(len(out["frames"])) / scenes.FRAMES
    found = scenes.drop_measures(times, out["frames"], out["velocities"], out["masses"], 2 * reach, reach)
    if found["stable"] == "yes" and out["end"] < scenes.DROP_END - 1e-6:
        return {**told, "stable": f"stopped at {float(out['end']):.2g} s", "seconds": seconds}
    return {**told, **found, **({"seconds": seconds} if found["stable"] == "yes" else {})}


def jobs(options):
    """All runs: scene, program, setting, cells across, function and its arguments. The longest ones first."""
    si, vbd = "Newton semi-implicit", "Newton VBD"
    if "newton" in options.programs:
        yield "drop", vbd, "k = 3 E h, 10 iterations", "", newton_drop, ("vbd", 3, 2.0)
        yield ("drop", si, "nodes and triangles, k = E h", "", newton_drop,
               ("semi-implicit", 1, 0.1, "--limit", 20))
        for stiffness in (1, 0.5):
            yield "balls", si, f"k = {stiffness:g} E h", 12, newton_balls, ("semi-implicit", 12, stiffness, (0.1, 0.07))
        for across, share in ((16, 0.3), (12, 0.3), (12, 0.1), (8, 0.3), (8, 0.1)):
            yield "balls", vbd, f"k = E h, step {share:g}", across, newton_balls, ("vbd", across, 1, (share,))
        for stiffness in (0.5, 1, 3):
            yield "balls", si, f"k = {stiffness:g} E h", 8, newton_balls, ("semi-implicit", 8, stiffness, (0.14, 0.1, 0.07))
        for across in (8, 12, 16):
            yield ("balls", si, "spheres, k = 5 E h", across, newton_balls,
                   ("semi-implicit", across, 5, (0.1, 0.05), "--contact", "particles"))
        for stiffness in (1, 5):
            yield ("drop", si, f"spheres, k = {stiffness} E h", "", newton_drop,
                   ("semi-implicit", stiffness, 0.1, "--contact", "particles"))
    if "lammps" in options.programs:
        for stiffness in (0.5, 2, 5):
            yield "drop", "LAMMPS", f"K = {stiffness:g} E", "", lammps_contact.drop, (options.lmp, ACROSS_DROP, stiffness)
        for across in options.across:
            for stiffness in (0.2, 0.3, 0.5, 1):
                yield "balls", "LAMMPS", f"K = {stiffness:g} E", across, lammps_contact.balls, (options.lmp, across, stiffness)
            for stiffness in (0.5, 8, 30):
                yield ("balls", "LAMMPS", f"on the surface, K = {stiffness:g} E", across, on_surface,
                       (options.lmp, options.phyxel, across, stiffness))
    if "phyxel" in options.programs:
        for across in options.across:
            for way in phyxel_contact.WAYS:
                yield "balls", "phyxel", way, across, phyxel_contact.balls, (options.phyxel, across, way)
            for name in list(METHODS)[1:]:
                yield ("balls", "phyxel", f"fitted; {name}", across, phyxel_contact.balls_of_scene,
                       (options.phyxel, points_of(across), METHODS[name]))
        for name, keys in METHODS.items():
            for precision in ("float", "double"):
                yield ("drop", "phyxel", f"{name}; {precision}", "", phyxel_contact.drop,
                       (options.phyxel, PHYXELS_DROP, keys, precision))


def on_surface(lmp, phyxel, across, stiffness):
    """LAMMPS with particles where phyxel has them."""
    return lammps_contact.balls(lmp, across, stiffness, phyxel_contact.fitted_ball(phyxel, points_of(across)))


def measure(job):
    scene, program, setting, across, function, arguments = job
    return (scene, program, setting, across), function(*arguments)


def rows_of(key, found):
    """The rows of a run, one for each quantity."""
    if not found:
        found = {"stable": "no", "points": "", "step": "", "why": "no step tried is stable"}
    references = {"duration": scenes.DURATION, "approach": scenes.APPROACH, "restitution": 1, "height": scenes.rest_height()}
    step = f"{found['step']:.3g}" if found["step"] else ""
    seconds = f"{found['seconds']:.3g}" if "seconds" in found else ""
    for name, value in found.items():
        if name in ("points", "step", "seconds", "ended"):
            continue
        text = value if isinstance(value, str) else f"{float(value):.4g}"
        error = f"{float(value) / references[name] - 1:.2e}" if name in references else ""
        yield [*key, found["points"], step, name, text, error, seconds]


def pin(cores):
    os.sched_setaffinity(0, {cores.get()})


def kept(options):
    """The rows of what does not run now."""
    if not FILE.exists():
        return []
    with open(FILE, encoding="utf-8") as old:
        rows = list(csv.reader(line for line in old if not line.startswith("#")))[1:]
    return [row for row in rows if row[0] not in options.scenes or row[1].split()[0].lower() not in options.programs]


def write(options, old, results):
    version = subprocess.run([options.phyxel, "--version"], capture_output=True, text=True, check=True).stdout.strip()
    order = ["phyxel", "LAMMPS", "Newton semi-implicit", "Newton VBD"]
    # Cells of these tables have no commas.
    new = [[str(cell).replace(",", ";") for cell in row] for key, found in results for row in rows_of(key, found)]
    rows = sorted(old + new, key=lambda row: (row[0], order.index(row[1]), int(row[3] or 0)))
    with open(FILE, "w", newline="", encoding="utf-8") as out:
        out.write(f"# program: {version}\n# what: {options.what}; Newton {importlib.metadata.version('newton')} on Warp "
                  f"{importlib.metadata.version('warp-lang')}, device cpu\n"
                  f"# hardware: {processor()}, one core for each run\n# date: {datetime.date.today()}\n")
        table = csv.writer(out, lineterminator="\n")
        table.writerow("scene program setting across points step_s quantity value error seconds".split())
        table.writerows(rows)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("lmp")
    parser.add_argument("phyxel")
    parser.add_argument("--what", default="LAMMPS smd/tlsph and smd/hertz")
    parser.add_argument("--cores", type=int, nargs="+", default=[0], help="one run at a time on each")
    parser.add_argument("--across", type=int, nargs="+", default=[8, 12, 16])
    parser.add_argument("--programs", nargs="+", choices=["phyxel", "lammps", "newton"],
                        default=["phyxel", "lammps", "newton"], help="programs to run; the table keeps the rows of other programs")
    parser.add_argument("--scenes", nargs="+", choices=["balls", "drop"], default=["balls", "drop"], help="scenes to run; the table keeps the rows of other scenes")
    options = parser.parse_args()
    options.lmp, options.phyxel = (str(pathlib.Path(p).resolve()) for p in (options.lmp, options.phyxel))
    manager = multiprocessing.Manager()
    cores = manager.Queue()
    for core in options.cores:
        cores.put(core)
    old, results = kept(options), []
    with concurrent.futures.ProcessPoolExecutor(len(options.cores), initializer=pin, initargs=(cores,)) as pool:
        running = [pool.submit(measure, job) for job in jobs(options) if job[0] in options.scenes]
        for done in concurrent.futures.as_completed(running):
            results.append(done.result())
            write(options, old, results)
            for row in rows_of(*results[-1]):
                print(*row, sep=", ", flush=True)


if __name__ == "__main__":
    main()
