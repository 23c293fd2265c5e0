"""A live view of a scene: the program runs it, and a browser or a notebook shows it."""

from __future__ import annotations

import os
import pathlib
import subprocess
import tempfile
from typing import Any

from ._program import program

_options = {"device": str, "precision": str, "method": str, "threads": int, "step": float,
            "unsafe_step": bool, "pace": float, "paused": bool, "port": int, "host": str,
            "out": str, "replay": str}


class View:
    """A scene that runs in the program `phyxel view` until `close`, or until Python ends.

    address: of its page, with the token that lets a browser in. In a notebook, the view shows the
    page in its cell.
    """

    def __init__(self, scene: str | os.PathLike[str] | dict[str, Any], **options: Any) -> None:
        found = program()
        if found is None:
            raise RuntimeError("phyxel.view: this module has no program beside it; allowed: one that "
                               "\"pip install\" installed, or that of a build with the target "
                               "phyxel_program")
        if isinstance(scene, dict):
            from . import to_toml
            self._folder = tempfile.TemporaryDirectory()  # as long as the view
            file = pathlib.Path(self._folder.name) / "scene.toml"
            file.write_text(to_toml(scene))
            scene = file
        words = [str(found), "view", os.fspath(scene)]
        for name, value in {"port": 0, **options}.items():
            if name not in _options:
                raise TypeError(f"phyxel.view: {name}: unknown; allowed: {', '.join(_options)}")
            flag = "--" + name.replace("_", "-")
            if _options[name] is bool:
                words += [flag] if value else []
            elif value is not None:
                words += [flag, str(value)]
        self._process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                         text=True)
        assert self._process.stdout is not None and self._process.stderr is not None
        self.address = self._process.stdout.readline().strip()
        if not self.address:
            self._process.wait()
            raise RuntimeError(self._process.stderr.read().strip())

    def close(self) -> None:
        """Ends the program."""
        if self._process.poll() is None:
            self._process.terminate()
        self._process.communicate()

    def __enter__(self) -> View:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __del__(self) -> None:
        if hasattr(self, "_process"):
            self.close()

    def __repr__(self) -> str:
        return f"<phyxel.View at {self.address}>"

    def _repr_html_(self) -> str:
        return f'<iframe src="{self.address}" width="100%" height="900" style="border:0"></iframe>'


def view(scene: str | os.PathLike[str] | dict[str, Any], **options: Any) -> View:
    """Runs a scene live, and returns its View, whose page a browser or a notebook's cell shows.

        live = phyxel.view("examples/dino/scene.toml", pace=0.5)
        print(live.address)

    scene: path of a scene file, or a dict of its keys; paths in a dict must be absolute.
    options: device, precision, method, threads, step [s], unsafe_step; pace [simulated s a second],
    paused, port (0: any that is free), host, out (folder of what is saved), replay (a saved
    session).
    Raises TypeError for another option, and RuntimeError with the program's message if it refuses
    the scene.
    """
    return View(scene, **options)
