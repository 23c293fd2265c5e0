"""docs/laws.md: which law is the default, from the table of `phyxel_studies laws`."""
from pages.page import Page, measured_by
from pages.problems import problems
from pages.tables import PageError, markdown_table, read_table

HEAD = """# Laws: the default, and why

Written by `bench/make_pages.py` from the table of `phyxel_studies laws` in `docs/results/laws.csv`. The \
scenes are typical first scenes of a new user: soft bodies under gravity, compressed, stretched, twisted and thrown \
bodies, for two seconds each, in float on the CPU, with default settings except for the law. [physics.md](physics.md) \
describes the laws."""

#: A scene is spoilt if it ends early, with more than this share of its phyxels inside out, or a phyxel this far away [m]:
#: bodies are at most 1 m long.
INSIDE_OUT, FAR = 0.05, 3


def is_early(row):
    return row.number("reached") < 1


def is_inside_out(row):
    return row.number("inverted") > INSIDE_OUT


def is_apart(row):
    return row.number("farthest_m") > FAR


def is_spoilt(row):
    return is_early(row) or is_inside_out(row) or is_apart(row)


def percent(share):
    if not share > 0:
        return "0"
    return f"{100 * share:.2g}%" if share < 0.095 else f"{100 * share:.0f}%"


def times(value, reference):
    return f"{value / reference:.2f}"


def total(rows, column):
    return sum(row.number(column) for row in rows)


def time_of(rows):
    return sum(row.positive("seconds") for row in rows)


def best_law(table):
    """The law that spoils the fewest scenes; among equals, the one with the shortest time for all scenes."""
    laws = table.values("law", part="scene")
    if not laws:
        raise PageError(f"{table.file}: no row of part \"scene\"; allowed: a table of phyxel_studies laws")
    rows = {law: table.where(part="scene", law=law) for law in laws}
    return min(laws, key=lambda law: (sum(map(is_spoilt, rows[law])), time_of(rows[law])))


def summary(page, table):
    """Adds a row for each law: how its scenes end, and the time that they take."""
    best, default = best_law(table), problems()["default_law"]
    page.paragraph("## Side by side")
    page.paragraph(
        "*Early*: number of scenes that stopped before their end time. *Inside out*: number of scenes in which more than "
        f"{percent(INSIDE_OUT)} of the phyxels have det F ≤ 0 at the end, and the largest such share. *Apart*: number of scenes "
        f"in which a phyxel moves by more than {FAR} m. *Halvings* of the step and *time*: totals over all scenes; times are "
        "relative to the default law. *Step*: time per step of a strained cube, likewise. *Accuracy*: the largest error in the "
        "cases below.")
    cells = []
    of_default = table.where(part="scene", law=default)
    for law in table.values("law", part="scene"):
        rows = table.where(part="scene", law=law)
        steps = []
        for precision in ("float", "double"):
            speed = table.find(part="speed", case=precision, law=law)
            reference = table.find(part="speed", case=precision, law=default)
            steps.append(times(speed.positive("seconds"), reference.positive("seconds")) if speed and reference else "–")
        errors = [abs(row.number("error")) for row in table.where(part="accuracy", law=law)]
        seconds = time_of(rows)
        cells.append([f"**{law}**" if law == default else law, sum(map(is_early, rows)),
                      f"{sum(map(is_inside_out, rows))}, {percent(max(row.number('inverted') for row in rows))}",
                      sum(map(is_apart, rows)), f"{total(rows, 'halvings'):g}",
                      times(seconds, time_of(of_default)) if of_default else "–", *steps,
                      percent(max(errors)) if errors else "–"])
    page.add(markdown_table(["law", "early", "inside out", "apart", "halvings", "time", "step, float", "step, double", "accuracy"],
                            cells))
    fewest = sum(map(is_spoilt, table.where(part="scene", law=best)))
    page.paragraph(
        f"The law that spoils the fewest scenes ({fewest} of {len(table.values('case', part='scene'))}), and among equals the "
        f"one that takes the least time, is **{best}**. The default in scenes, C++ and Python is **{default}**; the bodies of "
        "Farias et al. 2008 have st-venant-kirchhoff, as in the paper.")
    page.paragraph(
        "St. Venant-Kirchhoff's law softens under compression, and an inverted body stays inverted. Hencky's law resists "
        "compression best, but softens under tension: bodies are drawn out like threads. The corotated law takes the fewest "
        "steps, since it stiffens least, but its bodies turn inside out more often. The small-strain law holds for small "
        "rotations only.")


def scenes(page, table):
    """Adds every scene with every law."""
    what = {scene["name"]: scene["what"] for scene in problems()["first_scenes"]}
    page.paragraph("## The scenes")
    page.add("".join(f"- *{name}*: {text}\n" for name, text in what.items()))
    page.paragraph("- All others: a mesh of `examples/`, scaled to a height of 1 m, which stands on or hangs from a tenth of its height; "
                   "E in Pa.")
    page.paragraph("*Inside out*: share of phyxels with det F ≤ 0 at the end; *ever*: the largest share in any frame. Spoilt scenes, those "
                   "that end early, inside out or apart, are in bold.")
    cells = []
    for row in table.where(part="scene"):
        law = f"**{row['law']}**" if is_spoilt(row) else row["law"]
        cells.append([row["case"], law, row["phyxels"], percent(row.number("inverted")), percent(row.number("ever_inverted")),
                      row["farthest_m"], row["halvings"], row["doublings"], row["steps"], row["seconds"],
                      row["message"].split(";")[0] if is_early(row) else ""])
    page.add(markdown_table(["scene", "law", "phyxels", "inside out", "ever", "farthest [m]", "halved", "doubled", "steps", "s",
                             "ended early"], cells))


def accuracy(page, table):
    """Adds the errors of the accuracy cases with every law."""
    laws = table.values("law", part="accuracy")
    if not laws:
        return
    page.paragraph("## Accuracy")
    page.paragraph("Errors of problems of [accuracy.md](accuracy.md), six cells across, with α = 0.1 and closed gradients. Strains are "
                   "small, and the references are for Hooke's law: the rows include the differences between the laws themselves.")
    cells = []
    for case in table.values("case", part="accuracy"):
        errors = [table.find(part="accuracy", case=case, law=law) for law in laws]
        cells.append([case, *(f"{100 * row.number('error'):+.3f}%" if row else "–" for row in errors)])
    page.add(markdown_table(["", *laws], cells))


def make(results, link):
    """The page. Raises PageError if laws.csv is missing."""
    table = read_table(results / "laws.csv")
    page = Page(link)
    page.paragraph(HEAD)
    page.paragraph(f"Measured by {measured_by(table)}.")
    summary(page, table)
    scenes(page, table)
    accuracy(page, table)
    return page
