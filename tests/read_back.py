"""Reads what the tests of lib/files/recorder.cpp wrote, with readers that are not ours: VTK's and h5py.

read_back.py frames|single FOLDER FAR; exit code 77 if a reader is missing. The expected numbers are those of
tests/lib/files/recorder_test.cpp: in frame k everything has moved by k/2 in x, from FAR on.
"""

import json
import pathlib
import sys

try:
    import h5py
    import numpy as np
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOHDF import vtkHDFReader
except ImportError as missing:
    print(missing)
    sys.exit(77)

FAR = float(sys.argv[3])
REST = np.array([[0, 0, 0], [1, 0, 0], [5, 0, 0], [5, 1, 0], [5, 0, 1]], float) + [FAR, 0, 0]
SURFACE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float) + [FAR, 0, 0]
TRIANGLES = [0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2]


def grid_of(file):
    reader = vtkHDFReader()
    assert reader.CanReadFile(str(file)), file
    reader.SetFileName(str(file))
    reader.Update()
    return reader.GetOutput()


def check(condition, what):
    if not condition:
        sys.exit(f"wrong: {what}")


def check_phyxels(folder, k):
    grid = grid_of(folder / f"phyxels_{k:06d}.hdf")
    moved = REST + [0.5 * k, 0, 0]
    check(np.array_equal(vtk_to_numpy(grid.GetPoints().GetData()), moved), f"points of frame {k}")
    check(np.allclose(grid.GetBounds()[0:2], [FAR + 0.5 * k, FAR + 5 + 0.5 * k], rtol=0, atol=0), "bounds")
    check(grid.GetNumberOfCells() == 2, "one cell a body")
    check([grid.GetCell(c).GetNumberOfPoints() for c in range(2)] == [2, 3], "points of each body")
    data = grid.GetPointData()
    expected = {
        "displacement": np.tile([0.5 * k, 0, 0], (5, 1)),
        "velocity": np.tile([0, 0.25 * k, 0], (5, 1)),
        "von_mises": np.full(5, 100.0 * k),
        "volume_ratio": np.ones(5),
        "mass": np.array([1, 2, 3, 4, 5]),
        "volume": np.array([0.1, 0.2, 0.3, 0.4, 0.5], np.float32),
        "body": np.array([0, 0, 1, 1, 1]),
    }
    names = sorted(data.GetArrayName(a) for a in range(data.GetNumberOfArrays()))
    check(names == sorted(expected), f"fields {names}")
    for name, values in expected.items():
        check(np.array_equal(vtk_to_numpy(data.GetArray(name)), values), f"{name} of frame {k}")


def check_surface(folder, k):
    grid = grid_of(folder / f"surface_{k:06d}.hdf")
    moved = SURFACE + [0.5 * k, 0, 0]
    check(np.array_equal(vtk_to_numpy(grid.GetPoints().GetData()), moved), f"surface of frame {k}")
    cells = vtk_to_numpy(grid.GetCells().GetConnectivityArray())
    check(list(cells) == TRIANGLES, "triangles")
    check(grid.GetPointData().GetArray("Normals") is not None, "normals")


def check_metadata(folder, k):
    with h5py.File(folder / f"phyxels_{k:06d}.hdf") as file:
        meta = file["phyxel"].attrs
        check(meta["time"] == 0.1 * k and meta["step"] == 10 * k, "time and step")
        check(meta["kinetic_energy"] == k, "energy")
        check(file["phyxel/scene"][()].decode() == 'title = "two bodies"\n', "scene text")
        check(file.userblock_size == 512, "the seal is a user block")


def frames(folder):
    for family in "phyxels", "surface":
        series = json.loads((folder / f"{family}.hdf.series").read_text())
        check([f["name"] for f in series["files"]] == [f"{family}_{k:06d}.hdf" for k in range(3)], "series")
        check([f["time"] for f in series["files"]] == [0.1 * k for k in range(3)], "times")
    for k in range(3):
        check_phyxels(folder, k)
        check_surface(folder, k)
        check_metadata(folder, k)


def single(folder):
    for family, rest in ("phyxels", REST), ("surface", SURFACE):
        with h5py.File(folder / f"{family}.vtkhdf") as file:
            grid, steps = file["VTKHDF"], file["VTKHDF/Steps"]
            check(list(grid.attrs["Version"]) == [2, 0] and steps.attrs["NSteps"] == 3, "version and steps")
            check(np.array_equal(steps["Values"], [0.1 * k for k in range(3)]), "times")
            for k in range(3):
                begin = steps["PointOffsets"][k]
                points = grid["Points"][begin : begin + len(rest)]
                check(np.array_equal(points, rest + [0.5 * k, 0, 0]), f"points of step {k}")
        reader = vtkHDFReader()
        reader.SetFileName(str(folder / f"{family}.vtkhdf"))
        reader.UpdateInformation()
        if not hasattr(reader, "GetNumberOfSteps"):
            continue  # before VTK 9.3 the reader knows no time
        for k in range(3):
            reader.SetStep(k)
            reader.Update()
            points = vtk_to_numpy(reader.GetOutput().GetPoints().GetData())
            check(np.array_equal(points, rest + [0.5 * k, 0, 0]), f"VTK's points of step {k}")


{"frames": frames, "single": single}[sys.argv[1]](pathlib.Path(sys.argv[2]))
