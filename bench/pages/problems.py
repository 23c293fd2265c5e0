"""The problems that the measurements solve, in the program's own words: problems.json, which `phyxel_studies problems`
writes. A test compares the two."""
import functools
import json
import pathlib


@functools.lru_cache
def problems():
    return json.loads((pathlib.Path(__file__).parent / "problems.json").read_text(encoding="utf-8"))
