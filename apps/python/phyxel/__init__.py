"""phyxel: deformable bodies made of points, simulated.

    import phyxel
    beam = phyxel.shape("beam", size=(1, 0.1, 0.1), spacing=0.02)
    simulation = phyxel.Simulation({
        "gravity": [0, 0, -9.81],
        "solver": {"method": "equilibrium"},
        "body": [{"cloud": "beam",
                  "material": {"young": 1e7, "poisson": 0.3, "density": 1000},
                  "fixed": [{"region": "x-"}]}]}, clouds={"beam": beam})
    simulation.run()
    print(simulation.displacement[:, 2].min())

Lengths in m, masses in kg, times in s. Errors are `phyxel.Error`; wrong input is an `InputError`,
which is a ValueError, too.
"""

from __future__ import annotations

import csv
import json
import os
import pathlib
from typing import TYPE_CHECKING, Any, overload

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    import pandas


def _settle_thread_policy():
    """Makes waiting OpenMP threads sleep soon, unless the environment says how they wait: what
    `phyxel run` does (apps/phyxel/thread_policy.cpp says why). The runtime reads the environment
    when it is loaded, and ignores this if another module has loaded it before."""
    if "OMP_WAIT_POLICY" not in os.environ and "GOMP_SPINCOUNT" not in os.environ:
        os.environ["GOMP_SPINCOUNT"] = "1000"


_settle_thread_policy()  # before NumPy, whose libraries may load the runtime

import numpy  # noqa: E402

from ._phyxel import (Cloud, DeviceError, DivergedError, Error, Frame, InputError, Live,
                      OutputError, SimulationBase, inspect, read_body, read_frame, read_mesh,
                      sample, shape, version)
from ._phyxel import read_series as _read_series
from ._view import View, view

__version__ = version.split()[1]
__all__ = ["Cloud", "DeviceError", "DivergedError", "Error", "Frame", "InputError", "Live",
           "OutputError", "Simulation", "Trajectory", "View", "inspect", "read_body", "read_frame",
           "read_mesh", "run", "sample", "shape", "to_toml", "to_usd", "version", "view"]


def _text(text):
    """In quotes: TOML's escapes are JSON's, but for pairs of surrogates and the last of ASCII."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _value(value):
    """As TOML writes it on one line."""
    if isinstance(value, (numpy.generic, numpy.ndarray)):
        value = value.tolist()
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_text(k)} = {_value(v)}" for k, v in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_value(v) for v in value) + "]"
    if isinstance(value, bool):
        return json.dumps(value)
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, os.PathLike):
        return _text(os.fspath(value))
    if isinstance(value, (int, float)):
        return repr(value)
    raise InputError(f"scene: {value!r} found; allowed: text, numbers, booleans, lists and dicts")


def to_toml(scene: Mapping[str, Any]) -> str:
    """The text of a scene given as a dict: what `phyxel run` reads."""
    return "".join(f"{_text(key)} = {_value(value)}\n" for key, value in scene.items())


class Simulation(SimulationBase):
    """A scene that steps.

    scene: a scene file (docs/scenes.md), its text, or a dict of the same keys.
    clouds: {name: Cloud} for bodies that say `cloud = "name"`.
    device, precision, method, threads, step, end: instead of the scene's.
    unsafe_step: allow a step above the largest stable one.
    progress: called as progress(stage, share) while bodies are made and the step is found.
    """

    def __init__(self, scene: str | os.PathLike[str] | dict[str, Any],
                 clouds: Mapping[str, Cloud] | None = None, *, device: str | None = None,
                 precision: str | None = None, method: str | None = None,
                 threads: int | None = None, step: float | None = None, end: float | None = None,
                 unsafe_step: bool = False,
                 progress: Callable[[str, float], object] | None = None) -> None:
        file, text = None, ""
        if isinstance(scene, dict):
            text = to_toml(scene)
        elif isinstance(scene, str) and ("\n" in scene or "=" in scene and not scene.endswith(".toml")
                                         and not os.path.exists(scene)):
            text = scene
        else:
            file = os.fspath(scene)
        self._clouds = dict(clouds or {})
        super().__init__(file, text, self._clouds, device, precision, method, threads, step,
                         end, unsafe_step, progress)
        self._made = True

    @property
    def position(self) -> numpy.ndarray:
        """Deformed positions [m], (n, 3), a copy."""
        return self.rest + self.displacement

    def view(self, *, pace: float = 1, paused: bool = False, port: int = 0, host: str = "127.0.0.1",
             out: str | os.PathLike[str] | None = None) -> View:
        """Shows this simulation live, from its present state, and returns the View, whose page a
        browser or a notebook's cell shows. The page steps the simulation; until the view's close(),
        others can read it, but not change it.

            with simulation.view() as live:
                input(live.address)     # look, pull, change gravity; then go on
            simulation.run()

        pace: simulated s a second. paused: wait for the page's Play. port: 0 for any that is free.
        host: address to listen at. out: folder of what the page saves, instead of the scene's.
        What users set in the page, such as gravity, stays after close(); external forces go on.
        Raises InputError for a search for equilibrium, a second view, or a port that is taken.
        """
        # The end holds the simulation, which must not end before its view.
        address = self._open_view(self._clouds, pace, paused, port, host, out)
        return View(address, self._close_view)

    def __repr__(self):
        if not hasattr(self, "_made"):  # who looks at a traceback
            return "<phyxel.Simulation: not made>"
        return (f"<phyxel.Simulation: {len(self)} phyxels, t = {self.time:g} s, "
                f"dt = {self.dt:.3g} s, {self.device}>")


def run(scene: str | os.PathLike[str] | dict[str, Any],
        directory: str | os.PathLike[str] | None = None, *, force: bool = False,
        clouds: Mapping[str, Cloud] | None = None,
        progress: Callable[[str, float], object] | None = None, **overrides: Any) -> Trajectory:
    """Simulates a scene, writes its frames and logs as `phyxel run` does, and returns its Trajectory.

        trajectory = phyxel.run("examples/dino/scene.toml", precision="float")

    scene, clouds: as for Simulation; overrides are its device, precision, method, threads, step,
    end and unsafe_step.
    directory: folder of the trajectory, instead of the scene's.
    force: replace an earlier trajectory there.
    progress: called as progress(stage, share) meanwhile.
    """
    simulation = Simulation(scene, clouds, progress=progress, **overrides)
    directory = simulation.directory if directory is None else directory
    simulation.record(directory, force)
    simulation.run(progress=progress)
    return Trajectory(directory)


class _Family:
    """Frames of a trajectory, read when they are asked for."""

    def __init__(self, entries: list[tuple[str | os.PathLike[str], float]]) -> None:
        self.files = [file for file, _ in entries]
        self.times = numpy.array([time for _, time in entries])

    def __len__(self) -> int:
        return len(self.files)

    @overload
    def __getitem__(self, number: int) -> Frame: ...
    @overload
    def __getitem__(self, number: slice) -> list[Frame]: ...

    def __getitem__(self, number: int | slice) -> Frame | list[Frame]:
        if isinstance(number, slice):
            return [read_frame(file) for file in self.files[number]]
        return read_frame(self.files[number])

    def __repr__(self):
        return f"<{len(self)} frames>"


class Trajectory:
    """What a run has written: `phyxels` and `surface`, frames each, `energy`, the columns of
    energy.csv, `reactions`, those of reactions.csv, `probes`, those of probes.csv, `gases`,
    those of gas.csv, `contacts`, those of contacts.csv, `rigid_bodies`, those of rigid.csv, and
    `fragments`, those of fragments.csv.

        trajectory = phyxel.Trajectory("out/dino")
        for frame in trajectory.surface: ...
    """

    def __init__(self, directory: str | os.PathLike[str]) -> None:
        self.directory = pathlib.Path(directory)
        families = {name: self.directory / f"{name}.hdf.series" for name in ("phyxels", "surface")}
        if not any(file.exists() for file in families.values()):
            raise InputError(f"{self.directory}: holds no trajectory; allowed: the folder of a run")
        self.phyxels, self.surface = (_Family(_read_series(file) if file.exists() else [])
                                      for file in families.values())

    @property
    def times(self) -> numpy.ndarray:
        """Of the frames [s], (frames,)."""
        return (self.phyxels if len(self.phyxels) else self.surface).times

    @property
    def energy(self) -> dict[str, numpy.ndarray]:
        """{column: values}, one for each frame; energies [J]."""
        with open(self.directory / "energy.csv", newline="") as file:
            rows = list(csv.reader(file))
        table = numpy.array(rows[1:], dtype=float).reshape(-1, len(rows[0]))
        return {name.split(" [")[0]: table[:, k] for k, name in enumerate(rows[0])}

    @property
    def reactions(self) -> dict[tuple[str, str], dict[str, numpy.ndarray]]:
        """{(body, set): {column: values}}, one for each frame; forces [N], torques [N m], work [J].
        Sets are entries of fixed, motion and symmetry, e.g. ("beam", "fixed 1"). Empty without any."""
        return self._log("reactions.csv", str)

    @property
    def gases(self) -> dict[tuple[str, str], dict[str, numpy.ndarray]]:
        """{(body, set): {column: values}}, one for each frame; pressure [Pa] and volume [m^3] of the
        gases in cavities, by tractions, e.g. ("ball", "traction 1"). Empty without any."""
        return self._log("gas.csv", str)

    @property
    def contacts(self) -> dict[str, dict[str, numpy.ndarray]]:
        """{obstacle: {column: values}}, one for each frame; forces [N], torques [N m], impulses [N s],
        angular impulses [N m s], work, heat and loss [J]. Empty without any."""
        return {name: columns for (name, _), columns in self._log("contacts.csv", str).items()}

    @property
    def rigid_bodies(self) -> dict[str, dict[str, numpy.ndarray]]:
        """{obstacle: {column: values}}, one for each frame, of obstacles that are free rigid bodies:
        place [m] of the centre of mass, rotation [rad] from the position at rest, velocity [m/s],
        spin [rad/s], kinetic energy [J]. Empty without any."""
        return {name: columns for (name, _), columns in self._log("rigid.csv", str).items()}

    @property
    def fragments(self) -> dict[tuple[str, int], dict[str, numpy.ndarray]]:
        """{(body, fragment): {column: values}}, one for each frame in which the fragment of this
        number exists: `time` [s] tells which; 1 is the heaviest at that time, 0 the dust of the
        body. Masses [kg], centres [m], velocities [m/s], angular momenta [kg m^2/s], spins [rad/s].
        Empty without bodies that may break."""
        return self._log("fragments.csv", int)

    @property
    def probes(self) -> dict[tuple[str, int], dict[str, numpy.ndarray]]:
        """{(probe, point): {column: values}}, one for each frame; points are counted from 1. Empty
        without any."""
        return self._log("probes.csv", int)

    def table(self, name: str) -> pandas.DataFrame:
        """A log as a pandas DataFrame with a row for each frame, and for each support, gas, contact,
        body or point where a log has several: columns `time`, then the names, then the values.

            trajectory.table("energy").plot(x="time", y=["kinetic_energy", "strain_energy"])

        name: energy, reactions, gases, contacts, rigid_bodies, fragments or probes. Needs pandas.
        """
        if name not in self._KEYS:
            allowed = ", ".join(self._KEYS)
            raise InputError(f"table: {name!r} found; allowed: {allowed}")
        try:
            import pandas  # optional
        except ImportError:
            raise ImportError("table: pandas is not installed; allowed: pip install pandas, or the "
                              f"arrays of trajectory.{name}") from None
        if name == "energy":
            return pandas.DataFrame(self.energy)
        parts = []
        for key, columns in getattr(self, name).items():
            names = dict(zip(self._KEYS[name], key if isinstance(key, tuple) else (key,)))
            parts.append(pandas.DataFrame({"time": columns["time"], **names, **columns}))
        return pandas.concat(parts, ignore_index=True) if parts else pandas.DataFrame()

    #: Columns of names in each log.
    _KEYS = {"energy": (), "reactions": ("body", "set"), "gases": ("body", "set"),
             "contacts": ("obstacle",), "rigid_bodies": ("obstacle",),
             "fragments": ("body", "fragment"), "probes": ("probe", "point")}

    def _log(self, name, second):
        """The rows of a log by their third and fourth cells, of which the latter is a `second`."""
        file = self.directory / name
        if not file.exists():
            return {}
        with open(file, newline="") as text:
            header, *rows = csv.reader(text)
        names = [name.split(" [")[0] for name in header]
        sets = {}
        for row in rows:
            sets.setdefault((row[2], second(row[3])), []).append(
                [float(cell or "nan") for cell in row[:2] + row[4:]])
        columns = names[:2] + names[4:]
        return {key: dict(zip(columns, numpy.array(table).T)) for key, table in sets.items()}

    def __len__(self) -> int:
        return len(self.times)

    def __repr__(self):
        return f"<phyxel.Trajectory: {self.directory}, {len(self)} frames>"


from .usd import to_usd  # noqa: E402, which needs Trajectory
