"""Reads the CSV tables that the programs write, and writes Markdown tables.

A CSV file has facts ("# name: value"), a line of column names, then rows. Commas separate cells; no cell contains one.
Cells and facts are untrusted text: the reader escapes them for Markdown, so a page can insert them as they are. `plain`
removes the escapes from text that goes into a chart.
"""
import math
import pathlib
import re
import urllib.parse

_MARKUP = re.compile(r"[<>&|`\[\]\\$]")
_ESCAPE = re.compile(r"&#(\d+);")
_NUMBER = re.compile(r"-?(?:\d+\.?\d*(?:[eE][+-]?\d+)?|\.\d+(?:[eE][+-]?\d+)?|inf|nan)")


class PageError(Exception):
    """A table is missing or damaged. The message names the file, the fault and what is allowed."""


def on_one_line(text):
    """Replaces control characters and line separators by spaces."""
    return re.sub(r"[\x00-\x1f\x7f-\x9f\u2028\u2029]", " ", text)


def markdown_text(text):
    """Escapes the text: one line without Markdown markup, HTML elements or formulas."""
    return _MARKUP.sub(lambda found: f"&#{ord(found.group())};", on_one_line(text))


def plain(text):
    """Reverses the escapes of `markdown_text`; the result stays on one line."""
    return _ESCAPE.sub(lambda found: chr(int(found.group(1))), text)


def markdown_link(path):
    """A relative path as the address of a Markdown link: all characters but letters, digits and "-._~/" are encoded."""
    return urllib.parse.quote(pathlib.PurePath(path).as_posix().encode(errors="surrogateescape"), safe="-._~/")


def markdown_table(head, rows):
    """A Markdown table, followed by an empty line."""
    lines = ["| " + " | ".join(head) + " |", "|" + " --- |" * len(head)]
    lines += ["| " + " | ".join(str(cell) for cell in row) + " |" for row in rows]
    return "\n".join(lines) + "\n\n"


class Row:
    """A table row: `row["phyxels"]` is text, `row.number("phyxels")` a number. `place` is its file and line, for errors."""

    def __init__(self, table, place, cells):
        self.table, self.place, self._cells = table, place, cells

    def __getitem__(self, column):
        return self._cells[self.table.index(column)]

    def number(self, column):
        """The cell as a float, which may be inf or nan."""
        text = self[column]
        if not _NUMBER.fullmatch(text):
            raise PageError(f"{self.place}: column \"{column}\": \"{plain(text)}\" is no number")
        return float(text)

    def positive(self, column):
        """The cell as a finite float above zero."""
        value = self.number(column)
        if not (value > 0 and math.isfinite(value)):
            raise PageError(f"{self.place}: column \"{column}\": {self[column]}: allowed > 0")
        return value

    def matches(self, match):
        return all(self[column] == value for column, value in match.items())

    def get(self, column):
        """The cell; "" if the table lacks the column, as old tables do."""
        return self[column] if column in self.table.columns else ""


class Table:
    """A table in memory. `rows` are pairs of a place (file and line) and a list of cells."""

    def __init__(self, file, facts, columns, rows):
        self.file, self.facts, self.columns = file, facts, columns
        self.rows = [Row(self, place, cells) for place, cells in rows]

    def index(self, column):
        try:
            return self.columns.index(column)
        except ValueError:
            raise PageError(f"{self.file}: no column \"{column}\"; there are: {', '.join(self.columns)}") from None

    def fact(self, name):
        """The value of a fact; "" if the table lacks it."""
        return self.facts.get(name, "")

    def where(self, **match):
        """All rows whose cells equal the given values, by column."""
        for column in match:
            self.index(column)
        return [row for row in self.rows if row.matches(match)]

    def find(self, **match):
        """The first row whose cells equal the given values; None if there is none."""
        return next(iter(self.where(**match)), None)

    def values(self, column, **match):
        """The distinct cells of a column among matching rows, in order of appearance."""
        self.index(column)
        return list(dict.fromkeys(row[column] for row in self.where(**match)))


def read_table(file):
    """Reads a CSV file. Raises PageError if it is missing, damaged or without rows."""
    file = pathlib.Path(file)
    try:
        text = file.read_bytes().decode(errors="replace")
    except FileNotFoundError:
        raise PageError(f"{file}: no such file; allowed: a table of measurements") from None
    except OSError as error:
        raise PageError(f"{file}: cannot be read: {error.strerror}") from None
    facts, columns, rows = {}, None, []
    for line, content in enumerate(text.split("\n"), 1):
        if content.startswith("# "):
            name, colon, value = content[2:].partition(": ")
            if colon:
                facts.setdefault(name, markdown_text(value))
        elif columns is None:
            columns = [markdown_text(name) for name in content.split(",")]
        elif content:
            cells = [markdown_text(cell) for cell in content.split(",")]
            if len(cells) != len(columns):
                raise PageError(f"{file}:{line}: {len(cells)} cells under {len(columns)} columns")
            rows.append((f"{file}:{line}", cells))
    columns = columns or []
    if not rows:
        raise PageError(f"{file}: has no rows; allowed: a table of a measurement that ended, or none")
    twice = [name for name in columns if columns.count(name) > 1]
    if twice:
        raise PageError(f"{file}: column \"{twice[0]}\" stands there twice; allowed: once")
    return Table(file, facts, columns, rows)


def read_if_there(file):
    """Reads a CSV file; None if it does not exist."""
    return read_table(file) if pathlib.Path(file).exists() else None
