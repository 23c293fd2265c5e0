"""A page while it is made: its text and its charts."""


class Page:
    """@param link from the page to the folder of tables, where its charts lie, too; ends with "/" unless empty"""

    def __init__(self, link):
        self.link = link
        self.charts = {}  #: file name without ".svg": chart
        self._text = ""

    def add(self, text):
        self._text += text

    def paragraph(self, text):
        self._text += text + "\n\n"

    def show(self, chart, name):
        """Draws a chart into `<name>.svg` and shows it here. @param chart its title is text from outside"""
        self.charts[name] = chart
        self.paragraph(f"![{chart.title}]({self.link}{name}.svg)")

    def text(self):
        return self._text.rstrip("\n") + "\n"


def measured_by(table, device="hardware"):
    """By what, on what and when a table was measured."""
    compiler = "compiler" if device == "hardware" else "cuda"
    return f"{table.fact('program')} on {table.fact(device)}; {table.fact(compiler)}; {table.fact('date')}"
