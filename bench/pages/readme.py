"""What README.md has of the tables: speeds beside LAMMPS, and errors beside CalculiX."""
from pages import calculix, cpu
from pages.tables import PageError

#: The text of each block, by the name in the comments that enclose it.
BLOCKS = {"speed": cpu.speeds_in_brief, "calculix": calculix.in_brief}


def with_blocks(readme, text, results):
    """The text of the README with new blocks. `readme` is its name, for errors."""
    for name, block in BLOCKS.items():
        begin, end = f"<!-- {name}: made by bench/make_pages.py -->\n", f"<!-- end of {name} -->"
        before, found, rest = text.partition(begin)
        _, closed, after = rest.partition(end)
        if not found or not closed:
            raise PageError(f"{readme}: has no lines \"{begin.strip()}\" and \"{end}\"; allowed: each once, in this order")
        text = before + begin + block(results) + end + after
    return text
