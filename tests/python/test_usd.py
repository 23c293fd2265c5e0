"""USD stages of trajectories, read back by USD itself."""
import shutil
import sys

import numpy as np
import pytest

import phyxel

SCENE = {"title": "two blocks", "time": {"end": 0.02}, "solver": {"device": "cpu", "precision": "double"},
         "output": {"frames_per_second": 200, "fields": ["displacement", "velocity", "von_mises", "stress"]},
         "body": [{"name": "far", "shape": "block", "size": [1, 1, 1], "spacing": 0.5, "velocity": [0, 0, 2],
                   "translation": [1e6, 0, 0], "material": {"young": 1e5, "poisson": 0.3, "density": 1000}},
                  {"name": "near", "shape": "block", "size": [1, 2, 1], "spacing": 0.5, "velocity": [0, 1, 0], "fixed": [{"region": "z-"}],
                   "material": {"young": 1e5, "poisson": 0.3, "density": 1000}}]}


def usd():
    """USD's modules. The test is skipped without them, in CI, too: Debian has no package of usd-core."""
    reason = "missing tool: Python's usd-core"
    return pytest.importorskip("pxr.Usd", reason=reason), pytest.importorskip("pxr.UsdGeom", reason=reason)


@pytest.fixture
def run(tmp_path):
    return phyxel.run(SCENE, tmp_path / "run")


def of_body(frame, number):
    return frame.body == number


@pytest.mark.parametrize("ending", ["usda", "usdc"])
def test_a_stage_has_the_points_of_every_frame(run, tmp_path, ending):
    Usd, UsdGeom = usd()
    assert phyxel.to_usd(run, tmp_path / f"out/run.{ending}") == tmp_path / f"out/run.{ending}"
    stage = Usd.Stage.Open(str(tmp_path / f"out/run.{ending}"))
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1 and UsdGeom.GetStageUpAxis(stage) == "Z"
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (0, 4)
    assert stage.GetTimeCodesPerSecond() == pytest.approx(200)
    for name, family in ("surface", run.surface), ("phyxels", run.phyxels):
        for number in 0, 1:
            prim = UsdGeom.PointBased(stage.GetPrimAtPath(f"/phyxel/body_{number + 1}/{name}"))
            for k, frame in enumerate(family):
                expected = frame.points[of_body(frame, number)]
                matrix = np.array(prim.ComputeLocalToWorldTransform(k))
                points = np.array(prim.GetPointsAttr().Get(k)) @ matrix[:3, :3] + matrix[3, :3]
                assert points == pytest.approx(expected, abs=1e-6, rel=0)  # although one is at 1e6 m
                low, high = np.array(prim.GetExtentAttr().Get(k)) + matrix[3, :3]
                assert low == pytest.approx(expected.min(axis=0), abs=1e-6, rel=0)
                assert high == pytest.approx(expected.max(axis=0), abs=1e-6, rel=0)
    moved = UsdGeom.PointBased(stage.GetPrimAtPath("/phyxel/body_1/surface")).GetPointsAttr()
    assert np.ptp([np.array(moved.Get(k))[:, 2].mean() for k in range(5)]) == pytest.approx(0.04, rel=1e-3)


def test_a_stage_has_triangles_normals_and_fields(run, tmp_path):
    Usd, UsdGeom = usd()
    stage = Usd.Stage.Open(str(phyxel.to_usd(run, tmp_path / "run.usdc", fps=20)))
    surface, phyxels = run.surface[3], run.phyxels[3]
    mine = of_body(surface, 1)
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/phyxel/body_2/surface"))
    corners = np.array(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3)
    triangles = surface.triangles[mine[surface.triangles].all(axis=1)]
    assert np.array_equal(np.flatnonzero(mine)[corners], triangles) and len(triangles) < len(surface.triangles)
    assert set(mesh.GetFaceVertexCountsAttr().Get()) == {3}
    assert mesh.GetSubdivisionSchemeAttr().Get() == "none"
    assert mesh.GetNormalsInterpolation() == "vertex"
    assert np.array(mesh.GetNormalsAttr().Get(3)) == pytest.approx(surface.normals[mine], abs=1e-6)
    assert abs(surface.normals[mine] - run.surface[0].normals[mine]).max() > 1e-3  # they do turn
    first, second = (tuple(UsdGeom.Mesh(stage.GetPrimAtPath(f"/phyxel/body_{k}/surface")).GetDisplayColorAttr().Get()[0])
                     for k in (1, 2))
    assert first != second

    points = UsdGeom.Points(stage.GetPrimAtPath("/phyxel/body_2/phyxels"))
    inside = of_body(phyxels, 1)
    primvars = UsdGeom.PrimvarsAPI(points)
    value = lambda name: np.array(primvars.GetPrimvar(name).Get(3))
    assert value("von_mises") == pytest.approx(phyxels.fields["von_mises"][inside], rel=1e-6)
    assert value("displacement") == pytest.approx(phyxels.fields["displacement"][inside], rel=1e-6)
    assert phyxels.fields["stress"].shape == (len(phyxels), 6)
    assert abs(phyxels.fields["stress"][inside]).max(axis=0)[[3, 5]].max() < 0.5 * abs(phyxels.fields["stress"][inside, 4]).max()
    assert value("stress_yz") == pytest.approx(phyxels.fields["stress"][inside, 4], rel=1e-6)
    # An animation of 20 frames a second is ten times as slow as the run, and so are its velocities.
    assert stage.GetTimeCodesPerSecond() == 20
    assert np.array(points.GetVelocitiesAttr().Get(3)) == pytest.approx(0.1 * phyxels.fields["velocity"][inside], rel=1e-6)
    assert points.GetPurposeAttr().Get() == "guide"
    assert points.GetWidthsAttr().Get()[0] == pytest.approx(0.5, rel=0.01)  # the spacing


def test_triangles_change_where_those_of_the_frames_do(run, tmp_path):
    # A block that lies has as many surfels as one that stands, and other triangles.
    Usd, UsdGeom = usd()
    far, near = SCENE["body"]
    other = phyxel.run({**SCENE, "body": [far, {**near, "size": [2, 1, 1]}]}, tmp_path / "other")
    for k in 2, 3:
        shutil.copy(other.directory / f"surface_00000{k}.hdf", run.directory)
    stage = Usd.Stage.Open(str(phyxel.to_usd(run, tmp_path / "run.usdc")))
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/phyxel/body_2/surface"))
    found = [list(mesh.GetFaceVertexIndicesAttr().Get(k)) for k in range(5)]
    for k, frame in enumerate(run.surface):
        mine = np.flatnonzero(of_body(frame, 1))
        triangles = frame.triangles[of_body(frame, 1)[frame.triangles].all(axis=1)]
        assert np.array_equal(mine[np.reshape(found[k], (-1, 3))], triangles)
    assert found[0] == found[1] == found[4] and found[2] == found[3] != found[1]
    assert mesh.GetFaceVertexIndicesAttr().GetTimeSamples() == [0, 2, 4]  # only where they change


def test_obstacles_are_where_they_were(tmp_path):
    """A plane that rises, and a free ball that flies and spins, as the run's own log has it."""
    Usd, UsdGeom = usd()
    obstacles = [{"name": "floor", "shape": "plane", "translation": [0, 0, -9], "motion": {"velocity": [0, 0, -3]}},
                 {"name": "ball", "shape": "sphere", "radius": 0.5, "density": 1000, "translation": [5, 1e5, 2], "velocity": [0, 4, 0], "spin": [0, 0, 30]},
                 {"name": "wall", "shape": "box", "size": [1, 2, 3], "translation": [-9, 0, 0]}]
    run = phyxel.run({**SCENE, "obstacle": obstacles}, tmp_path / "run")
    stage = Usd.Stage.Open(str(phyxel.to_usd(run, tmp_path / "run.usda")))
    log = run.rigid_bodies["ball"]
    for k, time in enumerate(run.times):
        placed = {}
        for number, obstacle in enumerate(obstacles, 1):
            prim = stage.GetPrimAtPath(f"/phyxel/obstacle_{number}")
            assert prim.GetCustomDataByKey("name") == obstacle["name"]
            mesh = UsdGeom.Mesh(stage.GetPrimAtPath(f"/phyxel/obstacle_{number}/surface"))
            matrix = np.array(mesh.ComputeLocalToWorldTransform(k))
            placed[obstacle["name"]] = np.array(mesh.GetPointsAttr().Get()) @ matrix[:3, :3] + matrix[3, :3], matrix
        points, matrix = placed["ball"]
        centre = [log[f"place_{axis}"][k] for axis in "xyz"]
        assert np.linalg.norm(points - centre, axis=1) == pytest.approx(0.5, abs=1e-6)
        assert centre[1] == pytest.approx(1e5 + 4 * time, rel=1e-9)
        # The x axis has turned about z, by spin times time but for the run's own steps; quaternions are in single precision.
        turn = log["rotation_z"][k]
        assert turn == pytest.approx(30 * time, rel=0.01)
        assert matrix[0, :3] == pytest.approx([np.cos(turn), np.sin(turn), 0], abs=1e-5)
        assert placed["floor"][0][:, 2] == pytest.approx(-9 - 3 * time, abs=1e-6)
        assert np.ptp(placed["wall"][0], axis=0) == pytest.approx([1, 2, 3], abs=1e-6)
    wall = UsdGeom.Xformable(stage.GetPrimAtPath("/phyxel/obstacle_3"))
    assert not any(op.GetTimeSamples() for op in wall.GetOrderedXformOps())  # it stands still


def test_a_stage_obeys_the_rules_of_usd(run, tmp_path):
    Usd, _ = usd()
    validation = pytest.importorskip("pxr.UsdValidation", reason="missing tool: validators of USD")
    stage = Usd.Stage.Open(str(phyxel.to_usd(run, tmp_path / "run.usda")))
    validators = validation.ValidationRegistry().GetOrLoadAllValidators()
    assert len(validators) > 5
    assert [error.GetMessage() for error in validation.ValidationContext(validators).Validate(stage)] == []


def test_wrong_requests_leave_files_alone(run, tmp_path):
    usd()
    kept = tmp_path / "kept.usda"
    kept.write_text("mine")
    for arguments, said in (((kept, {}), "kept.usda: exists already and is kept; force=True"),
                            ((tmp_path / "a.obj", {}), "a.obj: to_usd: allowed: a name that ends in .usd"),
                            ((tmp_path / "a.usda", {"up": "x"}), "up: 'x' found; allowed: 'y', 'z'"),
                            ((tmp_path / "a.usda", {"fps": 0}), "fps: 0 found; allowed: a positive number")):
        with pytest.raises(phyxel.InputError, match=said):
            phyxel.to_usd(run, arguments[0], **arguments[1])
    assert kept.read_text() == "mine"
    phyxel.to_usd(run, kept, force=True)
    assert kept.read_text().startswith("#usda")
    # A damaged frame ends the export, and the stage of before stays.
    whole = kept.read_text()
    (run.directory / "surface_000003.hdf").write_bytes(b"")
    with pytest.raises(phyxel.InputError, match="surface_000003.hdf"):
        phyxel.to_usd(run, kept, force=True)
    assert kept.read_text() == whole
    assert sorted(p.name for p in tmp_path.iterdir()) == ["kept.usda", "run"]


def test_without_usd_the_error_says_what_to_install(run, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pxr", None)
    with pytest.raises(ImportError, match="pip install usd-core"):
        phyxel.to_usd(run, tmp_path / "run.usda")
    assert not (tmp_path / "run.usda").exists()
