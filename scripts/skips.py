#!/usr/bin/env python3
"""Counts skipped tests by reason: a line for each reason, the most frequent first, with the names of the cases.

    scripts/skips.py FILE

FILE is the file of the environment variable PHYXEL_SKIPS, to which tests append "case, tab, reason". A case that several
programs or ranks skip counts each time. A missing file counts as empty.
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
