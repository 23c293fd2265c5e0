#!/usr/bin/env python3
"""Writes the type stubs of the Python module's compiled half, apps/python/phyxel/_phyxel.pyi, from its docstrings.

    PYTHONPATH=build/cpu/python scripts/make_stubs.py              writes the stubs
    PYTHONPATH=build/cpu/python scripts/make_stubs.py --check      writes nothing; fails if names or parameters differ

pybind11 knows the names of parameters and their defaults, but arrays only as `object` or `numpy.ndarray`: PARAMETERS and
RESULTS say what these are. --check compares names, parameters and defaults alone, since the spelling of types differs between
versions of pybind11.
"""
import argparse
import ast
import importlib
import pathlib
import re
import sys

STUBS = pathlib.Path(__file__).resolve().parent.parent / "apps/python/phyxel/_phyxel.pyi"
HEAD = '''"""Types of phyxel's compiled half: written by scripts/make_stubs.py."""

import os
from collections.abc import Callable, Mapping
from typing import Any

from numpy.typing import ArrayLike, NDArray

Path = str | os.PathLike[str]
Mesh = Path | tuple[ArrayLike, ArrayLike]
Progress = Callable[[str, float], object] | None
'''
#: Types of parameters that are objects to pybind11, by their names; others are ArrayLike.
PARAMETERS = {"mesh": "Mesh", "progress": "Progress", "surface": "tuple[ArrayLike, ArrayLike]",
              "history": "Mapping[str, ArrayLike]"}
#: Types of results that are dicts, lists and tuples to pybind11, by the names of functions.
RESULTS = {"regions": "dict[str, NDArray[Any]]", "fields": "dict[str, NDArray[Any]]", "history": "dict[str, NDArray[Any]]",
           "at": "dict[str, NDArray[Any]]", "probes": "dict[str, dict[str, NDArray[Any]]]", "memory": "dict[str, int]",
           "surface": "tuple[NDArray[Any], NDArray[Any]]", "neighbours": "tuple[NDArray[Any], NDArray[Any]]",
           "read_mesh": "tuple[NDArray[Any], NDArray[Any]]", "body_colour": "tuple[float, float, float]"}


def plain_type(text):
    """A type as pybind11 writes it, in the words of the stubs."""
    text = re.sub(r"(?:numpy\.)?ndarray(?:\[[^\]]*\])?", "NDArray[Any]", text.replace("phyxel._phyxel.", ""))
    text = re.sub(r"Optional\[(.*)\]$", r"\1 | None", text)
    for old, new in (("Dict", "dict"), ("List", "list"), ("Tuple", "tuple"), ("os.PathLike", "Path")):
        text = re.sub(rf"\b{old}\b", new, text)
    return {"dict": "dict[str, Any]", "list": "list[dict[str, Any]]", "tuple": "tuple[Any, ...]"}.get(text, text)


def signature_of(doc):
    """The arguments and the result of a function, of the first line of its docstring."""
    head = re.sub(r"\bos\.PathLike\b", "os.PathLike", doc.split("\n")[0])
    definition = ast.parse(f"def {head}: ...").body[0]
    return definition.args, ast.unparse(definition.returns)


def parameter(argument, default):
    kind = plain_type(ast.unparse(argument.annotation)) if argument.annotation else "object"
    written = ast.unparse(default) if default is not None else None
    if kind == "object":
        kind = PARAMETERS.get(argument.arg, "ArrayLike")
        kind += " | None" if written == "None" and kind != "Progress" else ""
    if argument.arg == "grading":
        kind = "Mapping[str, Any] | None"
    return f"{argument.arg}: {kind}" + (f" = {written}" if written is not None else "")


def function_stub(name, doc, indent=""):
    arguments, result = signature_of(doc)
    positional = arguments.args
    defaults = [None] * (len(positional) - len(arguments.defaults)) + arguments.defaults
    words = ["self" if one.arg == "self" else parameter(one, default) for one, default in zip(positional, defaults)]
    if arguments.kwonlyargs:
        words += ["*", *map(parameter, arguments.kwonlyargs, arguments.kw_defaults)]
    result = RESULTS.get(name, plain_type(result))
    text = "\n".join(doc.split("\n")[1:]).strip()
    return f"{indent}def {name}({', '.join(words)}) -> {result}:" + documentation(text, indent + "    ")


def documentation(text, indent):
    """A docstring in a body, or "..." if there is none."""
    if not text:
        return " ...\n"
    text = text.replace("\\", "\\\\").replace("\n", f"\n{indent}").replace(f"\n{indent}\n", "\n\n")
    return f"\n{indent}\"\"\"{text}\"\"\"\n"


def property_stub(name, value):
    _, result = signature_of(f"{name}{value.fget.__doc__}")
    result = RESULTS.get(name, plain_type(result))
    stub = f"    @property\n    def {name}(self) -> {result}:" + documentation((value.__doc__ or "").strip(), " " * 8)
    if value.fset:
        stub += f"    @{name}.setter\n    def {name}(self, value: ArrayLike | None) -> None: ...\n"
    return stub


def members_of(kind):
    """The members of a class that stubs have: public ones, the constructor and the length."""
    return {name: value for name, value in vars(kind).items()
            if not name.startswith("_") or name == "__len__" or (name == "__init__" and "self" in (value.__doc__ or "").split("\n")[0]
                                                                 and "__init__(" in value.__doc__)}


def class_stub(kind):
    bases = [base.__name__ for base in kind.__bases__ if base.__name__ not in ("object", "pybind11_object")]
    stub = f"class {kind.__name__}" + (f"({', '.join(bases)})" if bases else "") + ":"
    if issubclass(kind, Exception):
        return stub + " ...\n"
    stub += documentation((kind.__doc__ or "").strip(), "    ").replace(" ...\n", "\n")
    for name, value in members_of(kind).items():
        stub += property_stub(name, value) if isinstance(value, property) else function_stub(name, value.__doc__, "    ")
    return stub


def public_of(module):
    """The public names of the module, exceptions first, whose bases come before them."""
    names = {name: value for name, value in vars(module).items() if not name.startswith("_") and name != "pybind11_version"}
    return dict(sorted(names.items(), key=lambda one: (not (isinstance(one[1], type) and issubclass(one[1], Exception)),
                                                       len(getattr(one[1], "__mro__", "")) if isinstance(one[1], type) else 99, one[0])))


def stubs_of(module):
    parts = []
    for name, value in public_of(module).items():
        if isinstance(value, type):
            parts.append(class_stub(value))
        elif callable(value):
            parts.append(function_stub(name, value.__doc__))
        else:
            parts.append(f"{name}: {type(value).__name__}\n")
    return HEAD + "\n" + "\n".join(parts)


def shape_of(text):
    """Names of stubs, with the parameters and the defaults of functions: {"Class.name": "arguments"}."""
    found = {}

    def add(prefix, body):
        for node in body:
            if isinstance(node, ast.ClassDef):
                found[node.name] = ", ".join(map(ast.unparse, node.bases))
                add(node.name + ".", node.body)
            elif isinstance(node, ast.FunctionDef):
                for argument in node.args.args + node.args.kwonlyargs:
                    argument.annotation = None
                setter = any(isinstance(one, ast.Attribute) for one in node.decorator_list)
                found[prefix + node.name + (" setter" if setter else "")] = f"({ast.unparse(node.args)})"
            elif isinstance(node, ast.AnnAssign):
                found[prefix + node.target.id] = ""

    add("", ast.parse(text).body)
    return found


def differences(text, module):
    """Describes how stubs and module differ, one line each."""
    written, own = shape_of(text), shape_of(stubs_of(module))
    lines = [f"{name}{own[name]}: not in the stubs" for name in own.keys() - written.keys()]
    lines += [f"{name}{written[name]}: not in the module" for name in written.keys() - own.keys()]
    lines += [f"{name}{written[name]}: the module has {own[name]}" for name in own.keys() & written.keys() if own[name] != written[name]]
    return sorted(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="write nothing; exit code 1 if stubs and module differ")
    options = parser.parse_args()
    module = importlib.import_module("phyxel._phyxel")
    if not options.check:
        STUBS.write_text(stubs_of(module), encoding="utf-8")
        return 0
    found = differences(STUBS.read_text(encoding="utf-8"), module)
    print("\n".join(found))
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
