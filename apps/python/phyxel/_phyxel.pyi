"""Types of phyxel's compiled half: written by scripts/make_stubs.py."""

import os
from collections.abc import Callable, Mapping
from typing import Any

from numpy.typing import ArrayLike, NDArray

Path = str | os.PathLike[str]
Mesh = Path | tuple[ArrayLike, ArrayLike]
Progress = Callable[[str, float], object] | None

class Error(RuntimeError): ...

class DeviceError(Error): ...

class DivergedError(Error): ...

class OutputError(Error): ...

class InputError(Error, ValueError): ...

class Cloud:
    """Rest points of one body.

    Cloud(position, volume=None, surface=None, regions={}, spacing=None): `position` (n, 3) [m];
    `volume` (n,) [m^3], without which masses follow from the kernel; `surface`, a pair of
    surfels (m, 3) [m] and triangles (t, 3); `regions`, names for phyxels that scenes select;
    `spacing` (n,) [m] of a graded cloud, from which the supports of its phyxels follow."""
    def __init__(self, position: ArrayLike, volume: ArrayLike | None = None, surface: tuple[ArrayLike, ArrayLike] | None = None, regions: dict[str, list[int]] = {}, spacing: ArrayLike | None = None) -> None: ...
    @property
    def position(self) -> NDArray[Any]:
        """Phyxels at rest [m], (n, 3)."""
    @property
    def volume(self) -> NDArray[Any]:
        """Volumes [m^3], (n,); empty if unknown."""
    @property
    def spacing(self) -> NDArray[Any]:
        """Distances between phyxels of a graded cloud [m], (n,); empty if unknown."""
    @property
    def surfels(self) -> NDArray[Any]:
        """Surfels at rest [m], (m, 3)."""
    @property
    def normals(self) -> NDArray[Any]:
        """Unit normals of the surfels, (m, 3)."""
    @property
    def triangles(self) -> NDArray[Any]:
        """Triangles of surfels, (t, 3)."""
    @property
    def regions(self) -> dict[str, NDArray[Any]]:
        """Named phyxels: {name: indices}."""
    @property
    def warnings(self) -> list[str]:
        """Warnings of the generator or sampler."""
    def __len__(self) -> int: ...
    def write(self, file: Path, overwrite: bool = False) -> None:
        """Writes a body file, which scenes name as `file`."""

class Frame:
    """A frame of a trajectory."""
    @property
    def time(self) -> float:
        """[s]"""
    @property
    def points(self) -> NDArray[Any]:
        """Deformed positions [m], (n, 3)."""
    @property
    def triangles(self) -> NDArray[Any]:
        """Triangles of the surface, (t, 3); empty for phyxels."""
    @property
    def normals(self) -> NDArray[Any]:
        """Normals of the surface, (n, 3); empty for phyxels."""
    @property
    def body(self) -> NDArray[Any]:
        """Index of the body of each point, (n,); empty if there is one body."""
    @property
    def fields(self) -> dict[str, NDArray[Any]]:
        """Fields of the scene's output.fields: {name: array}, (n,), (n, 3) or (n, 6)."""
    def __len__(self) -> int: ...

class Live:
    """The state where the CPU steps it, without a copy and read-only: it changes with
    every step. Phyxel i is at [pack[i], :, lane[i]]."""
    @property
    def displacement(self) -> NDArray[Any]:
        """u [m], (packs, 3, lanes)."""
    @property
    def velocity(self) -> NDArray[Any]:
        """v half a step before [m/s], (packs, 3, lanes)."""
    @property
    def pack(self) -> NDArray[Any]:
        """(n,)"""
    @property
    def lane(self) -> NDArray[Any]:
        """(n,)"""

class SimulationBase:
    def __init__(self, file: Path | None, text: str, clouds: dict[str, Cloud], device: str | None, precision: str | None, method: str | None, threads: int | None, step: float | None, end: float | None, unsafe_step: bool, progress: Progress) -> None: ...
    def step(self, steps: int = 1) -> None:
        """Takes so many steps."""
    def run(self, until: float | None = None, progress: Progress = None) -> None:
        """Steps until then [s], or to the scene's end; writes frames if they are recorded.
        progress(stage, share) is called meanwhile."""
    def record(self, directory: Path, force: bool = False) -> None:
        """From now on frames go there, the present one first, as the scene's [output] asks."""
    def write_frame(self) -> None:
        """Records the present state."""
    def energies(self) -> dict[str, Any]:
        """Energies [J], momenta and the other columns of energy.csv, now: {name: value}."""
    def reactions(self) -> list[dict[str, Any]]:
        """Reactions of supports, now: a list of dicts, one for each entry of fixed, motion
        and symmetry:
        body, set, force [N], torque [N m] about centre [m], work [J]."""
    def gases(self) -> list[dict[str, Any]]:
        """Gases in cavities, now: a list of dicts, one for each traction with gas:
        body, set, pressure [Pa], volume [m^3]."""
    def contacts(self) -> list[dict[str, Any]]:
        """What obstacles do, now and since t = 0: a list of dicts, one for each obstacle:
        obstacle, force [N] on the bodies and torque [N m] about place [m], impulse [N s],
        angular_impulse [N m s], work [J], friction_heat [J], impact_loss [J],
        depth [m] of the phyxel that is deepest inside."""
    def rigid_bodies(self) -> list[dict[str, Any]]:
        """Obstacles that are free rigid bodies, now: a list of dicts, one for each:
        obstacle, place [m] of its centre of mass, rotation [rad] from its position at rest
        (axis times angle), velocity [m/s], spin [rad/s], kinetic_energy [J]."""
    def fragments(self) -> list[dict[str, Any]]:
        """Fragments of broken bodies, now: a list of dicts, one for each, the heaviest first, and
        one for the dust of each body, phyxels without an unbroken pair: body, fragment (its
        number, from 1; 0: dust), first_phyxel, phyxels, mass [kg], centre [m] of mass, velocity
        [m/s] over the last step, angular_momentum [kg m^2/s] about the centre, spin [rad/s].
        Empty in scenes without fracture and notches."""
    def forces(self) -> NDArray[Any]:
        """Internal forces [N], (n, 3), a copy."""
    def gradients(self) -> NDArray[Any]:
        """Displacement gradients, F - 1, (n, 3, 3), a copy."""
    def von_mises(self) -> NDArray[Any]:
        """Von Mises equivalent of the Cauchy stress [Pa], (n,), a copy."""
    def volume_ratio(self) -> NDArray[Any]:
        """det F, (n,), a copy."""
    def stress(self) -> NDArray[Any]:
        """Cauchy stress [Pa], (n, 6): xx, yy, zz, xy, yz, xz; a copy."""
    def strain(self) -> NDArray[Any]:
        """Green's strain, (n, 6): xx, yy, zz, xy, yz, xz; a copy."""
    def at(self, points: ArrayLike, body: str = '') -> dict[str, NDArray[Any]]:
        """Values at points at rest [m], (m, 3), of a body: a dict of displacement [m] and
        velocity [m/s], (m, 3), Cauchy stress [Pa] and Green's strain, (m, 6): xx, yy, zz, xy,
        yz, xz, and von_mises [Pa], (m,). From a fit through phyxels within a support."""
    def probes(self) -> dict[str, dict[str, NDArray[Any]]]:
        """What the scene's probes read now: {name: dict}, each as of at()."""
    def surface(self) -> tuple[NDArray[Any], NDArray[Any]]:
        """Deformed surfels [m] and their normals, both (m, 3), copies."""
    def surface_fields(self, names: list[str]) -> dict[str, Any]:
        """Fields on the deformed surfels by the names of output.fields, as frames of the surface
        have them: {name: array}, (m,), (m, 3) or (m, 6), copies; "history" is all that the
        materials remember."""
    def set_state(self, displacement: ArrayLike | None = None, velocity: ArrayLike | None = None, history: Mapping[str, ArrayLike] | None = None) -> None:
        """Replaces displacements [m], velocities [m/s], both (n, 3), or history, {name: (n,)};
        time goes on. An empty history is the virgin material."""
    @property
    def live(self) -> Live:
        """The state without a copy (on the CPU): see Live."""
    @property
    def displacement(self) -> NDArray[Any]:
        """u [m], (n, 3), a copy."""
    @property
    def velocity(self) -> NDArray[Any]:
        """v half a step before [m/s], (n, 3), a copy."""
    @property
    def history(self) -> dict[str, NDArray[Any]]:
        """What the laws remember at the last step: {name: (n,)}, copies; e.g.
        equivalent_plastic_strain. Empty for elastic materials without viscosity."""
    @property
    def external_forces(self) -> NDArray[Any]:
        """Forces of your own [N], (n, 3), copied when set; they act until set again. None: none."""
    @external_forces.setter
    def external_forces(self, value: ArrayLike | None) -> None: ...
    @property
    def rest(self) -> NDArray[Any]:
        """Positions at rest [m], (n, 3)."""
    @property
    def mass(self) -> NDArray[Any]:
        """[kg], (n,)"""
    @property
    def volume(self) -> NDArray[Any]:
        """At rest [m^3], (n,)"""
    @property
    def triangles(self) -> NDArray[Any]:
        """Of the surface, (t, 3): those that no crack crosses now."""
    @property
    def neighbours(self) -> tuple[NDArray[Any], NDArray[Any]]:
        """Lists of neighbours as (offsets, indices): those of i are
        indices[offsets[i]:offsets[i + 1]]."""
    @property
    def time(self) -> float:
        """[s]"""
    @property
    def steps(self) -> int:
        """Taken so far."""
    @property
    def dt(self) -> float:
        """Time step [s]."""
    @property
    def largest_step(self) -> float:
        """Largest stable time step of Verlet's method [s]; 0 for other methods."""
    @property
    def end(self) -> float:
        """Of the scene [s]."""
    @property
    def residual(self) -> float:
        """Largest force that Newton's method has left, of what acts."""
    @property
    def device(self) -> str:
        """What steps, in words."""
    @property
    def directory(self) -> Path:
        """Output folder of the scene, as `phyxel run` takes it."""
    @property
    def warnings(self) -> list[str]: ...
    @property
    def memory(self) -> dict[str, int]:
        """Bytes the device holds: {array: bytes}."""
    def __len__(self) -> int: ...

def body_colour(body: int) -> tuple[float, float, float]:
    """The colour of a body in pictures: red, green and blue of linear light, 0 to 1."""

def inspect(mesh: Mesh) -> str:
    """Describes the defects of a surface in one line."""

def obstacles_of(frame: Frame, folder: Path, times: list[float], middle: tuple[float, float, float], reach: float) -> list[dict[str, Any]]:
    """Obstacles of a run, by a frame and the folder: a list of dicts, one for each: name, points,
    normals (empty for flat faces) and triangles of its surface in its own coordinates [m],
    place [m], (k, 3), and turn, (k, 3, 3), at times [s], and colour. A plane is a square of
    twice the reach [m] opposite the middle of the bodies [m]."""

def read_body(file: Path) -> Cloud:
    """Reads a body file as `phyxel sample` writes it."""

def read_frame(file: Path) -> Frame:
    """Reads a frame with all its fields."""

def read_mesh(file: Path) -> tuple[NDArray[Any], NDArray[Any]]:
    """Reads points (n, 3) [m] and triangles (t, 3) of an OBJ, PLY or STL file."""

def read_series(file: Path) -> list[tuple[Path, float]]:
    """Reads the files and times [s] of a series: [(file, time), ...]."""

def sample(mesh: Mesh, phyxels: int, seed: int = 1, relaxations: int = 30, on_surface: bool | None = None, grading: Mapping[str, Any] | None = None, progress: Progress = None, device: str = 'auto') -> Cloud:
    """Fills a closed surface, a file (OBJ, PLY, STL) or a pair (points, triangles), with
    exactly so many phyxels. progress(stage, share) is called meanwhile. A GPU (`device`:
    auto, cpu, cuda, cuda:0, ...) helps with 20,000 phyxels and more; the cloud is the same.
    Programs that fork later should name "cpu", as CUDA does not survive a fork.

    grading: a dictionary with the keys of a scene's `[body.grading]`; finer regions are
    dictionaries, {"ball": (centre, radius), "by": 4} or {"box": (low, high)} [m]."""

def shape(name: str, *, size: tuple[float, float, float] = (0.0, 0.0, 0.0), radius: float = 0.0, length: float = 0.0, spacing: float = 0.0, phyxels: int = 0, lattice: str = 'auto', jitter: float = 0.0, seed: int = 1, surfels: bool = True, grading: Mapping[str, Any] | None = None) -> Cloud:
    """A built-in shape, as scenes have it: beam, block (size), cylinder (radius, length),
    sphere (radius), each with `spacing` [m] or `phyxels`; alien_head, horn_bug, dino.
    `lattice` is "cells", "nodes", "fitted" or "auto", the most accurate;
    fitted shapes may have a grading, as meshes have in `sample`."""

version: str
