"""The pages that bench/make_pages.py makes of tables."""
import itertools
import json
import os
import re
import shutil
import subprocess
import sys

import pytest
from conftest import needs_module
from tables_of_pages import HOSTILE, RESULTS, SOURCE, cell, made_of, made_pages, write_table

import make_pages
from pages import accuracy, contact, cpu, laws, performance, scaling, scaling_model
from pages.problems import problems
from pages.tables import PageError, read_table

MAKERS = {"performance": performance, "scaling": scaling, "accuracy": accuracy, "laws": laws, "contact": contact, "cpu": cpu}


def phyxel(folder, *arguments, program="PHYXEL_PROGRAM"):
    """Runs the program, or the studies, as a user would."""
    if program not in os.environ:
        pytest.fail(f"{program} must name the program: run this by ctest -R Pages")
    done = subprocess.run([os.environ[program], *arguments], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def page_of(name, results, link="tables/"):
    return MAKERS[name].make(results, link).text()


def copied(tmp_path, name, rows=None):
    """A folder with the tables of a page, with the first rows of each."""
    folder = tmp_path / "tables"
    folder.mkdir(exist_ok=True)
    for file in made_of(name):
        lines = (RESULTS / file).read_text().splitlines(keepends=True)
        facts = sum(line.startswith("#") for line in lines)
        (folder / file).write_text("".join(lines if rows is None else lines[:facts + 1 + rows]))
    return folder


# --- tables that the program writes -----------------------------------------------------------------

def test_a_page_about_speed_is_made_of_what_bench_writes(tmp_path):
    phyxel(tmp_path, "bench", "step", "--phyxels", "27,64", "--precision", "float,double", "--terms", "green", "--threads",
           "1", "--seconds", "0.01", "--repeat", "1", "--csv", "gpu_sizes.csv")
    text = page_of("performance", tmp_path)
    assert "| 27 | float | 1 thread:" in text and "| 64 | double | 1 thread:" in text
    assert "Cost of each term" not in text and "cantilever" not in text  # these tables are not there
    # Double is measured although only float is asked for: it is what float is compared with.
    phyxel(tmp_path, "bench", "cantilever", "--device", "cpu", "--across", "2,3", "--factor", "1.4", "--precision", "float",
           "--csv", "gpu_cantilever.csv")
    text = page_of("performance", tmp_path)
    for words in ("## Speed against error: a cantilever", "From 2 to 3 phyxels across", "| 3 | 279 |", "rounding, float"):
        assert words in text


def test_a_page_about_accuracy_is_made_of_what_accuracy_writes(tmp_path):
    phyxel(tmp_path, "accuracy", "gravity", "--across", "2,3", "--lattice", "nodes", "--jitter", "0", "--hourglass", "0.3",
           "--closure", "0,1e-3", "--csv", "accuracy.csv")
    text = page_of("accuracy", tmp_path)
    assert "## gravity: deflection" in text and "nodes, α = 0.3, closed" in text
    assert "**nodes, α = 0.3** | 3 | 256 |" in text  # finer is better, and slower
    assert "![gravity: deflection, regular lattices](tables/accuracy_gravity_deflection_regular.svg)" in text


def test_problems_of_contact_have_a_table_and_a_summary_of_their_own(tmp_path):
    phyxel(tmp_path, "accuracy", "rotation", "--across", "2", "--lattice", "nodes", "--csv", "accuracy.csv")
    assert "## Contact" not in page_of("accuracy", tmp_path)
    phyxel(tmp_path, "accuracy", "slope", "bars", "--across", "2,3", "--lattice", "nodes", "--jitter", "0", "--factor", "2.2",
           "--csv", "accuracy_contact.csv")
    text = page_of("accuracy", tmp_path)
    assert text.index("## rotation") < text.index("## bars: energy") < text.index("## slope: way")
    assert "| nodes, factor 2.2, α = 0.1, closed | 3 |" in text.replace("**", "")
    phyxel(tmp_path, "accuracy", "slope", "--across", "4", "--lattice", "mesh", "--csv", "accuracy_contact.csv", "--force")
    summed = page_of("accuracy", tmp_path).split("## Contact", 1)[1].split("## ", 1)[0]
    assert "|  | phyxels | mesh, α = 0.1 | mesh, α = 0.1, closed |" in summed
    assert re.search(r"\| slope: way \| 125 \| \S+ in \S+ s \| \S+ in \S+ s \|", summed)


def test_studies_pictures_and_hard_cases_are_on_the_page(tmp_path):
    phyxel(tmp_path, "accuracy", "rotation", "--across", "2", "--lattice", "nodes", "--csv", "accuracy.csv")
    steps = phyxel(tmp_path, "steps", "--csv", "accuracy_steps.csv", program="PHYXEL_STUDIES")
    assert "way,step_s,error" in steps
    phyxel(tmp_path, "accuracy", "hard", "step 1.01", "lone phyxel", "--precision", "float", "--csv", "hard_cases_cpu.csv")
    phyxel(tmp_path, "pictures", "--results", ".", program="PHYXEL_STUDIES")
    plain, held = ((tmp_path / f"accuracy_swing_{name}.png").read_bytes() for name in ("plain", "held"))
    assert plain[1:4] == b"PNG" and plain != held
    text = page_of("accuracy", tmp_path)
    for words in ("## steps", "| implicit | 0.0025 |", "float refused", "not run", "![nodes, plain](tables/"):
        assert words in text


def test_the_default_law_spoils_the_fewest_scenes(tmp_path):
    """The page of the measurement says so, and so does one of two scenes measured now."""
    table = read_table(RESULTS / "laws.csv")
    assert laws.best_law(table) == problems()["default_law"]
    # Pressed to a third, a body of Hooke's law in Green's strain ends inside out.
    phyxel(tmp_path, "laws", "--case", "pressed cube,hung column", "--law", "st-venant-kirchhoff,neo-hookean", "--csv", "laws.csv",
           "--mesh", str(RESULTS.parent.parent / "examples" / "mesh" / "ring.obj"),
           program="PHYXEL_STUDIES")
    measured = read_table(tmp_path / "laws.csv")
    assert laws.best_law(measured) == "neo-hookean"
    assert measured.find(case="pressed cube", law="st-venant-kirchhoff").number("inverted") > 0.2
    text = page_of("laws", tmp_path)
    assert "| pressed cube | **st-venant-kirchhoff** | 729 |" in text
    assert "1 of" not in text and "(0 of 2)" in text


def test_setup_and_neighbour_search_are_measured(tmp_path):
    setup = phyxel(tmp_path, "setup", "--phyxels", "27", "--precision", "double", "--repeat", "1", "--csv", "gpu_setup.csv",
                   program="PHYXEL_STUDIES")
    assert "precision,threads,phyxels" in setup
    assert "for 27 phyxels" in page_of("performance", tmp_path)
    phyxel(tmp_path, "neighbour-search", "--phyxels", "64", "--threads", "1", "--csv", "cpu_neighbours.csv",
           program="PHYXEL_STUDIES")
    assert "| 1 | 64 |" in page_of("cpu", tmp_path)


def test_a_page_about_ranks_is_made_of_what_bench_writes(tmp_path):
    phyxel(tmp_path, "bench", "scaling", "--phyxels", "27", "--seconds", "0.01", "--repeat", "1", "--csv", "cpu_ranks_1.csv")
    assert scaling.make(tmp_path, "") is None  # one rank is no scaling
    assert read_table(tmp_path / "cpu_ranks_1.csv").columns == read_table(RESULTS / "gpu_ranks_2a.csv").columns


def test_a_page_of_contact_has_what_its_script_measures(tmp_path):
    """The bouncing ball, measured now, has the quantities and the values of the table, and they are on the page."""
    script = SOURCE / "scripts/measure_contact_examples.py"
    done = subprocess.run([sys.executable, "-B", script, os.environ["PHYXEL_PROGRAM"], "bouncing_ball", "--out", tmp_path / "now.csv"],
                          capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    now, table = read_table(tmp_path / "now.csv").rows, read_table(RESULTS / "contact_examples.csv")
    kept = table.where(case="bouncing_ball")
    assert [row["quantity"] for row in now] == [row["quantity"] for row in kept]
    for new, old in zip(now, kept):
        if old["quantity"] == "processor time":
            continue
        for column in ("value", "expected"):
            # Rounding in floats grows in impacts; the change of the total energy has one digit on the page.
            tolerance = 0.3 if "change" in old["quantity"] else 0.01
            assert new[column] == old[column] == "" or new.number(column) == pytest.approx(old.number(column), rel=tolerance), old.place
    text = page_of("contact", RESULTS)
    period = table.find(case="bouncing_ball", quantity="time between apexes")
    assert f"| {period.number('value'):.4g} s | {period.number('expected'):.4g} s: √(2 H₁/g) + √(2 H₂/g)" in text
    # The formula, of what the table has.
    heights = [table.find(case="bouncing_ball", quantity=f"height after the {n} impact").number("value") for n in ("first", "second")]
    touching = table.find(case="bouncing_ball", quantity="time of contact").number("expected")
    assert period.number("expected") == pytest.approx(sum((2 * h / 9.81) ** 0.5 for h in heights) + touching, rel=1e-5)  # six digits


def test_a_page_of_contact_names_a_quantity_that_is_missing(tmp_path):
    folder = copied(tmp_path, "contact", rows=20)
    with pytest.raises(PageError, match='contact_examples.csv: no quantity .* of case "cradle"; allowed: a table of'):
        page_of("contact", folder)


def test_the_problems_are_those_of_the_program(tmp_path):
    """bench/pages/problems.json is what phyxel_studies writes."""
    assert problems() == json.loads(phyxel(tmp_path, "problems", program="PHYXEL_STUDIES"))


# --- text from outside ---------------------------------------------------------------------------

#: What chooses rows and sections, and so must stay.
KEYS = {"case", "lattice", "partitioner", "cut_by", "terms", "shape", "kernel", "metric", "precision", "bodies", "threads", "ranks",
        "program", "discretisation", "quantity", "part", "law", "mesh", "solver"}


@pytest.mark.parametrize("name", MAKERS)
def test_cells_and_facts_of_every_table_are_text(tmp_path, name):
    """All facts and all cells of text end in hostile words, by turns. Pages keep their lines, and tables their columns."""
    folder = copied(tmp_path, name, rows=60)
    bare, words, used = page_of(name, folder, ""), itertools.cycle(HOSTILE), 0
    for file in sorted(folder.iterdir()):
        table = read_table(file)
        rows = [[row[column] for column in table.columns] for row in table.rows]
        for row, cells in zip(table.rows, rows):
            for k, column in enumerate(table.columns):
                try:
                    row.number(column)
                except PageError:
                    if column not in KEYS and cells[k]:
                        cells[k] = cells[k].encode() + cell(next(words))
                        used += 1
        for turn in range(3):  # each fact meets several words
            write_table(file, {fact: next(words) for fact in table.facts}, table.columns, rows)
            text = page_of(name, folder, "")
            for markup in ("<script", "<img", "](javascript", "\n!touch", "\x1b", "`touch", "$(", "$\\"):
                assert markup not in text
            assert [line.count("|") for line in text.split("\n") if line.startswith("|")] == \
                   [line.count("|") for line in bare.split("\n") if line.startswith("|")]
            assert len(text.splitlines()) == len(bare.splitlines())
            assert text.count("](") == bare.count("](")  # links lead to charts of ours alone
    assert text != bare and (used > 10 or name in ("cpu", "laws"))


@pytest.mark.parametrize("words", [w for w in HOSTILE if isinstance(w, str) and "/" not in w])
def test_names_of_folders_are_text(tmp_path, monkeypatch, words):
    folder = tmp_path / words
    folder.mkdir()
    monkeypatch.chdir(tmp_path)
    shutil.copy(RESULTS / "gpu_neighbours.csv", folder)
    texts, drawings = make_pages.made(["performance"], folder, tmp_path, None)
    assert list(drawings) == [folder / "gpu_neighbours.svg"]
    link = texts[tmp_path / "performance.md"].split("![Two million phyxels](")[1].split(")")[0]
    assert link.endswith("/gpu_neighbours.svg") and not set(link) & set(" `$<>|\\\n;'\"")
    make_pages.write_whole(folder / "gpu_neighbours.svg", b"<svg/>")
    assert [f.name for f in tmp_path.iterdir()] == [words]
    assert sorted(f.name for f in folder.iterdir()) == ["gpu_neighbours.csv", "gpu_neighbours.svg"]


# --- wrong tables --------------------------------------------------------------------------------

@pytest.mark.parametrize("name", MAKERS)
def test_a_damaged_column_is_named_or_is_not_needed(tmp_path, name):
    """Damage to any column yields a page, or an error that names the file and the column."""
    folder = copied(tmp_path, name, rows=4)
    alike = [f"gpu_ranks_{n}.csv" for n in ("2b", "2c", "2d_host", "2d_mpi", "4a", "4b", "4c", "4d_host", "4d_nccl")]
    for file in made_of(name):
        if file in alike:
            continue
        table, whole, refused = read_table(folder / file), (folder / file).read_bytes(), 0
        for column in table.columns:
            for damage in (None, "x", "0"):
                columns = [c for c in table.columns if damage is not None or c != column]
                rows = [[damage if c == column else row[c] for c in columns] for row in table.rows]
                write_table(folder / file, table.facts, columns, rows)
                try:
                    page_of(name, folder)
                except PageError as error:
                    refused += 1
                    assert f"{folder}/" in str(error) and ("column \"" in str(error) or "allowed" in str(error)), error
        assert refused > 0, f"{file}: no column is needed"
        (folder / file).write_bytes(whole)


def test_nothing_is_written_where_a_table_is_wrong(tmp_path, capsys):
    folder = tmp_path / "results"
    shutil.copytree(RESULTS, folder, ignore=shutil.ignore_patterns("*.svg", "paper"))
    for name in ("performance", "scaling", "accuracy"):
        (tmp_path / f"{name}.md").write_text("precious")
    text = (folder / "accuracy.csv").read_text()
    (folder / "accuracy.csv").write_text(text.replace(",setup_seconds", ",set_up"))
    code, _, said = made_pages(capsys, "--results", folder)
    assert code == 2
    assert "accuracy.csv: no column \"setup_seconds\"; there are: case, quantity" in said
    (folder / "accuracy.csv").unlink()
    assert "accuracy.csv: no such file; allowed: a table" in made_pages(capsys, "--results", folder)[2]
    assert {p.read_text() for p in tmp_path.glob("*.md")} == {"precious"} and not list(folder.glob("*.svg"))
    assert [p.name for p in tmp_path.iterdir() if p.name.startswith(".")] == []


@pytest.mark.parametrize("arguments, words", [
    (["--results", "nowhere"], "nowhere: no such folder; allowed: one with tables"),
    (["speed"], "page speed: unknown; allowed: performance, scaling, accuracy, laws, contact, cpu, readme, gallery"),
    (["readme", "--results", "."], "not the project's own tables"),
    (["readme", "--results", ".", "--readme", "none.md"], "none.md: no such file"),
    (["readme", "--results", ".", "--readme", "bare.md"], "bare.md: has no lines \"<!-- speed: made by"),
    (["performance", "--results", ".", "--out", "nowhere"], "nowhere"),
])
def test_wrong_arguments_are_answered(tmp_path, monkeypatch, capsys, arguments, words):
    (tmp_path / "bare.md").write_text("# A project\n")
    monkeypatch.chdir(tmp_path)
    code, _, said = made_pages(capsys, *arguments)
    assert code == 2 and words in said
    assert [p.name for p in tmp_path.iterdir()] == ["bare.md"]


# --- the command ---------------------------------------------------------------------------------

def test_all_pages_are_written_and_checked(tmp_path, capsys):
    """By the command itself, then in this process."""
    needs_module("matplotlib")
    folder, readme = tmp_path / "docs/results", tmp_path / "README.md"
    shutil.copytree(RESULTS, folder, ignore=shutil.ignore_patterns("*.svg", "README.md"))
    shutil.copy(SOURCE / "README.md", readme)
    arguments = ["--results", str(folder), "--readme", str(readme)]

    def check(*more):
        code, found, _ = made_pages(capsys, "--check", *arguments, *more)
        return code, found

    code, found = check()
    assert code == 1 and "Pages are not what the tables say" in found
    assert not (folder / "README.md").exists()  # a check writes nothing
    assert subprocess.run([sys.executable, "-B", SOURCE / "bench/make_pages.py", *arguments]).returncode == 0
    for file in ("docs/performance.md", "docs/scaling.md", "docs/accuracy.md", "docs/contact.md", "docs/results/README.md", "README.md"):
        assert (tmp_path / file).read_text() == (SOURCE / file).read_text(), file
    assert {f.name for f in folder.glob("*.svg")} == {f.name for f in RESULTS.glob("*.svg")}
    assert check() == (0, "")
    # A number that somebody typed, a chart that is missing, one that nobody shows.
    page = tmp_path / "docs/scaling.md"
    page.write_text(re.sub(r"(?m)^(\| 2000376 \| float \| metis \| 1 \|[^|]*\|) [0-9.]+ ", r"\1 1.00 ", page.read_text(), count=1))
    (folder / "gpu_sizes.svg").unlink()
    (folder / "gpu_old.svg").write_text("<svg/>")
    code, found = check()
    assert code == 1
    for words in ("-| 2000376 | float | metis | 1 |", "gpu_sizes.svg: a page shows this chart, which is not there",
                  "gpu_old.svg: no page shows this chart"):
        assert words in found
    # A table that was measured again.
    table = folder / "cpu_step.csv"
    table.write_text(table.read_text().replace("# date: ", "# date: later than "))
    assert "later than" in check("readme")[1]
    typed = re.sub(r"CalculiX in \d+ of", "CalculiX in 0 of", readme.read_text())
    readme.write_text(typed)
    assert "CalculiX in 0 of" in check("readme")[1]


# --- charts --------------------------------------------------------------------------------------

def test_charts_show_the_rows_of_their_tables():
    charts = performance.make(RESULTS, "").charts
    sizes, rows = charts["gpu_sizes"], read_table(RESULTS / "gpu_sizes.csv").where(precision="double")
    assert [curve.label for curve in sizes.curves] == ["float", "double", "mixed"] and sizes.log_x and sizes.log_y
    assert sizes.curves[1].x == [row.number("phyxels") for row in rows]
    assert sizes.curves[1].y == [row.number("phyxel_steps_per_s") * 1e-9 for row in rows]
    assert sizes.curves[0].x[-1] == read_table(RESULTS / "gpu_capacity.csv").rows[0].number("phyxels")
    neighbours = charts["gpu_neighbours"]
    assert not neighbours.log_x and neighbours.curves[0].x == [
        row.number("neighbours") for row in read_table(RESULTS / "gpu_neighbours.csv").where(precision="float")]
    beam, table = charts["gpu_cantilever"], read_table(RESULTS / "gpu_cantilever.csv")
    labels = [curve.label for curve in beam.curves]
    assert labels[:5] == ["double, 30 neighbours", "float, 30 neighbours", "rounding, float, 30 neighbours",
                          "mixed, 30 neighbours", "rounding, mixed, 30 neighbours"]
    assert len(labels) == 5 + len(table.values("factor")) - 1  # and float with each other support
    finest = table.where(factor="1.8", precision="float")[-1]
    assert (beam.curves[2].x[-1], beam.curves[2].y[-1]) == (finest.number("seconds"), finest.number("rounding_error"))


def test_charts_of_accuracy_show_all_of_the_time_and_the_front():
    charts = accuracy.make(RESULTS, "").charts
    front, *curves = charts["accuracy_gravity_deflection_regular"].curves
    assert front.is_front and [curve.label for curve in curves] == [
        f"{lattice}, {terms}" for lattice in ("nodes", "cells") for terms in ("plain", "closed", "α = 0.1", "α = 0.1, closed")]
    rows = read_table(RESULTS / "accuracy.csv").where(case="gravity", lattice="cells", jitter="0", hourglass="0.1", closure="0")
    assert curves[6].x == [row.number("seconds") + row.number("setup_seconds") for row in rows]
    assert curves[6].y == [abs(row.number("error")) for row in rows]
    points = [point for curve in curves for point in zip(curve.x, curve.y)]
    best = [(x, y) for x, y in points if not any((u <= x and v < y) or (u < x and v <= y) for u, v in points)]
    assert list(zip(front.x, front.y)) == sorted(best)
    steps = charts["accuracy_steps"].curves
    assert [curve.label for curve in steps] == ["verlet", "implicit"]
    assert steps[1].x == [row.number("seconds") for row in read_table(RESULTS / "accuracy_steps.csv").where(way="implicit")]


def test_a_lattice_has_one_colour_and_terms_have_one_marker_on_all_charts():
    colours, markers = {}, {}
    for name, chart in accuracy.make(RESULTS, "").charts.items():
        for curve in chart.curves:
            if curve.colour is None:
                continue
            colours.setdefault(curve.label.split(", ")[0], set()).add(curve.colour)
            terms = curve.label.split("0.2, ")[-1] if "jitter" in curve.label else curve.label.split(", ", 1)[1]
            markers.setdefault(terms, set()).add(curve.style)
    assert colours == {"nodes": {0}, "cells": {1}, "mesh": {2}}
    assert all(len(of_terms) == 1 for of_terms in markers.values())
    assert len(set().union(*markers.values())) == len(markers) == 6


# --- what pages say ------------------------------------------------------------------------------

def test_the_front_has_no_row_that_is_slower_and_worse(tmp_path):
    write_table(tmp_path / "t.csv", {}, ["seconds", "setup_seconds", "error"],
                [["3", "0", "0.1"], ["1", "0.5", "-0.3"], ["2", "0", "0.5"], ["1", "0", "inf"], ["4", "0", "0.1"]])
    rows = read_table(tmp_path / "t.csv").rows
    assert [rows.index(row) for row in accuracy.front_of(rows)] == [1, 0]


@pytest.mark.parametrize("error, words", [(0.5, "50%"), (-0.0123, "1.2%"), (0.095, "10%"), (5e-5, "5e-05"),
                                          (float("inf"), "diverged"), (float("nan"), "diverged")])
def test_errors_are_short(error, words):
    assert accuracy.short_error(error) == words


@pytest.mark.parametrize("reached, words", [(8e9, "on target"), (7.65e9, "4% below target"),
                                            (9.7e9, "21% above target")])
def test_speeds_are_compared_with_their_targets(reached, words):
    assert performance.against(reached, 8e9) == words


def ranks_table(file, ranks, rows, program="phyxel a", more=()):
    columns = read_table(RESULTS / "gpu_ranks_2a.csv").columns[:-2] + list(more)
    filled = [{"ranks": str(ranks), "rings": "1", "precision": "float", "partitioner": "curve", "cut_by": "curve",
               "transport": "CUDA IPC", **row} for row in rows]
    write_table(file, {"program": program, "compiler": "g", "date": "d", "gpu": "G", "gpus": "2", "hardware": "h"}, columns,
                [[row.get(column, "1") for column in columns] for row in filled])


def test_tables_of_as_many_ranks_are_one_that_tells_all_programs(tmp_path):
    ranks_table(tmp_path / "gpu_ranks_2a.csv", 2, [{"phyxels": "8"}])
    ranks_table(tmp_path / "gpu_ranks_2b.csv", 2, [{"phyxels": "27"}], "phyxel b", more=["backend_s"])
    table = scaling.tables_in(tmp_path, "gpu")[2]
    assert table.fact("program") == "phyxel a, phyxel b" and table.fact("date") == "d"
    assert [row["phyxels"] for row in table.rows] == ["8", "27"]
    assert [row["backend_s"] for row in table.rows] == ["", "1"]
    text = page_of("scaling", tmp_path)
    assert text.count("### 2 ranks, one GPU each") == 1 and "Not measured yet" not in text
    write_table(tmp_path / "gpu_ranks_2c.csv", {}, ["ranks", "other"], [["2", "1"]])
    with pytest.raises(PageError, match="gpu_ranks_2c.csv: other columns than"):
        scaling.tables_in(tmp_path, "gpu")


@pytest.mark.parametrize("ranks", ["0", "1e9", "nan"])
def test_a_table_of_impossible_ranks_is_refused(tmp_path, ranks):
    ranks_table(tmp_path / "cpu_ranks_2.csv", ranks, [{}])
    with pytest.raises(PageError, match="ranks; allowed: 1 to 1000000"):
        scaling.make(tmp_path, "")


def test_the_model_finds_the_link_that_tables_were_made_with(tmp_path):
    """Steps of one GPU in proportion to its phyxels, exchanges of 3 µs and 100 GB/s."""
    per_phyxel = 1e-10
    write_table(tmp_path / "gpu_sizes.csv", {}, ["bodies", "terms", "precision", "phyxels", "steps_per_s"],
                [["1", "green", "float", n, repr(1 / (float(n) * per_phyxel))] for n in ("1e4", "1e6", "1e8")])
    rows = []
    for phyxels in (1e6, 4e6, 9e6):
        ghosts = 2 * phyxels ** (2 / 3)  # two layers
        sent = 72 * ghosts
        seconds = phyxels / 2 * per_phyxel + 3e-6 + sent / 100e9
        rows.append({"phyxels": repr(phyxels), "phyxels_alone": repr(phyxels), "most": repr(phyxels / 2),
                     "most_ghosts": repr(ghosts), "bytes_per_step": repr(sent), "steps_per_s": repr(1 / seconds),
                     "phyxel_steps_per_s_alone": repr(1 / per_phyxel)})
    ranks_table(tmp_path / "gpu_ranks_2.csv", 2, rows)
    one = scaling_model.OneGpu(read_table(tmp_path / "gpu_sizes.csv"))
    assert one.seconds(3e5) == pytest.approx(3e-5) and one.seconds(1e9) == pytest.approx(0.1)
    fit = scaling_model.fitted([read_table(tmp_path / "gpu_ranks_2.csv")], one)
    assert fit.latency == pytest.approx(3e-6) and fit.bytes_per_s == pytest.approx(100e9)
    assert (fit.layers, fit.bytes_per_ghost, fit.slowdown, fit.rows) == pytest.approx((2, 72, 1, 3))
    assert "3.0 µs plus the bytes sent at 100 GB/s" in page_of("scaling", tmp_path)
