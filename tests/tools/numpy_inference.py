#!/usr/bin/env python3
"""The graph networks of models/ in NumPy, written from docs/reference/networks.md alone, against `graupel rollout`.

Runs by tests/run_all.sh, or: /usr/bin/python3 tests/tools/numpy_inference.py [-v]. Needs numpy, h5py and the program in
build/ (GRAUPEL_PROGRAM names another). The other files numpy_*.py are the page, a section or two
each; section numbers are those of the page.
"""
import json
import os
import shutil
import subprocess
import sys
import tempfile
import unittest

import h5py
import numpy as np

from numpy_features import Environment, contact
from numpy_networks import frames_after, predict
from numpy_weights import Network, with_more_inputs

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
PROGRAM = os.environ.get("GRAUPEL_PROGRAM", os.path.join(ROOT, "build", "graupel"))


class InferenceTest(unittest.TestCase):
    """One evaluation from a true history, compared with a rollout without corrections."""

    def setUp(self):
        self.folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, self.folder)

    def run_program(self, *arguments):
        done = subprocess.run([PROGRAM, *arguments], cwd=self.folder, capture_output=True, text=True,
                              env={**os.environ, "GRAUPEL_PRODUCTS": "f32"})
        self.assertEqual(done.returncode, 0, done.stderr)

    def history_of(self, scene, first, *changes):
        """Six frames from `first` on, as a trajectory of their own; (positions, types, environment)."""
        self.run_program("simulate", scene, "-o", "truth.h5", "--frames", str(first + 5), "--no-velocity", *changes)
        with h5py.File(os.path.join(self.folder, "truth.h5"), "r+") as file:
            group = file["00000"]
            history, times = group["position"][first:first + 6], group["time"][:6]
            for name, values in (("position", history), ("time", times)):
                attributes = dict(group[name].attrs)
                del group[name]
                data = group.create_dataset(name, data=values)
                for key, value in attributes.items():
                    data.attrs[key] = value
            scene = json.loads(group.attrs["scene_json"])
            return history, group["particle_type"][:], Environment(scene)

    def compare(self, weights, history, types, environment, most):
        """`weights`: a file, or the name of a shipped one."""
        path = weights if os.path.isabs(weights) else os.path.join(ROOT, "models", weights + ".safetensors")
        network = Network(path)
        bundle = int(network.number("bundle", 1))
        acceleration = predict(network, environment, history, types)
        mine = frames_after(history, acceleration)
        self.run_program("rollout", path, "truth.h5", "--start", "truth:6", "--frames", str(bundle), "--no-project", "--no-free-flight", "--density-limit", "0",
                         "-o", "predicted.h5", "--device", "cpu")
        with h5py.File(os.path.join(self.folder, "predicted.h5")) as file:
            theirs = file["00000/position"][1:].astype(np.float64)
        error = np.linalg.norm(mine[0] - theirs[0]) / np.linalg.norm(acceleration[0])
        furthest = np.abs(mine - theirs).max()
        if "-v" in sys.argv:
            print(f"{weights}: {len(types)} particles, relative error of the acceleration {error:.1e}, "
                  f"largest difference of {bundle} frames {furthest:.1e} m")
        self.assertLess(error, most)
        self.assertLess(furthest, 1e-6)

    def test_hgn(self):
        """Five rotated bodies: box, half sphere, cone, pyramid, half box."""
        scene = os.path.join(ROOT, "scenes", "shared", "mixed_blocks.json")
        inputs = self.history_of(scene, 24)
        self.compare("hgn", *inputs, most=2e-5)

    def test_hgn_that_sees_constants_and_contact(self):
        scene = os.path.join(ROOT, "scenes", "shared", "mixed_blocks.json")
        faces = {"y_low": {"kind": "slip", "friction": 0.4}, "x_low": {"kind": "stick"}}
        materials = {
            "water": {"model": "water", "bulk_modulus": 2e5, "viscosity": 0.5},
            "sand": {"model": "sand", "youngs_modulus": 1e6, "friction_angle": 30, "cohesion": 100},
            "snow": {"model": "snow", "youngs_modulus": 1.4e5, "hardening": 9, "critical_compression": 0.02,
                     "critical_stretch": 0.006}}
        inputs = self.history_of(scene, 24, "--set", f"domain.faces={json.dumps(faces)}", "--set",
                                 f"materials={json.dumps(materials)}", "--set", "domain.wall_friction=0.2")
        more = contact(Network(os.path.join(ROOT, "models", "hgn.safetensors")), inputs[2], inputs[0][-1].astype(float))
        self.assertGreater(len(np.unique(more, axis=0)), 3)
        path = os.path.join(self.folder, "more.safetensors")
        with_more_inputs(os.path.join(ROOT, "models", "hgn.safetensors"), path)
        self.compare(path, *inputs, most=2e-5)
        self.compare("hgn-general", *inputs, most=2e-5)

    def test_gns(self):
        """One small ball between a plane, a sphere and a cylinder: GNS has some hundred edges a particle."""
        scene = os.path.join(ROOT, "scenes", "shared", "sand_cone.json")
        ball = [{"shape": "sphere", "radius": 0.03, "position": [0.68, 0.25, 0.56], "material": "sand"}]
        obstacles = [
            {"shape": "plane", "position": [0.6, 0.16, 0.5], "rotation_axis": [0, 0, 1], "rotation_angle": 20},
            {"shape": "sphere", "radius": 0.05, "position": [0.72, 0.18, 0.54]},
            {"shape": "cylinder", "radius": 0.04, "height": 0.2, "position": [0.62, 0.2, 0.6],
             "rotation_axis": [1, 0, 1], "rotation_angle": 60}]
        materials = {"sand": {"model": "sand", "youngs_modulus": 1e6, "friction_angle": 35, "cohesion": 50}}
        changes = [word for key, value in (("sources", ball), ("obstacles", obstacles), ("materials", materials))
                   for word in ("--set", f"{key}={json.dumps(value)}")]
        self.compare("gns", *self.history_of(scene, 4, *changes), most=1e-4)


if __name__ == "__main__":
    unittest.main()
