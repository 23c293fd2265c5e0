"""Clouds and meshes of the Python module: what fills bodies, from shapes, meshes, files and arrays."""
import numpy as np
import pytest
from bodies import BEAM, cube

import phyxel


def test_shapes_fill_their_volume():
    assert BEAM.position.shape == (len(BEAM), 3) and BEAM.volume.shape == (len(BEAM),)
    assert BEAM.volume.sum() == pytest.approx(0.04, rel=1e-12)  # a lattice of whole cells
    assert np.allclose(BEAM.position[BEAM.regions["x-"], 0], 0)
    assert np.all(np.abs(np.linalg.norm(BEAM.normals, axis=1) - 1) < 1e-12)


def test_a_mesh_of_numpy_is_filled_with_exactly_so_many():
    cloud = phyxel.sample(cube(2.0), phyxels=300, seed=3)
    assert len(cloud) == 300
    assert cloud.volume.sum() == pytest.approx(8, rel=1e-9)  # shares of the enclosed volume
    assert cloud.position.min() >= 0 and cloud.position.max() <= 2
    with pytest.raises(phyxel.InputError, match="mesh: None found"):
        phyxel.sample(None, phyxels=5)
    again = phyxel.sample(list(cube(2.0)), phyxels=300, seed=3)
    assert np.array_equal(cloud.position, again.position)
    assert phyxel.inspect(cube()) == phyxel.inspect(cube(3))


def test_a_mesh_is_graded():
    finer = {"ball": ((1, 1, 1), 0.2), "by": 3}
    cloud = phyxel.sample(cube(), phyxels=1500, grading={"ratio": 4, "across": 0, "finer": [finer]})
    assert len(cloud) == 1500 and cloud.spacing.shape == (1500,)
    assert cloud.spacing.max() / cloud.spacing.min() == pytest.approx(3, rel=1e-2)
    assert np.linalg.norm(cloud.position[cloud.spacing.argmin()] - 1) < 0.2
    with pytest.raises(phyxel.InputError, match='key "ration" found'):
        phyxel.sample(cube(), phyxels=100, grading={"ration": 4})
    with pytest.raises(phyxel.InputError, match="exactly one of"):
        phyxel.sample(cube(), phyxels=100, grading={"finer": [{"by": 2}]})


def test_round_and_graded_shapes_are_fitted():
    ball = phyxel.shape("sphere", radius=0.5, phyxels=700)
    assert len(ball) == 700
    assert ball.volume.sum() == pytest.approx(np.pi / 6, rel=2e-3)  # the surface is a polyhedron
    assert np.linalg.norm(ball.position, axis=1).max() == pytest.approx(0.5, rel=1e-3)
    graded = phyxel.shape("block", size=(1, 1, 1), phyxels=1500, grading={"ratio": 3})
    assert len(graded) == 1500 and graded.spacing.shape == (1500,)
    with pytest.raises(phyxel.InputError, match="cannot be graded"):
        phyxel.shape("block", size=(1, 1, 1), phyxels=1500, lattice="nodes", grading={"ratio": 3})


def test_clouds_come_back_from_files(tmp_path):
    file = tmp_path / "beam.h5"
    BEAM.write(file)
    read = phyxel.read_body(file)
    assert np.array_equal(read.position, BEAM.position)
    assert read.regions.keys() == BEAM.regions.keys()
    with pytest.raises(phyxel.InputError, match="beam.h5"):
        BEAM.write(file)  # would replace it
    BEAM.write(file, overwrite=True)


def test_meshes_are_read(tmp_path):
    file = tmp_path / "t.obj"
    file.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n")
    points, triangles = phyxel.read_mesh(file)
    assert points.shape == (4, 3) and triangles.shape == (4, 3)
    assert len(phyxel.sample(file, phyxels=40)) == 40


@pytest.mark.parametrize("arguments, words", [
    (dict(position=[[0, 0]]), r"\(1, 2\).*\(n, 3\)"),
    (dict(position=[]), "position"),
    (dict(position=[[0, 0, np.nan]]), "row 0"),
    (dict(position=[["a", 0, 0]]), "position"),
    (dict(position=[[0, 0, 0]], volume=[1, 2]), r"\(2,\).*\(1,\)"),
    (dict(position=[[0, 0, 0]], volume=[-1]), "volume: -1"),
    (dict(position=[[0, 0, 0]], regions={"end": [1]}), "end"),
    (dict(position=[[0, 0, 0]], surface=([[0, 0, 0]], [[0, 0, 1]])), "triangles: 1 found in row 0"),
    (dict(position=[[0, 0, 0]], surface=([[0, 0, 0]], [[0.5, 0, 0]])), "no array of integers"),
    (dict(position=[[0, 0, 0]], surface=5), "surface: 5 found"),
])
def test_wrong_clouds_are_refused(arguments, words):
    with pytest.raises(phyxel.InputError, match=words):
        phyxel.Cloud(**arguments)


def test_wrong_shapes_are_refused():
    with pytest.raises(ValueError, match="did you mean \"beam\""):
        phyxel.shape("baem", size=(1, 1, 1), spacing=0.1)
    with pytest.raises(ValueError, match="exactly one of spacing and phyxels"):
        phyxel.shape("beam", size=(1, 1, 1))
    with pytest.raises(ValueError, match="lattice"):
        phyxel.shape("beam", size=(1, 1, 1), spacing=0.1, lattice="fcc")
