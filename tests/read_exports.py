"""Reads what "phyxel export" wrote with readers that are not ours, and compares it with the frames of the run.

read_exports.py gltf|vtu|meshio|paraview EXPORTED RUN; exit code 77 if a reader is missing. VTK's reader of HDF5 reads the
frames. EXPORTED is a .glb or .gltf file of which only the first body is compared, the folder of .vtu files, or the script
for ParaView.
"""

import json
import pathlib
import runpy
import sys
import types
import xml.etree.ElementTree

try:
    import numpy as np
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOGeometry import vtkGLTFReader
    from vtkmodules.vtkIOHDF import vtkHDFReader
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader
    if sys.argv[1] == "meshio":
        import meshio
except ImportError as missing:
    print(missing)
    sys.exit(77)

FAMILIES = ("surface", "phyxels")


def check(condition, what):
    if not condition:
        sys.exit(f"wrong: {what}")


def grid_of(file, reader):
    reader.SetFileName(str(file))
    reader.Update()
    return reader.GetOutput()


def points_of(grid):
    return vtk_to_numpy(grid.GetPoints().GetData())


def fields_of(grid):
    data = grid.GetPointData()
    return {data.GetArrayName(a): vtk_to_numpy(data.GetArray(a)) for a in range(data.GetNumberOfArrays())}


def series(run, family):
    """The files and times of a family of frames."""
    listed = json.loads((run / f"{family}.hdf.series").read_text())["files"]
    return [(run / entry["name"], entry["time"]) for entry in listed]


def parts_of(block):
    """The meshes in a tree of blocks."""
    if block is None or block.IsA("vtkPolyData"):
        return [block] if block is not None else []
    return [part for b in range(block.GetNumberOfBlocks()) for part in parts_of(block.GetBlock(b))]


def gltf(file, run):
    """The points of a run, whose vertical is z, with that of glTF, y."""
    reader = vtkGLTFReader()
    reader.SetFileName(str(file))
    reader.ApplyDeformationsToGeometryOn()
    frames = series(run, "surface")
    reader.SetFrameRate(round(1 / frames[1][1]))  # the times at which VTK looks at the animation
    reader.UpdateInformation()
    check(reader.GetNumberOfAnimations() == 1, "one animation")
    reader.EnableAnimation(0)
    reader.UpdateInformation()
    check(abs(reader.GetAnimationDuration(0) - frames[-1][1]) < 1e-6, "duration")
    for frame, time in frames:
        grid = grid_of(frame, vtkHDFReader())
        body = fields_of(grid).get("body", np.zeros(grid.GetNumberOfPoints(), int))
        x, y, z = points_of(grid)[body == 0].T
        reader.UpdateTimeStep(time)
        read = points_of(parts_of(reader.GetOutput())[0])
        check(np.allclose(read, np.array([x, z, -y]).T, rtol=0, atol=1e-5), f"points at t = {time}")


def vtu(folder, run):
    for family in FAMILIES:
        collection = xml.etree.ElementTree.parse(folder / f"{family}.pvd").getroot()
        entries = [(entry.get("file"), float(entry.get("timestep"))) for entry in collection.iter("DataSet")]
        frames = series(run, family)
        check([time for _, time in entries] == [time for _, time in frames], "times")
        for (name, time), (frame, _) in zip(entries, frames):
            grid, expected = grid_of(folder / name, vtkXMLUnstructuredGridReader()), grid_of(frame, vtkHDFReader())
            check(grid.GetFieldData().GetArray("TimeValue").GetValue(0) == time, "time")
            check(np.array_equal(points_of(grid), points_of(expected)), f"points of {name}")
            fields, wanted = fields_of(grid), fields_of(expected)
            check(sorted(fields) == sorted(wanted) and len(fields) > 2, f"fields of {name}: {sorted(fields)}")
            for field, values in fields.items():
                check(np.array_equal(values, wanted[field], equal_nan=True), f"{field} of {name}")
            types = set(vtk_to_numpy(grid.GetCellTypesArray()))
            check(types == ({5} if family == "surface" else {1}), f"cells of {name}")
            corners = vtk_to_numpy(grid.GetCells().GetConnectivityArray())
            if family == "surface":
                check(np.array_equal(corners, vtk_to_numpy(expected.GetCells().GetConnectivityArray())), "triangles")
            else:
                check(np.array_equal(corners, np.arange(grid.GetNumberOfPoints())), "vertices")


def of_meshio(folder, run):
    for family, cell in zip(FAMILIES, ("triangle", "vertex")):
        for k, (frame, _) in enumerate(series(run, family)):
            mesh, expected = meshio.read(folder / f"{family}_{k:06d}.vtu"), grid_of(frame, vtkHDFReader())
            check(np.array_equal(mesh.points, points_of(expected)), f"points of frame {k}")
            check(list(mesh.cells_dict) == [cell] and len(mesh.cells_dict[cell]) > 0, "cells")
            wanted = fields_of(expected)
            check(sorted(mesh.point_data) == sorted(wanted), f"fields {sorted(mesh.point_data)}")
            for field, values in wanted.items():
                check(np.array_equal(mesh.point_data[field], values, equal_nan=True), f"{field} of frame {k}")


class Stand:
    """An object of ParaView that takes every call, and remembers the attributes that are set."""

    def __init__(self, name, calls):
        self.__dict__.update(name=name, calls=calls)

    def __getattr__(self, method):
        return lambda *arguments: self.calls.append((self.name, method, *arguments))

    def __setattr__(self, attribute, value):
        self.calls.append((self.name, attribute, value))


def paraview(script, run):
    """Runs the script with a stand-in for ParaView, which opens the files by VTK."""
    calls, opened = [], {}

    def open_file(name):
        frames = json.loads(pathlib.Path(name).read_text())["files"]
        grids = [grid_of(pathlib.Path(name).parent / frame["name"], vtkHDFReader()) for frame in frames]
        source = Stand(pathlib.Path(name).name.split(".")[0], calls)
        opened[source.name] = grids
        return source

    simple = types.ModuleType("paraview.simple")
    for name in ("ColorBy", "Hide", "RenameSource", "Render", "ResetCamera", "SaveScreenshot"):
        setattr(simple, name, lambda *arguments, name=name: calls.append((name, *arguments)))
    simple.OpenDataFile = open_file
    simple.Show = lambda source, view: Stand(source.name, calls)
    simple.GetActiveViewOrCreate = lambda kind: Stand("view", calls)
    simple.GetAnimationScene = lambda: Stand("scene", calls)
    simple.GetColorTransferFunction = lambda field: Stand(field, calls)
    simple.GetScalarBar = lambda table, view: Stand("bar", calls)
    sys.modules["paraview"], sys.modules["paraview.simple"] = types.ModuleType("paraview"), simple
    sys.argv = [str(script)]
    runpy.run_path(str(script))

    check(sorted(opened) == ["phyxels", "surface"], "both families are open")
    said = {call[1]: call[2:] for call in calls if len(call) > 2 and isinstance(call[0], str)}
    (display, (place, field)), = [call[1:] for call in calls if call[0] == "ColorBy"]
    check(display.name == "surface" and place == "POINTS", "the surface has colours")
    values = np.concatenate([fields_of(grid)[field] for grid in opened["surface"]])
    low, high = said["RescaleTransferFunction"]
    if "UseLogScale" in said:  # three decades at most
        expected = np.percentile(values[values > 0], [5, 99], method="lower")
        expected[0] = max(expected[0], expected[1] / 1000)
    else:
        expected = np.percentile(values, [1, 99], method="lower")
    check(high > 2 * low and np.allclose((low, high), expected), f"range {low} to {high}: {expected}")
    check(said["AnimationTime"] == (series(run, "surface")[-1][1],), "the last time")
    check(any(call[0] == "Hide" and call[1].name == "phyxels" for call in calls), "phyxels are hidden")
    check(said["SetRepresentationType"] == ("Point Gaussian",), "phyxels are balls")
    points = points_of(opened["phyxels"][0])
    nearest = np.sort(np.linalg.norm(points[:, None] - points[None], axis=2), axis=1)[:, 1]
    check(0.3 < said["GaussianRadius"][0] / np.median(nearest) < 0.7, "radius of phyxels")
    check(said["CameraViewUp"] == ([0, 0, 1],) and said["CameraPosition"][0][2] > 0, "the camera looks down")


{"gltf": gltf, "vtu": vtu, "meshio": of_meshio, "paraview": paraview}[sys.argv[1]](*map(pathlib.Path, sys.argv[2:4]))
