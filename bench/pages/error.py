"""The section of docs/performance.md on the time that it takes to reach an error, from the tables of `phyxel bench error`."""
from pages.charts import LineChart
from pages.page import measured_by
from pages.tables import markdown_table, read_if_there

ABOUT = """A bar, five times as long as wide, is clamped at one end. *Seconds*: what one simulated second of it takes, in \
which it swings once; *rest*: the time of the search for rest on the CPU, in double. Errors are those of `phyxel accuracy` at \
rest. An error counts as reached where all finer clouds are as good, too, so that what is small by chance at one spacing \
does not count; between two spacings, times are powers of errors. *All*: the worst of all problems. *Factor*: support over \
the mean distance to the ten nearest; *safety*: step over the largest stable one; *across*: cells across the bar."""

PEERS = """*Finite elements*: explicit, total-Lagrangian, in float, on the same card in the same call \
(`bench/compare/explicit_fem`): linear tetrahedra, and bricks with one point and hourglass stiffness, by the fastest of \
several ways to step them, those for any mesh apart from those for a lattice alone."""

CLOUDS = {"nodes": "nodes of a lattice", "cells": "cells of a lattice", "mesh": "on and in a mesh"}


def seconds(value):
    """A time as text, in a unit that suits it."""
    return f"{value:.3g} s" if value >= 1 else f"{1e3 * value:.3g} ms" if value >= 1e-3 else f"{1e6 * value:.3g} µs"


def setting(row):
    """The time of a fastest setting, and the setting, as text; a dash if there is none."""
    if not row:
        return "–"
    parts = [f"factor {row['factor']}"] if row["factor"] else []
    parts.append(f"{row['across']} across")
    if row["safety"]:
        parts.append(f"safety {row['safety']}")
    return f"{seconds(row.positive('seconds'))} ({', '.join(parts)})"


def fastest(page, table, peers):
    """Adds the table of the fastest settings. @param peers those of finite elements, or None"""
    levels = sorted(table.values("error_percent"), key=float, reverse=True)
    cells = []
    problems = sorted({(row["problem"], row["quantity"]) for row in table.rows}, key=lambda p: (p[0] != "all", p))
    for problem, quantity in problems:
        for lattice in table.values("lattice"):
            for run in table.values("run"):
                found = [table.find(problem=problem, quantity=quantity, lattice=lattice, run=run, error_percent=level)
                         for level in levels]
                if any(found):
                    name = problem if problem == "all" else f"{problem}: {quantity}"
                    cells.append([name, CLOUDS.get(lattice, lattice), run, *map(setting, found)])
    if peers:
        for elements in peers.values("lattice"):
            found = [peers.find(problem="gravity", lattice=elements, error_percent=level) for level in levels]
            cells.append(["gravity: deflection", f"finite elements, {elements}", "steps", *map(setting, found)])
    page.add(markdown_table(["problem", "cloud", "run", *(f"{level}%" for level in levels)], cells))


def curve_of(chart, label, rows):
    """Adds the errors of rows over their times to a chart."""
    curve = chart.curve(label)
    for row in rows:
        curve.x.append(row.positive("seconds_per_simulated_second"))
        curve.y.append(100 * abs(row.number("error")))


def add(page, table, results, stem):
    """Adds the section. @param table all settings. @param stem of the file of the table"""
    page.paragraph("## Time to an error")
    page.paragraph(f"Measured by {measured_by(table, 'gpu')}; by `phyxel bench error`.")
    page.paragraph(ABOUT)
    summary = read_if_there(results / f"{stem}_fastest.csv")
    if summary:
        fastest(page, summary, read_if_there(results / f"{stem}_fem_fastest.csv"))
    peers = read_if_there(results / f"{stem}_fem.csv")
    if peers:
        page.paragraph(PEERS)
    for lattice in table.values("lattice"):
        chart = LineChart(f"A bar under gravity, {CLOUDS.get(lattice, lattice)}", "seconds a simulated second",
                          "error of the deflection [%]")
        for row in table.where(problem="gravity", lattice=lattice):
            if row["precision"] != "float" or row["safety"] != table.values("safety")[0] or row.number("error") == 0:
                continue
            curve_of(chart, f"factor {row['factor']}", [row])
        for elements in peers.values("lattice") if peers else []:
            if lattice != "mesh" or "any mesh" in elements:
                curve_of(chart, elements, peers.where(lattice=elements))
        if chart.curves:
            page.show(chart, f"{stem}_{lattice}")
