"""Tables of measurements as pages read them."""
import pytest
from tables_of_pages import HOSTILE, as_bytes, cell, write_table

from pages.tables import PageError, markdown_link, markdown_table, markdown_text, plain, read_table


@pytest.fixture
def file(tmp_path):
    return tmp_path / "t.csv"


def test_facts_columns_and_rows_come_back(file):
    write_table(file, {"hardware": "a: b, c", "date": "2008-10-29"}, ["n", "answer"], [["1", "yes"], ["2.5e-3", ""]])
    table = read_table(file)
    assert table.facts == {"hardware": "a: b, c", "date": "2008-10-29"} and table.fact("gpu") == ""
    assert table.columns == ["n", "answer"]
    assert table.rows[1].number("n") == 2.5e-3
    assert table.find(answer="") is table.rows[1] and table.find(answer="no") is None
    assert table.values("answer") == ["yes", ""] and table.values("answer", n="1") == ["yes"]
    assert table.rows[0].get("newer") == ""


@pytest.mark.parametrize("text, message", [
    ("# date: today\na,b\n1,2\n3\n", "t.csv:4: 1 cells under 2 columns"),
    ("a,b\n1,x\n", "t.csv:2: column \"b\": \"x\" is no number"),
    ("a,b\n1,1_0\n", "t.csv:2: column \"b\": \"1_0\" is no number"),
    ("a,b\n1,\n", "t.csv:2: column \"b\": \"\" is no number"),
    ("a,c\n1,2\n", "t.csv: no column \"b\"; there are: a, c"),
    ("a,b,b\n1,2,3\n", "t.csv: column \"b\" stands there twice; allowed: once"),
    ("a,b\n", "t.csv: has no rows; allowed: a table of a measurement that ended"),
    ("", "t.csv: has no rows"),
])
def test_damage_is_named_with_its_file_line_and_column(file, text, message):
    file.write_text(text)
    with pytest.raises(PageError) as error:
        read_table(file).rows[0].number("b")
    assert message in str(error.value)


def test_what_a_number_must_be_is_said(file):
    file.write_text("a\n0\ninf\n-1\n")
    table = read_table(file)
    assert table.rows[1].number("a") == float("inf")
    for row, found in zip(table.rows, ("0", "inf", "-1")):
        with pytest.raises(PageError, match=rf"t.csv:\d: column \"a\": {found}: allowed > 0"):
            row.positive("a")
    with pytest.raises(PageError, match="missing.csv: no such file; allowed: a table"):
        read_table(file.parent / "missing.csv")


@pytest.mark.parametrize("words", HOSTILE)
def test_cells_and_facts_are_text(file, words):
    """The row of a table has as many cells as its head, whatever stands in them; charts get what was written."""
    write_table(file, {"program": words}, ["a", "b"], [[cell(words), "1"]])
    table = read_table(file)
    text = markdown_table(["a", "b"], [[table.rows[0]["a"], table.fact("program")]])
    lines = text.split("\n")
    assert len(lines) == 5 and len(text.splitlines()) == 4
    assert lines[2].count("|") == 3
    for markup in ("<", ">", "`", "[", "]", "\\", "$", "\x1b", "\x7f"):
        assert markup not in lines[2]
    written = cell(words).decode(errors="replace")
    assert plain(table.rows[0]["a"]) == "".join(c if c.isprintable() or c == "\ufffd" else " " for c in written)


@pytest.mark.parametrize("words", ["1.5e-3", "nodes, α = 0.3", "dino", "", "8.1%", "ν_x * 2 - 1"])
def test_numbers_and_plain_words_stay_as_they_are(words):
    assert markdown_text(words) == words


def test_escapes_and_links_are_as_written_here():
    assert markdown_text("a|<b>`[\n") == "a&#124;&#60;b&#62;&#96;&#91; "
    assert markdown_text("$x$ &#36;") == "&#36;x&#36; &#38;#36;"
    assert plain(markdown_text("&#36; $")) == "&#36; $"
    assert markdown_link("a b/(c)`.svg") == "a%20b/%28c%29%60.svg"
    assert markdown_link("ü\n") == "%C3%BC%0A"
    assert as_bytes("a") == b"a"
