"""`python -m phyxel`: the command-line program, as `phyxel` in a shell."""

import os
import sys

from phyxel._program import program


def main():
    found = program()
    if found is None:
        print("phyxel: error: this module has no program beside it; allowed: one that \"pip install\" "
              "installed, or that of a build with the target phyxel_program", file=sys.stderr)
        return 2
    os.execv(found, ["phyxel", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
