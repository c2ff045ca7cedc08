# Draws pictures of a series with ParaView: pvpython --force-offscreen-rendering picture.py SERIES.pvd OUT.png [TIME_MS ...]
#
# Deformed shapes side by side at the given times (by default at three of the series), colored by von Mises stress, with
# contact forces as arrows; stress and arrows have one scale for all of them. The ground is drawn at the lowest point.
import sys

from paraview.simple import *

WIDTH, HEIGHT = 420, 380

series, out, times = sys.argv[1], sys.argv[2], [1e-3 * float(t) for t in sys.argv[3:]]
source = PVDReader(FileName=series)
if not times:
    steps = source.TimestepValues
    times = [steps[len(steps) * k // 4] for k in (1, 2, 3)]
paraview.simple._DisableFirstRenderCameraReset()
layout = CreateLayout("pictures")
source.UpdatePipeline(times[0])
low, high = [source.GetDataInformation().GetBounds()[k::2] for k in (0, 1)]
size = max(h - l for l, h in zip(low, high))
middle = [0.5 * (l + h) for l, h in zip(low, high)]
peaks, views, forces, floor = [], [], [], float("inf")
for time in times:
    shape = WarpByVector(Input=source, Vectors=["POINTS", "displacement"])
    shape.UpdatePipeline(time)
    peaks.append(shape.CellData["von_mises"].GetRange()[1])
    floor = min(floor, shape.GetDataInformation().GetBounds()[4])
    forces.append(max(abs(x) for k in range(3) for x in shape.PointData["contact_force"].GetRange(k)))
for k, time in enumerate(times):
    view = CreateView("RenderView")
    view.ViewSize = [WIDTH, HEIGHT]
    view.OrientationAxesVisibility = 0
    view.UseColorPaletteForBackground = 0
    view.Background = [1.0, 1.0, 1.0]
    view.ViewTime = time
    shape = WarpByVector(Input=source, Vectors=["POINTS", "displacement"])
    shape.UpdatePipeline(time)
    display = Show(shape, view)
    display.SetRepresentationType("Surface With Edges")
    display.EdgeColor = [0.35, 0.35, 0.35]
    display.LineWidth = 0.5
    ColorBy(display, ("CELLS", "von_mises"))
    colors = GetColorTransferFunction("von_mises")
    colors.ApplyPreset("Viridis (matplotlib)", True)
    colors.RescaleTransferFunction(0.0, 0.5 * max(peaks))
    display.SetScalarBarVisibility(view, False)
    if max(forces) > 0.0:
        arrows = Glyph(Input=shape, GlyphType="Arrow")
        arrows.OrientationArray = ["POINTS", "contact_force"]
        arrows.ScaleArray = ["POINTS", "contact_force"]
        arrows.ScaleFactor = 0.4 * size / max(forces)
        arrows.GlyphMode = "All Points"
        arrows.UpdatePipeline(time)
        shown = Show(arrows, view)
        ColorBy(shown, None)
        shown.AmbientColor = shown.DiffuseColor = [0.84, 0.37, 0.0]
    ground = Plane(
        Origin=[middle[0] - size, middle[1] - size, floor],
        Point1=[middle[0] + size, middle[1] - size, floor],
        Point2=[middle[0] - size, middle[1] + size, floor],
    )
    below = Show(ground, view)
    below.AmbientColor = below.DiffuseColor = [0.9, 0.9, 0.88]
    view.CameraFocalPoint = middle
    view.CameraPosition = [middle[0] + 1.1 * size, middle[1] - 2.6 * size, middle[2] + 0.8 * size]
    view.CameraViewUp = [0.0, 0.0, 1.0]
    view.CameraViewAngle = 30.0
    views.append(view)
    AssignViewToLayout(view=view, layout=layout, hint=layout.GetViewLocation(views[k - 1]) if k else 0)
    if k + 1 < len(times):
        layout.SplitHorizontal(layout.GetViewLocation(view), 1.0 / (len(times) - k))
layout.SetSize(WIDTH * len(times), HEIGHT)
SaveScreenshot(out, layout, SaveAllViews=1, ImageResolution=[WIDTH * len(times), HEIGHT], SeparatorWidth=0)
