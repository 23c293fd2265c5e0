#!/usr/bin/env python3
"""Compares the speed of two commits: builds both and runs them in turn, so that other load affects both alike.

    scripts/compare_commits.py main~5 main [--rounds 5] [--preset cpu] [--csv table.csv] [-- options of phyxel bench step]

Each is built in build/commits/, once. The table shows medians of the rounds; a difference within their spread is
called none. With --csv, it is added to a file of comparisons, which is made if there is none.
"""
import argparse
import csv
import pathlib
import statistics
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
KEYS = ["shape", "bodies", "terms", "precision", "threads", "phyxels", "surfels"]


def git(*words):
    return subprocess.run(["git", "-C", ROOT, *words], check=True, capture_output=True, text=True).stdout.strip()


def built(revision, preset):
    """Builds the program of a commit and returns its path."""
    commit = git("rev-parse", "--short", f"{revision}^{{commit}}")
    folder = ROOT / "build" / "commits" / commit
    if not folder.exists():
        git("worktree", "prune")
        git("worktree", "add", "--detach", str(folder), commit)
    for command in (["cmake", "--preset", preset, "-DPHYXEL_TESTS=OFF", f"-DPHYXEL_COMMIT={commit}"],
                    ["cmake", "--build", f"build/{preset}", "--target", "phyxel_program", "--parallel"]):
        done = subprocess.run(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        if done.returncode != 0:
            sys.exit(f"{commit}: {' '.join(command)} failed\n{done.stdout[-3000:]}")
    return commit, folder / "build" / preset / "bin" / "phyxel"


def measured(program, options):
    done = subprocess.run([program, "bench", "step", *options], capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{program}: {done.stderr}")
    rows = csv.DictReader(line for line in done.stdout.splitlines() if not line.startswith("#"))
    return {tuple(row[key] for key in KEYS if key in row): float(row["phyxel_steps_per_s"]) for row in rows}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("before")
    parser.add_argument("after")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--preset", default="cpu")
    parser.add_argument("--csv", type=pathlib.Path)
    words = sys.argv[1:]
    options = words[words.index("--") + 1:] if "--" in words else []
    asked = parser.parse_args(words[:words.index("--")] if "--" in words else words)
    programs = [built(revision, asked.preset) for revision in (asked.before, asked.after)]
    speeds = [{}, {}]
    for turn in range(asked.rounds):
        for side in ((0, 1), (1, 0))[turn % 2]:
            for key, speed in measured(programs[side][1], options).items():
                speeds[side].setdefault(key, []).append(speed)
    print(f"{asked.rounds} rounds; phyxel-steps/s of {programs[0][0]} and {programs[1][0]}")
    rows = []
    for key in speeds[0]:
        if key not in speeds[1]:
            print(f"  {' '.join(key):48} only before")
            continue
        before, after = (statistics.median(side[key]) for side in speeds)
        spread = max((max(side[key]) - min(side[key])) / statistics.median(side[key]) for side in speeds)
        change = after / before - 1
        verdict = "none" if abs(change) <= spread else f"{change:+.1%}"
        print(f"  {' '.join(key):48} {before:.4g} {after:.4g}  {verdict:>7} (spread {spread:.1%})")
        rows.append([programs[0][0], programs[1][0], asked.rounds, *key, f"{before:.4g}", f"{after:.4g}",
                     f"{after / before:.4f}", f"{spread:.4f}"])
    if asked.csv:
        is_new = not asked.csv.exists()
        with open(asked.csv, "a", newline="") as file:
            table = csv.writer(file, lineterminator="\n")
            if is_new:
                table.writerow(["before", "after", "rounds", *KEYS, "phyxel_steps_per_s_before", "phyxel_steps_per_s_after",
                                "ratio", "spread"])
            table.writerows(rows)


if __name__ == "__main__":
    main()
