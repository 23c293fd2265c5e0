"""The section of docs/accuracy.md that compares bodies at rest with CalculiX."""
import math
import re

from pages.charts import LineChart
from pages.tables import markdown_table, plain, read_if_there

LEVELS = (1e-2, 3e-3, 1e-3)
PROGRAMS = ("CalculiX", "phyxel")

MEASURED = """Bodies at rest, by phyxel and by CalculiX, a general finite-element program, on one core. Materials, supports, loads, \
references and measured quantities are those of *gravity*, *shear*, *elastica* and *cook* below; *plate* is the plate with \
a hole of [bench/references](../bench/references/README.md). Both programs compute in double on one thread. Times are CPU \
seconds, user and system, and memory is the peak resident set size. The kernel accounts both for the whole process. Each \
is the least of {repeats} runs, since other programs ran on the same machine. `bench/compare/calculix.py` runs both: \
{program} and {peer} on {hardware}; {date}."""

ALIKE = """- CalculiX: quadratic bricks with reduced integration (C3D20R) or quadratic tetrahedra (C3D10). The solver is the direct \
SPOOLES, or on uniform meshes of linear problems the iterative one with an incomplete Cholesky preconditioner. *Uniform*: \
equal cells, which are cubes in the bars. *Graded*: cells shrink towards edges where stresses are singular. *Long*: few \
cells along the bar and the fewest across; *elastica* needs two bricks across, since CalculiX does not converge with one. \
Meshes are made beforehand, which is not counted; reading them is. Debian's CalculiX is built without PaStiX and PARDISO, \
its other direct solvers.
- phyxel: hourglass control of 0.1 and a support factor of 1.8, the defaults of scenes. *Nodes*: phyxels on a lattice; \
*mesh*: phyxels on and in the surface, gradients closed to 0.01. Making the phyxels is counted.
- Law: *elastica* has large displacements in both programs, and the same law: CalculiX's `*ELASTIC` with `NLGEOM` relates \
the second Piola-Kirchhoff stress linearly to Green's strain, as phyxel's `st-venant-kirchhoff` does; a test stretches a \
cube by a half to check it. CalculiX solves the other cases as linear problems. phyxel has Newton's method for all, with \
`st-venant-kirchhoff` in *gravity*, *shear* and *cook*, whose strains are too small for a difference, and with \
`small-strain` in *plate*.
- *cook* is solved for two values of ν: its times are the sums of both solutions. CalculiX has one layer of elements in \
plane strain, phyxel three layers of phyxels."""

LEAST = """The table has the least CPU time and, separately, the least memory with which each program reaches an error. An error \
counts as reached where all finer discretisations are as good, too, and there is at least one; between two refinements, \
time and memory are powers of the error. ≤: the coarsest one is as good already. *Ratio*: phyxel over CalculiX; bold where \
phyxel needs less. *Uniform*: CalculiX on uniform meshes only."""

ORDERS = """The table has the error of the finest discretisation of each kind, and the order of convergence between the two finest. A \
dash stands where the error grows or changes its sign, and for graded meshes, whose elements have no single size. CalculiX \
solves *elastica* in one increment; its default tolerance of the residual, 0.5%, limits the error of the finest meshes \
there."""

ELEMENTS = {"C3D20R": "bricks", "C3D10": "tetrahedra"}


def setting_of(row):
    """The setting of a row without its refinement."""
    name = ELEMENTS.get(row["discretisation"], row["discretisation"])
    return f"{row['mesh']} {name}".strip() + (", iterative" if row["solver"] == "iterative" else "")


def families(table, case, quantity):
    """The rows of each program and setting, from coarse to fine."""
    found = {}
    for row in table.where(case=case, quantity=quantity):
        found.setdefault((row["program"], setting_of(row)), []).append(row)
    for rows in found.values():
        rows.sort(key=lambda row: row.number("refinement"))
    return found


def error_of(row):
    return abs(row.number("error"))


def reach(rows, level, column):
    """The cost in a column with which rows, from coarse to fine, reach an error, and whether the coarsest one does so already;
    None if they do not. The rule of `phyxel bench error`."""
    errors, largest = [], 0
    for row in reversed(rows):
        largest = max(largest, error_of(row)) if math.isfinite(error_of(row)) else math.inf
        errors.insert(0, largest)
    at = next((k for k, error in enumerate(errors) if error <= level), len(rows))
    if at + 1 >= len(rows):
        return None
    fine = rows[at].positive(column)
    if at == 0:
        return fine, True
    if not math.isfinite(errors[at - 1]) or errors[at] == 0:
        return fine, False
    coarse = rows[at - 1].positive(column)
    share = math.log(errors[at - 1] / level) / math.log(errors[at - 1] / errors[at])
    return coarse * (fine / coarse) ** share, False


def least(found, program, level, column, only=""):
    """The least cost of a program's settings that reach an error: cost, whether it is a bound, and setting; or None.
    @param only the beginning of the settings that count"""
    reached = [(*cost, setting) for (who, setting), rows in found.items() if who == program and setting.startswith(only)
               for cost in [reach(rows, level, column)] if cost]
    return min(reached, default=None)


def two_digits(value):
    """A positive number with two significant digits, or to a whole number."""
    return f"{value:.2g}" if value < 99.5 else f"{value:.0f}"


def shown(cost):
    return f"{'≤ ' if cost[1] else ''}{two_digits(cost[0])}" if cost else "–"


def ratio(own, peer):
    """The cost of phyxel over that of CalculiX, as text; bold if phyxel needs less."""
    if not own or not peer:
        return "–"
    value = own[0] / peer[0]
    return f"**{two_digits(value)}**" if value < 1 else two_digits(value)


def in_words(ratios):
    """Who needs less, how often and by how much. @param ratios pairs of the cost of phyxel over that of CalculiX and the row's
    name"""
    said = []
    slower, faster = [(r, name) for r, name in ratios if r >= 1], [(1 / r, name) for r, name in ratios if r < 1]
    for who, factors in (("CalculiX", slower), ("phyxel", faster)):
        if factors:
            (few, _), (most, where) = min(factors), max(factors)
            few, most = two_digits(few), two_digits(most)
            by = f"by a factor of {most}" if few == most else f"by factors of {few} to {most} (the largest in *{where}*)"
            said.append(f"{who} in {len(factors)} of {len(ratios)} rows, {by}")
    return ", ".join(said)


class Least:
    """The least costs of both programs: the cells of the table, and pairs of a ratio, phyxel over CalculiX, and its row's name."""

    def __init__(self, table):
        self.cells, self.times, self.uniform_times, self.memory = [], [], [], []
        self.missed = dict.fromkeys((*PROGRAMS, "uniform"), 0)
        for case, quantity in quantities_of(table):
            found = families(table, case, quantity)
            for level in LEVELS:
                self._add(found, f"{case}: {quantity}", level)

    def _add(self, found, name, level):
        peer, own = (least(found, program, level, "cpu_seconds") for program in PROGRAMS)
        uniform = least(found, "CalculiX", level, "cpu_seconds", "uniform")
        peer_memory, own_memory = (least(found, program, level, "memory_mib") for program in PROGRAMS)
        for kept, a, b in ((self.times, own, peer), (self.uniform_times, own, uniform), (self.memory, own_memory, peer_memory)):
            if a and b:
                kept.append((a[0] / b[0], name))
        for who, cost in (("CalculiX", peer), ("uniform", uniform), ("phyxel", own)):
            self.missed[who] += cost is None
        self.cells.append([name, f"{100 * level:g}%", f"{shown(peer)} ({peer[2]})" if peer else "–", shown(uniform),
                           f"{shown(own)} ({own[2]})" if own else "–", ratio(own, peer), shown(peer_memory), shown(own_memory),
                           ratio(own_memory, peer_memory)])


def quantities_of(table):
    """The cases and quantities of the table, in its order."""
    return list(dict.fromkeys((row["case"], row["quantity"]) for row in table.rows))


def in_brief(results):
    """Who needs less time and memory, for README.md; "" without a table."""
    table = read_if_there(results / "calculix.csv")
    costs = Least(table) if table else None
    if not costs or not costs.times or not costs.memory:
        return ""
    return (f"Bodies at rest on one core, to errors of {100 * max(LEVELS):g}% to {100 * min(LEVELS):g}%, beside CalculiX. Less time: "
            f"{in_words(costs.times)}. Less memory: {in_words(costs.memory)}.\n")


def table_of_least(page, table):
    """Adds the table of the least costs, and its summary."""
    costs = Least(table)
    page.paragraph(LEAST)
    for name, ratios in (("Less time", costs.times), ("Less time, with CalculiX on uniform meshes only", costs.uniform_times),
                         ("Less memory", costs.memory)):
        if ratios:
            page.add(f"- {name}: {in_words(ratios)}.\n")
    missed = costs.missed
    page.paragraph(f"- Not reached at the sizes measured: {missed['CalculiX']} of {len(costs.cells)} rows by CalculiX, "
                   f"{missed['uniform']} by CalculiX on uniform meshes, {missed['phyxel']} by phyxel.")
    page.add(markdown_table(["", "error", "CalculiX, CPU s", "uniform", "phyxel, CPU s", "ratio", "CalculiX, MiB", "phyxel, MiB",
                             "ratio"], costs.cells))


def order_of(case, rows):
    """The order of convergence of the two finest rows, as text."""
    if len(rows) < 2 or rows[-1]["mesh"] == "graded":
        return "–"
    coarse, fine = rows[-2:]
    errors = coarse.number("error"), fine.number("error")
    finer = fine.positive("refinement") / coarse.positive("refinement")
    if finer <= 1 or errors[0] * errors[1] <= 0 or abs(errors[1]) >= abs(errors[0]):
        return "–"
    if fine["program"] == "phyxel" and case == "plate":  # refined by the number of phyxels
        finer **= 1 / 3
    return f"{math.log(errors[0] / errors[1]) / math.log(finer):.1f}"


def orders(page, table, quantities):
    """Adds the finest errors and the orders of convergence."""
    cells = []
    for case, quantity in quantities:
        for (program, setting), rows in families(table, case, quantity).items():
            if "iterative" not in setting:
                finest = rows[-1]
                error = f"{100 * finest.number('error'):+.2g}%"
                cells.append([f"{case}: {quantity}", f"{program}, {setting}", finest["unknowns"], finest["cpu_seconds"],
                              finest["memory_mib"], error, order_of(case, rows)])
    page.paragraph(ORDERS)
    page.add(markdown_table(["", "", "unknowns", "CPU s", "MiB", "error", "order"], cells))


def charts(page, table, quantities):
    """Adds a chart of error over CPU seconds for the first quantity of each case."""
    for case in dict.fromkeys(case for case, _ in quantities):
        quantity = next(q for c, q in quantities if c == case)
        chart = LineChart(f"{case}: {quantity}, beside CalculiX", "CPU time of the process [s]", "error")
        for (program, setting), rows in families(table, case, quantity).items():
            if "iterative" in setting:
                continue
            curve = chart.curve(f"{program}, {setting}")
            for row in rows:
                if 0 < error_of(row) < math.inf:
                    curve.x.append(row.positive("cpu_seconds"))
                    curve.y.append(error_of(row))
        page.show(chart, f"accuracy_calculix_{re.sub('[^a-zA-Z0-9]', '-', plain(case))}")


def section(page, results):
    table = read_if_there(results / "calculix.csv")
    if not table:
        return
    quantities = quantities_of(table)
    page.paragraph("## Beside CalculiX")
    page.paragraph(MEASURED.format(**{name: table.fact(name) for name in ("repeats", "program", "peer", "hardware", "date")}))
    page.paragraph(ALIKE)
    table_of_least(page, table)
    charts(page, table, quantities)
    orders(page, table, quantities)
