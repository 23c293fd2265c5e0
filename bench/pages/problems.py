"""Descriptions of the measured problems. They come from the program: `phyxel_studies problems` writes problems.json, and a
test compares the two."""
import functools
import json
import pathlib


@functools.lru_cache
def problems():
    """The content of problems.json."""
    return json.loads((pathlib.Path(__file__).parent / "problems.json").read_text(encoding="utf-8"))
