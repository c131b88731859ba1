#!/usr/bin/env python3
"""Exported files in other programs: each format is opened by the library of a program that reads it.

    python3 tests/export/programs_test.py                 # with what this Python has; the rest is skipped
    python3 tests/export/programs_test.py ParaView --picture FILE.png
    python3 tests/export/programs_test.py --install       # in build/export-python, with usd-core and vtk from PyPI
    python3 tests/export/programs_test.py --install --blender [--picture FILE.png]   # and bpy (1 GB), a frame rendered

Runs build/graupel. USD by usd-core (pxr); VTP, PVD, PLY and OBJ by VTK; .pvd and OBJ by ParaView's pvpython (Debian's
python3-paraview), and a frame rendered under xvfb with --picture; all that Blender reads by bpy. Film by ffprobe. .bgeo and .vdb are read back by tests/io alone.
"""
import argparse
import importlib.util
import json
import os
import shutil
import subprocess
import sys
import tempfile
import unittest
import venv
import xml.etree.ElementTree

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
GRAUPEL = os.path.join(ROOT, "build", "graupel")
ENVIRONMENT = os.path.join(ROOT, "build", "export-python")
READ_IN_PARAVIEW = os.path.join(os.path.dirname(os.path.abspath(__file__)), "read_in_paraview.py")
SCENE = """{
  "name": "two",
  "domain": {"dx": 0.03125},
  "materials": {"water": {"preset": "taichi_water"}, "sand": {"model": "sand", "density": 1500,
                "youngs_modulus": 3e5}},
  "sources": [
    {"shape": "box", "size": [0.3, 0.2, 0.3], "position": [0.3, 0.5, 0.5], "material": "water", "velocity": [1, 0, 0]},
    {"shape": "sphere", "radius": 0.12, "position": [0.7, 0.6, 0.5], "material": "sand", "velocity": [0, -2, 0]}],
  "frames": 4
}"""
BOX_VOLUME = 0.3 * 0.2 * 0.3
LAST = 4
picture = None


def has(module):
    return importlib.util.find_spec(module) is not None


def needs(module, package):
    return unittest.skipUnless(has(module), f"{package} is not installed (--install, or pip install {package})")


class Exported(unittest.TestCase):
    """A small run with water and sand, exported as each test asks."""

    @classmethod
    def setUpClass(cls):
        cls.place = tempfile.TemporaryDirectory()
        cls.run_file = cls.file("two.h5")
        with open(cls.file("two.json"), "w", encoding="utf-8") as scene:
            scene.write(SCENE)
        cls.graupel("simulate", cls.file("two.json"), "-o", cls.run_file, "--device", "cpu", "--fields",
                    "plastic,deformation_gradient")

    @classmethod
    def tearDownClass(cls):
        cls.place.cleanup()

    @classmethod
    def file(cls, *parts):
        return os.path.join(cls.place.name, *parts)

    @classmethod
    def graupel(cls, *words):
        done = subprocess.run([GRAUPEL, *words], capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise AssertionError(f"graupel {' '.join(words)}: {done.stderr}")

    def exported(self, file_format, *options, folder=None):
        folder = self.file(folder or self.id().rsplit(".", 1)[1] + "_" + file_format)
        self.graupel("export", self.run_file, "--format", file_format, "-o", folder, "--name", "two", *options)
        return folder


@needs("pxr", "usd-core")
class Usd(Exported):
    def stage(self, folder):
        from pxr import Usd, UsdValidation
        stage = Usd.Stage.Open(os.path.join(folder, "two.usda"))
        validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
        faults = UsdValidation.ValidationContext(validators).Validate(stage)
        self.assertEqual([fault.GetMessage() for fault in faults], [])
        self.assertEqual((stage.GetStartTimeCode(), stage.GetEndTimeCode()), (0, LAST))
        self.assertAlmostEqual(stage.GetTimeCodesPerSecond(), 60)
        return stage

    def test_points(self):
        from pxr import UsdGeom
        stage = self.stage(self.exported("usda"))
        self.assertEqual(UsdGeom.GetStageUpAxis(stage), "Y")
        self.assertEqual(UsdGeom.GetStageMetersPerUnit(stage), 1)
        points = UsdGeom.Points(stage.GetPrimAtPath("/two/particles"))
        count = len(points.GetPointsAttr().Get(0))
        self.assertGreater(count, 4000)
        for attribute in (points.GetVelocitiesAttr(), points.GetIdsAttr()):
            self.assertEqual(attribute.GetTimeSamples(), [float(k) for k in range(LAST + 1)])
            self.assertEqual(len(attribute.Get(LAST)), count)
        variables = UsdGeom.PrimvarsAPI(points)
        types = variables.GetPrimvar("particle_type").Get(0)
        self.assertEqual(set(types), {5, 6})
        ratio = variables.GetPrimvar("J").Get(LAST)
        self.assertEqual(len(ratio), count)
        self.assertLess(max(abs(j - 1) for j in ratio), 0.2)
        velocity = points.GetVelocitiesAttr().Get(0)
        self.assertEqual(tuple(velocity[list(types).index(5)]), (1, 0, 0))
        low, high = points.GetExtentAttr().Get(0)
        self.assertLess(low[0], 0.16)
        self.assertGreater(high[0], 0.8)

    def test_surfaces(self):
        from pxr import UsdGeom
        stage = self.stage(self.exported("usda", "--surface"))
        for name, velocity in (("water", (1, 0, 0)), ("sand", (0, -2, 0))):
            mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/two/" + name))
            for frame in range(LAST + 1):
                points = mesh.GetPointsAttr().Get(frame)
                counts, corners = mesh.GetFaceVertexCountsAttr().Get(frame), mesh.GetFaceVertexIndicesAttr().Get(frame)
                self.assertTrue(UsdGeom.Mesh.ValidateTopology(corners, counts, len(points))[0])
                self.assertEqual(len(mesh.GetNormalsAttr().Get(frame)), len(points))
                self.assertEqual(len(mesh.GetVelocitiesAttr().Get(frame)), len(points))
            self.assertEqual(mesh.GetNormalsInterpolation(), "vertex")
            for v in mesh.GetVelocitiesAttr().Get(0):
                self.assertLess(max(abs(v[i] - velocity[i]) for i in range(3)), 1e-4)


@needs("vtk", "vtk")
class Vtk(Exported):
    """ParaView reads these formats by the same classes."""

    def times(self, folder):
        collection = xml.etree.ElementTree.parse(os.path.join(folder, "two.pvd")).getroot().find("Collection")
        return [{**one.attrib, "file": os.path.join(folder, one.attrib["file"])} for one in collection]

    def read(self, reader, path):
        import vtk
        errors = []
        reader.AddObserver(vtk.vtkCommand.ErrorEvent, lambda *_: errors.append(path))
        reader.SetFileName(path)
        reader.Update()
        self.assertEqual(errors, [])
        return reader.GetOutput()

    def check_closed(self, data, volume):
        import vtk
        edges = vtk.vtkFeatureEdges()
        edges.SetInputData(data)
        edges.BoundaryEdgesOn()
        edges.NonManifoldEdgesOn()
        edges.FeatureEdgesOff()
        edges.ManifoldEdgesOff()
        edges.Update()
        self.assertEqual(edges.GetOutput().GetNumberOfCells(), 0)
        mass = vtk.vtkMassProperties()
        mass.SetInputData(data)
        mass.Update()
        self.assertAlmostEqual(mass.GetVolume() / volume, 1, delta=0.1)

    def test_points(self):
        import vtk
        times = self.times(self.exported("vtp"))
        self.assertEqual([round(60 * float(one["timestep"])) for one in times], list(range(LAST + 1)))
        data = self.read(vtk.vtkXMLPolyDataReader(), times[-1]["file"])
        arrays = data.GetPointData()
        self.assertEqual({arrays.GetArrayName(i) for i in range(arrays.GetNumberOfArrays())},
                         {"particle_type", "id", "velocity", "J"})
        self.assertEqual(data.GetNumberOfPoints(), data.GetNumberOfVerts())
        self.assertEqual(arrays.GetArray("id").GetValue(data.GetNumberOfPoints() - 1), data.GetNumberOfPoints() - 1)

    def test_surfaces(self):
        import vtk
        times = self.times(self.exported("vtp", "--surface"))
        self.assertEqual({one["name"] for one in times}, {"water", "sand"})
        water = [one for one in times if one["name"] == "water"]
        data = self.read(vtk.vtkXMLPolyDataReader(), water[0]["file"])
        self.check_closed(data, BOX_VOLUME)
        velocity = data.GetPointData().GetArray("velocity")
        for i in range(0, data.GetNumberOfPoints(), 50):
            self.assertAlmostEqual(velocity.GetTuple3(i)[0], 1, delta=1e-4)
        normals = data.GetPointData().GetNormals()
        self.assertIsNotNone(normals)
        center = data.GetCenter()
        outwards = [sum(n * (x - c) for n, x, c in zip(normals.GetTuple3(i), data.GetPoint(i), center)) > 0
                    for i in range(data.GetNumberOfPoints())]
        self.assertGreater(sum(outwards) / len(outwards), 0.99)

    def test_meshes(self):
        import vtk
        for file_format, reader in (("obj", vtk.vtkOBJReader()), ("ply", vtk.vtkPLYReader())):
            folder = self.exported(file_format, "--surface", "--frames", "0")
            self.check_closed(self.read(reader, os.path.join(folder, f"two_water_0000.{file_format}")), BOX_VOLUME)

    def test_ply_points(self):
        import vtk
        folder = self.exported("ply", "--frames", "3")
        self.assertGreater(self.read(vtk.vtkPLYReader(), os.path.join(folder, "two_0003.ply")).GetNumberOfPoints(), 4000)


@unittest.skipUnless(shutil.which("pvpython"), "ParaView is not installed (Debian: apt-get install python3-paraview)")
class ParaView(Exported):
    def test_collections_over_time(self):
        points = os.path.join(self.exported("vtp"), "two.pvd")
        surfaces = os.path.join(self.exported("vtp", "--surface", folder="surfaces"), "two.pvd")
        mesh = os.path.join(self.exported("obj", "--surface", "--frames", "0"), "two_water_0000.obj")
        words = ["pvpython", READ_IN_PARAVIEW, points, surfaces, mesh]
        if picture:
            words = ["xvfb-run", "-a", *words, picture]
        done = subprocess.run(words, capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        read = json.loads(done.stdout.splitlines()[-1])
        for times in (read["times"], read["surface_times"]):
            self.assertEqual([round(60 * time) for time in times], list(range(LAST + 1)))
        self.assertGreater(read["points"], 4000)
        self.assertEqual(read["point_arrays"], ["J", "id", "particle_type", "velocity"])
        self.assertEqual(read["surface_arrays"], ["Normals", "particle_type", "velocity"])
        low, high = read["surface_bounds"][::2], read["surface_bounds"][1::2]
        self.assertAlmostEqual(low[0], 0.15 + LAST / 60, delta=0.02)  # the box flies at 1 m/s, the ball rests at x = 0.7
        self.assertAlmostEqual(high[0], 0.7 + 0.12, delta=0.02)
        box, ball = 2 * (0.3 * 0.2 + 0.2 * 0.3 + 0.3 * 0.3), 4 * 3.14159 * 0.12**2
        self.assertAlmostEqual(read["surface_area"] / (box + ball), 1, delta=0.15)
        self.assertGreater(read["mesh_points"], 1000)


@needs("bpy", "bpy")
class Blender(Exported):
    def setUp(self):
        import bpy
        bpy.ops.wm.read_factory_settings(use_empty=True)

    def test_meshes(self):
        import bpy
        for file_format, read in (("obj", bpy.ops.wm.obj_import), ("ply", bpy.ops.wm.ply_import)):
            folder = self.exported(file_format, "--surface", "--frames", "0")
            bpy.ops.wm.read_factory_settings(use_empty=True)
            read(filepath=os.path.join(folder, f"two_water_0000.{file_format}"))
            mesh = next(iter(bpy.data.objects)).data
            self.assertGreater(len(mesh.polygons), 1000)
            self.assertFalse(mesh.validate())
            if file_format == "ply":
                self.assertIn("vx", mesh.attributes)

    def test_level_sets(self):
        import bpy
        folder = self.exported("vdb", "--surface", "--frames", "0")
        bpy.ops.object.volume_import(filepath=os.path.join(folder, "two_water_0000.vdb"))
        grids = next(iter(bpy.data.volumes)).grids
        grids.load()
        self.assertEqual({grid.name for grid in grids}, {"surface", "v"})

    def test_usd_over_time_and_a_picture(self):
        import bpy
        folder = self.exported("usda", "--surface")
        bpy.ops.wm.usd_import(filepath=os.path.join(folder, "two.usda"))
        sizes = []
        for frame in (0, LAST):
            bpy.context.scene.frame_set(frame)
            graph = bpy.context.evaluated_depsgraph_get()
            sizes.append(len(bpy.data.objects["water"].evaluated_get(graph).data.vertices))
        self.assertGreater(min(sizes), 1000)
        self.assertNotEqual(*sizes)
        if picture:
            render(bpy, picture)


def render(bpy, path):
    """One frame on the CPU: blue water, ochre sand, a sun."""
    for name, colour in (("water", (0.05, 0.25, 0.8, 1)), ("sand", (0.7, 0.45, 0.15, 1))):
        material = bpy.data.materials.new(name + "_look")
        material.use_nodes = True
        material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = colour
        data = bpy.data.objects[name].data
        data.materials.clear()
        data.materials.append(material)
    scene = bpy.context.scene
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    target = bpy.data.objects.new("target", None)
    target.location = (0.5, -0.5, 0.5)  # the middle of the domain, with z up
    camera.location = (0.8, -1.6, 0.9)
    look = camera.constraints.new("TRACK_TO")
    look.target, look.track_axis, look.up_axis = target, "TRACK_NEGATIVE_Z", "UP_Y"
    sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
    sun.data.energy, sun.rotation_euler = 4, (0.6, 0.3, 0)
    for one in (camera, target, sun):
        scene.collection.objects.link(one)
    scene.camera = camera
    scene.world = scene.world or bpy.data.worlds.new("world")
    scene.world.use_nodes = True
    scene.render.engine, scene.cycles.samples, scene.cycles.device = "CYCLES", 24, "CPU"
    scene.render.resolution_x, scene.render.resolution_y, scene.render.filepath = 640, 400, os.path.abspath(path)
    scene.frame_set(LAST)
    bpy.ops.render.render(write_still=True)


@unittest.skipUnless(shutil.which("ffprobe"), "ffmpeg is not installed (Debian: apt-get install ffmpeg)")
class Film(Exported):
    def test_films_have_a_picture_a_frame(self):
        for file_format, codec in (("mp4", "h264"), ("gif", "gif")):
            folder = self.exported(file_format, "--width", "160", "--height", "96", "--rate", "20")
            told = subprocess.run(["ffprobe", "-v", "error", "-count_frames", "-show_streams", "-of", "json",
                                   os.path.join(folder, "two." + file_format)], capture_output=True, check=True)
            stream = json.loads(told.stdout)["streams"][0]
            self.assertEqual((stream["codec_name"], stream["width"], stream["height"], int(stream["nb_read_frames"])),
                             (codec, 160, 96, LAST + 1))


def main():
    global picture
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--install", action="store_true", help="run in build/export-python, made with PyPI's packages")
    parser.add_argument("--blender", action="store_true", help="with --install: bpy too (1 GB)")
    parser.add_argument("--picture", help="where ParaView, or Blender, renders a frame to")
    arguments, rest = parser.parse_known_args()
    if arguments.install:
        python = os.path.join(ENVIRONMENT, "bin", "python")
        if not os.path.exists(python):
            venv.create(ENVIRONMENT, with_pip=True)
        packages = ["usd-core", "vtk"] + (["bpy<5"] if arguments.blender else [])
        subprocess.run([python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *packages], check=True)
        picture_words = ["--picture", arguments.picture] if arguments.picture else []
        os.execv(python, [python, os.path.abspath(__file__), *picture_words, *rest])
    picture = arguments.picture
    unittest.main(argv=[sys.argv[0], *rest])


if __name__ == "__main__":
    main()
