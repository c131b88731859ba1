"""The examples of docs/guide/python.md run. Skipped where the guide is not beside the tests."""
import os
import re
import tempfile
import unittest

import numpy as np

import graupel
from scenes import block

GUIDE = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "docs", "guide", "python.md")


@unittest.skipUnless(os.path.exists(GUIDE), "docs/guide/python.md is not beside the tests")
class GuideTest(unittest.TestCase):
    def setUp(self):
        place = tempfile.TemporaryDirectory()
        self.addCleanup(place.cleanup)
        self.addCleanup(os.chdir, os.getcwd())
        os.chdir(place.name)

    def run_section(self, title, names):
        """All Python of a section with `names`; lines with {...} stand for what readers have."""
        with open(GUIDE, encoding="utf-8") as file:
            section = re.search(rf"^## {title}\n(.*?)(?=^## )", file.read(), re.M | re.S)[1]
        blocks = re.findall(r"^```python\n(.*?)^```", section, re.M | re.S)
        self.assertTrue(blocks)
        names = {"graupel": graupel, **names}
        for text in blocks:
            exec("".join(line for line in text.splitlines(True) if "{...}" not in line), names)
        return names

    def test_scenes(self):
        n = 10
        names = self.run_section("Scenes", {
            "n": n, "x": np.random.default_rng(0).uniform(0.4, 0.6, (n, 3)), "v": np.zeros((n, 3)),
            "F": np.tile(np.eye(3), (n, 1, 1)),
            "vertices": np.array([[0, 0, 0], [0.2, 0, 0], [0, 0.2, 0], [0, 0, 0.2]]),
            "triangles": np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])})
        self.assertEqual(graupel.Simulation(names["start"]).particle_count, n)

    def test_trajectories(self):
        graupel.simulate(block(), "run.h5", 20)
        names = self.run_section("Trajectories", {})
        self.assertEqual(names["frame"].time, names["t"].times[-1])
        self.assertTrue(os.path.exists("copy.h5"))


if __name__ == "__main__":
    unittest.main()
