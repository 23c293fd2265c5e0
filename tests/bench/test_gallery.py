"""docs/gallery.md and `phyxel examples`, which read the same comments."""
import json
import os
import shutil
import subprocess
import sys

import pytest
from tables_of_pages import SOURCE

from pages import gallery
from pages.tables import PageError

TEXTS = {"a/scene.toml": "# A ball of Farias et al. 2008 falls. It bounces.\n#\n#   phyxel run examples/a/scene.toml\ntitle = \"A\"\n",
         "b/main.cpp": "/// phyxel as a library on ranks: a block [of jelly]\n/// falls.\n\n#include <cstdio>\n",
         "python/c.py": "\"\"\"Where is it? Here.\n\n    python3 c.py\n\"\"\"\n"}


@pytest.fixture
def tree(tmp_path, monkeypatch):
    """A source tree with an example of each kind."""
    for name, text in TEXTS.items():
        file = tmp_path / "examples" / name
        file.parent.mkdir(parents=True)
        file.write_text(text)
    picture = gallery.picture_of(tmp_path, "a")
    picture.parent.mkdir(parents=True)
    picture.write_bytes(b"small")
    shots = tmp_path / "shots.json"
    shots.write_text('{"a": {"frame": -1}}')
    monkeypatch.setattr(gallery, "SHOTS", shots)
    monkeypatch.setattr(gallery, "PICTURES_OF_SCRIPTS", {"c": "docs/pictures/c.png"})
    return tmp_path


def test_the_program_lists_what_the_gallery_shows():
    listed = subprocess.run([os.environ["PHYXEL_PROGRAM"], "examples", "--json"], capture_output=True, text=True, check=True)
    of_program = {(one["name"], one["kind"]): one for one in json.loads(listed.stdout)["examples"]}
    of_page = {(one.name, one.kind): one for one in gallery.examples_of(SOURCE / "examples")}
    assert of_program.keys() == of_page.keys() and len(of_page) > 30
    for key, one in of_program.items():
        assert one["sentence"] == of_page[key].sentence
        assert one["command"] == of_page[key].command.replace("examples/", "")


def test_an_example_has_its_picture_its_sentence_and_its_command(tree):
    text = gallery.make(tree, tree / "docs").text()
    assert ("| ![a](pictures/gallery/a.png) | **[a](../examples/a/scene.toml)**<br>A ball of Farias et al. 2008 falls.<br>"
            "`phyxel run examples/a/scene.toml` |") in text
    assert ("| **[b](../examples/b/main.cpp)**<br>A block &#91;of jelly&#93; falls.<br>"
            "`cmake -S b -B b/build && cmake --build b/build` |") in text
    assert "| ![c](pictures/c.png) | **[c](../examples/python/c.py)**<br>Where is it?<br>`python3 c/c.py` |" in text


@pytest.mark.parametrize("file, content, words", [
    ("examples/a/scene.toml", "title = \"A\"\n", "scene.toml: its first comment has no sentence"),
    ("examples/a/scene.toml", "# A ball falls.\n", "scene.toml: its first comment has no command; allowed: phyxel run examples/a/"),
    ("examples/d/scene.toml", TEXTS["a/scene.toml"].replace("/a/", "/d/"), "shots.json: d: no frame to draw"),
    ("shots.json", '{"a": {}, "e": {}}', "shots.json: e: no such scene"),
    ("docs/pictures/gallery/a.png", None, "a.png: no such picture; scripts/draw_gallery.py draws it"),
    ("docs/pictures/gallery/a.png", b"x" * 100_001, "a.png: 100001 bytes; allowed: 100000"),
    ("docs/pictures/gallery/e.png", b"x", "e.png: no example has this picture"),
])
def test_an_example_without_one_of_these_is_refused(tree, file, content, words):
    file = tree / file
    file.parent.mkdir(exist_ok=True)
    if content is None:
        file.unlink()
    else:
        file.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(PageError) as error:
        gallery.make(tree, tree / "docs")
    assert words in str(error.value)


def test_a_picture_is_drawn_anew(tmp_path):
    """In a copy of what pictures are made of. Pixels may differ between machines, the size may not."""
    for part in ("scripts/draw_gallery.py", "bench/pages", "examples"):
        (tmp_path / part).parent.mkdir(parents=True, exist_ok=True)
        copy = shutil.copytree if (SOURCE / part).is_dir() else shutil.copy
        copy(SOURCE / part, tmp_path / part)
    script = [sys.executable, "-B", tmp_path / "scripts/draw_gallery.py", os.environ["PHYXEL_PROGRAM"]]
    (tmp_path / "docs/pictures").mkdir(parents=True)
    done = subprocess.run([*script, "wooden_beam"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    picture = gallery.picture_of(tmp_path, "wooden_beam").read_bytes()
    assert picture[:4] == b"\x89PNG" and picture[16:24] == bytes([0, 0, 1, 144, 0, 0, 1, 44])  # 400 by 300 pixels
    done = subprocess.run([*script, "wooden_bean"], capture_output=True, text=True)
    assert done.returncode == 2 and "name wooden_bean: unknown; allowed: alien_head" in done.stderr
