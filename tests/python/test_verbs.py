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

    def path(self, name):
        return os.path.join(self.folder, name)

    def test_data_sets_are_made(self):
        recipe = graupel.scene_path("recipes/hgn")
        changes = {"counts.train": 2, "counts.valid": 1, "counts.test": 0, "frames": 4}
        made = graupel.generate(recipe, os.path.join(self.folder, "data"), changes=changes, seed=3)
        json.dumps(made)
        data = graupel.open(os.path.join(self.folder, "data", "train.h5"))
        self.assertEqual(len(data), 2)
        self.assertTrue(data.complete)
        self.assertEqual(len(data[1]), 5)
        self.assertEqual([t.positions[0].tolist() for t in data[::-1]],
                         [data[i].positions[0].tolist() for i in (1, 0)])
        self.assertEqual(data[2:], [])
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

    def test_dicts_are_checked_by_the_program(self):
        text = graupel.scene_path("recipes/hgn").read_text(encoding="utf-8")
        recipe = json.loads("".join(line for line in text.splitlines() if not line.strip().startswith("//")))
        recipe.update(frames=1, counts={"train": 1, "valid": 0, "test": 0})
        self.assertEqual(graupel.generate(recipe, self.path("data"))["train"], 1)
        with self.assertRaisesRegex(graupel.ConfigError, "/obstacles"):
            graupel.generate({**recipe, "obstacles": 3}, self.path("x"))
        for key, value in (("sources", 3), ("sources", [3]), ("obstacles", {"shape": "box"}), ("obstacles", "mesh")):
            with self.assertRaisesRegex(graupel.ConfigError, f"/{key}"):
                graupel.compare({**block().to_dict(), key: value}, "mpm")

    def test_files_of_dicts_begin_at_the_working_directory(self):
        with open(self.path("m.obj"), "w", encoding="ascii") as file:
            file.write("v 0 0 0\nv 0.1 0 0\nv 0 0 0.1\nv 0 0.1 0\nf 1 2 3\nf 2 1 4\nf 3 2 4\nf 1 3 4\n")
        keys = block(frames=1).to_dict()
        keys["obstacles"] = [{"shape": "mesh", "file": "m.obj", "position": [0.2, 0.1, 0.2]}]
        before = os.getcwd()
        self.addCleanup(os.chdir, before)
        os.chdir(self.folder)
        graupel.compare(keys, "mpm", floors=False)
        self.assertEqual(keys["obstacles"][0]["file"], "m.obj")

    def test_names_are_no_flags(self):
        with self.assertRaisesRegex(graupel.InputError, "-h"):
            graupel.compare("-h", "mpm")
        for model in ("-h", "--help"):
            with self.assertRaises(graupel.Error):
                graupel.compare(block(), model)
        with self.assertRaisesRegex(graupel.ConfigError, "split '-h'"):
            graupel.compare(block(), "mpm", split="-h")
        for name in ("a,b.safetensors", ""):
            with self.assertRaisesRegex(graupel.ConfigError, f"the model '{name}'.*without commas"):
                graupel.compare(block(), ["mpm", name])

    def test_paths_may_be_bytes_that_are_no_utf8(self):
        out = os.path.join(os.fsencode(self.folder), b"x\xff")
        graupel.generate(graupel.scene_path("recipes/hgn"), out, fields="",
                         changes={"counts.train": 1, "counts.valid": 0, "counts.test": 0, "frames": 1})
        self.assertEqual(len(graupel.open(os.path.join(out, b"train.h5"))), 1)

    def test_empty_outputs_are_refused_before_the_work(self):
        before = os.getcwd()
        self.addCleanup(os.chdir, before)
        os.chdir(self.folder)
        for name, call in (("path", lambda: graupel.simulate(block(), "")),
                           ("path", lambda: graupel.simulate(block(), b"")),
                           ("out", lambda: graupel.generate(graupel.scene_path("recipes/hgn"), "")),
                           ("report", lambda: graupel.compare(block(), "mpm", report="")),
                           ("csv", lambda: graupel.compare(block(), "mpm", csv="")),
                           ("pictures", lambda: graupel.compare(block(), "mpm", pictures=""))):
            with self.assertRaisesRegex(graupel.ConfigError, f"{name} is ''"):
                call()
        self.assertEqual(os.listdir(self.folder), [])

    def test_ctrl_c_ends_the_program_too(self):
        code = ("import glob, graupel, os, signal, threading\n"
                "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
                "threading.Timer(2, os.kill, (os.getpid(), signal.SIGINT)).start()\n"
                "try:\n    graupel.generate(graupel.scene_path('recipes/hgn'), 'data', changes={'counts.train': 500})\n"
                "except KeyboardInterrupt:\n"
                "    children = [open(name).read() for name in glob.glob('/proc/self/task/*/children')]\n"
                "    print('interrupted', ''.join(children))\n")
        done = subprocess.run([sys.executable, "-c", code], cwd=self.folder, capture_output=True, text=True, timeout=60,
                              check=True)
        self.assertEqual(done.stdout.strip(), "interrupted")


if __name__ == "__main__":
    unittest.main()
