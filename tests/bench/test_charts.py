"""Charts: what stands in tables stays text in them, and the same chart is the same file."""
import math
import xml.etree.ElementTree

import pytest
from conftest import needs_module
from tables_of_pages import HOSTILE

from pages.charts import Curve, LineChart, draw, raised


@pytest.fixture(autouse=True)
def matplotlib():
    needs_module("matplotlib")


def texts_of(svg):
    root = xml.etree.ElementTree.fromstring(svg)
    elements = {element.tag.split("}")[1] for element in root.iter()}
    assert elements <= {"svg", "metadata", "RDF", "Work", "type", "format", "defs", "style", "g", "path", "use", "text", "tspan",
                        "clipPath", "rect"}
    return ["".join(text.itertext()) for text in root.iter("{http://www.w3.org/2000/svg}text")]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("words", HOSTILE)
def test_labels_are_text(words, tmp_path, monkeypatch):
    """Title, axes and legend say what was written, but for characters that cannot be shown. A formula would leave no "$"."""
    monkeypatch.chdir(tmp_path)
    words = words.decode(errors="replace") if isinstance(words, bytes) else words
    svg = draw(LineChart(words, words, words, curves=[Curve(words, [1, 2], [1, 20]), Curve("b", [1], [1])]))
    assert b"<script" not in svg
    shown = [text.lstrip("\u2060") for text in texts_of(svg)]
    expected = "".join(c if c.isprintable() else "\ufffd" if c == "\u2060" else " " for c in words)
    assert shown.count(expected) == 4, shown
    assert not list(tmp_path.iterdir())


def test_the_same_chart_is_the_same_file():
    chart = LineChart("title", "x", "y", curves=[Curve("a", [1, 100], [1e-9, 1]), Curve("front", [1], [1], is_front=True)])
    assert draw(chart) == draw(chart)
    assert b"Date" not in draw(chart) and b"Matplotlib v" not in draw(chart)


def test_every_label_is_in_the_legend():
    """In their order, those that begin with an underscore, too."""
    labels = ["_a", "b", "Pareto front"]
    chart = LineChart("t", "x", "y", curves=[Curve(label, [1, 2], [1, 2], is_front="front" in label) for label in labels])
    shown = [text.lstrip("\u2060") for text in texts_of(draw(chart))]
    assert [text for text in shown if text in labels] == labels


@pytest.mark.parametrize("x, ticks", [([1e-5, 1e2], ["10⁻⁴", "0.001", "10"]), ([3, 8], ["3", "5", "8"]),
                                      ([0.02, 5], ["0.1", "1"]), ([0.05, 3], ["0.1", "0.2", "0.5", "1", "2"])])
def test_logarithmic_axes_have_readable_numbers(x, ticks):
    shown = texts_of(draw(LineChart("t", "x", "y", curves=[Curve("a", x, [1, 1])])))
    assert set(ticks) <= set(shown), shown
    assert not any("$" in text or "mathdefault" in text for text in shown)


@pytest.mark.filterwarnings("error")
def test_powers_of_ten_and_points_that_are_not_finite():
    assert raised(-12) == "10⁻¹²"
    draw(LineChart("t", "x", "y", curves=[Curve("a", [1, 2, 3], [math.inf, math.nan, 0])]))
    draw(LineChart("t", "x", "y"))


def test_curves_are_found_by_their_label():
    chart = LineChart("t", "x", "y")
    chart.curve("a").x.append(1)
    assert chart.curve("a", colour=3).x == [1] and len(chart.curves) == 1
