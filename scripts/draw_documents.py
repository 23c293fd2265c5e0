#!/usr/bin/env python3
"""Draws the pictures of README.md and docs/tutorial.md: docs/pictures/{dino,report,tutorial}.png.

    scripts/draw_documents.py build/cpu/bin/phyxel               all of them, in a minute
    scripts/draw_documents.py build/cpu/bin/phyxel tutorial      this one alone

dino: the example at three times, by `phyxel render`; report: its page in headless Chromium; tutorial: the ring of the
tutorial's own scene and commands at four times. Needs ffmpeg, which puts pictures side by side, and Chromium.
"""
import argparse
import pathlib
import re
import shutil
import sys
import tempfile

from draw_gallery import PageError, done

ROOT = pathlib.Path(__file__).resolve().parent.parent
PICTURES = ROOT / "docs/pictures"


def run_of_dino(program, folder):
    """The run of the example, made once."""
    run = folder / "dino"
    if not (run / "run.json").exists():
        done([program, "run", ROOT / "examples/dino/scene.toml", "--out", run, "--no-pictures", "--quiet"], folder)
    return run


def side_by_side(program, run, frames, options, out):
    """Draws frames of a run, the first one on the left."""
    folder = run / "drawn"
    done([program, "render", run, "--frames", ",".join(map(str, frames)), *options, "--out", folder], run)
    inputs = [word for picture in sorted(folder.glob("*.png")) for word in ("-i", picture)]
    done(["ffmpeg", "-loglevel", "error", "-y", *inputs, "-filter_complex", f"hstack=inputs={len(frames)}", out], run)


def draw_dino(program, folder, out):
    """The dino at rest, and swinging."""
    side_by_side(program, run_of_dino(program, folder), (0, 12, 30), ["--width", "420", "--height", "354"], out)


def draw_report(program, folder, out):
    """The page of the dino's run, as it opens, coloured by stress."""
    page = folder / "report.html"
    done([program, "report", run_of_dino(program, folder), "-o", page, "--force"], folder)
    done(["chromium", "--headless=new", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--hide-scrollbars",
          "--window-size=1000,960", "--virtual-time-budget=20000", f"--user-data-dir={folder / 'chromium'}", f"--screenshot={out}",
          page.as_uri() + "#t=1.2&colours=stress%20(von%20Mises)"], folder)


def draw_tutorial(program, folder, out):
    """The ring of the tutorial, by its scene and its commands."""
    text = (ROOT / "docs/tutorial.md").read_text(encoding="utf-8")
    scene = re.search(r"cat > ring.toml <<'END'\n(.*?)\nEND\n", text, re.DOTALL)
    sample = re.search(r"^phyxel (sample ring.obj .*)$", text, re.MULTILINE)
    if not scene or not sample:
        raise PageError("docs/tutorial.md: no scene ring.toml, or no \"phyxel sample ring.obj\"; allowed: both")
    shutil.copy(ROOT / "examples/mesh/ring.obj", folder)
    (folder / "ring.toml").write_text(scene[1] + "\n", encoding="utf-8")
    done([program, *sample[1].split()], folder)
    done([program, "run", "ring.toml", "--no-pictures", "--quiet"], folder)
    side_by_side(program, folder / "out/ring", (0, 5, 10, 25), ["--width", "400", "--height", "320"], out)


DRAWINGS = {"dino": draw_dino, "report": draw_report, "tutorial": draw_tutorial}


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=pathlib.Path, help="phyxel")
    parser.add_argument("names", nargs="*", metavar="name", help=f"{', '.join(DRAWINGS)}; all, if none is named")
    options = parser.parse_args(arguments)
    unknown = [name for name in options.names if name not in DRAWINGS]
    if unknown:
        parser.error(f"name {unknown[0]}: unknown; allowed: {', '.join(DRAWINGS)}")
    try:
        with tempfile.TemporaryDirectory() as folder:
            for name in options.names or DRAWINGS:
                drawn = pathlib.Path(folder) / f"{name}.png"
                DRAWINGS[name](options.program.resolve(), pathlib.Path(folder), drawn)
                shutil.copyfile(drawn, PICTURES / drawn.name)
                print(f"docs/pictures/{drawn.name}: {drawn.stat().st_size / 1000:.0f} kB", flush=True)
    except (PageError, OSError) as error:
        print(f"draw_documents.py: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
