"""Where the command-line program of this module is."""

from __future__ import annotations

import os
import pathlib


def program() -> pathlib.Path | None:
    """The program that belongs to this module: beside it if pip installed both, else of its build."""
    package = pathlib.Path(__file__).resolve().parent
    for file in (package / "bin" / "phyxel", package.parents[1] / "bin" / "phyxel"):
        if os.access(file, os.X_OK) and file.is_file():
            return file
    return None
