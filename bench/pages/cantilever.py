"""The section of docs/performance.md about `phyxel bench cantilever`."""
import math

from pages.charts import LineChart
from pages.problems import problems
from pages.tables import PageError, markdown_table


def refinement(table, factor, precision):
    """The rows of one support factor and precision, from the coarsest cloud to the finest. Raises PageError if there is none."""
    rows = sorted(table.where(factor=factor, precision=precision), key=lambda row: row.positive("across"))
    if not rows:
        raise PageError(f"{table.file}: factor {factor}, {precision}: no row; allowed: a table of a measurement that ended")
    return rows


def usual_factor(table):
    """The default support factor of scenes; the first one of the table if the default was not measured."""
    usual = f"{problems()['default_factor']:g}"
    return usual if table.find(factor=usual) else table.rows[0]["factor"]


def rounded_precisions(table):
    """All precisions but double, the reference for rounding errors."""
    return [precision for precision in table.values("precision") if precision != "double"]


def words(table):
    """The paragraphs that describe the problem and its results. Most of them are about the default support factor."""
    beam = problems()["cantilever"]
    text = (
        f"A square beam on a regular lattice, {beam['heights_long']:g} heights long, Poisson's ratio {beam['poisson']:g}, "
        f"clamped at one end, under a shear force at the other that deflects it by {beam['deflection_by_length']:.2g} of its "
        "length; it is critically damped until the deflection changes by a relative "
        f"{beam['settled']:g} or less while the first mode decays by e. *Discretisation*: difference from the known deflection, "
        f"{beam['known_by_timoshenko']:.4g} of Timoshenko's (in which the clamped end may contract sideways, unlike fixed "
        "phyxels); *rounding*: largest difference of a displacement from double on the same cloud after the same number of "
        "steps, over the largest displacement. Times are those of the steps alone.\n\n")
    usual = usual_factor(table)
    clouds = refinement(table, usual, "double")
    coarse, fine = clouds[0], clouds[-1]

    def error(row):
        return row.positive("discretisation_error")

    def seconds(row):
        return row.positive("seconds")

    if coarse.number("across") < fine.number("across"):
        order = math.log(error(coarse) / error(fine)) / math.log(fine.number("across") / coarse.number("across"))
        text += (f"From {coarse['across']} to {fine['across']} phyxels across, with {fine['neighbours']} neighbours at the finest: the "
                 f"discretisation error falls from {100 * error(coarse):.2g}% to {100 * error(fine):.2g}%, of order "
                 f"{order:.2f}.\n\n")
    for factor in table.values("factor"):
        if factor == usual:
            continue
        row = refinement(table, factor, "double")[-1]
        text += (f"{row['neighbours']} neighbours, {row['across']} across: a discretisation error of {100 * error(row):.2g}% in "
                 f"{seconds(row) / seconds(fine):.2g} of the time with {fine['neighbours']} neighbours.\n\n")
    for precision in rounded_precisions(table):
        rows = table.where(precision=precision)
        rounding = [row.number("rounding_error") for row in rows]
        least = min(error(row) / r if r else math.inf for row, r in zip(rows, rounding))
        same = refinement(table, usual, precision)[-1]
        text += (f"{precision}: the rounding error is at most {max(rounding):.1e}, the discretisation error at least {least:.0e} "
                 f"times as large; the beam {same['across']} across, with {same['neighbours']} neighbours, takes "
                 f"{seconds(same) / seconds(fine):.2g} of double's time.\n\n")
    return text


def chart(table):
    """A chart of errors over time: discretisation for each precision and support factor, and rounding."""
    drawn = LineChart("A cantilever: error against time to solution", "time to solution [s]", "error")

    def add(column, factor, precision, colour):
        rows = refinement(table, factor, precision)
        rounding = column == "rounding_error"
        label = f"{'rounding, ' if rounding else ''}{precision}, {rows[-1].number('neighbours'):.0f} neighbours"
        curve = drawn.curve(label, colour=colour, style=1 if rounding else 0)
        curve.x = [row.number("seconds") for row in rows]
        curve.y = [row.number(column) for row in rows]

    usual = usual_factor(table)
    add("discretisation_error", usual, "double", 0)
    rounded = rounded_precisions(table)
    for colour, precision in enumerate(rounded, 1):
        add("discretisation_error", usual, precision, colour)
        add("rounding_error", usual, precision, colour)
    others = [factor for factor in table.values("factor") if factor != usual]
    for colour, factor in enumerate(others, len(rounded) + 1):
        add("discretisation_error", factor, rounded[0] if rounded else "double", colour)
    return drawn


def side_by_side(table):
    """A Markdown table with a row for each cloud and support factor and with the precisions side by side."""
    precisions, rounded = table.values("precision"), rounded_precisions(table)
    head = ["across", "phyxels", "neighbours", "steps", "of Timoshenko's", "discretisation"]
    head += [f"rounding, {p}" for p in rounded] + [f"s, {p}" for p in precisions]
    head += [f"10⁹ phyxel-steps/s, {p}" for p in precisions]
    cells = []
    for row in table.where(precision="double"):
        line = [row[c] for c in ("across", "phyxels", "neighbours", "steps", "over_timoshenko", "discretisation_error")]
        beside = {p: table.find(across=row["across"], factor=row["factor"], precision=p) for p in precisions}
        line += [beside[p]["rounding_error"] or "–" if beside[p] else "–" for p in rounded]
        line += [beside[p]["seconds"] or "–" if beside[p] else "–" for p in precisions]
        line += [f"{beside[p].number('phyxel_steps_per_s') * 1e-9:.3g}" if beside[p] else "–" for p in precisions]
        cells.append(line)
    return markdown_table(head, cells)
