#!/usr/bin/env python3
"""Finds source files above 500 lines and functions above 80 lines.

    scripts/sizes.py [FILE...]       default: all C++ and CUDA sources and Python scripts that git tracks

A table or a straight formula may be longer: LONG lists such functions. Sources must be formatted by clang-format. The exit
code is 1 if there is a finding.
"""
import ast
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
MOST_OF_FILE, MOST_OF_FUNCTION = 500, 80
#: Functions that are tables: one entry of the list after the other.
LONG = {"apps/python/simulation.cpp": {"add_simulation"},
        "lib/scene/scene_keys.cpp": {"body_keys"},
        "tests/lib/files/files_test.cpp": {"TEST_F"},
        "tests/lib/mesh/mesh_malformed_test.cpp": {"bad_files"},
        "tests/lib/scene/scene_refusal_test.cpp": {"malformed"}}
#: Preprocessor lines, comments, strings and characters, which may contain braces.
SKIPPED = re.compile(r'(?m:^[ \t]*#(?:\\\n|[^\n])*)|//[^\n]*|/\*.*?\*/|R"(\w*)\(.*?\)\1"|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])*\'', re.DOTALL)
NOT_FUNCTIONS = re.compile(r"(template <.*> *)?(class|struct|namespace|enum|union|if|for|while|switch|else|do)\b")


def blanked(text):
    """The code alone: everything in SKIPPED is replaced by spaces, so that positions stay."""
    return SKIPPED.sub(lambda match: re.sub(r"[^\n]", " ", match[0]), text)


def functions_of_cpp(text):
    """Yields name, first line and number of lines of each function with a body."""
    code = blanked(text)
    opened = []
    for match in re.finditer(r"[{}]", code):
        if match[0] == "{":
            begin = max(code.rfind(mark, 0, match.start()) for mark in ";{}") + 1
            opened.append((match.start(), " ".join(code[begin:match.start()].split())))
        elif opened:
            at, head = opened.pop()
            head = re.sub(r"^(public|private|protected): |__launch_bounds__\([^()]*\)", "", head)
            name = re.search(r"([\w~]+) ?\(", re.sub(r"^template <[^()]*?> (?=\w)", "", head))
            if name and not NOT_FUNCTIONS.match(head):
                yield name[1], code.count("\n", 0, at) + 1, code.count("\n", at, match.start()) + 1


def functions_of_python(text):
    """Yields name, first line and number of lines of each function."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef):
            yield node.name, node.lineno, node.end_lineno - node.lineno + 1


def findings(name, text):
    """Yields a message for a file, and for each of its functions, that is too long."""
    lines = text.count("\n")
    if lines > MOST_OF_FILE:
        yield f"{name}: {lines} lines; allowed: {MOST_OF_FILE}"
    for function, line, length in (functions_of_python if name.endswith(".py") else functions_of_cpp)(text):
        if length > MOST_OF_FUNCTION and function not in LONG.get(name, ()):
            yield f"{name}:{line}: {function}: {length} lines; allowed: {MOST_OF_FUNCTION}"


def main():
    names = sys.argv[1:] or subprocess.run(["git", "-C", ROOT, "ls-files", "*.cpp", "*.hpp", "*.cu", "*.cuh", "*.py"],
                                           check=True, capture_output=True, text=True).stdout.splitlines()
    files = [ROOT / name for name in names]
    found = [message for file in files if file.exists()
             for message in findings(str(file.relative_to(ROOT)), file.read_text(encoding="utf-8"))]
    print("\n".join(found) or f"{len(files)} files: no file and no function is too long")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main())
