"""What the tests of tools/convert.py share: a folder, the place of the tool, series that are exact in f32."""
import os
import shutil
import sys
import tempfile
import unittest

import numpy as np

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
TOOL = os.path.join(ROOT, "tools", "convert.py")
PROGRAM = os.environ.get("GRAUPEL_PROGRAM", os.path.join(ROOT, "build", "graupel"))
sys.dont_write_bytecode = True
sys.path.insert(0, os.path.join(ROOT, "tools"))

import convert  # noqa: E402

convert.load_package()
from graupel_convert import series  # noqa: E402

EXAMPLE = {"bounds": [[0.1, 0.9], [0.1, 0.9]], "sequence_length": 320, "default_connectivity_radius": 0.015, "dim": 2,
           "dt": 0.0025, "vel_mean": [5.1e-06, -0.00099], "vel_std": [0.0021, 0.0026], "acc_mean": [5.2e-07, 2.3e-07],
           "acc_std": [0.00025, 0.00029]}  # the example of geoelements/gns's documentation


def sample(frames, particles, axes, shift=0.0):
    """x[t, p, axis] = shift + t + p / 4 + axis / 16, exact in f32; types 5, 6, 5, 6, ..."""
    t, p, a = np.meshgrid(np.arange(frames), np.arange(particles), np.arange(axes), indexing="ij")
    return series.Series("sample", (shift + t + p / 4 + a / 16).astype(np.float32), 5 + np.arange(particles) % 2)


def objects(*parts):
    out = np.empty(len(parts), object)
    for i, part in enumerate(parts):
        out[i] = part
    return out


class Case(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.mkdtemp(prefix="graupel_test_")
        self.addCleanup(shutil.rmtree, self.folder)

    def path(self, *names):
        return os.path.join(self.folder, *names)

    def refused(self, kind, words, body, *arguments):
        with self.assertRaises(kind) as caught:
            body(*arguments)
        for word in [words] if isinstance(words, str) else words:
            self.assertIn(word, str(caught.exception))

    def same(self, a, b):
        self.assertEqual(a.position.dtype, np.float32)
        np.testing.assert_array_equal(a.position, b.position)
        np.testing.assert_array_equal(a.particle_type, b.particle_type)
        if b.material_property is None:
            self.assertIsNone(a.material_property)
        else:
            np.testing.assert_array_equal(a.material_property, b.material_property)
