"""Trajectories: files read lazily, rollouts in memory, writing."""
import os
import tempfile
import unittest
from collections.abc import Iterable

import numpy as np

import graupel
from scenes import block


class TrajectoryTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.place = tempfile.TemporaryDirectory()
        cls.file = os.path.join(cls.place.name, "run.h5")
        cls.told = []
        cls.made = graupel.simulate(block("sand"), cls.file, 3, seed=5, fields="stress,plastic",
                                    progress=cls.told.append)

    @classmethod
    def tearDownClass(cls):
        cls.place.cleanup()

    def test_frames_are_those_of_the_run(self):
        run = graupel.Simulation(block("sand"), seed=5)
        trajectory = graupel.Trajectory(self.file)
        self.assertEqual(self.told, [1, 2, 3])
        self.assertEqual(len(trajectory), 4)
        self.assertEqual(trajectory.positions.shape, (4, run.particle_count, 3))
        for i, frame in enumerate(trajectory):
            if i > 0:
                run.advance_frame()
            np.testing.assert_array_equal(frame.positions, run.positions)
            np.testing.assert_array_equal(trajectory.positions[i], run.positions)
            np.testing.assert_array_equal(trajectory.velocities[i], run.velocities)
            np.testing.assert_array_equal(trajectory.field("stress")[i], run.field("stress"))
            self.assertAlmostEqual(frame.time, run.time)
        np.testing.assert_array_equal(trajectory.particle_types, run.particle_types)
        np.testing.assert_allclose(trajectory.times, np.arange(4) / 60)
        self.assertEqual((trajectory.seed, trajectory.made_by, trajectory.complete), (5, "mpm", True))
        self.assertEqual(trajectory.diverged_at_frame, -1)

    def test_slices_stack_frames(self):
        trajectory = graupel.Trajectory(self.file)
        x = np.asarray(trajectory.positions)
        self.assertEqual(x.shape, trajectory.positions.shape)
        np.testing.assert_array_equal(trajectory.positions[1:3], x[1:3])
        np.testing.assert_array_equal(trajectory.positions[::-2], x[::-2])
        np.testing.assert_array_equal(trajectory.positions[-1], x[-1])
        self.assertEqual(trajectory.positions[4:].shape, (0,) + x.shape[1:])
        self.assertEqual(trajectory.field("plastic")[:2].shape, (2, x.shape[1]))
        with self.assertRaises(IndexError):
            trajectory.positions[4]
        with self.assertRaises(IndexError):
            graupel.Trajectory(self.file, 1)

    def test_slices_of_a_trajectory_are_lists_of_frames(self):
        trajectory = graupel.Trajectory(self.file)
        times = list(trajectory.times)
        for part in (slice(1, 3), slice(None), slice(None, None, -2), slice(-1, None), slice(3, 1), slice(9, 2**70)):
            self.assertEqual([frame.time for frame in trajectory[part]], times[part])
        np.testing.assert_array_equal(trajectory[1:3][1].positions, trajectory.positions[2])
        with self.assertRaises(ValueError):
            trajectory[::0]

    def test_type_checkers_know_what_iterates(self):
        for many in (graupel.open(self.file), graupel.Trajectory(self.file), graupel.Trajectory(self.file).positions):
            self.assertIsInstance(many, Iterable)
            self.assertEqual(len(list(many)), len(many))

    def test_arrays_of_all_frames_are_copies(self):
        x = graupel.Trajectory(self.file).positions
        if int(np.__version__.split(".")[0]) >= 2:
            with self.assertRaisesRegex(ValueError, "without a copy"):
                np.array(x, copy=False)
        with self.assertRaisesRegex(ValueError, "without a copy"):
            x.__array__(copy=False)
        self.assertEqual(np.asarray(x, dtype=np.float64).dtype, np.float64)
        np.testing.assert_array_equal(np.array(x, copy=True), np.asarray(x))

    def test_arrays_outlive_the_file(self):
        frame = graupel.Trajectory(self.file).positions[2]
        np.testing.assert_array_equal(frame, graupel.Trajectory(self.file)[2].positions)
        self.assertFalse(frame.flags.writeable)

    def test_the_scene_is_there(self):
        trajectory = graupel.open(self.file)[0]
        self.assertEqual(trajectory.scene.frames, 4)
        self.assertEqual(trajectory.scene_dict["sources"][0]["material"], "matter")
        self.assertEqual(trajectory.obstacles, [])

    def test_what_is_not_stored_is_an_error(self):
        trajectory = graupel.Trajectory(self.file)
        with self.assertRaisesRegex(graupel.InputError, "affine.*stress,plastic"):
            trajectory.field("affine")
        with self.assertRaises(graupel.InputError):
            graupel.open("no_such.h5")
        damaged = os.path.join(self.place.name, "damaged.h5")
        with open(self.file, "rb") as whole, open(damaged, "wb") as part:
            part.write(whole.read(2000))
        with self.assertRaises(graupel.InputError):
            graupel.Trajectory(damaged)

    def test_a_copy_is_the_same(self):
        copy = os.path.join(self.place.name, "copy.h5")
        graupel.Trajectory(self.file).write(copy)
        one, other = graupel.Trajectory(self.file), graupel.Trajectory(copy)
        np.testing.assert_array_equal(np.asarray(one.positions), np.asarray(other.positions))
        np.testing.assert_array_equal(np.asarray(one.field("stress")), np.asarray(other.field("stress")))
        self.assertEqual(one.scene_dict, other.scene_dict)

    def test_a_folder_that_is_not_there_is_an_error_of_writing(self):
        with self.assertRaises(graupel.IoError):
            graupel.Trajectory(self.file).write(os.path.join(self.place.name, "none", "x.h5"))
        self.assertFalse(issubclass(graupel.ConfigError, OSError))

    def test_a_writer_keeps_what_it_has_after_an_error(self):
        file = os.path.join(self.place.name, "broken.h5")
        run, start = graupel.Simulation(block()), graupel.Simulation(block())
        with self.assertRaises(LookupError):
            with graupel.TrajectoryWriter(file, run) as writer:
                for _ in range(3):
                    writer.append(run)
                    run.advance_frame()
                with self.assertRaisesRegex(graupel.ConfigError, "in their order"):
                    writer.append(start)
                raise LookupError
        self.assertFalse(os.path.exists(file))
        os.rename(file + ".part", file)
        self.assertEqual(len(graupel.Trajectory(file)), 3)
        with graupel.TrajectoryWriter(file + "2", run) as writer:
            writer.append(run)
        self.assertEqual(len(graupel.Trajectory(file + "2")), 1)
        with self.assertRaisesRegex(graupel.ConfigError, "finished"):
            writer.append(run)


class RolloutTest(unittest.TestCase):
    def test_a_network_predicts_a_scene(self):
        scene = graupel.Scene.from_file(graupel.scene_path("shared/water_steps"))
        seen = []
        predicted = graupel.rollout(graupel.model_path("hgn"), scene, 4, progress=seen.append)
        truth = graupel.Simulation(scene)
        self.assertEqual(seen, [1, 2, 3, 4])
        self.assertEqual(len(predicted), 5)
        np.testing.assert_array_equal(predicted.positions[0], truth.positions)
        truth.run(4)
        self.assertLess(np.linalg.norm(predicted.positions[4] - truth.positions, axis=1).mean(), 1e-3)
        self.assertEqual(predicted.obstacles, scene.to_dict()["obstacles"])
        with tempfile.TemporaryDirectory() as folder:
            predicted.write(os.path.join(folder, "predicted.h5"))
            stored = graupel.Trajectory(os.path.join(folder, "predicted.h5"))
            np.testing.assert_array_equal(stored.positions[3], predicted.positions[3])

    def test_networks_start_from_arrays(self):
        scene = graupel.Scene.from_file(graupel.scene_path("shared/water_steps"))
        start = graupel.Simulation(scene)
        given = scene.with_particles(start.positions, velocities=start.velocities)
        model = graupel.NetworkModel(graupel.model_path("hgn"))
        np.testing.assert_allclose(model.rollout(given, 2).positions[2], model.rollout(scene, 2).positions[2],
                                   atol=1e-6)

    def test_networks_say_what_they_do_not_know(self):
        scene = graupel.Scene.from_file(graupel.scene_path("shared/water_steps"), {"materials.water.bulk_modulus": 5e5})
        self.assertTrue(graupel.NetworkModel(graupel.model_path("hgn")).remarks(scene))

    def test_reduced_models_have_a_verdict(self):
        model = graupel.ReducedModel(graupel.model_path("nsf-jelly"))
        self.assertLess(model.parameters[0]["low"], model.parameters[0]["high"])
        self.assertEqual(model.remarks(model.scene), [])
        predicted = graupel.rollout(graupel.model_path("nsf-jelly"), model.scene, 3)
        self.assertEqual(len(predicted), 4)
        self.assertIn(predicted.verdict, ("ok", "doubtful", "do not trust", "unknown"))
        self.assertGreater(predicted.trust_number, 0)

    def test_errors_are_by_kind(self):
        scene = block()
        with self.assertRaisesRegex(graupel.InputError, "no_such"):
            graupel.rollout("no_such.safetensors", scene)
        with self.assertRaisesRegex(graupel.InputError, "no model"):
            graupel.rollout(graupel.scene_path("shared/water_steps"), scene)
        with tempfile.TemporaryDirectory() as folder:
            deep = os.path.join(folder, "deep.safetensors")
            with open(deep, "wb") as file:
                file.write((200_000).to_bytes(8, "little") + b"[" * 200_000)
            with self.assertRaisesRegex(graupel.InputError, "deep.safetensors"):
                graupel.rollout(deep, scene)
        with self.assertRaisesRegex(graupel.ConfigError, "coarse"):
            graupel.rollout(graupel.model_path("coarse-mpm"), scene)
        slow = graupel.Scene.from_file(graupel.scene_path("shared/water_steps"), {"frame_time": 0.1})
        with self.assertRaises(graupel.ConfigError):
            graupel.rollout(graupel.model_path("hgn"), slow, 1)
        with self.assertRaisesRegex(graupel.InputError, "hgn-general"):
            graupel.model_path("hgnn")


if __name__ == "__main__":
    unittest.main()
