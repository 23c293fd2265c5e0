#!/usr/bin/env python3
"""Mutation testing: puts small faults into the sources, one at a time, and checks whether a test fails.

    scripts/mutate.py                                 100 faults in what changed since main
    scripts/mutate.py --base v0.1                     in what changed since a revision
    scripts/mutate.py --files lib/solver 'mpi/*.cpp'  in these files and folders
    scripts/mutate.py --count 200 --seed 2 --resume   skips faults that are in the table of results
    scripts/mutate.py --quick 6                       longer tests run at the end, on faults that no other test noticed
    scripts/mutate.py --page                          rewrites the page from the table

The faults are wrong operators, constants, dropped statements, swapped arguments and negated conditions, selected by a fixed
seed (scripts/faults.py). They are put into a copy, build/mutate/tree; the tree itself is only read. The files affected by a
fault are rebuilt, and the test programs that link the file are run, the quickest first, until one fails: the fault is
killed. A program that runs longer than --factor times its time without a fault hangs, which also kills. A fault that does
not compile does not count. The results, docs/results/mutation.csv, and the explanations, docs/results/mutation_reasons.csv,
make docs/results/mutation.md. The score is the share of killed faults among those that are not explained as equivalent
(no input makes a difference).

Exit code 0 if the score is at least --aim (95%), else 1.
"""
import argparse
import csv
import fnmatch
import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from faults import chosen  # noqa: E402

ROOT = pathlib.Path(__file__).resolve().parents[1]
COLUMNS = ["commit", "seed", "file", "line", "kind", "change", "outcome", "noticed_by", "seconds"]
KILLED, HUNG, SURVIVED, NOT_BUILT = "killed", "hung", "survived", "not built"
SOURCES = ("lib/*.cpp", "lib/*.hpp", "mpi/*.cpp", "mpi/*.hpp", "partition/*.cpp", "partition/*.hpp", "apps/phyxel/*.cpp")


# Tests receive signals as in a terminal, even if nohup or a shell's & makes this program ignore them.
HEAR_SIGNALS = ["env", "--default-signal=HUP,INT,QUIT,PIPE"]


def git(source, *arguments):
    return subprocess.run(["git", "-C", str(source), *arguments], capture_output=True, text=True, check=True).stdout


# --- the copy ------------------------------------------------------------------------------------

class Copy:
    """A copy of a tree and its build."""

    def __init__(self, source, folder, options=(), jobs=2):
        self.source, self.tree, self.jobs = source, folder / "tree", jobs
        self.build = self.tree / "build" / "mutate"  # as deep as the presets' folders: ccache finds its objects again
        self.log = folder / "build.log"
        self.options = list(options)
        self.environment = {"CCACHE_BASEDIR": str(source), "CCACHE_NOHASHDIR": "1", "OMP_WAIT_POLICY": "passive", **os.environ}
        for name in ("CI", "PHYXEL_SKIPS"):
            self.environment.pop(name, None)

    def sync(self):
        """Synchronises the copy with the tree, which also removes a fault that a killed program has left."""
        names = [n for n in git(self.source, "ls-files", "-z", "--cached", "--others", "--exclude-standard").split("\0") if n]
        names = [n for n in names if (self.source / n).is_file()]
        for name in names:
            target, content = self.tree / name, (self.source / name).read_bytes()
            if not target.exists() or target.read_bytes() != content:
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(content)
                shutil.copymode(self.source / name, target)
        wanted = set(names)
        for folder, folders, files in os.walk(self.tree):
            relative = pathlib.Path(folder).relative_to(self.tree)
            if relative == pathlib.Path("."):
                folders[:] = [f for f in folders if f != "build"]
            for file in files:
                if str(relative / file) not in wanted:
                    (pathlib.Path(folder) / file).unlink()

    def run(self, command, seconds=None):
        """Runs a command. Returns its exit code, or None after the time limit, and its output. Its children end with it."""
        with subprocess.Popen([*HEAR_SIGNALS, *command], cwd=self.build if self.build.exists() else self.tree, env=self.environment,
                              stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                              errors="replace", start_new_session=True) as child:
            try:
                output, _ = child.communicate(timeout=seconds)
                return child.returncode, output
            except subprocess.TimeoutExpired:
                os.killpg(child.pid, signal.SIGKILL)
                output, _ = child.communicate()
                return None, output

    def configure(self):
        code, output = self.run(["cmake", "-S", str(self.tree), "-B", str(self.build), "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release",
                                 "-DPHYXEL_TESTS=ON", "-DPHYXEL_CUDA=OFF", "-DPHYXEL_COMMIT=mutated", *self.options])
        if code != 0:
            sys.exit(f"mutate.py: the copy cannot be configured:\n{output}")

    def make(self, targets):
        code, output = self.run(["ninja", "-j", str(self.jobs), *targets])
        if code != 0:
            self.log.write_text(output)
        return code == 0


# --- which tests reach a file --------------------------------------------------------------------

class Graph:
    """The dependency graph of the build, from build.ninja and the compilers' header dependencies."""

    def __init__(self, copy):
        self.inputs, self.order_only = {}, {}
        text = (copy.build / "build.ninja").read_text().replace("$\n", "")
        for line in text.splitlines():
            match = re.match(r"build ((?:[^:$]|\$.)+): (\S+)(.*)", line)
            if not match or match[2] == "phony":
                continue
            before, _, after = match[3].partition("||")
            explicit = re.split(r"\s\|(?:@)?\s", before)
            outputs = [o for o in match[1].replace("|", " ").split()]
            for output in outputs:
                self.inputs[output] = [i for part in explicit for i in part.split()]
                self.order_only[output] = after.split()
        self.objects_of = {}  # a source: the objects that read it
        object_name = None
        for line in subprocess.run(["ninja", "-t", "deps"], cwd=copy.build, capture_output=True, text=True).stdout.splitlines():
            if not line.startswith(" "):
                object_name = line.split(":")[0]
            elif line.strip():
                path = pathlib.Path(os.path.normpath(copy.build / line.strip()))
                if path.is_relative_to(copy.tree):
                    self.objects_of.setdefault(str(path.relative_to(copy.tree)), set()).add(object_name)
        self.copy = copy
        self.symbols = {}

    def symbols_of(self, file, defined_only):
        """The defined symbols of an object, which a program that links the archive's member has."""
        if file not in self.symbols:
            lines = subprocess.run(["nm", file], cwd=self.copy.build, capture_output=True, text=True).stdout.splitlines()
            self.symbols[file] = {w[2] for w in map(str.split, lines) if len(w) == 3 and w[1] in "TDBR"}
        return self.symbols[file]

    def links(self, program, reached):
        """True if a program contains one of these objects, by name or as a member of an archive."""
        named, archives = set(), []
        for entry in self.inputs.get(program, []):
            (archives if entry.endswith(".a") else [named.add(entry)] and []).append(entry)
        if reached & named:
            return True
        own = None
        for archive in archives:
            for member in reached & set(self.inputs.get(archive, [])):
                own = own or self.symbols_of(program, False)
                if self.symbols_of(member, True) & own:
                    return True
        return False

    def programs_reached(self, file, programs):
        """The jobs whose programs, or the programs that they run, contain the file."""
        reached = self.objects_of.get(file, set())
        found = []
        for program in programs:
            runs = [o for o in self.order_only.get(program, []) if o.startswith("bin/")]
            if any(self.links(p, reached) for p in [program, *runs]):
                found.append(program)
        return found

    def needed(self, program):
        return [program, *[o for o in self.order_only.get(program, []) if o.startswith("bin/")]]


class Job:
    """A test program, or a command with one in it, as CTest would run it."""

    def __init__(self, name, command, program, folder, environment):
        self.name, self.command, self.program, self.folder = name, command, program, folder
        self.environment = environment
        self.seconds = None

    def run(self, copy, limit):
        command = self.command
        if self.environment:
            command = ["env", *self.environment, *command]
        return copy.run(command, limit)


def jobs_of(copy, graph):
    """All of CTest's tests that run a program of this build: the cases of a GoogleTest program at once."""
    listed = json.loads(copy.run(["ctest", "--show-only=json-v1"])[1])["tests"]
    jobs, seen = [], set()
    for test in listed:
        command = test.get("command")
        if not command or re.search(r"(^|/)(python[\d.]*|cmake|doxygen)$", command[0]):
            continue  # installs, builds or reads text
        programs = [os.path.relpath(w, copy.build) for w in command if w.startswith(str(copy.build))]
        programs = [p for p in programs if p in graph.inputs]
        if not programs:
            continue
        properties = {p["name"]: p["value"] for p in test.get("properties", [])}
        whole = command[0].startswith(str(copy.build)) and any(w.startswith("--gtest_filter") for w in command)
        name = pathlib.Path(command[0]).name if whole else test["name"]
        if name in seen:
            continue
        seen.add(name)
        if whole:
            command = [command[0], "--gtest_brief=1", "--gtest_fail_fast"]
        jobs.append(Job(name, command, programs[0], copy.build, properties.get("ENVIRONMENT", [])))
    return jobs


def good(code):
    return code in (0, 77)  # 77: all cases are skipped here


def time_clean(copy, jobs, state):
    """The time of each test without a fault; tests that fail are left out."""
    known = json.loads(state.read_text()) if state.exists() else {}
    kept = []
    for job in jobs:
        if job.name not in known:
            start = time.monotonic()
            code, output = job.run(copy, 900)
            known[job.name] = time.monotonic() - start if good(code) else None
            if not good(code):
                print(f"  left out, as it fails without a fault: {job.name}\n{output[-2000:]}", flush=True)
            state.write_text(json.dumps(known))
        if known[job.name] is not None:
            job.seconds = known[job.name]
            kept.append(job)
    return sorted(kept, key=lambda j: j.seconds)


# --- one fault -----------------------------------------------------------------------------------

def near_first(jobs, file):
    """The order of tests for a file: the test of the same name first, then by time."""
    stem = pathlib.Path(file).stem
    return sorted(jobs, key=lambda j: (stem not in j.name, j.seconds))


def batches(jobs):
    """Groups of tests that are built and run together: the first test alone, which mostly notices, then larger groups."""
    begin, size = 0, 1
    while begin < len(jobs):
        yield jobs[begin:begin + size]
        begin, size = begin + size, 2 * size


def what_one_fault_does(copy, graph, jobs, fault, factor, least):
    """Tries a fault. Returns the outcome and the test that noticed. The copy is restored in any case."""
    path = copy.tree / fault.file
    original = path.read_text()
    try:
        path.write_text(fault.applied(original))
        programs = set(graph.programs_reached(fault.file, sorted({j.program for j in jobs})))
        objects = sorted(graph.objects_of.get(fault.file, []))
        own = [o for o in objects if pathlib.Path(o).name == pathlib.Path(fault.file).name + ".o"] or objects[:1]
        if own and not copy.make(own[:1]):
            return NOT_BUILT, ""
        for batch in batches(near_first([j for j in jobs if j.program in programs], fault.file)):
            if not copy.make(sorted({n for job in batch for n in graph.needed(job.program)})):
                return NOT_BUILT, ""
            with ThreadPoolExecutor(copy.jobs) as pool:
                codes = list(pool.map(lambda job: job.run(copy, max(least, factor * job.seconds))[0], batch))
            for job, code in zip(batch, codes):
                if code is None:
                    return HUNG, job.name
                if not good(code):
                    return KILLED, job.name
        return SURVIVED, ""
    finally:
        path.write_text(original)


# --- results -------------------------------------------------------------------------------------

def read_rows(file):
    if not file.exists():
        return []
    with open(file, newline="") as lines:
        return list(csv.DictReader(lines))


def add_row(file, row):
    new = not file.exists()
    with open(file, "a", newline="") as out:
        writer = csv.DictWriter(out, COLUMNS, lineterminator="\n")
        if new:
            writer.writeheader()
        writer.writerow(row)


def identity(row):
    """The identity of a fault, independent of line numbers."""
    return row["file"], row["kind"], row["change"]


def score_of(rows, reasons):
    counted = [r for r in rows if r["outcome"] != NOT_BUILT]
    equivalent = [r for r in counted if r["outcome"] == SURVIVED and reasons.get(identity(r), {}).get("equivalent") == "yes"]
    killed = [r for r in counted if r["outcome"] in (KILLED, HUNG)]
    return len(killed), len(counted) - len(equivalent), len(equivalent)


def page_of(rows, reasons):
    killed, all_, equivalent = score_of(rows, reasons)
    commits = ", ".join(dict.fromkeys(r["commit"] for r in rows))
    lines = ["# Faults that tests notice", "",
             "Made by `scripts/mutate.py --page` of [mutation.csv](mutation.csv), and the reasons of",
             "[mutation_reasons.csv](mutation_reasons.csv). Each fault is one change of one place: an operator, a constant, a dropped",
             "statement, swapped arguments, a negated condition.", "",
             f"**{killed} of {all_} faults that are not equivalent were noticed: {100 * killed / max(all_, 1):.0f}%** "
             f"({equivalent} equivalent ones apart; commit {commits}).", "",
             "| folder | noticed | of | equivalent |", "|---|---:|---:|---:|"]
    for folder in sorted({str(pathlib.Path(r["file"]).parent) for r in rows}):
        k, a, e = score_of([r for r in rows if str(pathlib.Path(r["file"]).parent) == folder], reasons)
        lines.append(f"| {folder} | {k} | {a} | {e} |")
    lines += ["", "## Survivors", "", "| place | fault | equivalent | reason, or what is to be done |", "|---|---|---|---|"]
    cell = lambda text: text.replace("|", "\\|").replace("<", "&lt;")
    for row in rows:
        if row["outcome"] == SURVIVED:
            reason = reasons.get(identity(row), {})
            left = f" ({row['noticed_by']})" if row["noticed_by"] else ""
            lines.append(f"| {row['file']}:{row['line']} | {row['kind']}: {cell(row['change'])} | {reason.get('equivalent', '?')} | "
                         f"{cell(reason.get('reason', 'not explained yet'))}{left} |")
    return "\n".join(lines) + "\n"


def report(rows, reasons):
    for row in rows:
        if row["outcome"] == SURVIVED:
            why = reasons.get(identity(row), {}).get("reason", "")
            print(f"  survived  {row['file']}:{row['line']}: {row['kind']}: {row['change']}{'  (' + why + ')' if why else ''}")
    killed, all_, equivalent = score_of(rows, reasons)
    not_built = sum(r["outcome"] == NOT_BUILT for r in rows)
    print(f"{killed} of {all_} noticed: {100 * killed / max(all_, 1):.1f}%; {equivalent} equivalent, {not_built} did not compile")
    return killed >= all_


def try_faults(faults, copy, graph, jobs, table, row_begin, options, begin):
    """Adds a row for each fault that the table lacks. Faults that quick tests do not notice wait for the slow tests."""
    done = {identity(r): r for r in read_rows(table)}
    quick = [j for j in jobs if j.seconds <= options.quick]
    slow = [j for j in jobs if j.seconds > options.quick]
    counted, waiting = 0, []

    def tried(row, fault, tests):
        start = time.monotonic()
        row["outcome"], row["noticed_by"] = what_one_fault_does(copy, graph, tests, fault, options.factor, options.limit)
        row["seconds"] = f"{float(row.get('seconds', 0)) + time.monotonic() - start:.1f}"
        left = row["outcome"] == SURVIVED and tests is quick and slow
        if not left:
            add_row(table, row)
        print(f"{counted:4} {'waits' if left else row['outcome']:9} {float(row['seconds']):6.1f} s  {fault.file}:{fault.line}: "
              f"{fault.kind}: {fault.change}{'  by ' + row['noticed_by'] if row['noticed_by'] else ''}", flush=True)
        return left

    def late():
        return (time.monotonic() - begin) / 60 > options.minutes

    for fault in faults:
        row = {**row_begin, "file": fault.file, "line": fault.line, "kind": fault.kind, "change": fault.change}
        known = done.get(identity(row))
        if known:
            counted += known["outcome"] != NOT_BUILT
        if counted >= options.count or late():
            break
        if known:
            continue
        if tried(row, fault, quick):
            waiting.append((row, fault))
        counted += row["outcome"] != NOT_BUILT
        done[identity(row)] = row
    for row, fault in waiting:
        if late():
            add_row(table, {**row, "noticed_by": "slow tests not run"})
        else:
            tried(row, fault, slow)


# --- the command ---------------------------------------------------------------------------------

def sources_of(source, options):
    """The names and texts of the files to be mutated."""
    if options.files:
        names = git(source, "ls-files").splitlines()
        wanted = [n for n in names for f in options.files
                  if n == f or n.startswith(f.rstrip("/") + "/") or fnmatch.fnmatch(n, f)]
    else:
        wanted = git(source, "diff", "--name-only", "--diff-filter=d", options.base).splitlines()
        wanted = [n for n in wanted if any(fnmatch.fnmatch(n, s) for s in SOURCES)]
    wanted = [n for n in dict.fromkeys(wanted) if re.search(r"\.[ch]pp$", n)]
    if not wanted:
        sys.exit(f"mutate.py: no C++ source in {options.files or 'what changed since ' + options.base}")
    return {n: (source / n).read_text() for n in wanted}


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("--count", type=int, default=100, help="faults that compile (100)")
    add("--seed", type=int, default=1)
    add("--base", default="main", help="mutate the differences from this revision (main)")
    add("--files", nargs="+", help="mutate these files, folders or patterns instead")
    add("--resume", action="store_true", help="keep the table, and skip its faults")
    add("--factor", type=float, default=5, help="time limit of a test, relative to its time without a fault (5)")
    add("--limit", type=float, default=20, help="smallest time limit of a test in seconds (20)")
    add("--quick", type=float, default=float("inf"), help="time of a test [s] above which it runs at the end")
    add("--jobs", type=int, default=os.cpu_count(), help="compilers, or tests, at a time")
    add("--minutes", type=float, default=float("inf"), help="time after which no further fault is tried")
    add("--aim", type=float, default=95, help="score in percent below which the exit code is 1 (95)")
    add("--list", action="store_true", help="print the faults, change nothing")
    add("--page", action="store_true", help="write the page from the table only")
    add("--source", type=pathlib.Path, default=ROOT, help=argparse.SUPPRESS)
    add("--results", type=pathlib.Path, help="folder of the table (docs/results)")
    add("--cmake", nargs="*", default=[], metavar="NAME=VALUE", help="more settings of the copy's build")
    return parser.parse_args()


def main():
    options = arguments()
    source = options.source.resolve()
    results = options.results or source / "docs/results"
    table = results / "mutation.csv"
    reasons = {identity(r): r for r in read_rows(results / "mutation_reasons.csv")}
    write_page = lambda: (results / "mutation.md").write_text(page_of(read_rows(table), reasons))
    if options.page:
        write_page()
        return 0 if report(read_rows(table), reasons) else 1
    faults = chosen(sources_of(source, options), options.seed)
    if options.list:
        for fault in faults[:options.count]:
            print(f"{fault.file}:{fault.line}: {fault.kind}: {fault.change}")
        return 0
    results.mkdir(parents=True, exist_ok=True)
    if not options.resume and table.exists():
        table.unlink()
    begin = time.monotonic()
    folder = source / "build/mutate"
    copy = Copy(source, folder, [f"-D{s}" for s in options.cmake], options.jobs)
    copy.tree.mkdir(parents=True, exist_ok=True)
    print("builds the copy", flush=True)
    copy.sync()
    copy.configure()
    if not copy.make([]):
        sys.exit(f"mutate.py: the copy does not build, see {copy.log}")
    graph = Graph(copy)
    print("runs the tests without a fault", flush=True)
    changed = git(source, "status", "--porcelain", "--untracked-files=no", "--", ".", ":!docs/results")
    commit = git(source, "describe", "--always").strip() + ("-dirty" if changed else "")
    state = folder / f"clean-{commit}.json"
    if not options.resume or commit.endswith("-dirty"):
        state.unlink(missing_ok=True)
    jobs = time_clean(copy, jobs_of(copy, graph), state)
    try_faults(faults, copy, graph, jobs, table, {"commit": commit, "seed": options.seed}, options, begin)
    copy.sync()
    rows = read_rows(table)
    write_page()
    report(rows, reasons)
    killed, all_, _ = score_of(rows, reasons)
    return 0 if 100 * killed >= options.aim * all_ else 1


if __name__ == "__main__":
    sys.exit(main())
