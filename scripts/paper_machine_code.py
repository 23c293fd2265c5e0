#!/usr/bin/env python3
"""Counts the integer multiplications in the machine code of the kernels of 2008.

The source requests 24-bit products (__mul24, __umul24), as the paper does. This script compiles
cuda/paper/paper_backend.cu for one architecture, disassembles it, and counts the instructions that
the compiler has generated for them in each kernel:

    scripts/paper_machine_code.py                      to docs/results/paper/machine_code.csv
    scripts/paper_machine_code.py --check              compares with that file, writes nothing
    scripts/paper_machine_code.py --check --ptx        compares PTX only, which needs no nvdisasm
    scripts/paper_machine_code.py --arch sm_75 -o FILE

Two kernels of one line, which multiply two integers with __mul24 and with `*`, are counted for comparison.
`phyxel paper --redraw` puts the table on the page.

Needs nvcc, and nvdisasm (in the CUDA Toolkit; alone: pip install nvidia-cuda-nvdisasm). They are
looked for in $NVCC and $NVDISASM, on the path, and in /usr/local/cuda/bin. Exit code 77: one of
them is missing.
"""
import argparse
import csv
import datetime
import io
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
SOURCE = ROOT / "cuda/paper/paper_backend.cu"
TABLE = ROOT / "docs/results/paper/machine_code.csv"
NO_TOOL = 77
KERNELS = ["precalcImutableValues", "calcStrainStressA", "calcStrainStressB",
           "calcStrainStressB_csr", "integrate", "updateSurfels"]
ONE_LINE = """__global__ void with_mul24(int* product, int a, int b) { *product = __mul24(a, b); }
__global__ void with_asterisk(int* product, int a, int b) { *product = a * b; }
"""
COLUMNS = ["kernel", "precision", "in_source", "ptx_24_bit", "sass_24_bit", "sass_32_bit",
           "ptx_truncations", "sass_instructions"]


def find(variable, name):
    """Path of a tool, or exit code 77."""
    path = os.environ.get(variable) or shutil.which(name)
    if not path and pathlib.Path("/usr/local/cuda/bin", name).exists():
        path = f"/usr/local/cuda/bin/{name}"
    if not path:
        print(f"{name} was not found (on the path, in /usr/local/cuda/bin, or by ${variable})",
              file=sys.stderr)
        sys.exit(NO_TOOL)
    return path


def output_of(*command):
    """Standard output of a command; exits with its error message and code 1 if it fails."""
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, command))}\n{done.stderr}")
    return done.stdout


def compiled(nvcc, nvdisasm, source, arch, folder):
    """PTX and machine code of one source file; the latter empty without nvdisasm."""
    flags = ["-std=c++20", "-O3", f"-arch={arch}", "--expt-relaxed-constexpr", "-I", ROOT / "cuda",
             "-I", ROOT / "lib/include", "-I", ROOT / "lib"]
    ptx, cubin = folder / f"{source.stem}.ptx", folder / f"{source.stem}.cubin"
    output_of(nvcc, *flags, "-ptx", "-o", ptx, source)
    if not nvdisasm:
        return ptx.read_text(), ""
    output_of(nvcc, *flags, "-cubin", "-o", cubin, source)
    return ptx.read_text(), output_of(nvdisasm, "-c", cubin)


def by_kernel(text, begin):
    """Map from mangled names to the text of each kernel."""
    marks = list(re.finditer(begin, text, re.M))
    ends = [m.start() for m in marks[1:]] + [len(text)]
    return {m.group(1): text[m.end():end] for m, end in zip(marks, ends)}


def kernel_of(mangled):
    """(kernel, precision) of an instance that the paper's program runs; None for other instances."""
    match = re.match(r"_Z(?:N6phyxel5paper)?\d+(\w+?)(?:I([fd])((?:Lb[01]E)*)E)?(?:Evv?N|P)", mangled)
    if not match:
        return None
    name, real, flags = match.groups()
    # Green's strain and the n x n matrix, as in the measurements of section 6.
    if flags and "Lb0E" in flags:
        return None
    return name, {"f": "float", "d": "double", None: ""}[real]


def source_uses(name):
    """The number of 24-bit products in the kernel's source, without the helpers that it calls."""
    if name == "with_mul24":
        return 1
    if name == "with_asterisk":
        return 0
    text = (ROOT / "cuda/paper/kernels.cuh").read_text()
    body = re.search(r"__global__ void " + name + r"\(.*?^}", text, re.M | re.S).group(0)
    helpers = {"thread_index": 1, "load9": 1, "store9": 1, "matrix_entry": 1}
    return len(re.findall(r"__u?mul24", body)) + sum(
        n * len(re.findall(rf"\b{helper}\(", body)) for helper, n in helpers.items())


def counts(name, precision, ptx, sass):
    """One row of the table."""
    opcodes = re.findall(r"^\s+/\*[0-9a-f]{4,}\*/\s+(?:@!?U?P\w+\s+)?([A-Z][\w.]*)", sass, re.M)
    opcodes = [o for o in opcodes if o != "NOP"]
    # Some forms of IMAD move, shift or add, and do not multiply.
    idle = re.compile(r"U?IMAD\.(MOV|SHL|IADD|X\b|U32$)")
    wide = [o for o in opcodes if re.match(r"U?(IMAD|IMUL)", o) and not idle.match(o)]
    narrow = [o for o in opcodes if "24" in o or o.startswith("XMAD")]
    truncations = len(re.findall(r"and\.b32.*, 16777215;|shr\.[su]32.*, 8;", ptx))
    return [name, precision, source_uses(name), len(re.findall(r"\b(?:mul|mad)24", ptx)),
            len(narrow), len(wide), truncations, len(opcodes)]


def rows_for(nvcc, nvdisasm, arch):
    """The table's rows: two of one line, then the kernels of 2008 in float and double."""
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        one_line = folder / "one_line.cu"
        one_line.write_text(ONE_LINE)
        for source in (one_line, SOURCE):
            ptx, sass = compiled(nvcc, nvdisasm, source, arch, folder)
            of_ptx = by_kernel(ptx, r"^(?:\.visible )?\.entry (\w+)\(")
            of_sass = by_kernel(sass, r"^\.text\.(\w+):")
            for mangled, text in of_ptx.items():
                kernel = kernel_of(mangled)
                if kernel and (kernel[0] in KERNELS or source == one_line):
                    rows.append(counts(*kernel, text, of_sass.get(mangled, "")))
    order = ["with_mul24", "with_asterisk"] + KERNELS
    rows.sort(key=lambda r: (order.index(r[0]), -ord(r[1][:1] or "a")))
    if sorted({r[0] for r in rows}) != sorted(order):
        sys.exit(f"{SOURCE}: found {[r[0] for r in rows]}; allowed: each of {order}")
    return rows


def table_text(rows, facts):
    """Writes the table in the format of the program's tables."""
    text = io.StringIO()
    for key, value in facts:
        text.write(f"# {key}: {value}\n")
    csv.writer(text, lineterminator="\n").writerows([COLUMNS] + rows)
    return text.getvalue()


def check(rows, arch, columns):
    """Compares the table with these kernels. Counts depend on the compiler, so only their being zero is
    compared."""
    lines = [l for l in TABLE.read_text().splitlines() if not l.startswith("#")]
    written = {(r["kernel"], r["precision"]): r for r in csv.DictReader(lines)}
    wrong = []
    for row in rows:
        new = dict(zip(COLUMNS, row))
        old = written.pop((new["kernel"], new["precision"]), None)
        if old is None:
            wrong.append(f"{new['kernel']} {new['precision']}: not in the table")
            continue
        if int(old["in_source"]) != new["in_source"]:
            wrong.append(f"{new['kernel']}: the source asks for 24 bits {new['in_source']} times, "
                         f"{old['in_source']} in the table")
        for column in columns:
            if (int(old[column]) > 0) != (new[column] > 0):
                wrong.append(f"{new['kernel']} {new['precision']}: {column} is {new[column]}, "
                             f"{old[column]} in the table")
    wrong += [f"{k} {p}: in the table, and no kernel now" for k, p in written]
    for line in wrong:
        print(f"{TABLE}: {line}", file=sys.stderr)
    print(f"{len(rows)} kernels for {arch}: {'as' if not wrong else 'not as'} in {TABLE.name}")
    return 1 if wrong else 0


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--arch", default="sm_90")
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--ptx", action="store_true")
    parser.add_argument("-o", type=pathlib.Path, default=TABLE, metavar="FILE")
    options = parser.parse_args()
    if options.ptx and not options.check:
        parser.error("--ptx: allowed with --check")
    nvcc = find("NVCC", "nvcc")
    nvdisasm = None if options.ptx else find("NVDISASM", "nvdisasm")
    rows = rows_for(nvcc, nvdisasm, options.arch)
    if options.check:
        columns = ["ptx_24_bit", "ptx_truncations"]
        return check(rows, options.arch,
                     columns if options.ptx else columns + ["sass_24_bit", "sass_32_bit"])
    release = [l for l in output_of(nvcc, "--version").splitlines() if "release" in l][0]
    options.o.write_text(table_text(rows, [
        ("compiler", "nvcc " + release.split("release ")[1].replace(",", "")),
        ("architecture", options.arch), ("date", datetime.date.today().isoformat())]))
    print(options.o)
    return 0


if __name__ == "__main__":
    sys.exit(main())
