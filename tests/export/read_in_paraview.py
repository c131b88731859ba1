"""Run by pvpython: opens a .pvd of points, one of surfaces and an OBJ, and renders the last frame of the surfaces.

    pvpython read_in_paraview.py POINTS.pvd SURFACES.pvd MESH.obj [PICTURE.png]   # the picture needs a display, such as xvfb-run's

What it reads goes to standard output as one line of JSON; programs_test.py checks it.
"""
import json
import os
import sys

from paraview import simple
from paraview.servermanager import Fetch

points_file, surfaces_file, mesh_file = sys.argv[1:4]


def read(path):
    source = simple.OpenDataFile(path)
    times = list(source.TimestepValues) if hasattr(source, "TimestepValues") else []
    simple.UpdatePipeline(times[-1] if times else 0, source)
    return source, times


def arrays(source):
    return sorted(source.PointData.keys())


points, point_times = read(points_file)
surfaces, surface_times = read(surfaces_file)
mesh, _ = read(mesh_file)
area = simple.IntegrateVariables(simple.ExtractSurface(surfaces))
simple.UpdatePipeline(surface_times[-1], area)

if len(sys.argv) > 4:
    view = simple.CreateRenderView()
    view.ViewSize = [640, 400]
    shown = simple.Show(surfaces, view)
    simple.ColorBy(shown, ("POINTS", "velocity", "Magnitude"))
    view.ViewTime = surface_times[-1]
    simple.ResetCamera(view)
    simple.SaveScreenshot(sys.argv[4], view)

print(json.dumps({
    "times": point_times,
    "points": points.GetDataInformation().GetNumberOfPoints(),
    "point_arrays": arrays(points),
    "surface_times": surface_times,
    "surface_arrays": arrays(surfaces),
    "surface_bounds": list(surfaces.GetDataInformation().GetBounds()),
    "surface_area": Fetch(area).GetCellData().GetArray("Area").GetValue(0),
    "mesh_points": mesh.GetDataInformation().GetNumberOfPoints(),
}), flush=True)
os._exit(0)  # Debian's ParaView sometimes aborts when it takes its windows down
