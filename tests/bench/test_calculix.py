"""bench/compare/calculix.py: its finite-element models, the section that it fills, and the command."""
import os
import sys

import pytest
from conftest import needs_module, needs_program
from tables_of_pages import SOURCE, write_table

sys.path.insert(0, str(SOURCE / "bench/compare"))
from pages import calculix as section
from pages.page import Page
from pages.tables import read_table


@pytest.fixture
def cases():
    needs_module("numpy")
    import calculix_cases
    return calculix_cases


def solved(cases, case, mesh, element, refinement, folder=None):
    """The relative errors of a model, by quantity."""
    import calculix_model
    found = {}
    for analysis in cases.CASES[case].analyses(element, mesh, refinement):
        displacements, _ = calculix_model.solve("ccx", analysis.model, "direct", min(os.sched_getaffinity(0)), case)
        found.update({q: v / cases.CASES[case].references[q] - 1 for q, v in analysis.values(displacements).items()})
    return found


# --- meshes -----------------------------------------------------------------------------------------

def test_elements_fill_a_box_and_share_its_end(cases):
    import numpy as np
    for element, middles in (("C3D20R", 12), ("C3D10", 6)):
        mesh = cases.box(element, [0, 1, 3], [0, 0.5], [-1, 0, 2])
        corners = mesh.nodes[mesh.elements[:, :-middles]]
        # Of a brick, the corners beside the first one.
        edges = corners[:, [1, 3, 4] if element == "C3D20R" else [1, 2, 3]] - corners[:, :1]
        volumes = np.linalg.det(edges) / (1 if element == "C3D20R" else 6)
        assert volumes.min() > 0 and volumes.sum() == pytest.approx(3 * 0.5 * 3)
        assert len(np.unique(mesh.nodes, axis=0)) == len(mesh.nodes)
        assert np.isclose(mesh.nodes[list(mesh.end), 0], 3).all()
        weight = np.array(list(mesh.end.values()))
        assert weight.sum() == pytest.approx(1)
        assert weight @ mesh.nodes[list(mesh.end), 1:] == pytest.approx([0.25, 0.5])  # the middle of the end


def test_the_parts_of_the_plate_meet(cases):
    """Each face inside belongs to two elements, so that the faces of one element alone have the area of the surface."""
    import numpy as np
    mesh = cases.CASES["plate"].analyses("C3D10", "uniform", 2)[0].model.mesh
    corners = mesh.elements[:, [(0, 1, 2), (0, 1, 3), (1, 2, 3), (0, 2, 3)]]
    faces = np.sort(corners.reshape(-1, 3), axis=1)
    single, count = np.unique(faces, axis=0, return_counts=True)
    assert set(count) == {1, 2}
    a, b, c = np.moveaxis(mesh.nodes[single[count == 1]], 1, 0)
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    hole = 16 * 0.05 * np.sin(np.pi / 16)  # half of the sides of about sixteen
    assert area == pytest.approx(2 * (0.4 * 0.2 - np.pi * 0.05 ** 2) + 0.02 * (1.2 + 2 * hole), rel=0.01)


# --- models -----------------------------------------------------------------------------------------

def test_the_law_is_st_venant_and_kirchhoffs(cases):
    """A cube stretched by a half: the force is E λ (λ² - 1)/2, for ν = 0."""
    needs_program("ccx")
    import calculix_model
    mesh = cases.box("C3D10", [0, 1], [0, 1], [0, 1])
    fixed = {axis: mesh.nodes_at(axis, 0.0) for axis in range(3)}
    stretch = 1.5
    force = 1e6 * stretch * (stretch ** 2 - 1) / 2
    model = calculix_model.Model(mesh, 1e6, 0.0, fixed=fixed, end_force=(force, 0, 0), nonlinear=True, measured=list(mesh.end))
    found, cost = calculix_model.solve("ccx", model, "direct", min(os.sched_getaffinity(0)), "cube", increment=0.2)
    assert sum(w * found[n][0] for n, w in mesh.end.items()) == pytest.approx(stretch - 1, rel=1e-4)
    assert 0 < cost.seconds < 60 and 1 < cost.mebibytes < 1000


@pytest.mark.parametrize("case, mesh, element, coarse, fine, last", [
    ("gravity", "graded", "C3D20R", 1, 3, 2e-3),
    ("gravity", "uniform", "C3D10", 1, 3, 7e-3),
    ("shear", "uniform", "C3D20R", 1, 3, 4e-3),
    ("elastica", "long", "C3D20R", 4, 6, 5e-4),
    ("cook", "graded", "C3D20R", 0, 2, 4e-3),
    ("cook", "uniform", "C3D10", 4, 8, 7e-2),
    ("plate", "uniform", "C3D20R", 1, 3, 1e-3),
])
def test_finite_elements_come_nearer_to_the_reference(cases, case, mesh, element, coarse, fine, last):
    needs_program("ccx")
    before, after = (solved(cases, case, mesh, element, refinement) for refinement in (coarse, fine))
    for quantity in cases.CASES[case].references:
        assert abs(after[quantity]) < 0.6 * abs(before[quantity]) and abs(after[quantity]) < last, (quantity, before, after)


def test_a_failure_of_calculix_is_told(cases):
    needs_program("ccx")
    import calculix_model
    model = cases.elastica("C3D20R", "uniform", 1)[0].model  # one brick across has motions without stiffness
    with pytest.raises(calculix_model.ModelError, match=r"thin bar: .*ccx ended with 201: .*too many cutbacks"):
        calculix_model.solve("ccx", model, "direct", min(os.sched_getaffinity(0)), "thin bar")


# --- the section ------------------------------------------------------------------------------------

def table_of(folder, rows):
    columns = ["case", "quantity", "program", "discretisation", "mesh", "solver", "refinement", "unknowns", "error",
               "cpu_seconds", "memory_mib"]
    facts = {"program": "phyxel", "peer": "CalculiX", "hardware": "a processor", "repeats": "3", "date": "2026-11-30"}
    write_table(folder / "calculix.csv", facts, columns,
                [[str(cell) for cell in ("bar", "sag", *row)] for row in rows])
    return folder / "calculix.csv"


def test_costs_of_an_error_lie_between_those_measured(tmp_path):
    rows = read_table(table_of(tmp_path, [
        ("phyxel", "nodes", "", "Newton", 16, 1, 1e-4, 100, 40), ("phyxel", "nodes", "", "Newton", 4, 1, -1e-2, 1, 10),
        ("phyxel", "nodes", "", "Newton", 8, 1, 1e-3, 10, 20)])).rows
    rows = [rows[1], rows[2], rows[0]]
    assert section.reach(rows, 10 ** -2.5, "cpu_seconds") == (pytest.approx(10 ** 0.5), False)
    assert section.reach(rows, 1e-2, "memory_mib") == (10, True)  # the coarsest one is as good
    assert section.reach(rows, 1e-4, "cpu_seconds") is None  # none is finer
    # What is small by chance does not count.
    rows = read_table(table_of(tmp_path, [("phyxel", "nodes", "", "Newton", n, 1, e, n, n)
                                          for n, e in ((1, 1e-5), (2, 1e-1), (4, 1e-3), (8, 1e-4))])).rows
    assert section.reach(rows, 1e-3, "cpu_seconds") == (4, False)


def test_the_section_says_who_needs_less(tmp_path):
    table_of(tmp_path, [(program, kind, mesh, solver, n, n ** 3, 0.1 / n ** 2, n * cost, n * memory)
                        for program, kind, mesh, solver, cost, memory in (
                            ("CalculiX", "C3D20R", "uniform", "direct", 3, 1), ("CalculiX", "C3D20R", "graded", "direct", 1, 1),
                            ("CalculiX", "C3D20R", "uniform", "iterative", 5, 1), ("phyxel", "nodes", "", "Newton", 2, 0.5))
                        for n in (2, 4, 8, 16, 32)])
    page = Page("results/")
    section.section(page, tmp_path)
    text = page.text()
    assert ("- Less time: CalculiX in 3 of 3 rows, by a factor of 2.\n"
            "- Less time, with CalculiX on uniform meshes only: phyxel in 3 of 3 rows, by a factor of 1.5.\n"
            "- Less memory: phyxel in 3 of 3 rows, by a factor of 2.\n"
            "- Not reached at the sizes measured: 0 of 3 rows by CalculiX, 0 by CalculiX on uniform meshes, 0 by phyxel.\n") in text
    assert "| bar: sag | 0.1% | 10 (graded bricks) | 30 | 20 (nodes) | 2 | 10 | 5 | **0.5** |" in text
    assert "| bar: sag | CalculiX, uniform bricks | 32768 | 96 | 32 | +0.0098% | 2.0 |" in text
    assert "| bar: sag | CalculiX, graded bricks | 32768 | 32 | 32 | +0.0098% | – |" in text
    assert list(page.charts) == ["accuracy_calculix_bar"] and len(page.charts["accuracy_calculix_bar"].curves) == 3


# --- the command ------------------------------------------------------------------------------------

def test_the_command_writes_what_the_section_reads(cases, tmp_path, capsys):
    needs_program("ccx")
    import calculix
    if "PHYXEL_PROGRAM" not in os.environ:
        pytest.fail("PHYXEL_PROGRAM must name the program: run this by ctest -R Pages")
    arguments = [os.environ["PHYXEL_PROGRAM"], "--cases", "gravity", "--repeats", "1", "--most", "1900", "--most-across", "4"]
    assert calculix.main([*arguments, "--out", str(tmp_path / "calculix.csv")]) == 0
    table = read_table(tmp_path / "calculix.csv")
    assert {(row["program"], row["discretisation"]) for row in table.rows} == \
           {("CalculiX", "C3D20R"), ("CalculiX", "C3D10"), ("phyxel", "nodes"), ("phyxel", "mesh")}
    for row in table.rows:
        assert row.positive("value") == pytest.approx(row.positive("reference") * (1 + row.number("error")), rel=1e-4)
        assert abs(row.number("error")) < 0.05 and row.positive("cpu_seconds") < 60 and 1 < row.positive("memory_mib") < 1000
    page = Page("")
    section.section(page, tmp_path)
    assert "| gravity: deflection | 1% |" in page.text()
    capsys.readouterr()
    assert calculix.main([*arguments, "--out", str(tmp_path / "none" / "calculix.csv")]) == 1
    assert "No such file" in capsys.readouterr().err


@pytest.mark.parametrize("arguments, words", [
    (["nowhere/phyxel"], "nowhere/phyxel: no such program; needed: a built phyxel"),
    ([sys.executable, "--ccx", "nowhere/ccx"], "nowhere/ccx: no such program; needed: CalculiX; Debian: calculix-ccx"),
    ([sys.executable, "--ccx", sys.executable, "--core", "100000"], "--core 100000: not allowed; allowed: "),
    ([sys.executable, "--ccx", sys.executable, "--repeats", "0"], "--repeats 0: not allowed; allowed: 1 and more"),
])
def test_wrong_arguments_are_answered(cases, capsys, arguments, words):
    import calculix
    with pytest.raises(SystemExit) as end:
        calculix.main(arguments)
    assert end.value.code == 2 and words in capsys.readouterr().err
