"""docs/gallery.md, and what examples/ says about itself: `phyxel examples` reads the same comments."""
import collections
import json
import os
import pathlib
import re

from pages.page import Page
from pages.tables import PageError, markdown_link, markdown_table, markdown_text

HEAD = """# Gallery

`phyxel run` simulates a scene and draws its pictures, with the commands below in a clone of this repository. An installed \
program carries all examples: `phyxel examples` lists them, and `phyxel examples copy dino` copies one into the folder `dino`, with \
its meshes, and prints the command that runs it. `phyxel report out/dino` makes a page in which a run can be played and turned.

This page is written by `bench/make_pages.py` from the first comment of each example. `scripts/draw_gallery.py` runs the scenes and \
draws the pictures, each one frame, by `phyxel render`; *cluster* is drawn with fewer phyxels than it has.

## Scenes"""
SCRIPTS = """## Python

[python.md](python.md) explains the module. Commands below are for copies, e.g. by `phyxel examples copy trajectory`; each script \
draws a picture, into the file that is named after it or one with the script's name."""
PROGRAMS = """## C++

Programs that link the library. Commands below build copies, e.g. by `phyxel examples copy step_loop`, against an installed phyxel."""
#: Pictures that the scripts have drawn, for docs/python.md.
PICTURES_OF_SCRIPTS = {"own_loop": "docs/pictures/python_loop.png", "ring_at_rest": "docs/pictures/python_ring.png",
                       "trajectory": "docs/pictures/python_trajectory.png"}
SHOTS = pathlib.Path(__file__).with_name("gallery_pictures.json")
LARGEST_PICTURE = 100_000  # bytes

#: An example: its name, its kind (scene, c++ or python), the sentence and the command of its first comment, and its main file.
Example = collections.namedtuple("Example", "name kind sentence command file")


def comment_of(text):
    """The first comment of a file in TOML, C++ or Python: its lines without the marks of comments."""
    found = re.match(r'"""(.*?)"""', text, re.DOTALL)
    if found:
        return found[1].split("\n")
    mark = re.compile(r"/// ?" if text.startswith("///") else r"# ?")
    lines = text.split("\n")
    end = next((k for k, line in enumerate(lines) if not mark.match(line)), len(lines))
    return [mark.sub("", line, count=1) for line in lines[:end]]


def sentence_of(lines):
    """The first sentence of a comment: up to a full stop or a question mark before a letter, or to an empty line."""
    first = lines[:lines.index("")] if "" in lines else lines
    paragraph = re.sub(r"^phyxel as a library[^:]*: ", "", " ".join(" ".join(first).split()))
    sentence = re.split(r"(?<=[.?]) (?=[A-Za-z])", paragraph)[0]
    return sentence[:1].upper() + sentence[1:]


def example_of(name, kind, file):
    """The example whose main file this is. @throws PageError if its comment has no sentence, or no command of a scene"""
    lines = comment_of(file.read_text(encoding="utf-8"))
    sentence = sentence_of(lines)
    if not re.search(r"[.?]$", sentence):
        raise PageError(f"{file}: its first comment has no sentence; allowed: one that ends in a full stop")
    command = {"c++": f"cmake -S {name} -B {name}/build && cmake --build {name}/build",
               "python": f"python3 {name}/{name}.py"}.get(kind)
    if kind == "scene":
        commands = [line.strip() for line in lines if f"phyxel run examples/{name}/scene.toml" in line]
        if not commands:
            raise PageError(f"{file}: its first comment has no command; allowed: phyxel run examples/{name}/scene.toml")
        command = commands[0]
    return Example(name, kind, sentence, command, file)


def examples_of(folder):
    """All examples of a folder, by kind and name."""
    found = [example_of(file.parent.name, "scene", file) for file in sorted(folder.glob("*/scene.toml"))]
    found += [example_of(file.parent.name, "c++", file) for file in sorted(folder.glob("*/main.cpp"))]
    found += [example_of(file.stem, "python", file) for file in sorted(folder.glob("python/*.py"))]
    return found


def picture_of(root, name):
    """The file of the picture of a scene."""
    return root / "docs/pictures/gallery" / f"{name}.png"


def check_shots(scenes, shots):
    """@throws PageError if a scene has no frame to draw, or a frame has no scene"""
    names = {example.name for example in scenes}
    for name in sorted(names ^ set(shots)):
        raise PageError(f"{SHOTS.name}: {name}: {'no frame to draw' if name in names else 'no such scene'}; "
                        "allowed: one entry for each examples/*/scene.toml")


def check_pictures(root, scenes):
    """@throws PageError if a picture is missing, large or of no scene"""
    folder = picture_of(root, "").parent
    wanted = {picture_of(root, example.name) for example in scenes}
    for file in sorted(wanted - set(folder.glob("*"))):
        raise PageError(f"{file}: no such picture; scripts/draw_gallery.py draws it")
    for file in sorted(set(folder.glob("*")) - wanted):
        raise PageError(f"{file}: no example has this picture; allowed: one for each examples/*/scene.toml")
    for file in sorted(wanted):
        if file.stat().st_size > LARGEST_PICTURE:
            raise PageError(f"{file}: {file.stat().st_size} bytes; allowed: {LARGEST_PICTURE}")


def make(root, folder):
    """The page about the examples of a source tree, for a folder."""
    def link(file):
        return markdown_link(os.path.relpath(file, folder))

    def row(example, picture=None):
        about = f"**[{example.name}]({link(example.file)})**<br>{markdown_text(example.sentence)}<br>`{example.command}`"
        return [f"![{example.name}]({link(picture)})", about] if picture else [about]

    examples = examples_of(root / "examples")
    scenes, programs, scripts = ([one for one in examples if one.kind == kind] for kind in ("scene", "c++", "python"))
    check_shots(scenes, json.loads(SHOTS.read_text(encoding="utf-8")))
    check_pictures(root, scenes)
    page = Page("")
    page.paragraph(HEAD)
    page.add(markdown_table(["", "scene"], [row(one, picture_of(root, one.name)) for one in scenes]))
    page.paragraph(SCRIPTS)
    page.add(markdown_table(["", "script"], [row(one, root / PICTURES_OF_SCRIPTS[one.name]) for one in scripts]))
    page.paragraph(PROGRAMS)
    page.add(markdown_table(["program"], [row(one) for one in programs]))
    return page
