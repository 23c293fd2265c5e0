"""The section of docs/accuracy.md that compares contact with LAMMPS and Newton."""
from pages.charts import LineChart
from pages.tables import markdown_table, read_if_there

#: What the settings of each program mean.
SETTINGS = """- phyxel: *fitted* phyxels lie on the surface; *cells* are in the middle of each cell of a lattice. Contact is \
projected, which has no stiffness, or by penalties of the stiffness given.
- LAMMPS: pair style `smd/tlsph` on cells, or with particles where *fitted* phyxels are (*on the surface*). Contact is by \
`smd/hertz`; its manual advises a stiffness K of about E/2. The contact radius is half a spacing. In the impact, steps are the \
largest stable ones of those tried; in the drop they are half as long, and longer ones were not tried. The walls of the drop are harmonic.
- Newton: linear tetrahedra with edges of mean length h. A node is pushed out of a layer, 0.3 h thick, about the triangles of a \
surface, with a force of k times its depth. `SolverSemiImplicit` tests each node against each triangle in each step: its cost grows \
with the square of the number of nodes, so that it ran no finer balls, and only the first steps of the drop. *Spheres* about nodes \
push each other instead, found by a grid, as particles do in LAMMPS. `SolverVBD` takes ten iterations; its steps are shares of the \
time of a pressure wave along h."""
ERRORS = {"duration": "time of contact", "approach": "approach", "restitution": "restitution"}


def percent(text, sign=""):
    value = 100 * float(text)
    return f"{value:{sign}.2g}%" if abs(value) < 99.5 else f"{value:{sign}.0f}%"


def runs_of(table, scene):
    """The rows of each run of a scene, by quantity."""
    runs = {}
    for row in table.where(scene=scene):
        runs.setdefault((row["program"], row["setting"], row["across"]), {})[row["quantity"]] = row
    return runs


def worst(run):
    """The larger error of duration and approach."""
    return max(abs(run[name].number("error")) for name in ("duration", "approach"))


def balls(page, table):
    """Adds the impact of two balls: all sizes of the settings that are the best of their program at one size, and of the
    default ones."""
    runs = {key: run for key, run in runs_of(table, "balls").items() if "duration" in run}
    best = {}
    for key in runs:
        program, _, across = key
        if worst(runs[key]) < worst(runs[best.setdefault((program, across), key)]):
            best[program, across] = key
    shown = {key[:2] for key in best.values()} | {("phyxel", "fitted"), ("LAMMPS", "K = 0.5 E")}
    chart = LineChart("two balls that meet", "time on one core [s]", "larger error of time and approach")
    cells = []
    for key in sorted(runs, key=lambda key: [list(runs).index(next(k for k in runs if k[:2] == key[:2])), int(key[2])]):
        program, setting, across = key
        if (program, setting) not in shown:
            continue
        run = runs[key]
        curve = chart.curve(f"{program}; {setting}")
        curve.x.append(run["duration"].number("seconds"))
        curve.y.append(worst(run))
        cells.append([f"{program}; {setting}", across, run["duration"]["points"],
                      *(percent(run[name]["error"], "+") for name in ERRORS), run["duration"]["seconds"]])
    page.show(chart, "accuracy_contact_peers")
    page.add(markdown_table(["", "across", "points", *ERRORS.values(), "s"], cells))


def drop(page, table):
    """Adds the drop of many balls: all runs."""
    cells = []
    for (program, setting, _), run in runs_of(table, "drop").items():
        row = next(iter(run.values()))
        found = [f"{1000 * float(run[name]['value']):.2g} mm" if name in run else "–" for name in ("walls", "bodies")]
        height = percent(run["height"]["error"], "+") if "height" in run else "–"
        rest = percent(run["kinetic"]["value"]) if "kinetic" in run else "–"
        end = run["why"]["value"] if "why" in run else run["stable"]["value"]
        cells.append([f"{program}; {setting}", row["points"], row["step_s"] or "–", row["seconds"] or "–", *found, height, rest,
                      "at the end" if end == "yes" else end])
    page.add(markdown_table(["", "points", "step [s]", "s per simulated s", "deepest in walls", "deepest in bodies", "height",
                             "motion left", "came to rest"], cells))


def section(page, results):
    table = read_if_there(results / "contact_peers.csv")
    if not table:
        return
    page.paragraph("## Contact beside LAMMPS and Newton")
    page.paragraph(
        f"Two scenes in three programs, on the same processor: {table.fact('what')}. All runs use one core, as Newton does on a CPU; "
        "times are those of the core, with set-up for phyxel and without it for LAMMPS and Newton. "
        f"`bench/compare/contact_peers.py` runs them: {table.fact('program')} on {table.fact('hardware')}; {table.fact('date')}.")
    page.paragraph(SETTINGS)
    page.paragraph(
        "The balls of *balls* below meet. The table has those settings of each program that have the smallest errors of time and "
        "approach at one size, phyxel's default (*fitted*), and what LAMMPS's manual advises; `contact_peers.csv` has all. A stiffness "
        "chosen to fit lets errors of contact and of the bodies cancel. At 8 across, the radius of contact is less than a spacing, and "
        "Newton's errors depend on whether a node or a face of the mesh is where the balls meet. Strains are small ones in phyxel and "
        "in the reference, large ones in LAMMPS and Newton.")
    balls(page, table)
    page.paragraph(
        "27 balls, E = 0.5 MPa, fall by 0.2 m into a box, in three layers of nine that nearly fill it; there is no friction, and velocities "
        "are damped by 4 1/s. *Height*: of the centre of mass during the last quarter of a second, relative to an estimate by Hertz's "
        "formula for columns that carry themselves. Depths are the largest ones, of points in the convex hulls of other balls, beyond the "
        "distance at which contact begins; *motion left*: kinetic energy at the end over the energy of the fall. Newton's balls are "
        "smaller by their layer of contact, so that they take up as much room as the others. Where points push points, as in LAMMPS and "
        "among spheres, bodies slip into the gaps between each other's points, the deeper the softer the contact.")
    drop(page, table)
