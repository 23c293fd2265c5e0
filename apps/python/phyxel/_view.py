"""A live view of a scene: the program runs it, and a browser or a notebook shows it."""

from __future__ import annotations

import os
import pathlib
import subprocess
import tempfile
import weakref
from typing import TYPE_CHECKING, Any

from ._program import program

if TYPE_CHECKING:
    from collections.abc import Callable

_options = {"device": str, "precision": str, "method": str, "threads": int, "step": float,
            "unsafe_step": bool, "pace": float, "paused": bool, "port": int, "host": str,
            "out": str, "replay": str}


class View:
    """A scene that runs live until `close`, or until Python ends: that of `phyxel.view`, or of
    `Simulation.view`.

    address: of its page, with the token that lets a browser in. In a notebook, the view shows the
    page in its cell.
    """

    def __init__(self, address: str, end: Callable[[], object]) -> None:
        self.address = address
        self._end = weakref.finalize(self, end)  # called once: by close, or when the view is gone

    def close(self) -> None:
        """Ends the view. A simulation that it showed goes on from the time reached; raises the
        phyxel.Error that has ended the view before, if there was one."""
        self._end()

    def __enter__(self) -> View:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<phyxel.View at {self.address}{'' if self._end.alive else ', closed'}>"

    def _repr_html_(self) -> str:
        return f'<iframe src="{self.address}" width="100%" height="900" style="border:0"></iframe>'


def _words_of(scene, options):
    """The command line of the program for a scene's file."""
    found = program()
    if found is None:
        raise RuntimeError("phyxel.view: this module has no program beside it; allowed: one that "
                           "\"pip install\" installed, or that of a build with the target "
                           "phyxel_program")
    words = [str(found), "view", os.fspath(scene)]
    for name, value in {"port": 0, **options}.items():
        if name not in _options:
            raise TypeError(f"phyxel.view: {name}: unknown; allowed: {', '.join(_options)}")
        flag = "--" + name.replace("_", "-")
        if _options[name] is bool:
            words += [flag] if value else []
        elif value is not None:
            words += [flag, str(value)]
    return words


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
    folder = None
    if isinstance(scene, dict):
        from . import to_toml
        folder = tempfile.TemporaryDirectory()  # as long as the view
        file = pathlib.Path(folder.name) / "scene.toml"
        file.write_text(to_toml(scene))
        scene = file
    process = subprocess.Popen(_words_of(scene, options), stdout=subprocess.PIPE,
                               stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None and process.stderr is not None
    address = process.stdout.readline().strip()
    if not address:
        process.wait()
        raise RuntimeError(process.stderr.read().strip())

    def end():
        if process.poll() is None:
            process.terminate()
        process.communicate()
        if folder:
            folder.cleanup()

    return View(address, end)
