"""Data sets and comparisons as plain data, errors of the program as exceptions."""
import json
import os
import subprocess
import sys
import tempfile
import unittest

import numpy as np

import graupel
from scenes import block


class VerbsTest(unittest.TestCase):
    def setUp(self):
        place = tempfile.TemporaryDirectory()
        self.addCleanup(place.cleanup)
        self.folder = place.name

    def test_data_sets_are_made(self):
        recipe = graupel.scene_path("recipes/hgn")
        changes = {"counts.train": 2, "counts.valid": 1, "counts.test": 0, "frames": 4}
        made = graupel.generate(recipe, os.path.join(self.folder, "data"), changes=changes, seed=3)
        json.dumps(made)
        data = graupel.open(os.path.join(self.folder, "data", "train.h5"))
        self.assertEqual(len(data), 2)
        self.assertTrue(data.complete)
        self.assertEqual(len(data[1]), 5)
        self.assertTrue(np.isfinite(data[1].positions[4]).all())

    def test_models_are_compared(self):
        scene = graupel.Scene.from_file(graupel.scene_path("shared/water_steps"), {"frames": 3})
        result = graupel.compare(scene, ["mpm:coarse", graupel.model_path("hgn")], floors=False,
                                 report=os.path.join(self.folder, "report.html"))
        text = json.dumps(result)
        self.assertIn("mpm:coarse", text)
        self.assertIn("hgn", text)
        self.assertTrue(os.path.exists(os.path.join(self.folder, "report.html")))

    def test_errors_are_by_kind(self):
        with self.assertRaisesRegex(graupel.InputError, "no_such.json"):
            graupel.compare("no_such.json", "mpm")
        with self.assertRaisesRegex(graupel.ConfigError, "contents|countz|key"):
            graupel.generate(graupel.scene_path("recipes/hgn"), os.path.join(self.folder, "x"), changes={"countz": 1})
        with self.assertRaisesRegex(graupel.ConfigError, "in memory"):
            graupel.compare(block().with_particles([[0.2, 0.2, 0.2]]), "mpm")
        in_the_way = os.path.join(self.folder, "file")
        with open(in_the_way, "w", encoding="ascii") as file:
            file.write("x")
        with self.assertRaises(graupel.Error):
            graupel.generate(graupel.scene_path("recipes/hgn"), os.path.join(in_the_way, "data"),
                             changes={"counts.train": 1, "counts.valid": 0, "counts.test": 0, "frames": 1})

    def test_ctrl_c_ends_the_program_too(self):
        code = ("import graupel, os, signal, threading\n"
                "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
                "threading.Timer(2, os.kill, (os.getpid(), signal.SIGINT)).start()\n"
                "try:\n    graupel.generate(graupel.scene_path('recipes/hgn'), 'data', changes={'counts.train': 500})\n"
                "except KeyboardInterrupt:\n    print('interrupted')\n")
        done = subprocess.run([sys.executable, "-c", code], cwd=self.folder, capture_output=True, text=True, timeout=60,
                              check=True)
        self.assertEqual(done.stdout.strip(), "interrupted")


if __name__ == "__main__":
    unittest.main()
