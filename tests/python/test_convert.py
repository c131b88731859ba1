"""Data sets to and from the formats of other programs. Needs h5py."""
import json
import math
import os
import subprocess
import sys
import tempfile
import unittest
import unittest.mock

import numpy as np

import graupel


class ConvertTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.place = tempfile.TemporaryDirectory()
        cls.data = os.path.join(cls.place.name, "data")
        graupel.generate(graupel.scene_path("recipes/hgn"), cls.data, seed=4, connectivity_radius=0.035,
                         changes={"counts.train": 2, "counts.valid": 0, "counts.test": 0, "frames": 4})

    @classmethod
    def tearDownClass(cls):
        cls.place.cleanup()

    def path(self, name):
        return os.path.join(self.place.name, name)

    def test_there_and_back(self):
        seen = []
        made = graupel.convert.data_set(self.data, self.path("gns"), format="gns",
                                        progress=lambda done, total: seen.append((done, total)))
        self.assertEqual(made["splits"]["train"]["trajectories"], 2)
        self.assertTrue(seen)
        graupel.convert.data_set(self.path("gns"), self.path("back"), changes={"gravity": [0, -9.8, 0]})
        for there, back in zip(graupel.open(os.path.join(self.data, "train.h5")),
                               graupel.open(self.path("back/train.h5"))):
            np.testing.assert_array_equal(np.asarray(there.positions), np.asarray(back.positions))
            self.assertEqual(back.scene_dict["gravity"], [0, -9.8, 0])

    def test_tfrecords(self):
        graupel.convert.data_set(self.data, self.path("tf"), format="tfrecord")
        self.assertEqual(sorted(os.listdir(self.path("tf"))), ["dataset.json", "metadata.json", "train.tfrecord"])
        with open(self.path("tf/metadata.json"), encoding="utf-8") as file:
            metadata = json.load(file)
        self.assertEqual((metadata["sequence_length"], metadata["dim"]), (4, 3))
        self.assertGreater(os.path.getsize(self.path("tf/train.tfrecord")),
                           graupel.open(os.path.join(self.data, "train.h5"))[0].positions[0].nbytes * 5)

    def test_errors_are_by_kind(self):
        with self.assertRaisesRegex(graupel.ConfigError, "tfrecords"):
            graupel.convert.data_set(self.data, self.path("x"), format="tfrecords")
        with self.assertRaises(graupel.InputError):
            graupel.convert.data_set(self.path("none"), self.path("x"), format="gns")
        with self.assertRaisesRegex(graupel.ConfigError, "already"):
            graupel.convert.data_set(self.data, self.path("x"))

    def test_arguments_are_checked(self):
        for name, values, words in (
                ("connectivity_radius", (math.nan, math.inf, -1, 0, "abc", True, 10**400, [1]), "a number above 0"),
                ("split", (["training"], "training", 3, [3]), "allowed: train, valid, test"),
                ("types", ({5: "water"}, 5), "allowed: a text"),
                ("format", (None, 3, ["gns"]), "allowed: graupel, gns")):
            for value in values:
                with self.assertRaisesRegex(graupel.ConfigError, f"{name} .*{words}"):
                    graupel.convert.data_set(self.data, self.path("x"), **{"format": "gns", name: value})
        for target in ("", "x\0y"):
            with self.assertRaisesRegex(graupel.ConfigError, "target is '.*without null bytes"):
                graupel.convert.data_set(self.data, target, format="gns")
        with unittest.mock.patch("sys.executable", None), self.assertRaisesRegex(graupel.ConfigError, "sys.executable"):
            graupel.convert.data_set(self.data, self.path("x"), format="gns")
        with self.assertRaisesRegex(TypeError, "progress is a 'int'"):
            graupel.convert.data_set(self.data, self.path("x"), format="gns", progress=5)
        self.assertFalse(os.path.exists(self.path("x")))
        graupel.convert.data_set(self.data, self.path("numpy"), format="gns", split="train",
                                 connectivity_radius=np.float32(0.5))
        with open(self.path("numpy/metadata.json"), encoding="utf-8") as file:
            self.assertEqual(json.load(file)["default_connectivity_radius"], 0.5)

    def test_what_progress_raises_comes_through(self):
        before = sorted(os.listdir(self.place.name))
        for error in (RuntimeError("mine"), OSError(5, "mine"), KeyError("mine"), KeyboardInterrupt("mine")):
            for last in (1, 2):
                def progress(done, total, error=error, last=last):
                    if done == last:
                        raise error
                with self.assertRaises(type(error)) as caught:
                    graupel.convert.data_set(self.data, self.path("x"), format="lagrangebench", progress=progress)
                self.assertIs(caught.exception, error)
        self.assertEqual(sorted(os.listdir(self.place.name)), before)

    def test_the_distance_of_particles_is_kept(self):
        graupel.convert.data_set(self.data, self.path("bench"), format="lagrangebench")
        with open(self.path("bench/metadata.json"), encoding="utf-8") as file:
            metadata = json.load(file)
        metadata["dx"] = 0.02
        with open(self.path("bench/metadata.json"), "w", encoding="utf-8") as file:
            json.dump(metadata, file)
        graupel.convert.data_set(self.path("bench"), self.path("own"))
        graupel.convert.data_set(self.path("own"), self.path("again"), format="lagrangebench")
        for name in ("own", "again"):
            with open(self.path(name + "/metadata.json"), encoding="utf-8") as file:
                self.assertEqual(json.load(file)["dx"], 0.02)

    def test_a_full_disk_is_an_error_that_python_survives(self):
        disk = self.path("disk")
        os.makedirs(disk)
        if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", disk], capture_output=True,
                          check=False).returncode:
            self.skipTest("no tmpfs can be mounted here (needs root)")
        code = ("import graupel, sys\ntry:\n    graupel.convert.data_set(*sys.argv[1:], format='lagrangebench')\n"
                "except graupel.IoError as error:\n    print(error)\n")
        try:
            done = subprocess.run([sys.executable, "-c", code, self.data, disk + "/out"], capture_output=True,
                                  text=True, check=False)
            self.assertEqual((done.returncode, done.stderr), (0, ""))
            self.assertIn("Free space on that disk", done.stdout)
            self.assertEqual(os.listdir(disk), [])
        finally:
            subprocess.run(["umount", disk], check=True)


if __name__ == "__main__":
    unittest.main()
