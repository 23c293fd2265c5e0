"""A page under construction."""


class Page:
    """The text and the charts of a page. `link` leads from the page to the folder of tables and charts; it is empty or
    ends with "/"."""

    def __init__(self, link):
        self.link = link
        self.charts = {}  #: file name without ".svg": chart
        self._text = ""

    def add(self, text):
        self._text += text

    def paragraph(self, text):
        self._text += text + "\n\n"

    def show(self, chart, name):
        """Adds a chart, to be drawn into `<name>.svg`, and the image that shows it. Its title is escaped text."""
        self.charts[name] = chart
        self.paragraph(f"![{chart.title}]({self.link}{name}.svg)")

    def text(self):
        return self._text.rstrip("\n") + "\n"


def measured_by(table, device="hardware"):
    """The program, device, compiler and date of a measurement. `device` is the fact that names the device."""
    compiler = "compiler" if device == "hardware" else "cuda"
    return f"{table.fact('program')} on {table.fact(device)}; {table.fact(compiler)}; {table.fact('date')}"
