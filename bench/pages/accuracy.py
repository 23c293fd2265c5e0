"""docs/accuracy.md: errors beside time, from the tables of `phyxel accuracy`, `phyxel accuracy contact`, `phyxel accuracy
hard` and the studies of `phyxel_studies`."""
import math
import re

from pages import calculix, contact_peers
from pages.charts import Curve, LineChart
from pages.page import Page, measured_by
from pages.problems import problems
from pages.tables import markdown_table, plain, read_if_there, read_table

HEAD = """# Accuracy

Written by `bench/make_pages.py` from the table of `phyxel accuracy` in `docs/results/`: problems with known answers, \
solved on the CPU in double (*inf*: the solution diverged). *Cells*: a phyxel in the middle of each cell of a lattice; \
*nodes*: a phyxel at each corner of the cells, also on faces, edges and corners of the body; *mesh*: as many phyxels as \
nodes, on the body's surface and inside it, as `phyxel sample --on-surface` places them. *Jitter*: largest random \
displacement of phyxels in spacings, with the volumes of the lattice. α: strength of hourglass control; *closed*: with \
closed gradients; *plain*: with neither. *Order*: order of convergence in the spacing, from the row before. \
*Evaluations*: number of evaluations of all forces, in Newton's method and in its preparation. *Set-up*: time from the \
scene to the first evaluation; bold rows and charts include it. Errors are relative to the reference, or as the quantity \
says."""

#: The discretisations in the summary.
SUMMARY = ["cells, plain", "nodes, plain", "nodes, α = 0.1", "nodes, jitter 0.2, plain",
           "nodes, jitter 0.2, α = 0.1, closed", "mesh, plain", "mesh, α = 0.1", "mesh, α = 0.1, closed"]
#: The discretisations in the summaries of groups of cases, which have tables of their own.
SUMMARY_OF_GROUPS = ["nodes, α = 0.1", "nodes, α = 0.1, closed", "nodes, jitter 0.2, α = 0.1",
                     "nodes, jitter 0.2, α = 0.1, closed", "cells, α = 0.1", "cells, jitter 0.2, α = 0.1",
                     "mesh, α = 0.1", "mesh, α = 0.1, closed"]
GROUPS = ["contact", "fracture"]


def cloud_of(row):
    """The kind of point cloud: lattice, jitter and support factor."""
    cloud = row["lattice"]
    if row.number("jitter") > 0:
        cloud += f", jitter {row['jitter']}"
    if row.number("factor") != problems()["default_factor"]:
        cloud += f", factor {row['factor']}"
    return cloud


def terms_of(row):
    """The terms beside the plain discretisation: hourglass control and closed gradients."""
    held, closure = row.number("hourglass") > 0, row.number("closure")
    terms = [f"α = {row['hourglass']}"] if held else []
    if closure > 0:
        terms.append("closed" + ("" if closure == 1e-3 else f" to {row['closure']}"))
    return ", ".join(terms) or "plain"


def way_of(row):
    """The discretisation without its resolution: point cloud and terms."""
    return f"{cloud_of(row)}, {terms_of(row)}"


def time_of(row):
    """The time of set-up and solution [s]."""
    return row.number("seconds") + row.number("setup_seconds")


def error_of(row):
    return abs(row.number("error"))


def front_of(rows):
    """The Pareto front of time and error: rows that no other row beats in both, the fastest first."""
    front, best = [], math.inf
    for row in sorted(rows, key=time_of):
        if error_of(row) < best:
            best = error_of(row)
            front.append(row)
    return front


def file_name_of(quantity):
    """The name of a quantity in a file name: its letters and digits, with hyphens for all other characters."""
    return re.sub("[^a-zA-Z0-9]", "-", plain(quantity).replace("ν", "nu"))


def short_error(error):
    """An error as a percentage, or below 0.01% as a power of ten."""
    error = abs(error)
    if not math.isfinite(error):
        return "diverged"
    if error < 1e-4:
        return f"{error:.0e}"
    return f"{100 * error:.2g}%" if error < 0.095 else f"{100 * error:.0f}%"


def finest_rows(table, ways, group):
    """Yields, for each quantity of a group of cases, its name, the row of each way at its finest resolution (None without
    rows), and the largest number of phyxels."""
    for case in problems()["cases"]:
        if case["group"] != group:
            continue
        for quantity in table.values("quantity", case=case["name"]):
            rows = table.where(case=case["name"], quantity=quantity)
            finest = []
            for way in ways:
                of_way = [row for row in rows if way_of(row) == way]
                # Among equally fine rows, the last.
                finest.append(max(reversed(of_way), key=lambda row: row.number("across")) if of_way else None)
            most = max((row.number("phyxels") for row in rows if way_of(row) in ways), default=0)
            yield f"{case['name']}: {quantity}", finest, most


def summary(page, table):
    """Adds the errors of each discretisation at its finest resolution, side by side."""
    there = {way_of(row) for row in table.rows}
    ways = [way for way in SUMMARY if way in there]
    if len(ways) < 2:
        return  # nothing to compare
    cells = [[name, f"{most:g}", *(short_error(row.number("error")) if row else "–" for row in finest)]
             for name, finest, most in finest_rows(table, ways, "")]
    page.paragraph("## Summary")
    page.paragraph("Errors at the finest resolution of each problem, with the largest number of phyxels (cells have fewer). "
                   "By default, scenes have nodes (cells in round bodies) with α = 0.1, or meshes with α = 0.1, closed to 0.01.")
    page.add(markdown_table(["", "phyxels", *ways], cells))


def summary_of_group(page, table, group):
    """Adds the errors of a group of problems, each beside its time."""
    there = {way_of(row) for row in table.rows}
    ways = [way for way in SUMMARY_OF_GROUPS if way in there]
    beside = table.fact("beside")  # what ran beside it, if someone has added that to the table
    page.paragraph(f"## {group.capitalize()}")
    page.paragraph(f"Errors at the finest resolution of each problem of {group}, `phyxel accuracy {group}`, each with the time from "
                   f"the scene to the answer. Measured by {measured_by(table)}{beside and '; ' + beside}.")
    page.add(markdown_table(["", "phyxels", *ways], [
        [name, f"{most:g}", *(f"{short_error(row.number('error'))} in {time_of(row):.2g} s" if row else "–" for row in finest)]
        for name, finest, most in finest_rows(table, ways, group)]))


def beside_lammps(page, results):
    """Adds the comparison with LAMMPS on the same beam and the same cores."""
    table = read_if_there(results / "accuracy_lammps.csv")
    if not table:
        return
    chart = LineChart("frequency of a bending bar", "time for ten periods [s]", "error")
    cells = []
    for row in table.rows:
        way = f"{row['program']}, {row['discretisation']}"
        curve = chart.curve(way)
        curve.x.append(row.number("seconds"))
        curve.y.append(error_of(row))
        cells.append([way, row["across"], row["phyxels"], short_error(row.number("error")), row["seconds"]])
    page.paragraph("## Beside LAMMPS")
    page.paragraph(
        "The bar of *bending* below vibrates for ten periods, on the same cores: the error of its frequency, and the time. "
        f"{table.fact('what')}. `bench/compare/lammps_bending.py` runs both programs: LAMMPS with its largest stable step "
        f"and without its set-up, phyxel with its default step and with its set-up. {table.fact('program')} on "
        f"{table.fact('hardware')}; {table.fact('date')}.")
    page.show(chart, "accuracy_lammps")
    page.add(markdown_table(["", "across", "phyxels", "error", "s"], cells))


def hourglass(page, results):
    """Adds pictures of a bar with and without hourglass control, and the costs of the terms."""
    shown = [p for p in problems()["pictures"] if (results / p["file"]).exists()]
    costs = []
    for device, file in (("CPU", "cpu_terms.csv"), ("GPU", "gpu_terms.csv")):
        table = read_if_there(results / file)
        for precision in ("double", "mixed", "float") if table else ():
            bare = table.find(terms="green", precision=precision)
            if not bare:
                continue
            row = [device, precision, bare["phyxels"]]
            for terms in ("hourglass", "closure"):
                with_terms = table.find(terms=terms, precision=precision)
                row.append(f"{100 * (bare.number('steps_per_s') / with_terms.positive('steps_per_s') - 1):+.0f}%"
                           if with_terms else "–")
            costs.append(row)
    if not shown and not costs:
        return
    page.paragraph("## Effect and cost of hourglass control")
    if shown:
        page.paragraph("A soft bar of neo-Hookean material, clamped at its upper end, after its release: its phyxels, drawn by "
                       "`phyxel_studies pictures`.")
        page.add(markdown_table([p["what"] for p in shown], [[f"![{p['what']}]({page.link}{p['file']})" for p in shown]]))
    if costs:
        page.paragraph("Extra time per step with the term, from `phyxel bench step`:")
        page.add(markdown_table(["", "precision", "phyxels", "hourglass control", "closed gradients"], costs))


def chart(page, case, quantity, rows, irregular, styles):
    """Adds a chart of error over time with a curve for each discretisation and the Pareto front, for regular lattices or
    irregular ones. On all charts a lattice has the same colour, and a set of terms the same marker."""
    drawn = LineChart(f"{case['name']}: {quantity}, {'irregular' if irregular else 'regular'} lattices",
                      "time from the scene to the answer [s]", "error")
    shown = [row for row in rows if (row.number("jitter") > 0 or row["lattice"] == "mesh") == irregular
             and 0 < error_of(row) < math.inf]
    # Rounding has no order, and one resolution no curve.
    if len(shown) < 2 or case["name"] == "rotation" or len(case["across"]) < 2:
        return
    front = front_of(shown)
    drawn.curves.append(Curve("Pareto front", [time_of(row) for row in front], [error_of(row) for row in front],
                              is_front=True))
    for row in shown:
        curve = drawn.curve(way_of(row), colour=styles["lattice"][row["lattice"]], style=styles["terms"][terms_of(row)])
        curve.x.append(time_of(row))
        curve.y.append(error_of(row))
    page.show(drawn, f"accuracy_{case['name']}_{file_name_of(quantity)}_{'irregular' if irregular else 'regular'}")


def section(page, table, case, quantity, styles):
    page.paragraph(f"## {case['name']}: {quantity}")
    page.paragraph(case["what"])
    rows = table.where(case=case["name"], quantity=quantity)
    for irregular in (False, True):
        chart(page, case, quantity, rows, irregular, styles)
    front = front_of(rows)
    page.paragraph("Bold rows are on the Pareto front: no other row is both faster and more accurate.")
    columns = ["across", "phyxels", "neighbours", "value", "error", "order", "evaluations", "seconds", "setup_seconds"]
    page.add(markdown_table(
        ["discretisation", "across", "phyxels", "neighbours", "value", "error", "order", "evaluations", "s", "set-up s"],
        [[f"**{way_of(row)}**" if row in front else way_of(row), *(row[column] for column in columns)] for row in rows]))


def study_section(page, results, study):
    table = read_if_there(results / f"accuracy_{study['name']}.csv")
    if not table:
        return
    page.paragraph(f"## {study['name']}")
    page.paragraph(f"{study['what']} By `phyxel_studies {study['name']}`: {measured_by(table)}.")
    drawn = LineChart(study["name"], study["x_label"], "error")
    x = study["x"]
    for row in table.rows:
        curve = drawn.curve(row["way"])
        curve.x.append(row.number("seconds" if study["by_time"] else x))
        curve.y.append(max(1e-17, row.number("error")))
    page.show(drawn, f"accuracy_{study['name']}")
    page.add(markdown_table(["", x, "error", "evaluations", "s"],
                            [[row[c] for c in ("way", x, "error", "evaluations", "seconds")] for row in table.rows]))


def hard_section(page, results):
    tables = {}
    for device, file in (("CPU", "hard_cases_cpu.csv"), ("GPU", "hard_cases_gpu.csv")):
        table = read_if_there(results / file)
        if table:
            tables[device] = table
    if not tables:
        return

    def found_in(table, name):
        """The results of a case in one table, precision by precision."""
        found = [f"{row['precision']} {'refused' if row['found'] == 'refusal' else row['error']}"
                 f"{'' if row['good'] == 'yes' else ' **(wrong)**'}" for row in table.where(case=name)]
        return "; ".join(found) or "not run"

    cells, refusals = [], ""
    for hard in problems()["hard"]:
        cells.append([hard["name"], hard["what"], f"{hard['tolerance']:g}" if hard["tolerance"] > 0 else "refusal",
                      *(found_in(table, hard["name"]) for table in tables.values())])
        messages = [row["message"] for row in next(iter(tables.values())).where(case=hard["name"]) if row["message"]]
        if messages:
            refusals += f"- {hard['name']}: {messages[0]}\n"
    measured = " ".join(f"{device}: {measured_by(table)}." for device, table in tables.items())
    page.paragraph("## Hard cases")
    page.paragraph("From `phyxel accuracy hard`: each case is solved within its tolerance, or refused with an error that names the cause. "
                   f"{measured}")
    page.add(markdown_table(["case", "what", "allowed", *tables], cells))
    if refusals:
        page.paragraph("Messages of refusals:")
        page.add(refusals)


def styles_of(tables):
    """Colours by lattice and markers by terms, the same on all charts."""
    rows = [row for table in tables for row in table.rows]
    terms = ["plain", "closed", "α = 0.1", "α = 0.1, closed", *(terms_of(row) for row in rows)]
    lattices = ["nodes", "cells", "mesh", *(row["lattice"] for row in rows)]
    return {"lattice": {name: k for k, name in enumerate(dict.fromkeys(lattices))},
            "terms": {name: k for k, name in enumerate(dict.fromkeys(terms))}}


def make(results, link):
    """The page. Raises PageError if accuracy.csv is missing."""
    table = read_table(results / "accuracy.csv")
    groups = {name: read_if_there(results / f"accuracy_{name}.csv") for name in GROUPS}
    page = Page(link)
    cases = problems()["cases"]
    page.paragraph(HEAD)
    # Cases that another program, or another machine, has measured since.
    since = {}
    for case in cases:
        if table.fact(case["name"]):
            since.setdefault(table.fact(case["name"]), []).append(case["name"])
    apart = "".join(f"; {', '.join(names)} by {program}" for program, names in since.items())
    page.paragraph(f"Measured by {measured_by(table)}{apart}.")
    summary(page, table)
    for group, own in groups.items():
        if own:
            summary_of_group(page, own, group)
    beside_lammps(page, results)
    calculix.section(page, results)
    contact_peers.section(page, results)
    hourglass(page, results)
    styles = styles_of([table, *(of_group for of_group in groups.values() if of_group)])
    for case in cases:
        own = groups[case["group"]] if case["group"] else table
        for quantity in own.values("quantity", case=case["name"]) if own else ():
            section(page, own, case, quantity, styles)
    for study in problems()["studies"]:
        study_section(page, results, study)
    hard_section(page, results)
    return page
