"""Data sets to and from the formats of other programs. Needs h5py."""
import json
import os
import tempfile
import unittest

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


if __name__ == "__main__":
    unittest.main()
