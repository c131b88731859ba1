"""Files: outputs that take the place of nothing, writers that threads share, paths and text of every kind, forks."""
import json
import os
import subprocess
import tempfile
import threading
import time
import unittest

import h5py
import numpy as np

import graupel
from scenes import block, large

TETRAHEDRON = "v 0 0 0\nv 0.1 0 0\nv 0 0 0.1\nv 0 0.1 0\nf 1 2 3\nf 2 1 4\nf 3 2 4\nf 1 3 4\n"


class FilesTest(unittest.TestCase):
    def setUp(self):
        place = tempfile.TemporaryDirectory()
        self.addCleanup(place.cleanup)
        self.folder = place.name
        keys = block(frames=2).to_dict()
        keys["obstacles"] = [{"shape": "mesh", "file": "m.obj", "position": [0.2, 0.1, 0.2]}]
        for name, text in (("m.obj", TETRAHEDRON), ("sc.json", json.dumps(keys))):
            with open(self.path(name), "w", encoding="ascii") as file:
                file.write(text)
        self.scene = graupel.Scene.from_file(self.path("sc.json"))

    def path(self, *names):
        return os.path.join(self.folder, *names)

    def names(self):
        return sorted(os.listdir(self.folder))


class OutputsTest(FilesTest):
    def test_runs_replace_nothing_that_they_are_made_of(self):
        os.symlink("sc.json", self.path("link"))
        before = self.names()
        for name, what in (("sc.json", "the scene"), ("link", "the scene"), ("m.obj", "the geometry")):
            with self.assertRaisesRegex(graupel.ConfigError, f"would overwrite {what}"):
                graupel.simulate(self.scene, self.path(name), 1)
        for derived in (self.scene.with_particles([[0.2, 0.3, 0.2]]), graupel.Simulation(self.scene).scene,
                        graupel.Batch([self.scene]).scenes[0]):
            with self.assertRaisesRegex(graupel.ConfigError, "would overwrite the scene"):
                graupel.TrajectoryWriter(self.path("sc.json"), graupel.Simulation(derived))
        self.assertEqual(self.names(), before)

    def test_trajectories_replace_nothing_that_they_are_made_of(self):
        made = graupel.simulate(self.scene, self.path("run.h5"), 1)
        for name, what in (("run.h5", "the trajectory"), ("m.obj", "the geometry")):
            with self.assertRaisesRegex(graupel.ConfigError, f"would overwrite {what}"):
                made.write(self.path(name))
        with self.assertRaisesRegex(graupel.ConfigError, "would overwrite the scene"):
            graupel.simulate(made.scene, self.path("run.h5"), 1)
        weights = self.path("hgn.safetensors")
        with open(graupel.model_path("hgn"), "rb") as whole, open(weights, "wb") as copy:
            copy.write(whole.read())
        scene = graupel.Scene.from_file(graupel.scene_path("shared/water_steps"))
        with self.assertRaisesRegex(graupel.ConfigError, "would overwrite the weights"):
            graupel.rollout(weights, scene, 1).write(weights)
        self.assertEqual(self.names(), ["hgn.safetensors", "m.obj", "run.h5", "sc.json"])

    def test_devices_and_folders_are_refused(self):
        made = graupel.simulate(block(), self.path("run.h5"), 1)
        before = self.names()
        for name in ("/dev/null", self.folder, self.folder + "/.", self.path("none", "x.h5")):
            with self.assertRaises(graupel.IoError):
                made.write(name)
            with self.assertRaises(graupel.IoError):
                graupel.simulate(block(), name, 1)
        self.assertFalse(os.path.exists("/dev/null.part"))
        self.assertEqual(self.names(), before)

    def test_a_copy_keeps_forces_and_parameters(self):
        recorded, copy = self.path("run.h5"), self.path("copy.h5")
        subprocess.run([graupel._program.PROGRAM, "simulate", self.path("sc.json"), "-o", recorded, "--forces"],
                       check=True, capture_output=True)
        graupel.Trajectory(recorded).write(copy)
        with h5py.File(recorded) as one, h5py.File(copy) as other:
            self.assertEqual(set(one["00000"]), set(other["00000"]))
            for name in ("impulse", "force", "torque", "reference"):
                np.testing.assert_array_equal(one["00000/contact_" + name], other["00000/contact_" + name])
            self.assertEqual(list(one["00000"].attrs["contact_names"]), list(other["00000"].attrs["contact_names"]))

    def test_a_copy_of_a_run_that_did_not_end_says_so(self):
        recorded, copy = self.path("run.h5"), self.path("copy.h5")
        graupel.simulate(block(), recorded, 2)
        with h5py.File(recorded, "r+") as file:
            file.attrs["complete"] = 0
        unfinished = graupel.Trajectory(recorded)
        unfinished.write(copy)
        self.assertEqual((unfinished.complete, graupel.Trajectory(copy).complete), (False, False))
        graupel.Trajectory(copy).write(self.path("again.h5"))
        self.assertFalse(graupel.Trajectory(self.path("again.h5")).complete)


class WriterTest(FilesTest):
    def test_a_run_of_other_particles_is_refused(self):
        run, other = graupel.Simulation(block()), graupel.Simulation(block().with_particles([[0.2, 0.2, 0.2]] * 7))
        with graupel.TrajectoryWriter(self.path("a.h5"), run) as writer:
            with self.assertRaisesRegex(graupel.ConfigError, f"7 particles.*allowed: {run.particle_count}"):
                writer.append(other)
            writer.append(run)
        self.assertEqual(len(graupel.Trajectory(self.path("a.h5"))), 1)

    def test_threads_do_not_share_a_writer(self):
        run, twin = graupel.Simulation(large()), graupel.Simulation(large())
        refused, kept = [], []

        def append(simulation):
            for _ in range(12):
                try:
                    writer.append(simulation)
                    kept.append(1)
                except graupel.ConfigError:
                    pass  # the frame at 0 s is there
                except RuntimeError as error:
                    refused.append(str(error))
                    time.sleep(0.02)
        with graupel.TrajectoryWriter(self.path("a.h5"), run) as writer:
            threads = [threading.Thread(target=append, args=(simulation,)) for simulation in (run, twin)]
            for thread in threads:
                thread.start()
            for thread in threads:
                thread.join()
        self.assertTrue(refused and "another thread" in refused[0])
        self.assertEqual(len(graupel.Trajectory(self.path("a.h5"))), len(kept))

    def test_a_run_that_another_thread_advances_is_not_stored(self):
        run = graupel.Simulation(large())
        with graupel.TrajectoryWriter(self.path("a.h5"), run) as writer:
            thread = threading.Thread(target=lambda: [run.step() for _ in range(30)])
            thread.start()
            time.sleep(0.1)
            with self.assertRaisesRegex(RuntimeError, "another thread"):
                while thread.is_alive():
                    writer.append(run)
            thread.join()


class TextTest(FilesTest):
    def test_paths_are_str_bytes_or_path_like(self):
        odd = os.path.join(os.fsencode(self.folder), b"r\xff.h5")
        made = graupel.simulate(graupel.Scene.from_file(os.fsencode(self.path("sc.json"))), odd, 1)
        self.assertEqual(len(graupel.open(odd)[0]), 2)
        self.assertEqual(len(graupel.Trajectory(os.fsdecode(odd))), 2)
        made.write(os.fsencode(self.path("copy.h5")))
        graupel.NetworkModel(os.fsencode(graupel.model_path("hgn")))
        with self.assertRaisesRegex(graupel.InputError, "none"):
            graupel.open(os.path.join(os.fsencode(self.folder), b"none\xff.h5"))
        for wrong in (3, None, ["a"]):
            with self.assertRaisesRegex(TypeError, "path|PathLike"):
                graupel.open(wrong)
        with self.assertRaisesRegex(graupel.ConfigError, "null byte"):
            made.write(self.path("m.obj\0.h5"))

    def test_bytes_that_are_no_utf8_are_replaced(self):
        graupel.simulate(block(), self.path("a.h5"), 1)
        with h5py.File(self.path("a.h5"), "r+") as file:
            file["00000"].attrs["made_by"] = np.bytes_(b"caf\xe9")
        trajectory = graupel.Trajectory(self.path("a.h5"))
        self.assertEqual(trajectory.made_by, "caf\ufffd")
        self.assertIn("caf\ufffd", str(trajectory))


if __name__ == "__main__":
    unittest.main()
