"""Opens a run of phyxel in ParaView, with its colours, times and view: written by "phyxel export".

In ParaView: File > Load State. In a shell: paraview --script=open_in_paraview.py; or pvbatch open_in_paraview.py picture.png,
for a picture of the last frame. The file may move with the folder of the run.
"""
import json
import math
import pathlib
import sys

from paraview.simple import (ColorBy, GetActiveViewOrCreate, GetAnimationScene, GetColorTransferFunction,
                             GetScalarBar, Hide, OpenDataFile, RenameSource, Render, ResetCamera, SaveScreenshot, Show)

SETTINGS = json.loads(@settings@)


def folder():
    """The folder of the run: that of this file, if ParaView says where it is."""
    here = pathlib.Path(globals().get("__file__", "")).resolve().parent
    found = any((here / file).exists() for file in SETTINGS["files"].values())
    return here if found else pathlib.Path(SETTINGS["folder"])


def show_colours(display, view):
    """Colours by the field, over the range that pictures have."""
    colours = SETTINGS["colours"]
    ColorBy(display, ("POINTS", colours["field"], "Magnitude") if colours["vector"] else ("POINTS", colours["field"]))
    table = GetColorTransferFunction(colours["field"])
    table.AutomaticRescaleRangeMode = "Never"
    table.ApplyPreset("Viridis (matplotlib)", True)
    table.RescaleTransferFunction(colours["low"], colours["high"])
    if colours["logarithmic"]:
        table.MapControlPointsToLogSpace()
        table.UseLogScale = 1
    bar = GetScalarBar(table, view)
    bar.Title, bar.ComponentTitle = colours["title"], ""
    display.SetScalarBarVisibility(view, True)


def open_run():
    view = GetActiveViewOrCreate("RenderView")
    for family, file in SETTINGS["files"].items():
        source = OpenDataFile(str(folder() / file))
        RenameSource(family, source)
        display = Show(source, view)
        if family == "phyxels":
            display.SetRepresentationType("Point Gaussian")
            display.GaussianRadius = SETTINGS["radius"]
        if family == SETTINGS["coloured"]:
            show_colours(display, view)
        elif family == "phyxels":
            Hide(source, view)  # inside the surface
        else:
            display.Opacity = 0.25  # around the phyxels
    scene = GetAnimationScene()
    scene.UpdateAnimationUsingDataTimeSteps()
    scene.AnimationTime = SETTINGS["times"][-1]
    up, ahead = SETTINGS["up"], SETTINGS["view"]
    length = math.hypot(*ahead)
    view.CameraFocalPoint = [0, 0, 0]
    view.CameraPosition = [-x / length for x in ahead]
    view.CameraViewUp = up
    ResetCamera(view)
    Render(view)
    return view


VIEW = open_run()
if len(sys.argv) == 2 and sys.argv[1].endswith(".png"):
    SaveScreenshot(sys.argv[1], VIEW, ImageResolution=[1280, 960])
