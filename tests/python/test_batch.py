"""Batches: every scene as in its own run, to the byte; errors that name the scene; Ctrl-C, threads, arrays."""
import gc
import os
import signal
import threading
import time
import unittest

import numpy as np

import graupel
from scenes import block, large


def several():
    """Scenes that differ in material, time step, grid and dimensions."""
    plane = (graupel.SceneBuilder(size=(0.6, 0.48, 0.48), dx=0.02, dimensions=2)
             .material("sand", preset="taichi_sand")
             .source("sand", "box", size=(0.1, 0.1, 0.1), position=(0.3, 0.2, 0.24)).scene(name="plane", frames=4))
    finer = block().to_dict()
    finer["domain"]["dx"], finer["time_step"] = 0.016, {"policy": "adaptive"}
    return [block("jelly"), block("sand"), plane, graupel.Scene.from_dict(finer), block("water")]


class BatchTest(unittest.TestCase):
    def expect_single_runs(self, device, **options):
        scenes = several()
        batch = graupel.Batch(scenes, device, **options)
        self.assertEqual(len(batch), len(scenes))
        batch.run(3)
        for i, scene in enumerate(scenes):
            alone = graupel.Simulation(scene, device, **options)
            alone.run(3)
            np.testing.assert_array_equal(batch.positions[i], alone.positions)
            np.testing.assert_array_equal(batch.velocities[i], alone.velocities)
            np.testing.assert_array_equal(batch.particle_types[i], alone.particle_types)
            np.testing.assert_array_equal(batch.active[i], alone.active)
            for name in ("stress", "affine", "deformation_gradient", "plastic"):
                np.testing.assert_array_equal(batch.field(name)[i], alone.field(name))
        self.assertEqual(batch.diverged, [None] * len(scenes))

    def test_scenes_are_as_alone_to_the_byte(self):
        self.expect_single_runs("cpu")

    def test_scenes_are_as_alone_in_double_precision(self):
        self.expect_single_runs("cpu", precision="f64")

    @unittest.skipUnless(graupel.cuda_available(), "no GPU here, or a package without CUDA")
    def test_scenes_are_as_alone_on_a_gpu(self):
        self.expect_single_runs("cuda")

    def test_seeds(self):
        batch = graupel.Batch([block()] * 2, seeds=[5, 6])
        for seed, positions in zip((5, 6), batch.positions):
            np.testing.assert_array_equal(positions, graupel.Simulation(block(), seed=seed).positions)
        with self.assertRaisesRegex(graupel.ConfigError, "1 seeds for 2 scenes"):
            graupel.Batch([block()] * 2, seeds=[5])

    def test_arrays_are_views_that_stay(self):
        batch = graupel.Batch([block(), block("sand")])
        start = batch.positions[1]
        copy = start.copy()
        self.assertTrue(np.shares_memory(start, batch.positions[1]))
        self.assertFalse(start.flags.writeable)
        self.assertEqual((start.dtype, start.shape[1]), (np.float32, 3))
        batch.advance_frame()
        self.assertGreater(np.abs(batch.positions[1] - start).max(), 1e-4)
        del batch
        gc.collect()
        np.testing.assert_array_equal(start, copy)

    def test_a_scene_that_blows_up_leaves_the_others_alone(self):
        wild = block().to_dict()
        wild["name"], wild["time_step"]["substeps_per_frame"] = "wild", 1
        scenes = [block(), graupel.Scene.from_dict(wild), block("sand")]
        batch = graupel.Batch(scenes)
        batch.run(50)
        self.assertEqual(batch.frames_done, 50)
        self.assertIsNone(batch.diverged[0])
        self.assertIsNone(batch.diverged[2])
        self.assertRegex(batch.diverged[1], r"^scene 1 \('wild'\): .*diverged at particle")
        alone = graupel.Simulation(scenes[2])
        alone.run(50)
        np.testing.assert_array_equal(batch.positions[2], alone.positions)

    def test_errors_name_the_scene(self):
        outside = block().to_dict()
        outside["name"], outside["sources"][0]["position"] = "outside", [0.24, 0.0, 0.24]
        with self.assertRaisesRegex(graupel.ConfigError, r"^scene 2 \('outside'\): "):
            graupel.Batch([block(), block(), graupel.Scene.from_dict(outside)])
        with self.assertRaisesRegex(graupel.ConfigError, "no scene"):
            graupel.Batch([])
        with self.assertRaisesRegex(TypeError, "scene 1 of the batch is a 'dict'"):
            graupel.Batch([block(), block().to_dict()])
        with self.assertRaisesRegex(graupel.ConfigError, "scene 0: 4, scene 1: 7.*run\\(frames\\)"):
            graupel.Batch([block(), block(frames=7)]).run()
        with self.assertRaisesRegex(graupel.ConfigError, "stress"):
            graupel.Batch([block()]).field("stres")

    def test_progress_is_told_every_frame(self):
        seen = []
        graupel.Batch([block(frames=3)] * 2).run(progress=seen.append)
        self.assertEqual(seen, [1, 2, 3])


class InterruptTest(unittest.TestCase):
    def test_ctrl_c_ends_a_frame_and_the_next_call_ends_it(self):
        self.addCleanup(signal.signal, signal.SIGINT, signal.getsignal(signal.SIGINT))
        signal.signal(signal.SIGINT, signal.default_int_handler)  # shells let background processes ignore it
        scenes = [block(), large(), block("sand")]
        batch = graupel.Batch(scenes)
        timer = threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT))
        begin = time.perf_counter()
        timer.start()
        with self.assertRaises(KeyboardInterrupt):
            batch.run(1)  # the large one takes many seconds on its thread
        self.assertLess(time.perf_counter() - begin, 5)
        self.assertEqual(batch.frames_done, 0)
        for i in (0, 2):
            self.assertTrue(np.isfinite(batch.positions[i]).all())

    def test_an_interrupted_frame_has_the_bytes_of_another(self):
        self.addCleanup(signal.signal, signal.SIGINT, signal.getsignal(signal.SIGINT))
        signal.signal(signal.SIGINT, signal.default_int_handler)
        keys = block(frames=1).to_dict()
        keys["time_step"]["substeps_per_frame"] = 4000
        scenes = [graupel.Scene.from_dict(keys), block("sand")]
        batch, whole = graupel.Batch(scenes), graupel.Batch(scenes)
        begin = time.perf_counter()
        whole.run(2)
        timer = threading.Timer((time.perf_counter() - begin) / 4, os.kill, (os.getpid(), signal.SIGINT))
        timer.start()
        with self.assertRaises(KeyboardInterrupt):
            batch.run(2)
        self.assertLess(batch.frames_done, 2)
        batch.run(2 - batch.frames_done)
        for interrupted, other in zip(batch.positions, whole.positions):
            np.testing.assert_array_equal(interrupted, other)

    def test_other_threads_run_meanwhile_and_may_not_use_it(self):
        batch, counted, errors = graupel.Batch([block(frames=2)] * 4), [0], []
        done = threading.Event()

        def count():
            while not done.is_set():
                counted[0] += 1
                try:
                    batch.frames_done, batch.diverged
                except RuntimeError as error:
                    errors.append(str(error))
                time.sleep(0.001)
        thread = threading.Thread(target=count)
        thread.start()
        begin = time.perf_counter()
        batch.run(8)
        seconds = time.perf_counter() - begin
        done.set()
        thread.join()
        self.assertGreater(counted[0], 20 * seconds)
        self.assertTrue(errors and "another thread" in errors[0])


if __name__ == "__main__":
    unittest.main()
