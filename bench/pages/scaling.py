"""docs/scaling.md: speed-up on many ranks, from the tables of `phyxel bench scaling`, <cpu|gpu>_ranks_<n>*.csv."""
from pages.page import Page
from pages.scaling_model import model
from pages.tables import PageError, Table, markdown_table, read_if_there, read_table

TARGET_OF_TWO = 1.8  # target speed-up of two ranks on two cores, from 200,000 phyxels on

HEAD = """# Scaling

Written by `bench/make_pages.py` from the tables of `phyxel bench scaling` in `docs/results/`: one jittered cube under \
gravity with Green's strain, stepped by the ranks of `mpirun -n N`. Positions are bitwise equal for any number of ranks \
and any partitioner (`tests/mpi/share_test.cpp`, `tests/apps/mpirun_test.cpp`), so the error of a scaled run is that of \
one rank. Ranks have one ring of ghosts, whose displacements and stresses are exchanged; rows with two rings, where the \
stresses of the inner ring were computed twice, are from earlier versions. *One alone*: 10⁶ phyxel-steps/s of the first \
rank by itself, with the whole body or with one rank's part of it, measured alternately with all ranks; *speed-up*: the \
ratio of all ranks to one alone; *efficiency*: the speed-up over the number of ranks; *spread*: (largest - smallest) / \
median of the repeats, for all ranks and for one. *Exchanging* is the largest share of a rank's time for packing, waiting \
and unpacking, including load imbalance. *Shares*: time until each rank has its share of the body; *backend*: time from \
there to the first step; *host*: peak host memory of all ranks together."""

WITH_ONE = ["phyxels", "precision", "cut by", "ghost rings", "transport", "10⁶ phyxel-steps/s", "one alone", "speed-up",
            "efficiency", "spread", "most ghosts", "kB sent per step", "exchanging", "set-up [s]"]
WITHOUT_ONE = ["phyxels", "precision", "cut by", "transport", "10⁶ phyxel-steps/s", "steps/s", "spread", "largest part",
               "most ghosts", "kB sent per step", "exchanging", "shares [s]", "backend [s]", "host [GB]"]


def joined(first, second):
    """Concatenates two tables; the facts name both programs, compilers and dates. An older table may lack the last
    columns."""
    columns = max(first.columns, second.columns, key=len)
    facts = dict(first.facts)
    for name in ("program", "compiler", "date"):
        if name in facts and second.fact(name) not in facts[name]:
            facts[name] += ", " + second.fact(name)
    for table in (first, second):
        if table.columns != columns[:len(table.columns)]:
            raise PageError(f"{table.file}: other columns than {first.file}; allowed: the same, with new ones at the end")
    rows = [(row.place, [row.get(column) for column in columns]) for table in (first, second) for row in table.rows]
    return Table(second.file, facts, columns, rows)


def tables_in(results, kind):
    """Reads the tables `<kind>_ranks_<n>*.csv` and joins tables of equal numbers of ranks. Returns them by that number."""
    tables = {}
    for file in sorted(results.glob(f"{kind}_ranks_*.csv")):
        table = read_table(file)
        ranks = table.rows[0].number("ranks")
        if not 1 <= ranks <= 1e6:
            raise PageError(f"{file}: {ranks:g} ranks; allowed: 1 to 1000000")
        ranks = int(ranks)
        tables[ranks] = joined(tables[ranks], table) if ranks in tables else table
    return dict(sorted(tables.items()))


def exchanging(row):
    """The share of time spent on exchanges; a dash for NCCL, which does not report its waiting time."""
    return "–" if row["transport"].startswith("NCCL") else f"{100 * row.number('exchanging'):.1f}%"


def cells_with_one(row, speed_up, ranks):
    requested, cut_by = row["partitioner"], row["cut_by"]
    return [row["phyxels"], row["precision"], cut_by if requested == cut_by else f"{cut_by} ({requested})", row["rings"],
            row["transport"], f"{row.number('phyxel_steps_per_s') * 1e-6:.2f}",
            f"{row.number('phyxel_steps_per_s_alone') * 1e-6:.2f}", f"{speed_up:.2f}", f"{100 * speed_up / ranks:.0f}%",
            f"{100 * row.number('spread'):.0f}%, {100 * row.number('spread_alone'):.0f}%", row["most_ghosts"],
            f"{row.number('bytes_per_step') * 1e-3:.1f}", exchanging(row), row["set_up_s"]]


def cells_without_one(row):
    return [row["phyxels"], row["precision"], row["cut_by"], row["transport"],
            f"{row.number('phyxel_steps_per_s') * 1e-6:.2f}", row["steps_per_s"], f"{100 * row.number('spread'):.0f}%",
            row["most"], row["most_ghosts"], f"{row.number('bytes_per_step') * 1e-3:.1f}", exchanging(row), row["set_up_s"],
            row.get("backend_s"), row.get("host_gb")]


def section(page, table, ranks, gpus):
    page.paragraph(f"### {ranks} {'ranks, one GPU each' if gpus else 'CPU ranks'}")
    devices = f", {table.fact('gpus')} × {table.fact('gpu')}" if gpus else ""
    page.paragraph(f"Measured by {table.fact('program')} on {table.fact('hardware')}{devices}; {table.fact('compiler')}; "
                   f"{table.fact('date')}.")
    strong, weak, large, best = [], [], [], 0
    for row in table.rows:
        if not row["phyxels_alone"]:
            large.append(cells_without_one(row))
            continue
        gain = row.number("phyxel_steps_per_s") / row.positive("phyxel_steps_per_s_alone")
        same = row.number("phyxels_alone") == row.number("phyxels")
        (strong if same else weak).append(cells_with_one(row, gain, ranks))
        if same and row.number("phyxels") > 150_000 and row["rings"] == "1":
            best = max(best, gain)
    if not gpus and ranks == 2 and best > 0:
        page.paragraph(f"Two ranks on two cores from 200,000 phyxels on, one ring of ghosts: {best:.2f} by the best partitioner; "
                       f"target: {TARGET_OF_TWO:g}.")
    for title, head, rows in (("The same body on more ranks:", WITH_ONE, strong),
                              ("A body that grows with the ranks:", WITH_ONE, weak),
                              ("Without a measurement of one rank:", WITHOUT_ONE, large)):
        if rows:
            page.paragraph(title)
            page.add(markdown_table(head, rows))


def make(results, link):
    """The page; None if there is no table of two ranks or more."""
    gpus, cpus = tables_in(results, "gpu"), tables_in(results, "cpu")
    shown = {kind: {n: t for n, t in tables.items() if n > 1} for kind, tables in (("gpu", gpus), ("cpu", cpus))}
    if not any(shown.values()):
        return None
    page = Page(link)
    page.paragraph(HEAD)
    page.paragraph("## GPUs")
    if shown["gpu"]:
        page.paragraph("Targets for the efficiency of 8 GPUs in float: 80% with 17 million phyxels, 50% with 2 million, 95% with 16 million "
                       "per GPU.")
    else:
        page.paragraph("Not measured yet.")
    for ranks, table in shown["gpu"].items():
        section(page, table, ranks, gpus=True)
    sizes = read_if_there(results / "gpu_sizes.csv")
    if sizes:
        page.add(model(list(gpus.values()), sizes))
    if shown["cpu"]:
        page.paragraph("## CPUs")
        page.paragraph("One thread per rank.")
    for ranks, table in shown["cpu"].items():
        section(page, table, ranks, gpus=False)
    return page
