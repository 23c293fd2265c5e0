"""`python -m phyxel`: the command-line program, as `phyxel` in a shell."""

import os
import pathlib
import sys


def program():
    """The program that belongs to this module: beside it if pip installed both, else of its build."""
    package = pathlib.Path(__file__).resolve().parent
    for file in (package / "bin" / "phyxel", package.parents[1] / "bin" / "phyxel"):
        if os.access(file, os.X_OK) and file.is_file():
            return file
    return None


def main():
    found = program()
    if found is None:
        print("phyxel: error: this module has no program beside it; allowed: one that \"pip install\" "
              "installed, or that of a build with the target phyxel_program", file=sys.stderr)
        return 2
    os.execv(found, ["phyxel", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
