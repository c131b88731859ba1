"""Scenes from dicts, files and the builder; own meshes."""
import json
import os
import tempfile
import unittest

import numpy as np

import graupel
from scenes import block


class SceneTest(unittest.TestCase):
    def test_a_dict_is_the_scene_of_its_file(self):
        path = graupel.scene_path("shared/water_steps")
        from_file = graupel.Scene.from_file(path)
        again = graupel.Scene.from_dict(from_file.to_dict())
        self.assertEqual(again.to_dict(), from_file.to_dict())
        self.assertEqual(from_file.frames, 300)
        self.assertAlmostEqual(from_file.frame_time, 1 / 60)

    def test_numbers_and_arrays_of_numpy_are_values(self):
        scene = block(gravity=np.array([0, -3.5, 0]), seed=np.int64(7))
        self.assertEqual(scene.gravity, (0, -3.5, 0))
        self.assertEqual(scene.seed, 7)

    def test_changes_come_before_the_checks(self):
        path = graupel.scene_path("shared/water_steps")
        self.assertEqual(graupel.Scene.from_file(path, {"frames": 12, "gravity": [0, -1, 0]}).frames, 12)
        with self.assertRaisesRegex(graupel.ConfigError, "fames"):
            graupel.Scene.from_file(path, {"fames": 12})

    def test_errors_name_the_key_and_what_is_allowed(self):
        keys = block().to_dict()
        keys["domain"]["dx"] = -1
        with self.assertRaisesRegex(graupel.ConfigError, "/domain/dx.*-1"):
            graupel.Scene.from_dict(keys)
        with self.assertRaises(graupel.InputError):
            graupel.Scene.from_file("no_such_scene.json")
        with self.assertRaisesRegex(graupel.ConfigError, "object"):
            graupel.Scene.from_dict({"name": object()})

    def test_errors_are_pythons_kinds_too(self):
        for kind, base, code in ((graupel.ConfigError, ValueError, 2), (graupel.InputError, ValueError, 3),
                                 (graupel.DivergedError, ArithmeticError, 4), (graupel.IoError, OSError, 5)):
            self.assertTrue(issubclass(kind, base) and issubclass(kind, graupel.Error))
            self.assertEqual(kind.exit_code, code)

    def test_relative_meshes_start_at_the_folder(self):
        with tempfile.TemporaryDirectory() as folder:
            with open(os.path.join(folder, "tetrahedron.obj"), "w", encoding="ascii") as file:
                file.write("v 0 0 0\nv 0.1 0 0\nv 0 0 0.1\nv 0 0.1 0\nf 1 2 3\nf 2 1 4\nf 3 2 4\nf 1 3 4\n")
            keys = block().to_dict()
            keys["obstacles"] = [{"shape": "mesh", "file": "tetrahedron.obj", "position": [0.2, 0.1, 0.2]}]
            self.assertEqual(len(graupel.Scene.from_dict(keys, folder).to_dict()["obstacles"]), 1)
            with self.assertRaises(graupel.InputError):
                graupel.Scene.from_dict(keys)

    def test_meshes_in_memory_are_obstacles(self):
        vertices = np.array([[-0.2, 0, -0.15], [0.2, 0, -0.15], [0, 0, 0.2], [0, 0.1, 0]])
        triangles = [[0, 1, 2], [1, 0, 3], [2, 1, 3], [0, 2, 3]]
        scene = block()
        without = graupel.Simulation(scene)
        with_mesh = graupel.Simulation(scene.with_mesh(vertices, triangles, position=(0.24, 0.1, 0.24)))
        without.run(10)
        with_mesh.run(10)
        self.assertGreater((with_mesh.positions - without.positions)[:, 1].max(), 0.01)
        with self.assertRaisesRegex(graupel.ConfigError, r"triangles\[1\] names the vertex 4"):
            scene.with_mesh(vertices, [[0, 1, 2], [1, 0, 4]])
        with self.assertRaisesRegex(graupel.ConfigError, "contact is not known"):
            scene.with_mesh(vertices, triangles, contact="glue")

    def test_the_builders_dict_is_a_copy(self):
        builder = graupel.SceneBuilder(size=(1, 1, 1)).material("water", preset="water")
        keys = builder.to_dict()
        keys["domain"]["size"][0] = 7
        keys["materials"]["sand"] = {"preset": "sand"}
        self.assertEqual(builder.to_dict()["domain"]["size"], [1, 1, 1])
        self.assertEqual(list(builder.to_dict()["materials"]), ["water"])

    def test_a_dict_is_plain_data(self):
        json.dumps(block().to_dict())


if __name__ == "__main__":
    unittest.main()
