#!/usr/bin/env python3
"""Draws the pictures of docs/gallery.md: runs the scenes of examples/ and draws one frame of each by `phyxel render`.

    scripts/draw_gallery.py build/cpu/bin/phyxel                     all scenes, in about ten minutes
    scripts/draw_gallery.py build/cpu/bin/phyxel dice clap           these alone
    scripts/draw_gallery.py build/cpu/bin/phyxel --runs /tmp/runs    keeps the trajectories, and draws those that are there

Frames, views and colours are in bench/pages/gallery_pictures.json: `frame` counts from 0, or from the end if it is negative;
`options` are those of `phyxel render`; `replace` changes the text of a copy of the scene, which is drawn in its place. Then
`bench/make_pages.py gallery` makes the page.
"""
import argparse
import json
import pathlib
import shutil
import subprocess
import sys
import tempfile

sys.dont_write_bytecode = True
ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "bench"))
from pages import gallery  # noqa: E402
from pages.tables import PageError  # noqa: E402

SIZE = ["--width", "400", "--height", "300"]


def done(command, folder=ROOT):
    """Runs a command in a folder. @throws PageError with the last line of its messages"""
    finished = subprocess.run([str(word) for word in command], cwd=folder, capture_output=True, text=True)
    if finished.returncode != 0:
        raise PageError((finished.stderr.splitlines() or [f"{command[0]}: exit code {finished.returncode}"])[-1])
    return finished.stdout


def scene_of(example, shot, folder):
    """The scene to draw: that of the example, or a changed copy beside a copy of its meshes."""
    if not shot.get("replace"):
        return example.file
    copy = folder / f"{example.name}-changed"
    shutil.copytree(example.file.parent, copy, dirs_exist_ok=True)
    text = example.file.read_text(encoding="utf-8")
    for old, new in shot["replace"].items():
        if text.count(old) != 1:
            raise PageError(f"{example.file}: \"{old}\" is there {text.count(old)} times; allowed: once")
        text = text.replace(old, new)
    (copy / "scene.toml").write_text(text, encoding="utf-8")
    return copy / "scene.toml"


def draw(program, example, shot, runs):
    """Runs an example unless its trajectory is there, and draws its picture."""
    scene, trajectory = scene_of(example, shot, runs), runs / example.name
    if not (trajectory / "run.json").exists():
        done([program, "run", scene, "--out", trajectory, "--no-pictures", "--force", "--quiet"])
    with tempfile.TemporaryDirectory() as folder:
        drawn = json.loads(done([program, "render", trajectory, "--frames", str(shot["frame"]), *SIZE, *shot.get("options", []),
                                 "--scene-folder", scene.parent, "--out", folder, "--json"]))
        picture = gallery.picture_of(ROOT, example.name)
        picture.parent.mkdir(exist_ok=True)
        shutil.copyfile(drawn["pictures"][0], picture)
    return picture


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=pathlib.Path, help="phyxel")
    parser.add_argument("names", nargs="*", metavar="name", help="all scenes, if none is named")
    parser.add_argument("--runs", type=pathlib.Path, help="folder in which trajectories are kept and looked for")
    options = parser.parse_args(arguments)
    shots = json.loads(gallery.SHOTS.read_text(encoding="utf-8"))
    unknown = [name for name in options.names if name not in shots]
    if unknown:
        parser.error(f"name {unknown[0]}: unknown; allowed: {', '.join(shots)}")
    try:
        scenes = [example for example in gallery.examples_of(ROOT / "examples") if example.kind == "scene"]
        gallery.check_shots(scenes, shots)
        with tempfile.TemporaryDirectory() as temporary:
            runs = (options.runs or pathlib.Path(temporary)).resolve()
            runs.mkdir(parents=True, exist_ok=True)
            for example in scenes:
                if not options.names or example.name in options.names:
                    picture = draw(options.program.resolve(), example, shots[example.name], runs)
                    print(f"{picture.relative_to(ROOT)}: {picture.stat().st_size / 1000:.0f} kB", flush=True)
    except (PageError, OSError) as error:
        print(f"draw_gallery.py: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
