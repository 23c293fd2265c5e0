"""docs/results/README.md, the speed on CPUs, and the table of speeds in README.md."""
from pages import sampling
from pages.page import Page
from pages.tables import PageError, markdown_table, read_if_there


HEAD = """# Measurements

Written by `bench/make_pages.py` from the CSV files in this folder, which the `bench` commands write. [The measurements of \
the 2008 paper](paper/paper.md) have a page of their own, written by `phyxel paper`; so has [the GPU solver's \
performance](../performance.md)."""

STEP = """A jittered cube; medians; `spread` is (fastest − slowest)/median over the repeats. The force error is the \
largest difference from double over the largest force. Bytes are the minimum traffic of a step; *of copy \
bandwidth* compares them with a plain copy on the same threads (above 100%: the body fits in cache)."""

MORE_THREADS = """### More threads

*Ratio*: speed relative to one thread. The last column is the round-trip time of a cache line between two cores in \
nanoseconds, measured right after: a virtual machine may move its cores, and small bodies scale less if the cores do not \
share a cache."""


def measured(table):
    return ", ".join(table.fact(key) for key in ("hardware", "compiler", "program", "date") if table.fact(key))


def million(speed):
    return f"{speed / 1e6:.2f}"


def step_section(page, table, title):
    page.paragraph(f"## {title}")
    page.paragraph(f"`phyxel bench step --device cpu`, {measured(table)}. {STEP}")
    head = ["terms", "precision", "threads", "phyxels", "neighbours", "M phyxel-steps/s", "spread", "G pairs/s",
            "bytes/phyxel-step", "of copy bandwidth", "force error"]
    page.add(markdown_table(head, [
        [row["terms"], row["precision"], row["threads"], row["phyxels"], row["neighbours"],
         million(row.number("phyxel_steps_per_s")), f"{row.number('spread'):.0%}", f"{row.number('pairs_per_s') / 1e9:.2f}",
         row["bytes_per_phyxel_step"], f"{row.number('bytes_per_s') / row.positive('copy_bytes_per_s'):.0%}",
         row["force_error"]] for row in table.rows]))
    by_threads = {}
    for row in table.rows:
        by_threads.setdefault((row["terms"], row["precision"], row["phyxels"]), {})[row["threads"]] = row
    ratios = [[*key, threads, f"{row.number('phyxel_steps_per_s') / rows['1'].positive('phyxel_steps_per_s'):.2f}",
               row["core_round_trip_ns"]]
              for key, rows in by_threads.items() if "1" in rows
              for threads, row in rows.items() if threads != "1"]
    if ratios:
        page.paragraph(MORE_THREADS)
        page.add(markdown_table(["terms", "precision", "phyxels", "threads", "ratio", "core round trip"], ratios))


def neighbours_section(page, table):
    page.paragraph("## Neighbour search")
    page.paragraph(f"`phyxel_studies neighbour-search`, {measured(table)}. Times in microseconds per phyxel: mean distance to "
                   "the ten nearest, search within the support, transposition into the inverse neighbour lists.")
    parts = ["spacing_us_per_phyxel", "search_us_per_phyxel", "transpose_us_per_phyxel"]
    page.add(markdown_table(
        ["threads", "phyxels", "neighbours", "spacing", "search", "transpose", "together"],
        [[row["threads"], row["phyxels"], row["neighbours"], *(row[part] for part in parts),
          f"{sum(row.number(part) for part in parts):.2f}"] for row in table.rows]))


def sample_section(page, results):
    """Adds how fast a mesh is filled with phyxels."""
    tables = [table for table in (read_if_there(results / f"cpu_sample{more}.csv") for more in ("", "_16")) if table]
    if tables:
        page.paragraph("## Filling a mesh with phyxels")
        sampling.add_tables(page, tables, measured)


def peer_rows(peer, own):
    """Yields rows of LAMMPS and the speeds of phyxel in double and float, of a similar size on as many cores."""
    for row in peer.rows:
        speeds = {}
        for precision in ("double", "float"):
            near = [r for r in own.where(terms="green", precision=precision, threads=row["ranks"])
                    if 0.5 < r.number("phyxels") / row.positive("particles") < 2]
            if near:
                speeds[precision] = near[0].number("phyxel_steps_per_s")
        if len(speeds) == 2:
            yield row, speeds


def peer_table(rows):
    body = []
    for row, speeds in rows:
        peer = row.positive("particle_steps_per_s")
        line = [f"{row.number('particles'):,.0f}", row["ranks"], million(peer)]
        for precision in ("double", "float"):
            line += [million(speeds[precision]), f"{speeds[precision] / peer:.1f}×"]
        body.append(line)
    return markdown_table(["particles", "cores", "LAMMPS `smd/tlsph`, double", "phyxel, double", "ratio", "phyxel, float",
                           "ratio"], body)


def peers(results):
    """The tables of LAMMPS and of phyxel and the rows of `peer_rows`; None if a table is missing."""
    peer, own = read_if_there(results / "lammps_tlsph.csv"), read_if_there(results / "cpu_step.csv")
    if not peer or not own:
        return None
    return peer, own, list(peer_rows(peer, own))


def make(results, link):
    """The page, with a section for each table that exists."""
    page = Page(link)
    page.paragraph(HEAD)
    for name, title in (("cpu_step", "One time step on the CPU"), ("cpu_step_16", "Sixteen cores with AVX-512")):
        table = read_if_there(results / f"{name}.csv")
        if table:
            step_section(page, table, title)
    table = read_if_there(results / "cpu_neighbours.csv")
    if table:
        neighbours_section(page, table)
    sample_section(page, results)
    beside = peers(results)
    if beside and beside[2]:
        peer, _, rows = beside
        page.paragraph("## Beside LAMMPS `smd/tlsph`")
        page.paragraph(
            f"Millions of particle steps per second. {peer.fact('what')} {measured(peer)}. Input: "
            "`bench/compare/lammps_tlsph.in`, run by `bench/compare/lammps_tlsph.py`. The phyxel rows are those above (terms "
            "green) of the nearest size, on as many threads as LAMMPS has ranks. Both are total-Lagrangian with 32 "
            "neighbours inside a cubic lattice; LAMMPS also computes an artificial viscosity and hourglass control, which "
            "phyxel does not.")
        page.add(peer_table(rows))
    return page


def speeds_in_brief(results):
    """The table of speeds in README.md; "" without tables to make it of."""
    beside = peers(results)
    rows = [row for row in beside[2] if row[0].number("particles") > 50_000] if beside else []
    if not rows:
        return ""
    return ("Millions of phyxel steps per second on a CPU (Green strain, gravity, about 32 neighbours), beside the "
            f"nearest peer on the same cores: {measured(beside[1])}.\n\n" + peer_table(rows).rstrip("\n") + "\n")
