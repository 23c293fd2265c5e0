#!/usr/bin/env python3
"""What tests have skipped, counted by reason: one line each, the commonest first, and the cases' names behind it.

    scripts/skips.py FILE

FILE is what tests append to where the environment variable PHYXEL_SKIPS names it: "case, tab, reason". A case that
several programs or ranks skip counts each time. A file that is not there holds no skip.
"""
import collections
import pathlib
import sys


def summary(text, names=3):
    cases = collections.defaultdict(list)
    for line in text.splitlines():
        case, _, reason = line.partition("\t")
        cases[reason or "no reason given"].append(case)
    lines = []
    for reason, skipped in sorted(cases.items(), key=lambda item: (-len(item[1]), item[0])):
        shown = list(dict.fromkeys(skipped))
        more = f" and {len(shown) - names} more" if len(shown) > names else ""
        lines.append(f"{len(skipped):5}  {reason}: {', '.join(shown[:names])}{more}")
    return lines


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(f"usage: {sys.argv[0]} FILE")
    file = pathlib.Path(sys.argv[1])
    for line in summary(file.read_text() if file.exists() else ""):
        print(line)
