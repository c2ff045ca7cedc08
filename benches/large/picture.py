# Draws target/large/slab.vtu with ParaView: pvpython --force-offscreen-rendering picture.py SLAB.vtu OUT.png
#
# Left: the lower side from below, with contact forces as color. Right: the slab cut open through crests of the floor,
# with vertical velocities. Displacements are magnified.
import sys

from paraview.simple import *

WIDTH, HEIGHT, MAGNIFIED = 620, 400, 20.0

slab = XMLUnstructuredGridReader(FileName=[sys.argv[1]])
slab.UpdatePipeline()
low, high = [slab.GetDataInformation().GetBounds()[k::2] for k in (0, 1)]
size = max(h - l for l, h in zip(low, high))
middle = [0.5 * (l + h) for l, h in zip(low, high)]
paraview.simple._DisableFirstRenderCameraReset()
layout = CreateLayout("slab")


def show(source, array, axis, preset, span, camera):
    view = CreateView("RenderView")
    view.ViewSize = [WIDTH, HEIGHT]
    view.OrientationAxesVisibility = 0
    view.UseColorPaletteForBackground = 0
    view.Background = [1.0, 1.0, 1.0]
    shape = WarpByVector(Input=source, Vectors=["POINTS", "displacement"], ScaleFactor=MAGNIFIED)
    display = Show(shape, view)
    display.Ambient, display.Diffuse = 0.45, 0.6
    ColorBy(display, ("POINTS", array, axis))
    colors = GetColorTransferFunction(array)
    colors.ApplyPreset(preset, True)
    colors.VectorMode, colors.VectorComponent = "Component", 2
    colors.RescaleTransferFunction(*span)
    display.SetScalarBarVisibility(view, False)
    view.CameraFocalPoint = middle
    view.CameraPosition = [m + size * c for m, c in zip(middle, camera)]
    view.CameraViewUp = [0.0, 0.0, 1.0]
    view.CameraViewAngle = 30.0
    return view


force = slab.PointData["contact_force"].GetRange(2)[1]
speed = max(abs(v) for v in slab.PointData["velocity"].GetRange(2))
cut = Clip(Input=slab, ClipType="Plane", Invert=0)
# (Crests are a quarter of a wave from the sides; there are three waves a side.)
cut.ClipType.Origin = [middle[0], low[1] + (high[1] - low[1]) / 12.0, middle[2]]
cut.ClipType.Normal = [0.0, 1.0, 0.0]
below = show(slab, "contact_force", "Z", "Viridis (matplotlib)", [0.0, force], [0.9, -1.6, -1.35])
inside = show(cut, "velocity", "Z", "Cool to Warm", [-speed, speed], [0.6, -1.7, 0.9])
AssignViewToLayout(view=below, layout=layout, hint=0)
layout.SplitHorizontal(layout.GetViewLocation(below), 0.5)
AssignViewToLayout(view=inside, layout=layout, hint=layout.GetViewLocation(below) + 1)
layout.SetSize(2 * WIDTH, HEIGHT)
SaveScreenshot(sys.argv[2], layout, SaveAllViews=1, ImageResolution=[2 * WIDTH, HEIGHT], SeparatorWidth=0)
