#!/usr/bin/env python3
"""Measures the table of docs/accuracy.md on a machine with many cores: runs `phyxel accuracy` in slices of one case,
lattice, jitter and discretisation, several at a time on separate cores, and joins their rows in one file.

    scripts/measure_accuracy.py path/to/phyxel docs/results/accuracy.csv [--cores 4] [--case CASE] [--meshes]

Times in the table are those of --cores cores, while other cores are busy. With --case, rows of that case are replaced in
an existing table or added to it; with --meshes, rows of bodies from meshes. A fact then names the program that measured
them, and the machine if it is another one. Problems of contact have a table of their own, which `phyxel accuracy contact`
writes.
bench/make_pages.py writes the page.
"""
import argparse
import concurrent.futures
import itertools
import os
import queue
import re
import subprocess
import tempfile

SLOW = ["taylor", "elastica", "L-block", "spinning", "twist"]  # begun first
OWN_WAYS = ["cycles", "simple-shear", "tube", "sphere", "taylor"]  # measured in no others than they name themselves


def cases(program):
    text = subprocess.run([program, "accuracy", "--help"], check=True, capture_output=True, text=True).stdout
    listed = text.split("Problems:", 1)[1].split("Problems of contact", 1)[0]
    return re.findall(r"^\s*([A-Za-z][\w-]*): ", listed, re.MULTILINE)


def slices(names, meshes_alone):
    ways = [("nodes", "0"), ("nodes", "0.2"), ("cells", "0"), ("cells", "0.2"), ("mesh", "0")]
    for name, lattice in itertools.product(names, ("nodes", "cells", "mesh")):
        if name in OWN_WAYS and (lattice == "mesh" or not meshes_alone):
            yield [name, "--lattice", lattice]
    for name, (lattice, jitter), hourglass in itertools.product(names, ways, ("0", "0.1")):
        if name in OWN_WAYS or (meshes_alone and lattice != "mesh"):
            continue
        arguments = ["--lattice", lattice, "--jitter", jitter, "--hourglass", hourglass]
        if name == "elastica":
            for closure in ("0", "1e-3"):
                yield [name, *arguments, "--closure", closure]
        else:
            yield [name, *arguments]


def measured(program, arguments, free, folder, number):
    cores = free.get()
    file = os.path.join(folder, f"{number}.csv")
    environment = dict(os.environ, OMP_NUM_THREADS=str(len(cores.split(","))), OMP_PROC_BIND="true")
    done = subprocess.run(["taskset", "-c", cores, program, "accuracy", *arguments, "--csv", file],
                          env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    free.put(cores)
    print(" ".join(arguments), f": exit code {done.returncode}", done.stderr.strip(), flush=True)
    if not os.path.exists(file):
        return [], []
    with open(file) as text:
        lines = text.read().splitlines()
    facts = [line for line in lines if line.startswith("#")]
    return facts, lines[len(facts):]


def joined(lines, facts, head, rows, options):
    """The facts and rows of a table in which those that have been measured replace older ones."""
    def fact(name, of):
        return next(line for line in of if line.startswith(f"# {name}: ")).split(": ", 1)[1]

    program = fact("program", facts)
    if fact("hardware", facts) != fact("hardware", lines):
        program += " on " + fact("hardware", facts)
    what = ", ".join(([options.case] if options.case else []) + (["meshes"] if options.meshes else []))
    said = f"# {what}: "
    old = [line for line in lines if not line.startswith("#")]
    if old[0] != head:
        raise SystemExit(f"{options.table}: has other columns")
    lattice = head.split(",").index("lattice")

    def case_of(row):
        return row.split(",", 1)[0]

    def is_replaced(row):
        return (not options.case or case_of(row) == options.case) and (not options.meshes or row.split(",")[lattice] == "mesh")

    kept = [row for row in old[1:] if not is_replaced(row)]
    merged = []
    for name in dict.fromkeys(case_of(row) for row in old[1:] + rows):
        merged += [row for row in kept + rows if case_of(row) == name]
    return [line for line in lines if line.startswith("#") and not line.startswith(said)] + [said + program], merged


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("table")
    parser.add_argument("--cores", type=int, default=4, help="for each slice")
    parser.add_argument("--case", help="this one alone")
    parser.add_argument("--meshes", action="store_true", help="bodies from meshes alone")
    options = parser.parse_args()
    cores = sorted(os.sched_getaffinity(0))
    free = queue.Queue()
    for first in range(0, len(cores) - options.cores + 1, options.cores):
        free.put(",".join(map(str, cores[first:first + options.cores])))
    at_once = free.qsize()
    if at_once == 0:
        parser.error(f"--cores {options.cores}: this machine has {len(cores)}")
    work = list(slices([options.case] if options.case else cases(options.program), options.meshes))
    order = sorted(range(len(work)), key=lambda k: SLOW.index(work[k][0]) if work[k][0] in SLOW else len(SLOW))
    with tempfile.TemporaryDirectory() as folder, concurrent.futures.ThreadPoolExecutor(at_once) as pool:
        found = {k: pool.submit(measured, options.program, work[k], free, folder, k) for k in order}
        results = [found[k].result() for k in range(len(work))]
    facts = next(facts for facts, _ in results if facts)
    head = next(rows[0] for _, rows in results if rows)
    rows = [row for _, rows in results for row in rows[1:]]
    if options.case or options.meshes:
        with open(options.table) as table:
            facts, rows = joined(table.read().splitlines(), facts, head, rows, options)
    else:
        facts.append(f"# at once: {at_once}")
    with open(options.table, "w") as table:
        table.write("\n".join(facts + [head] + rows) + "\n")


if __name__ == "__main__":
    main()
