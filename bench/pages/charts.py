"""Line charts, drawn by matplotlib. The SVG is deterministic: equal charts give equal files.

Labels are plain text: matplotlib's formulas are off, and powers of ten on the axes are written with raised digits.
"""
import dataclasses
import io
import math
import textwrap

from pages.tables import on_one_line, plain

#: The colour-blind-safe palette of Okabe and Ito 2008, without its yellow, which is too pale for lines.
COLOURS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000"]
MARKERS = ["o", "s", "^", "D", "v", "P", "X"]
DASHES = ["solid", (0, (5, 2)), (0, (1, 1.5)), (0, (7, 2, 1.5, 2)), (0, (3, 1.5)), (0, (1, 3))]

_STYLE = {
    "text.parse_math": False, "text.usetex": False, "axes.formatter.use_mathtext": False,
    "axes.unicode_minus": True, "svg.fonttype": "none", "svg.hashsalt": "phyxel",
    "font.family": "sans-serif", "font.sans-serif": ["DejaVu Sans"], "font.size": 10,
    "axes.spines.top": False, "axes.spines.right": False, "axes.grid": True, "grid.color": "#dddddd",
    "grid.linewidth": 0.6, "axes.axisbelow": True, "lines.linewidth": 1.6, "lines.markersize": 5,
}


@dataclasses.dataclass
class Curve:
    """A curve through points, in this order. `colour` and `style` are indices into the lists above; None stands for the
    curve's place in the chart."""
    label: str
    x: list = dataclasses.field(default_factory=list)
    y: list = dataclasses.field(default_factory=list)
    colour: int = None
    style: int = None       #: of marker and dashes
    is_front: bool = False  #: True for a broad grey line behind the other curves, without markers


@dataclasses.dataclass
class LineChart:
    title: str
    x_label: str
    y_label: str
    log_x: bool = True
    log_y: bool = True
    curves: list = dataclasses.field(default_factory=list)

    def curve(self, label, **style):
        """The curve with this label; a new one if there is none."""
        for curve in self.curves:
            if curve.label == label:
                return curve
        self.curves.append(Curve(label, **style))
        return self.curves[-1]


def raised(exponent):
    """A power of ten as text, 10⁻³."""
    return "10" + str(exponent).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def _shown(text):
    """Makes a label safe for matplotlib. Characters that XML or fonts lack are replaced. A legend omits labels that begin
    with an underscore: a word joiner (U+2060), which is invisible, precedes it."""
    text = "".join(c if c.isprintable() else "\ufffd" for c in on_one_line(plain(text)))
    return "\u2060" + text if text.startswith("_") else text


def _logarithmic(axis, values):
    """Sets ticks at powers of ten; for less than two decades, ticks with numbers in between, too."""
    from matplotlib import ticker
    span = math.log10(max(values) / min(values))

    def of_ten(value, _):
        exponent = round(math.log10(value))
        return raised(exponent) if abs(exponent) > 3 else f"{10.0 ** exponent:g}"

    axis.set_major_locator(ticker.LogLocator(base=10, numticks=12))
    axis.set_major_formatter(ticker.FuncFormatter(of_ten))
    if span < 2:
        axis.set_minor_locator(ticker.LogLocator(base=10, subs=(2, 5) if span > 1 else (1.5, 2, 3, 4, 5, 6, 8), numticks=30))
        axis.set_minor_formatter(ticker.FuncFormatter(lambda value, _: f"{value:g}"))
    else:
        axis.set_minor_locator(ticker.LogLocator(base=10, subs=range(2, 10) if span < 7 else (), numticks=90))
        axis.set_minor_formatter(ticker.NullFormatter())


def _figure(chart):
    from matplotlib.figure import Figure
    figure = Figure(figsize=(6.4, 4.2))
    axes = figure.add_subplot()
    handles = []
    for place, curve in enumerate(chart.curves):
        if curve.is_front:
            line, = axes.plot(curve.x, curve.y, color="#c8c8c8", linewidth=6, zorder=1, solid_capstyle="round",
                              solid_joinstyle="round")
        else:
            colour = place if curve.colour is None else curve.colour
            style = place if curve.style is None else curve.style
            line, = axes.plot(curve.x, curve.y, color=COLOURS[colour % len(COLOURS)], marker=MARKERS[style % len(MARKERS)],
                              linestyle=DASHES[style % len(DASHES)], markeredgecolor="white", markeredgewidth=0.5)
        handles.append(line)
    for axis, logarithmic, values in ((axes.xaxis, chart.log_x, [v for c in chart.curves for v in c.x]),
                                      (axes.yaxis, chart.log_y, [v for c in chart.curves for v in c.y])):
        if not logarithmic:
            axis.get_major_formatter().set_scientific(False)
            continue
        values = [v for v in values if v > 0 and math.isfinite(v)]
        if values:
            (axes.set_xscale if axis is axes.xaxis else axes.set_yscale)("log")
            _logarithmic(axis, values)
    if not chart.log_y:
        axes.set_ylim(bottom=0)
    axes.set_title(textwrap.fill(_shown(chart.title), 62), fontsize=11, loc="left")
    axes.set_xlabel(_shown(chart.x_label))
    axes.set_ylabel(_shown(chart.y_label))
    axes.tick_params(which="both", labelsize=9)
    axes.tick_params(which="minor", pad=5)  # as far from the axis as those of longer ticks
    if handles:
        axes.legend(handles, [_shown(curve.label) for curve in chart.curves], loc="center left", bbox_to_anchor=(1.02, 0.5),
                    frameon=False, fontsize=9, handlelength=3.2)
    return figure


def draw(chart, format="svg"):
    """Draws a chart and returns the bytes of the file. Raises ImportError if matplotlib is missing."""
    import matplotlib
    with matplotlib.rc_context({**matplotlib.rcParamsDefault, **_STYLE}):
        out = io.BytesIO()
        options = {"metadata": {"Date": None, "Creator": None}} if format == "svg" else {"dpi": 110}
        _figure(chart).savefig(out, format=format, bbox_inches="tight", facecolor="white", **options)
    return out.getvalue()
