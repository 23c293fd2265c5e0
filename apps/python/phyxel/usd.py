"""Trajectories as stages of USD, Pixar's Universal Scene Description."""

from __future__ import annotations

import os
import pathlib
from typing import TYPE_CHECKING

import numpy

from ._phyxel import Frame, InputError, body_colour, obstacles_of

if TYPE_CHECKING:
    from . import Trajectory

_ENDINGS = (".usd", ".usda", ".usdc")


def _libraries():
    """The modules of USD. ImportError without them."""
    try:
        from pxr import Gf, Sdf, Usd, UsdGeom, Vt  # optional
    except ImportError:
        raise ImportError("to_usd: USD is not installed; allowed: pip install usd-core, or \"phyxel "
                          "export --format glb\", which needs nothing") from None
    return Gf, Sdf, Usd, UsdGeom, Vt


def time_codes(times: numpy.ndarray) -> tuple[numpy.ndarray, float]:
    """Time codes of frames, one apart on average, and the number of codes in a second of the run."""
    if len(times) < 2:
        return numpy.zeros(len(times)), 24.0
    rate = (len(times) - 1) / (times[-1] - times[0])
    codes = (times - times[0]) * rate
    whole = numpy.round(codes)
    return numpy.where(abs(codes - whole) < 1e-6, whole, codes), rate


def _spacing(points):
    """The median distance of some points to their nearest neighbour [m]; 1 for a single point."""
    if len(points) < 2:
        return 1.0
    nearest = []
    for k in numpy.linspace(0, len(points) - 1, 32).astype(int):
        distance = numpy.linalg.norm(points - points[k], axis=1)
        nearest.append(numpy.delete(distance, k).min())
    return float(numpy.median(nearest))


class _Body:
    """The prims of a body, and the points of the frames that belong to it. Positions are relative to
    an origin, since USD has them in single precision: the middle of the first frame."""

    def __init__(self, number, surface, phyxels):
        self.number = number
        self.surfels = self._points(surface)
        self.phyxels = self._points(phyxels)
        points = surface.points[self.surfels] if len(self.surfels) else phyxels.points[self.phyxels]
        self.origin = 0.5 * (points.min(axis=0) + points.max(axis=0))

    def _points(self, frame):
        if frame is None:
            return numpy.zeros(0, int)
        return numpy.flatnonzero(frame.body == self.number) if len(frame.body) else numpy.arange(len(frame))


class _Stage:
    """A stage under construction."""

    def __init__(self, file, surface: Frame | None, phyxels: Frame | None, up, rate, fps, codes):
        self.gf, self.sdf, usd, self.geom, self.vt = _libraries()
        self.stage = usd.Stage.CreateNew(str(file))
        self.geom.SetStageMetersPerUnit(self.stage, 1)
        self.geom.SetStageUpAxis(self.stage, up.upper())
        self.stage.SetTimeCodesPerSecond(fps or rate)
        self.stage.SetFramesPerSecond(fps or rate)
        self.pace = (fps or rate) / rate  # seconds of the run in a second of the animation
        self.stage.SetStartTimeCode(codes[0])
        self.stage.SetEndTimeCode(codes[-1])
        root = self.geom.Xform.Define(self.stage, "/phyxel")
        self.stage.SetDefaultPrim(root.GetPrim())
        numbers = {0}
        for frame in surface, phyxels:
            if frame is not None and len(frame.body):
                numbers |= set(numpy.unique(frame.body).tolist())
        self.bodies = [_Body(number, surface, phyxels) for number in sorted(numbers)]
        self.surface, self.phyxels = surface, phyxels
        self.latest = surface  # the frame whose triangles are the last ones set
        for body in self.bodies:
            self._define(body)

    def _define(self, body):
        path = f"/phyxel/body_{body.number + 1}"
        place = self.geom.Xform.Define(self.stage, path)
        place.AddTranslateOp().Set(self.gf.Vec3d(*map(float, body.origin)))
        colour = self.vt.Vec3fArray([self.gf.Vec3f(*body_colour(body.number))])
        if len(body.surfels):
            body.mesh = self.geom.Mesh.Define(self.stage, path + "/surface")
            self._set_triangles(body, self.surface)
            body.mesh.CreateSubdivisionSchemeAttr(self.geom.Tokens.none)
            body.mesh.SetNormalsInterpolation(self.geom.Tokens.vertex)
            body.mesh.CreateDisplayColorAttr(colour)
        if len(body.phyxels):
            body.points = self.geom.Points.Define(self.stage, path + "/phyxels")
            width = _spacing(self.phyxels.points[body.phyxels])
            body.points.CreateWidthsAttr(self._array("FloatArray", [width]))
            body.points.SetWidthsInterpolation(self.geom.Tokens.constant)
            body.points.CreateIdsAttr(self._array("Int64Array", body.phyxels))
            body.points.CreateDisplayColorAttr(colour)
            if len(body.surfels):  # inside the surface: shown on request
                body.points.CreatePurposeAttr(self.geom.Tokens.guide)

    def add_obstacles(self, folder: pathlib.Path, times: numpy.ndarray, codes: numpy.ndarray) -> None:
        """Adds the obstacles of the run, each with its place and turn at the frames."""
        frame = self.phyxels if self.surface is None else self.surface
        low, high = frame.points.min(axis=0), frame.points.max(axis=0)
        reach = 2 * float(numpy.linalg.norm(high - low))
        for k, obstacle in enumerate(obstacles_of(frame, folder, list(times), 0.5 * (low + high), reach)):
            path = f"/phyxel/obstacle_{k + 1}"
            place = self.geom.Xform.Define(self.stage, path)
            place.GetPrim().SetCustomDataByKey("name", obstacle["name"])
            self._place(place, obstacle, codes)
            mesh = self.geom.Mesh.Define(self.stage, path + "/surface")
            points, triangles = self._array("Vec3fArray", obstacle["points"]), obstacle["triangles"]
            mesh.CreatePointsAttr(points)
            mesh.CreateExtentAttr(self.geom.PointBased.ComputeExtent(points))
            mesh.CreateFaceVertexCountsAttr(self._array("IntArray", numpy.full(len(triangles), 3)))
            mesh.CreateFaceVertexIndicesAttr(self._array("IntArray", triangles.ravel()))
            mesh.CreateSubdivisionSchemeAttr(self.geom.Tokens.none)
            mesh.CreateDoubleSidedAttr(True)
            if len(obstacle["normals"]):
                mesh.CreateNormalsAttr(self._array("Vec3fArray", obstacle["normals"]))
                mesh.SetNormalsInterpolation(self.geom.Tokens.vertex)
            mesh.CreateDisplayColorAttr(self.vt.Vec3fArray([self.gf.Vec3f(*obstacle["colour"])]))

    def _place(self, prim, obstacle, codes):
        """Sets the place and the turn of an obstacle: once if it stands still, else at each frame."""
        translate, orient = prim.AddTranslateOp(), prim.AddOrientOp()
        before = None
        for code, place, turn in zip(codes, obstacle["place"], obstacle["turn"]):
            # USD multiplies rows by matrices.
            quaternion = self.gf.Matrix3d(*map(float, turn.T.ravel())).ExtractRotation().GetQuat()
            if before is not None and self.gf.Dot(before, quaternion) < 0:
                quaternion = -quaternion  # on the shorter way
            before = quaternion
            still = numpy.ptp(obstacle["place"], axis=0).max() == 0 and numpy.ptp(obstacle["turn"], axis=0).max() == 0
            at = () if still else (float(code),)
            translate.Set(self.gf.Vec3d(*map(float, place)), *at)
            orient.Set(self.gf.Quatf(quaternion), *at)
            if still:
                return

    def _set_triangles(self, body, frame, *code):
        """Sets the triangles of a body, at a time code if one is given."""
        position = numpy.full(len(frame), -1)
        position[body.surfels] = numpy.arange(len(body.surfels))
        corners = position[frame.triangles]
        corners = corners[(corners >= 0).all(axis=1)]
        body.mesh.GetFaceVertexCountsAttr().Set(self._array("IntArray", numpy.full(len(corners), 3)), *code)
        body.mesh.GetFaceVertexIndicesAttr().Set(self._array("IntArray", corners.ravel()), *code)

    def _array(self, kind, values):
        types = {"IntArray": numpy.int32, "Int64Array": numpy.int64}
        return getattr(self.vt, kind).FromNumpy(
            numpy.ascontiguousarray(values, types.get(kind, numpy.float32)))

    def add(self, surface: Frame | None, phyxels: Frame | None, code: float) -> None:
        """Adds the samples of a frame. Triangles have samples from the first frame on where they change,
        as those of bodies that break."""
        cut = surface is not None and not numpy.array_equal(surface.triangles, self.latest.triangles)
        for body in self.bodies:
            if cut and len(body.surfels):
                if self.latest is self.surface:
                    self._set_triangles(body, self.surface, self.stage.GetStartTimeCode())
                self._set_triangles(body, surface, code)
            if surface is not None and len(body.surfels):
                self._sample(body, body.mesh, surface, body.surfels, code)
                if len(surface.normals):
                    body.mesh.GetNormalsAttr().Set(
                        self._array("Vec3fArray", surface.normals[body.surfels]), code)
            if phyxels is not None and len(body.phyxels):
                self._sample(body, body.points, phyxels, body.phyxels, code)
        if cut:
            self.latest = surface

    def _sample(self, body, prim, frame, which, code):
        points = self._array("Vec3fArray", frame.points[which] - body.origin)
        prim.GetPointsAttr().Set(points, code)
        prim.GetExtentAttr().Set(self.geom.PointBased.ComputeExtent(points), code)
        api = self.geom.PrimvarsAPI(prim)
        for name, values in frame.fields.items():
            if name == "velocity":
                prim.GetVelocitiesAttr().Set(self._array("Vec3fArray", self.pace * values[which]), code)
            for part, numbers, kind in self._primvars(name, values[which]):
                primvar = api.CreatePrimvar(part, kind, self.geom.Tokens.vertex)
                array = "Vec3fArray" if numbers.ndim == 2 else "FloatArray"
                primvar.Set(self._array(array, numbers), code)

    def _primvars(self, name, values):
        """Names, values and types of a field: a tensor is six numbers, as USD has none of them."""
        types = self.sdf.ValueTypeNames
        if values.ndim == 1:
            return [(name, values, types.FloatArray)]
        if values.shape[1] == 3:
            return [(name, values, types.Vector3fArray)]
        return [(f"{name}_{part}", values[:, k], types.FloatArray)
                for k, part in enumerate(("xx", "yy", "zz", "xy", "yz", "xz"))]


def to_usd(run: Trajectory | str | os.PathLike[str], out: str | os.PathLike[str], *,
           up: str = "z", fps: float | None = None, force: bool = False) -> pathlib.Path:
    """Writes a trajectory as a USD stage, for film and for tools such as Omniverse and Houdini.

        phyxel.to_usd("out/dino", "dino.usdc")

    Each body is an Xform with a Mesh `surface` and Points `phyxels`, whose positions, normals and
    extents have a time sample for each frame; fields of the frames are primvars, stress and strain
    with one for each component. Phyxels inside a surface have the purpose "guide". Each obstacle is an
    Xform with a Mesh `surface`, placed at each frame. Lengths are in metres. Needs usd-core.

    run: a Trajectory, or the folder of a run.
    out: the file, .usdc (binary), .usda (text) or .usd.
    up: the vertical axis of the scene, "y" or "z".
    fps: frames per second of the animation; default: as fast as the run.
    force: replace the file if it exists.
    """
    from . import Trajectory
    _libraries()
    out = pathlib.Path(out)
    trajectory = run if isinstance(run, Trajectory) else Trajectory(run)
    if out.suffix not in _ENDINGS:
        raise InputError(f"{out}: to_usd: allowed: a name that ends in {', '.join(_ENDINGS)}")
    if up not in ("y", "z"):
        raise InputError(f"to_usd: up: {up!r} found; allowed: 'y', 'z'")
    if fps is not None and not 0 < fps < float("inf"):
        raise InputError(f"to_usd: fps: {fps!r} found; allowed: a positive number")
    if out.exists() and not force:
        raise InputError(f"{out}: exists already and is kept; force=True replaces it")
    families = [family for family in (trajectory.surface, trajectory.phyxels) if len(family)]
    if any(len(family) != len(families[0]) for family in families):
        raise InputError(f"{trajectory.directory}: surface and phyxels have different numbers of frames; "
                         "allowed: a run that was finished")
    codes, rate = time_codes(families[0].times)
    out.parent.mkdir(parents=True, exist_ok=True)
    unfinished = out.with_name(f".{out.stem}.{os.getpid()}{out.suffix}")  # replaces the file when complete
    try:
        _write(unfinished, trajectory, up, rate, fps, codes)
        os.replace(unfinished, out)
    finally:
        unfinished.unlink(missing_ok=True)
    return out


def _write(file, trajectory, up, rate, fps, codes):
    """Writes the stage of a trajectory to a file."""
    def frame(family, k):
        return family[k] if len(family) else None

    stage = None
    for k, code in enumerate(codes):
        surface, phyxels = frame(trajectory.surface, k), frame(trajectory.phyxels, k)
        if stage is None:
            stage = _Stage(file, surface, phyxels, up, rate, fps, codes)
            stage.add_obstacles(trajectory.directory, trajectory.times, codes)
        for now, first in (surface, stage.surface), (phyxels, stage.phyxels):
            if now is not None and len(now) != len(first):
                raise InputError(f"{trajectory.directory}: frame {k} has {len(now)} points, the first "
                                 f"one {len(first)}; allowed: frames with as many")
        stage.add(surface, phyxels, float(code))
    stage.stage.GetRootLayer().Save()
