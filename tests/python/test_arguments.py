"""Arguments that are not possible: which error, and what it names."""
import json
import math
import os
import tempfile
import unittest
from pathlib import Path

import numpy as np

import graupel
from scenes import block


class IndexTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.place = tempfile.TemporaryDirectory()
        cls.made = graupel.simulate(block(), os.path.join(cls.place.name, "a.h5"), 2)

    @classmethod
    def tearDownClass(cls):
        cls.place.cleanup()

    def test_frames_are_indexed_by_int_and_slice(self):
        x = self.made.positions
        np.testing.assert_array_equal(x[np.int64(1)], x[1])
        np.testing.assert_array_equal(self.made[np.int64(-1)].positions, x[2])
        for wrong in (1.5, "a", (0, 1), [0, 1]):
            with self.assertRaisesRegex(TypeError, "allowed: int, slice"):
                x[wrong]
            with self.assertRaises(TypeError):
                self.made[wrong]
        for far in (2**70, -2**70, 3, -4):
            with self.assertRaises(IndexError):
                x[far]
            with self.assertRaises(IndexError):
                self.made[far]


class ArraysTest(unittest.TestCase):
    def test_arrays_hold_real_numbers_in_their_shape(self):
        scene, x = block(), np.full((2, 3), 0.2)
        for wrong in (x.astype(complex), [["0.2"] * 3], [[0.2, 0.2], [0.2]], "abc", x * 1j):
            with self.assertRaisesRegex(graupel.ConfigError, "positions is no array of real numbers"):
                scene.with_particles(wrong)
        with self.assertRaisesRegex(graupel.ConfigError, r"materials has the wrong shape \(\[2, 1\]"):
            scene.with_particles(x, materials=np.zeros((2, 1), int))
        with self.assertRaisesRegex(graupel.ConfigError, r"materials\[1\] = 0.5 is no whole number"):
            scene.with_particles(x, materials=[0, 0.5])
        scene.with_particles(x, materials=[0.0, 0.0])

    def test_masked_elements_are_refused(self):
        scene, x = block(), np.full((3, 3), 0.2)
        graupel.Simulation(scene.with_particles(np.ma.masked_array(x, mask=np.zeros((3, 3)))))
        masked = np.ma.masked_array(x, mask=[[0, 0, 0], [0, 0, 1], [1, 1, 1]])
        for wrong in (masked, list(masked), np.ma.masked_array(x, mask=[[0, 0, 0], [0, 0, 1], [0, 0, 0]])):
            with self.assertRaisesRegex(graupel.ConfigError, r"positions\[1\]\[2\] is masked .*fill"):
                scene.with_particles(wrong)
        with self.assertRaisesRegex(graupel.ConfigError, r"materials\[2\] is masked"):
            scene.with_particles(x, materials=np.ma.masked_array(["matter"] * 3, mask=[0, 0, 1]))
        odd = np.ma.masked_array(np.zeros(3, [("x", "f4")]), mask=[(1,), (0,), (0,)])
        with self.assertRaisesRegex(graupel.ConfigError, "volumes is no array of real numbers"):
            scene.with_particles(x, volumes=odd)

    def test_meshes_have_whole_corners_and_finite_numbers(self):
        scene, corners = block(), [[0, 0, 0], [0.1, 0, 0], [0, 0, 0.1], [0, 0.1, 0]]
        triangles = np.array([[0, 1, 2], [1, 0, 3], [2, 1, 3], [0, 2, 3]], float)
        scene.with_mesh(corners, triangles)
        for odd in (1.25, math.nan, math.inf):
            triangles[1, 2] = odd
            with self.assertRaisesRegex(graupel.ConfigError, r"triangles\[1\]\[2\] = \S+ is no whole number"):
                scene.with_mesh(corners, triangles)
        for friction in (math.inf, math.nan, -1):
            with self.assertRaisesRegex(graupel.ConfigError, "friction"):
                scene.with_mesh(corners, [[0, 1, 2]], friction=friction)
        with self.assertRaisesRegex(graupel.ConfigError, "position"):
            scene.with_mesh(corners, [[0, 1, 2]], position=(0, math.nan, 0))

    def test_histories_of_networks(self):
        model = graupel.NetworkModel(graupel.model_path("hgn"))
        scene = graupel.Scene.from_file(graupel.scene_path("shared/water_steps"))
        history, types = model.start(scene)
        for wrong, words in (("abc", "history is no array"), (history[0], "history has the wrong shape")):
            with self.assertRaisesRegex(graupel.ConfigError, words):
                model.accelerations(scene, wrong, types)
        for wrong, words in ((types[:, None], "particle_types has the wrong shape"), (types * 2.0**40, "allowed: 0")):
            with self.assertRaisesRegex(graupel.ConfigError, words):
                model.accelerations(scene, history, wrong)


class SettingsTest(unittest.TestCase):
    def test_numbers_out_of_their_range(self):
        scene = graupel.Scene.from_file(graupel.scene_path("shared/water_steps"))
        model = graupel.NetworkModel(graupel.model_path("hgn"))
        for limit in (math.nan, -1, 1e9, math.inf):
            with self.assertRaisesRegex(graupel.ConfigError, "density_limit.*0 to 10"):
                model.rollout(scene, 1, density_limit=limit)
        before = graupel.num_threads()
        for threads in (-1, 4097, 10**6, 2**40):
            with self.assertRaisesRegex(graupel.ConfigError, f"{threads}, allowed: 0 to 4096"):
                graupel.set_num_threads(threads)
        self.assertEqual(graupel.num_threads(), before)
        with tempfile.TemporaryDirectory() as folder:
            with self.assertRaisesRegex(graupel.ConfigError, "frames.*-3"):
                graupel.simulate(block(), os.path.join(folder, "a.h5"), -3)
            self.assertEqual(os.listdir(folder), [])

    def test_runs_take_scenes_dicts_and_files(self):
        keys = block().to_dict()
        with tempfile.TemporaryDirectory() as folder:
            scene, out = Path(folder) / "scene.json", os.path.join(folder, "a.h5")
            scene.write_text(json.dumps(keys), encoding="utf-8")
            expected = np.asarray(graupel.simulate(block(), out, 1).positions)
            for same in (keys, scene, str(scene), os.fsencode(scene)):
                np.testing.assert_array_equal(graupel.simulate(same, out, 1).positions, expected)
            with self.assertRaises(graupel.ConfigError):  # a scene's file is kept here too
                graupel.simulate(scene, scene, 1)
            with self.assertRaisesRegex(graupel.InputError, "no_such.json"):
                graupel.simulate("no_such.json", out)
            for wrong in (None, 3, [keys]):
                with self.assertRaisesRegex(TypeError, "allowed: a path, a dict, a Scene"):
                    graupel.simulate(wrong, out)
                with self.assertRaisesRegex(TypeError, "allowed: a path, a dict, a Scene"):
                    graupel.rollout(graupel.model_path("hgn"), wrong)
        water = graupel.scene_path("shared/water_steps")
        self.assertEqual(len(graupel.rollout(graupel.model_path("hgn"), water, 1)), 2)

    def test_names_of_fields_may_have_spaces_around(self):
        with tempfile.TemporaryDirectory() as folder:
            made = graupel.simulate(block(), os.path.join(folder, "a.h5"), 0, fields=" stress, plastic")
            self.assertEqual(made.field("plastic").shape, made.field("stress").shape[:2])

    def test_reduced_models_know_two_precisions(self):
        model = graupel.ReducedModel(graupel.model_path("nsf-jelly"))
        with self.assertRaisesRegex(graupel.ConfigError, "f16.*f32, f64"):
            model.rollout(model.scene, 1, precision="f16")

    def test_changes_are_a_dict(self):
        for make in (lambda changes: graupel.Scene.from_dict(block().to_dict(), changes=changes),
                     lambda changes: graupel.generate("r.json", "out", changes=changes),
                     lambda changes: graupel.compare("s.json", "mpm", changes=changes)):
            for wrong in (["a=1"], "a=1", 3):
                with self.assertRaisesRegex(TypeError, "changes is a '(list|str|int)'"):
                    make(wrong)

    def test_numbers_that_are_not_finite_are_named(self):
        keys = block().to_dict()
        keys["sources"][0]["position"] = np.array([0.2, math.nan, 0.2])
        with self.assertRaisesRegex(graupel.ConfigError, "/sources/0/position/1 = nan is not finite"):
            graupel.Scene.from_dict(keys)
        with self.assertRaisesRegex(graupel.ConfigError, "domain.dx.*= inf is not finite"):
            graupel.Scene.from_dict(block().to_dict(), changes={"domain.dx": math.inf})
        with self.assertRaisesRegex(graupel.ConfigError, "/frame_time = nan"):
            graupel.compare({**block().to_dict(), "frame_time": math.nan}, "mpm")


class VerbsTest(unittest.TestCase):
    def test_minutes_may_be_a_part_of_one(self):
        recipe = graupel.scene_path("recipes/hgn")
        with tempfile.TemporaryDirectory() as folder:
            changes = {"counts.train": 1, "counts.valid": 0, "counts.test": 0, "frames": 2}
            graupel.generate(recipe, os.path.join(folder, "a"), changes=changes, minutes=1.0)
            with self.assertRaises(graupel.ConfigError):
                graupel.generate(recipe, os.path.join(folder, "b"), changes=changes, minutes=-0.5)
            many = {**changes, "counts.train": 400, "frames": 60}
            made = graupel.generate(recipe, os.path.join(folder, "c"), changes=many, minutes=0.005)
            self.assertFalse(os.path.exists(os.path.join(folder, "c", "train.h5")), made)

    def test_kinds_that_are_not_possible(self):
        made = graupel.ReducedModel(graupel.model_path("nsf-jelly"))
        for call in (lambda: graupel.generate([1], "out"), lambda: graupel.compare(made, "mpm"),
                     lambda: graupel.compare([made], "mpm"), lambda: graupel.generate(None, "out")):
            with self.assertRaisesRegex(TypeError, "allowed: a path, a dict, a Scene"):
                call()
        with self.assertRaisesRegex(graupel.ConfigError, "no models"):
            graupel.compare("scene.json", [])
        with self.assertRaisesRegex(graupel.ConfigError, "no scenes"):
            graupel.compare([], "mpm")


class BatchTest(unittest.TestCase):
    def test_any_tells_whether_a_scene_diverged(self):
        keys = block().to_dict()
        keys["time_step"]["substeps_per_frame"] = 1
        batch = graupel.Batch([block(), graupel.Scene.from_dict(keys)])
        self.assertEqual(batch.diverged, [None, None])
        self.assertFalse(any(batch.diverged))
        batch.run(50)
        self.assertTrue(any(batch.diverged))
        self.assertEqual([i for i, why in enumerate(batch.diverged) if why], [1])


if __name__ == "__main__":
    unittest.main()
