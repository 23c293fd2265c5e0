"""What the tests of the pages share: bench/pages on the path, small tables of each kind, and the command."""
import pathlib
import sys

SOURCE = pathlib.Path(__file__).resolve().parents[2]
RESULTS = SOURCE / "docs/results"
sys.path.insert(0, str(SOURCE / "bench"))

#: Text that a shell, Markdown, HTML or matplotlib would take for more than text.
HOSTILE = [
    "`touch canary`", "$(touch canary)", r"$\int$", r"$\frac{", "_label", "'; touch canary; '", '"; system("touch canary")',
    "x\n!touch canary", "x\r\n| a | b |", "</text><script>alert(1)</script>", "| ![x](javascript:x) <img src=x onerror=x>",
    "[a](javascript:x)", "&lt;script&gt;", "a\\|b", "\u2028# head", "\x1b[31m", b"\xff\xfe no UTF-8",
]


def as_bytes(text):
    return text if isinstance(text, bytes) else text.encode()


def cell(words):
    """The words as the program would write them into a cell: on one line, without a comma."""
    return as_bytes(words).replace(b"\n", b" ").replace(b",", b";")


def write_table(file, facts, columns, rows):
    """@param facts, rows text or bytes"""
    lines = [b"# " + as_bytes(name) + b": " + as_bytes(value).replace(b"\n", b" ") for name, value in facts.items()]
    lines += [b",".join(as_bytes(c) for c in row) for row in (columns, *rows)]
    pathlib.Path(file).write_bytes(b"\n".join(lines) + b"\n")


def made_pages(capsys, *arguments):
    """Runs make_pages.py in this process, which spares the start of another. Returns exit code, output and errors."""
    import make_pages
    try:
        code = make_pages.main([str(argument) for argument in arguments])
    except SystemExit as end:  # argparse
        code = end.code
    return code, *capsys.readouterr()


def made_of(name):
    """The tables that a page is made of: file names in docs/results."""
    beginnings = {"performance": ["gpu_sizes", "gpu_capacity", "gpu_small", "gpu_surfels", "gpu_neighbours",
                                  "gpu_cantilever", "gpu_terms", "gpu_contact", "gpu_setup", "gpu_profile", "gpu_bin",
                                  "gpu_view"],
                  "scaling": ["gpu_ranks_", "cpu_ranks_", "gpu_sizes"],
                  "accuracy": ["accuracy", "calculix", "hard_cases_", "cpu_terms", "gpu_terms"],
                  "laws": ["laws"],
                  "contact": ["contact_examples"],
                  "cpu": ["cpu_step", "cpu_neighbours", "lammps_tlsph"]}[name]
    return sorted(f.name for f in RESULTS.glob("*.csv") if f.name.startswith(tuple(beginnings)))
