#!/usr/bin/env python3
"""Writes docs/results/README.md, and the table of speeds in README.md, from the CSV files of
docs/results. No number there is typed by hand.

    build/cpu/bin/phyxel bench step --csv docs/results/cpu_step.csv --force
    build/cpu/bin/phyxel bench step --terms green --threads 1,4,16 --phyxels 100000,1000000 \
      --csv docs/results/cpu_step_16.csv --force
    build/cpu/bin/phyxel bench neighbours --csv docs/results/cpu_neighbours.csv --force
    bench/compare/lammps_tlsph.py path/to/lmp
    scripts/results_page.py
"""
import csv
import pathlib

ROOT = pathlib.Path(__file__).resolve().parent.parent
FOLDER = ROOT / "docs" / "results"
BEGIN, END = "<!-- speed: made by scripts/results_page.py -->\n", "<!-- end of speed -->"


def read(name):
    """(header comments as a dict, rows) of a CSV, or (None, []) if it is not there."""
    path = FOLDER / name
    if not path.exists():
        return None, []
    lines = path.read_text().splitlines()
    facts = dict(line[2:].split(": ", 1) for line in lines if line.startswith("# ") and ": " in line)
    return facts, list(csv.DictReader(line for line in lines if not line.startswith("#")))


def measured(facts):
    return ", ".join(facts[key] for key in ("hardware", "compiler", "program", "date") if key in facts)


def table(head, rows):
    lines = ["| " + " | ".join(head) + " |", "|" + " --- |" * len(head)]
    lines += ["| " + " | ".join(str(cell) for cell in row) + " |" for row in rows]
    return "\n".join(lines) + "\n"


def million(text):
    return f"{float(text) / 1e6:.2f}"


def step_section(name, title):
    facts, rows = read(name)
    if not rows:
        return ""
    text = f"\n## {title}\n\n"
    text += f"`phyxel bench step --device cpu`, {measured(facts)}. A jittered cube; medians; `spread` is "
    text += "(fastest − slowest)/median over the repeats. The force error is the largest difference from "
    text += "double over the largest force. Bytes are the least a step must move; the last column sets them "
    text += "against a plain copy on the same threads (above 100%: the body fits in cache).\n\n"
    head = ["terms", "precision", "threads", "phyxels", "neighbours", "M phyxel-steps/s", "spread",
            "G pairs/s", "bytes/phyxel-step", "of copy bandwidth", "force error"]
    body = [[r["terms"], r["precision"], r["threads"], r["phyxels"], r["neighbours"],
             million(r["phyxel_steps_per_s"]), f"{float(r['spread']):.0%}",
             f"{float(r['pairs_per_s']) / 1e9:.2f}", r["bytes_per_phyxel_step"],
             f"{float(r['bytes_per_s']) / float(r['copy_bytes_per_s']):.0%}", r["force_error"]]
            for r in rows]
    text += table(head, body)
    scaling = {}
    for r in rows:
        scaling.setdefault((r["terms"], r["precision"], r["phyxels"]), {})[r["threads"]] = r
    ratios = [[*key, threads, f"{float(r['phyxel_steps_per_s']) / float(by['1']['phyxel_steps_per_s']):.2f}",
               r["core_round_trip_ns"]]
              for key, by in scaling.items() if "1" in by
              for threads, r in by.items() if threads != "1"]
    if ratios:
        text += "\n### More threads\n\nThe speed over that of one thread. The last column is the time in "
        text += "nanoseconds in which two cores answer each other through a cache line, measured right after: "
        text += "a virtual machine's cores move, and where they no longer share a cache, small bodies scale "
        text += "less.\n\n"
        text += table(["terms", "precision", "phyxels", "threads", "ratio", "core round trip"], ratios)
    return text


def neighbours_section():
    facts, rows = read("cpu_neighbours.csv")
    if not rows:
        return ""
    text = "\n## Neighbour search\n\n"
    text += f"`phyxel bench neighbours`, {measured(facts)}. Microseconds per phyxel: mean spacing to the ten "
    text += "nearest, search within the support, transposition into the inverse neighbourhood.\n\n"
    head = ["threads", "phyxels", "neighbours", "spacing", "search", "transpose", "together"]
    body = [[r["threads"], r["phyxels"], r["neighbours"], r["spacing_us_per_phyxel"],
             r["search_us_per_phyxel"], r["transpose_us_per_phyxel"],
             f"{sum(float(r[k + '_us_per_phyxel']) for k in ('spacing', 'search', 'transpose')):.2f}"]
            for r in rows]
    return text + table(head, body)


def peer_rows():
    """Each measured run of LAMMPS beside ours in double and float, of the nearest size."""
    _, peer = read("lammps_tlsph.csv")
    _, own = read("cpu_step.csv")
    for p in peer:
        rates = {}
        for precision in ("double", "float"):
            near = [r for r in own if r["terms"] == "green" and r["precision"] == precision
                    and r["threads"] == p["ranks"]
                    and 0.5 < float(r["phyxels"]) / float(p["particles"]) < 2]
            if near:
                rates[precision] = float(near[0]["phyxel_steps_per_s"])
        if len(rates) == 2:
            yield p, rates


def peer_table(rows):
    head = ["particles", "cores", "LAMMPS `smd/tlsph`, double", "phyxel, double", "ratio", "phyxel, float", "ratio"]
    body = []
    for p, rates in rows:
        peer = float(p["particle_steps_per_s"])
        line = [f"{int(p['particles']):,}", p["ranks"], million(peer)]
        for precision in ("double", "float"):
            line += [million(rates[precision]), f"{rates[precision] / peer:.1f}×"]
        body.append(line)
    return table(head, body)


def peer_section():
    facts, _ = read("lammps_tlsph.csv")
    rows = list(peer_rows())
    if not rows:
        return ""
    text = "\n## Beside LAMMPS `smd/tlsph`\n\n"
    text += f"Millions of particle steps per second. {facts.get('what', '')} {measured(facts)}. Input: "
    text += "`bench/compare/lammps_tlsph.in`, run by `bench/compare/lammps_tlsph.py`. The phyxel rows are "
    text += "those above (terms green) of the nearest size, on as many threads as LAMMPS has ranks. Both are "
    text += "total-Lagrangian with 32 neighbours inside a cubic lattice; LAMMPS also computes an artificial "
    text += "viscosity and hourglass control, which phyxel does not.\n\n"
    return text + peer_table(rows)


def readme_block():
    facts, _ = read("cpu_step.csv")
    rows = [row for row in peer_rows() if int(row[0]["particles"]) > 50_000]
    if not rows:
        return ""
    text = "Millions of phyxel steps per second on a CPU (Green strain, gravity, about 32 neighbours), beside the "
    text += f"nearest peer on the same cores: {measured(facts)}.\n\n"
    return text + peer_table(rows)


def main():
    page = "# Measurements\n\nMade by `scripts/results_page.py` from the CSV files in this folder, which the "
    page += "`bench` commands write. [The 2008 paper, run again](paper/paper.md) is a page of its own, made "
    page += "by `phyxel paper`; so is [the GPU solver's performance](../performance.md), by `phyxel bench "
    page += "page`.\n"
    page += step_section("cpu_step.csv", "One time step on the CPU")
    page += step_section("cpu_step_16.csv", "Sixteen cores with AVX-512")
    page += neighbours_section() + peer_section()
    (FOLDER / "README.md").write_text(page)
    readme = (ROOT / "README.md").read_text()
    before, rest = readme.split(BEGIN)
    (ROOT / "README.md").write_text(before + BEGIN + readme_block() + END + rest.split(END, 1)[1])


if __name__ == "__main__":
    main()
