"""docs/performance.md: the speed of the GPU solver, from the tables of scripts/measure_gpu.sh and scripts/profile_gpu.sh.
All measured numbers come from these tables; the targets are constants here."""
import math

from pages import cantilever, error, large_meshes
from pages.charts import LineChart
from pages.page import Page, measured_by
from pages.tables import markdown_table, read_if_there

# Targets for one H200, in float unless the name says otherwise.
TARGET_LARGE, TARGET_DOUBLE = 8e9, 3e9  # phyxel-steps/s of 2 to 17 million phyxels
TARGET_SETUP = 1                        # s for 16 million phyxels
TARGET_OBSTACLE, TARGET_CONTACT = 0.02, 0.1  # more time of a step of a million phyxels
TARGET_WITH_SURFELS = 1e5               # steps/s of the dino
TARGET_STEPS = {"dino": 2, "alien_head": 1.5}  # µs per step

DINO_SPACING = 0.0565                   # m: 0.45 of its support, 0.1256 m

HEAD = """# Performance of the GPU solver

Written by `bench/make_pages.py` from the CSV files in `docs/results/`, which `scripts/measure_gpu.sh` and \
`scripts/profile_gpu.sh` make. A step is a step of Verlet's method with both passes over the neighbour lists; unless said \
otherwise, the body is a jittered cube under gravity with Green's strain. *Error* is the largest difference of a force \
from the force in double on the same GPU (which the tests compare with the CPU), over the largest force, at strains of \
about 10%; *spread* is (fastest − slowest)/median of the repeats: the GPU lowers its clock under load, so the first \
repeat is the fastest."""

PATH = """*Path*: `tiles` take two launches per step, replayed by a CUDA graph where the launch overhead matters; resident \
bodies stay in shared memory for many steps per launch, in a thread block cluster per body or in blocks that exchange \
packets. *Bytes moved* are the minimum traffic of a step; their share of a plain copy's bandwidth shows that memory \
bandwidth is not the limit."""

ALONE = """The time per step of a single body is the latency of its slowest block: two passes over its longest list, \
whose operations depend on each other, and two exchanges. Many bodies side by side are limited by the throughput of \
loads from shared memory."""

SURFELS = """A resident body stores the data of its surfels after each of up to sixteen steps of a launch; a second launch \
then moves all surfels for all of these steps. If a caller reads surfels after a step, the launch ends with that step."""

CONTACT = """An obstacle is one launch more, which has little to do but waits much: for its start, for the places of the \
surface's phyxels in device memory, and for what these places hold. Neither smaller blocks, nor sums that are left out \
or added by each thread, nor a start before the previous launch has ended take more than a tenth of its time away."""

TRIED = """## What was tried

Gains over one thread per phyxel on compressed rows, largest first: tiles in shared memory with 16-bit slots; lists \
ordered so that eight lanes have no bank conflicts (broadcasts are free); the contribution of the phyxel's own stress from \
a constant of the cloud; a tile's own phyxels in its first slots; lists loaded 16 bytes at a time; constants prefetched \
into the L2 cache. Losses: two phyxels per lane (half the loads, too few warps); tiles of 512 and 1024 (too few resident \
blocks); lists padded with the lane's own phyxel instead of null points (bank conflicts); records in half precision. \
Programmatic dependent launch gained 2 to 5% at half a million phyxels, nothing above, and lost a third at 27 thousand; \
graphs gain 4 to 17% below a million and never lose. For surfels, gradients computed by each block of surfels took twice \
as long as the tiles' own pass, and carrier lists shared by a warp gained 4% with dense surfels and lost 20% otherwise; \
for the surfels of resident bodies, one launch per step was a third slower than sixteen steps together, and blocks that \
loop over the sixteen steps were up to twice as slow as one block per step. In clusters, prefetching the next neighbours' \
stresses lost (the longer loop waits for instructions)."""

#: Nsight Compute's name of a metric, the page's title and the factor between their units.
METRICS = [
    ("gpu__time_duration.sum", "time [µs]", 1e-3),
    ("smsp__cycles_elapsed.avg.per_second", "clock [GHz]", 1e-9),
    ("smsp__inst_executed.sum", "10⁶ warp instructions", 1e-6),
    ("smsp__issue_active.avg.pct_of_peak_sustained_active", "issue slots used [%]", 1),
    ("l1tex__data_pipe_lsu_wavefronts.avg.pct_of_peak_sustained_elapsed", "load/store pipe: shared memory, L1 [%]", 1),
    ("sm__pipe_fma_cycles_active.avg.pct_of_peak_sustained_active", "FP32 pipe [%]", 1),
    ("sm__pipe_fp64_cycles_active.avg.pct_of_peak_sustained_active", "FP64 pipe [%]", 1),
    ("lts__t_bytes.sum", "L2 cache [MB]", 1e-6),
    ("lts__t_sectors.avg.pct_of_peak_sustained_elapsed", "L2 cache [%]", 1),
    ("dram__bytes.sum", "DRAM [MB]", 1e-6),
    ("dram__throughput.avg.pct_of_peak_sustained_elapsed", "DRAM [%]", 1),
    ("sm__warps_active.avg.pct_of_peak_sustained_active", "active warps [%]", 1),
]


def against(reached, target):
    """The deviation of a speed or a time from its target, in words."""
    share = reached / target - 1
    return "on target" if abs(share) < 0.005 else f"{100 * abs(share):.0f}% {'above' if share > 0 else 'below'} target"


def rate(row):
    """The speed in billions of phyxel-steps per second, as text."""
    return f"{row.number('phyxel_steps_per_s') * 1e-9:.3g}"


def speeds(rows, title, x, x_label, logarithmic):
    """A chart of the speed over column `x`, with a curve for each precision."""
    chart = LineChart(title, x_label, "10⁹ phyxel-steps/s", logarithmic, logarithmic)
    for row in rows:
        curve = chart.curve(row["precision"])
        curve.x.append(row.number(x))
        curve.y.append(row.number("phyxel_steps_per_s") * 1e-9)
    return chart


def sizes(page, table, results):
    page.paragraph("## Speed by size")
    page.paragraph(f"Measured by {measured_by(table, 'gpu')}.")
    more = read_if_there(results / "gpu_capacity.csv")
    rows = table.rows + (more.rows if more else [])
    speed = {"float": [], "double": []}
    cells = []
    for row in rows:
        phyxels = row.number("phyxels")
        if 2e6 < phyxels < 2e7 and row["precision"] in speed:
            speed[row["precision"]].append(row.number("phyxel_steps_per_s"))
        moves = "resident" not in row["path"]  # a resident body moves none of its bytes
        copied = f"{100 * row.number('bytes_per_s') / row.positive('copy_bytes_per_s'):.0f}%" if moves else "–"
        cells.append([row["phyxels"], row["precision"], row["path"], f"{1e6 / row.positive('steps_per_s'):.4g}", rate(row),
                      f"{100 * row.number('spread'):.0f}%", row["memory_bytes_per_phyxel"],
                      row["bytes_per_phyxel_step"] if moves else "–", copied, row["force_error"] or "–"])
    if speed["float"]:
        slowest, fastest = min(speed["float"]), max(speed["float"])
        in_double = min(speed["double"], default=math.inf)
        page.paragraph(
            f"From 2 to 17 million phyxels, float: {slowest * 1e-9:.3g} to {fastest * 1e-9:.3g} billion phyxel-steps/s "
            f"({against(slowest, TARGET_LARGE)}; {against(fastest, TARGET_LARGE)}); double: at least {in_double * 1e-9:.3g} "
            f"({against(in_double, TARGET_DOUBLE)}). The largest body measured has "
            f"{max(row.number('phyxels') for row in rows) * 1e-6:.0f} million phyxels.")
    page.show(speeds(rows, "Steps of a cube on one GPU", "phyxels", "phyxels", True), "gpu_sizes")
    page.paragraph(PATH)
    page.add(markdown_table(["phyxels", "precision", "path", "µs per step", "10⁹ phyxel-steps/s", "spread",
                             "bytes stored per phyxel", "bytes moved per phyxel-step", "of copy bandwidth", "error"], cells))


def small(page, table, _):
    page.paragraph("## The paper's bodies, alone and side by side")
    page.paragraph(f"Measured by {measured_by(table, 'gpu')}.")
    for body, target in TARGET_STEPS.items():
        row = table.find(shape=body, bodies="1")
        if row:
            page.paragraph(f"{body}, {row['phyxels']} phyxels: {1e6 / row.positive('steps_per_s'):.3g} µs per step; target: "
                           f"{target:.3g} µs.")
    cells = []
    for row in table.rows:
        alone = 1 / table.find(shape=row["shape"]).positive("steps_per_s")
        step = 1 / row.positive("steps_per_s")
        cells.append([row["shape"], row["bodies"], row["phyxels"], row["path"], f"{1e6 * step:.3g}", f"{step / alone:.3g}",
                      rate(row), row["force_error"]])
    page.add(markdown_table(["body", "bodies", "phyxels", "path", "µs per step of all", "× one body", "10⁹ phyxel-steps/s",
                             "error"], cells))
    page.paragraph(ALONE)


def surfels(page, table, _):
    page.paragraph("## Surfels moved after every step")
    page.paragraph(f"Measured by {measured_by(table, 'gpu')}.")
    cells = []
    for row in table.where(terms="surfels"):
        steps = row.positive("steps_per_s")
        without = table.find(shape=row["shape"], phyxels=row["phyxels"], terms="green")
        cells.append([row["shape"], row["phyxels"], row["surfels"], f"{steps:.4g}", f"{1e6 / steps:.3g}",
                      f"{1e6 / without.positive('steps_per_s'):.3g}" if without else "–"])
        if row["shape"] == "dino":
            page.paragraph(f"Dino, {row['surfels']} surfels: {steps:.3g} steps/s ({against(steps, TARGET_WITH_SURFELS)}).")
    page.add(markdown_table(["body", "phyxels", "surfels", "steps/s", "µs per step", "µs per step without"], cells))
    page.paragraph(SURFELS)


def neighbours(page, table, _):
    page.paragraph("## Speed by number of neighbours")
    page.paragraph(f"Measured by {measured_by(table, 'gpu')}.")
    page.show(speeds(table.rows, "Two million phyxels", "neighbours", "neighbours per phyxel", False), "gpu_neighbours")
    page.add(markdown_table(
        ["neighbours", "precision", "10⁹ phyxel-steps/s", "10⁹ pairs/s, both passes", "bytes stored per phyxel", "error"],
        [[row["neighbours"], row["precision"], rate(row), f"{row.number('pairs_per_s') * 1e-9:.3g}",
          row["memory_bytes_per_phyxel"], row["force_error"]] for row in table.rows]))


def bending(page, table, _):
    page.paragraph("## Speed against error: a cantilever")
    page.paragraph(f"Measured by {measured_by(table, 'gpu')}.")
    page.add(cantilever.words(table))
    page.show(cantilever.chart(table), "gpu_cantilever")
    page.add(cantilever.side_by_side(table))


def terms(page, table, _):
    page.paragraph("## Cost of each term")
    page.paragraph(f"Measured by {measured_by(table, 'gpu')}.")
    page.paragraph("Two million phyxels. *Added* is the difference from Green's strain alone in the same precision; "
                   "differences of time within the spread are noise. A term that is off takes no memory and no instructions.")
    cells = []
    for row in table.rows:
        base = table.find(terms="green", precision=row["precision"])

        def numbers(of):
            return 1e12 / of.positive("phyxel_steps_per_s"), of.number("memory_bytes_per_phyxel")

        picoseconds, held = numbers(row)
        added = ("–", "–")
        if base:
            base_picoseconds, base_held = numbers(base)
            added = (f"{picoseconds - base_picoseconds:+.0f}", f"{held - base_held:+.0f}")
        cells.append([row["terms"], row["precision"], f"{picoseconds:.0f}", added[0], f"{100 * row.number('spread'):.0f}%",
                      f"{held:.0f}", added[1], row["force_error"]])
    page.add(markdown_table(["term", "precision", "ps per phyxel-step", "added [ps]", "spread", "bytes stored per phyxel", "added",
                             "error"], cells))


def contact(page, table, _):
    page.paragraph("## Cost of contact")
    page.paragraph(f"Measured by {measured_by(table, 'gpu')}.")
    page.paragraph(f"Cubes of which a sixth of the surface touches: one that lies on a plane (target: at most "
                   f"{100 * TARGET_OBSTACLE:.0f}% of a step), and two that lie on each other (target: at most "
                   f"{100 * TARGET_CONTACT:.0f}%). Scenes without contact run none of its kernels.")
    cells = []
    for bodies, term, scene in (("1", "obstacle", "a cube on a plane"), ("2", "contact", "two cubes on each other")):
        with_term = table.find(bodies=bodies, terms=term)
        without = table.find(bodies=bodies, terms="green")
        if not (with_term and without):
            continue
        more = without.positive("steps_per_s") / with_term.positive("steps_per_s") - 1
        cells.append([scene, with_term["phyxels"], f"{1e6 / without.positive('steps_per_s'):.4g}",
                      f"{1e6 / with_term.positive('steps_per_s'):.4g}", f"{100 * more:.1f}%",
                      f"{100 * max(row.number('spread') for row in (with_term, without)):.0f}%"])
    page.add(markdown_table(["scene", "phyxels", "µs per step without", "µs per step with", "more", "spread"], cells))
    page.paragraph(CONTACT)


def setup(page, table, _):
    page.paragraph("## Set-up")
    page.paragraph(f"Measured by {measured_by(table, 'gpu')}.")
    last = table.rows[-1]
    on_device = last.number("survey_s") + last.number("backend_s")
    page.paragraph(
        "*Survey*: spacings, supports, list lengths, ranks of moment matrices. *Model*: arrays on the host. *Backend*: order "
        "along the curve, tiles, lists, moments, arrays on the GPU. *Step limit*: Lanczos iteration. Survey and backend together for "
        f"{last['phyxels']} phyxels: {on_device:.3g} s ({against(on_device, TARGET_SETUP)}).")
    columns = ["phyxels", "survey_s", "model_s", "backend_s", "limit_s", "iterations"]
    page.add(markdown_table(["phyxels", "survey [s]", "model [s]", "backend [s]", "step limit [s]", "iterations"],
                            [[row[column] for column in columns] for row in table.rows]))


def profile(page, table, _):
    page.paragraph("## Limits of the two passes")
    page.paragraph(f"Nsight Compute on {table.fact('gpu')} with {table.fact('program')}, {table.fact('date')}, two million "
                   "phyxels; it locks the clock to its base frequency. Percentages are shares of the hardware's peak.")
    columns = [(kernel, precision) for precision in table.values("precision") for kernel in ("pass 1", "pass 2")]
    cells = []
    for name, title, scale in METRICS:
        line = [title]
        for kernel, precision in columns:
            row = table.find(precision=precision, kernel=kernel, metric=name)
            line.append(f"{row.number('value') * scale:.3g}" if row else "–")
        cells.append(line)
    page.add(markdown_table(["metric", *(f"{kernel}, {precision}" for kernel, precision in columns)], cells))


def bin_of_dinos(page, table, _):
    page.paragraph("## A thousand dinos in a bin")
    row = table.rows[-1]
    steps_per_second = row.number("steps") / row.number("steps_seconds")
    needed = row.number("steps") / row.number("end_s")
    loss = row.number("impact_loss_j")
    reading = row.number("readings_seconds") / row.number("readings")
    page.paragraph(f"Measured by {table.fact('program')} on {table.fact('device')}; {table.fact('date')}; by `scripts/measure_bin.py`.")
    page.paragraph(
        f"{row['dinos']} dinos of the 2008 paper, {row['phyxels']} phyxels, E = 10⁵ Pa, fall onto each other for {row['end_s']} s, "
        f"with friction, {row['steps']} steps that end at {row.number('step_s') * 1e3:.3g} ms. {steps_per_second:.0f} steps/s, with all searches "
        f"for what touches: {steps_per_second / needed:.2f} simulated seconds a second, {steps_per_second / needed * 24:.0f} frames a second of a "
        f"film with 24 (target: real time). A reading of all energies and forces takes {reading:.2g} s beside that, "
        f"set-up {row.number('setup_seconds'):.0f} s. Bodies overlapped by {row.number('deepest_m') / DINO_SPACING:.2g} distances between phyxels "
        f"at most; friction took {row.number('friction_heat_j'):.3g} J, and impacts {'took' if loss > 0 else 'made'} {abs(loss):.3g} J.")


def view(page, table, _):
    page.paragraph("## Live views")
    page.paragraph(f"Measured by {table.fact('program')}; {table.fact('date')}; by `scripts/measure_view.py`: frames that "
                   "`phyxel view` sends to a page that draws at once, while the scene runs as fast as it can, up to real time. "
                   "At most a fifth of the time goes to frames.")
    page.add(markdown_table(["scene", "phyxels", "device", "frames a second", "simulated seconds a second", "kB a frame"],
                            [[row["scene"], row["phyxels"], row["device"], row["frames_per_s"], row["speed"], row["kb_per_frame"]]
                             for row in table.rows]))


SECTIONS = {"gpu_error": lambda page, table, results: error.add(page, table, results, "gpu_error"), "gpu_sizes": sizes, "gpu_small": small, "gpu_surfels": surfels, "gpu_neighbours": neighbours,
            "gpu_cantilever": bending, "gpu_terms": terms, "gpu_contact": contact, "gpu_setup": setup, "gpu_profile": profile,
            "gpu_bin": bin_of_dinos, "gpu_view": view}


def make(results, link):
    """The page, with a section for each table that exists."""
    page = Page(link)
    page.paragraph(HEAD)
    for name, section in SECTIONS.items():
        table = read_if_there(results / f"{name}.csv")
        if table:
            section(page, table, results)
    large_meshes.add(page, results)
    page.add(TRIED)
    return page
