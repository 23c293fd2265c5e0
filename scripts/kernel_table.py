#!/usr/bin/env python3
"""Tabulates instructions, registers and stack of the compiled production kernels.

A change that should not affect a kernel must not change its code; this script shows the differences:

    scripts/kernel_table.py build/cuda            compares with docs/results/kernels.csv
    scripts/kernel_table.py build/cuda --write    rewrites that table
    scripts/kernel_table.py build/cuda --other build/before    compares two builds

A build with tests (-DPHYXEL_TESTS=ON) is needed, whose device code is not compressed. For each kernel
the table has the number of PTX instructions and a hash of their sequence (names of instructions, without
registers and addresses), the registers of a thread, and the bytes of stack that spilled values take, both
for sm_90. Kernels that are new or gone are named, and so are those whose row differs; only differing rows
make the exit code 1. Exit code 77: another compiler than the table's, or no uncompressed device code.
"""
import argparse
import csv
import hashlib
import pathlib
import re
import struct
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
TABLE = ROOT / "docs/results/kernels.csv"
COLUMNS = ["kernel", "instructions", "sequence", "registers", "stack_bytes"]
SKIPPED = 77
REGISTER_COUNT = 0x2F  # of the attributes in .nv.info
FRAME_SIZE = 0x11


def skip(reason):
    print(f"skipped: {reason}", file=sys.stderr)
    sys.exit(SKIPPED)


def instructions(body):
    """The names of the instructions of a kernel in PTX, predicates reduced to a mark."""
    names = []
    for line in body.splitlines():
        line = line.strip()
        if not line or line[0] in ".{}$)" or line.startswith("//"):
            continue
        line = re.sub(r"^@!?%p\d+\s+", "@ ", line)
        words = line.rstrip(";").split()
        names.append(" ".join(words[:2]) if words[0] == "@" else words[0])
    return names


def ptx_kernels(data):
    """Mangled name: instructions, of all PTX that an object file holds."""
    found = {}
    for text in re.findall(rb"\.version \d+\.\d+\n.*?\.target sm_90.*?\0", data, re.DOTALL):
        ptx = text.decode("utf-8", "replace")
        for entry in re.finditer(r"\.entry (\w+)\(", ptx):
            begin = ptx.index("\n{", entry.end()) + 2
            found[entry.group(1)] = instructions(ptx[begin:end_of_block(ptx, begin)])
    return found


def end_of_block(ptx, begin):
    """The end of the block whose first character after the brace is at `begin`."""
    depth = 1
    for brace in re.finditer(r"[{}]", ptx[begin:]):
        depth += 1 if brace.group() == "{" else -1
        if depth == 0:
            return begin + brace.start()
    raise ValueError("a block in PTX has no end")


def sections_of(elf):
    """Name and bytes of each section of a 64-bit ELF image."""
    table, = struct.unpack_from("<Q", elf, 40)
    size, count, names = struct.unpack_from("<HHH", elf, 58)
    headers = [struct.unpack_from("<IIQQQQIIQQ", elf, table + k * size) for k in range(count)]
    text = headers[names][4]
    for h in headers:
        end = elf.index(b"\0", text + h[0])
        yield elf[text + h[0]:end].decode(), elf[h[4]:h[4] + h[5]] if h[1] != 8 else b"", h


def symbol_names(elf, sections):
    """The names of the symbols of an ELF image, by index."""
    strings = next((data for name, data, _ in sections if name == ".strtab"), b"")
    symbols = next((data for name, data, _ in sections if name == ".symtab"), b"")
    names = []
    for at in range(0, len(symbols), 24):
        offset, = struct.unpack_from("<I", symbols, at)
        names.append(strings[offset:strings.index(b"\0", offset)].decode())
    return names


def usage(data):
    """Mangled name: [registers, stack], of all machine code that an object file holds."""
    found = {}
    at = data.find(b"\x7fELF", 4)
    while at >= 0:
        elf = data[at:]
        machine, = struct.unpack_from("<H", elf, 18)
        if machine == 190:  # CUDA
            sections = list(sections_of(elf))
            names = symbol_names(elf, sections)
            info = next((d for name, d, _ in sections if name == ".nv.info"), b"")
            where = 0
            while where + 4 <= len(info):
                kind, attribute, size = struct.unpack_from("<BBH", info, where)
                where += 4
                if kind == 4:
                    if attribute in (REGISTER_COUNT, FRAME_SIZE):
                        symbol, value = struct.unpack_from("<II", info, where)
                        column = 0 if attribute == REGISTER_COUNT else 1
                        found.setdefault(names[symbol], [0, 0])[column] = value
                    where += size
        at = data.find(b"\x7fELF", at + 4)
    return found


def shown_names(mangled):
    """The demangled name without parameters and namespaces."""
    text = subprocess.run(["c++filt"], input="\n".join(mangled), capture_output=True, text=True, check=True).stdout
    names = []
    for name in text.splitlines():
        name = re.sub(r"^void |phyxel::|cuda::|\(anonymous namespace\)::", "", name)
        depth = 0
        for k, c in enumerate(name):
            depth += (c == "<") - (c == ">")
            if c == "(" and depth == 0:
                name = name[:k]
                break
        names.append(name)
    return names


def cached(build, name):
    """A value of CMake's cache of a build folder."""
    cache = (pathlib.Path(build) / "CMakeCache.txt").read_text()
    return re.search(rf"^{name}:\w+=(.*)$", cache, re.MULTILINE).group(1)


def rows_of(build):
    sources = pathlib.Path(cached(build, "CMAKE_HOME_DIRECTORY")) / "cuda/solver"
    objects = sorted(file for file in pathlib.Path(build).glob("cuda/CMakeFiles/phyxel_cuda.dir/solver/*.cu.o")
                     if (sources / file.stem).exists())  # no stale objects of earlier versions
    if not objects:
        sys.exit(f"{build}: has no objects of the production solver; build the target phyxel_cuda there")
    rows = {}
    for file in objects:
        data = file.read_bytes()
        kernels, used = ptx_kernels(data), usage(data)
        if not kernels:
            skip(f"{file}: no uncompressed PTX; configure with -DPHYXEL_TESTS=ON")
        for mangled, shown in zip(kernels, shown_names(kernels)):
            names = kernels[mangled]
            digest = hashlib.sha256("\n".join(names).encode()).hexdigest()[:12]
            registers, stack = used.get(mangled, ["", ""])
            rows[shown] = dict(zip(COLUMNS, map(str, [shown, len(names), digest, registers, stack])))
    return rows


def compiler_of(build):
    compiler = cached(build, "CMAKE_CUDA_COMPILER")
    text = subprocess.run([compiler, "--version"], capture_output=True, text=True, check=True).stdout
    return "nvcc " + re.search(r"V([\d.]+)", text).group(1)


def read_table():
    lines = TABLE.read_text().splitlines()
    facts = dict(line[2:].split(": ", 1) for line in lines if line.startswith("# "))
    return facts, {row["kernel"]: row for row in csv.DictReader(line for line in lines if line[0] != "#")}


def differences(before, now):
    differ = [kernel for kernel in before if kernel in now and before[kernel] != now[kernel]]
    for kernel in differ:
        changes = [f"{c} {before[kernel][c]} -> {now[kernel][c]}" for c in COLUMNS if before[kernel][c] != now[kernel][c]]
        print(f"differs: {kernel}: {', '.join(changes)}")
    for kernel in sorted(before.keys() - now.keys()):
        print(f"gone: {kernel}")
    for kernel in sorted(now.keys() - before.keys()):
        print(f"new: {kernel}: {now[kernel]['instructions']} instructions, {now[kernel]['registers']} registers")
    same = len(before.keys() & now.keys()) - len(differ)
    print(f"{same} of {len(before)} kernels are as before, {len(differ)} differ")
    return differ


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build", help="build folder of the preset cuda")
    parser.add_argument("--write", action="store_true", help="write docs/results/kernels.csv")
    parser.add_argument("--other", help="build folder to compare with, in place of the table")
    arguments = parser.parse_args()
    now, compiler = rows_of(arguments.build), compiler_of(arguments.build)
    if arguments.write:
        with TABLE.open("w", newline="") as out:
            out.write(f"# compiler: {compiler}, sm_90\n")
            table = csv.DictWriter(out, COLUMNS, lineterminator="\n")
            table.writeheader()
            table.writerows(now[kernel] for kernel in sorted(now))
        return
    if arguments.other:
        sys.exit(1 if differences(rows_of(arguments.other), now) else 0)
    facts, before = read_table()
    if facts.get("compiler") != f"{compiler}, sm_90":
        skip(f"the table is of {facts.get('compiler')}, this build of {compiler}")
    sys.exit(1 if differences(before, now) else 0)


if __name__ == "__main__":
    main()
