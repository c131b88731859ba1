"""Runs: arrays without a copy, substeps, threads, Ctrl-C, saved states."""
import gc
import os
import signal
import subprocess
import sys
import threading
import time
import unittest

import numpy as np

import graupel
from scenes import block, large


class ArraysTest(unittest.TestCase):
    def test_shapes_types_and_units(self):
        run = graupel.Simulation(block())
        n = run.particle_count
        for name, shape in (("positions", (n, 3)), ("velocities", (n, 3))):
            self.assertEqual(getattr(run, name).shape, shape)
            self.assertEqual(getattr(run, name).dtype, np.float32)
        self.assertEqual(run.field("stress").shape, (n, 6))
        self.assertEqual(run.field("affine").shape, (n, 3, 3))
        self.assertEqual(run.field("deformation_gradient").shape, (n, 3, 3))
        self.assertEqual(run.field("plastic").shape, (n,))
        np.testing.assert_array_equal(run.field("deformation_gradient")[5], np.eye(3))
        self.assertEqual(run.active.sum(), n)
        self.assertEqual(set(run.particle_types), {4})
        self.assertAlmostEqual(run.velocities[:, 0].max(), 6 * 0.04, delta=0.02)
        with self.assertRaisesRegex(graupel.ConfigError, "stress"):
            run.field("stres")

    def test_there_is_no_copy_and_arrays_are_read_only(self):
        run = graupel.Simulation(block())
        self.assertTrue(np.shares_memory(run.positions, run.positions))
        self.assertTrue(np.shares_memory(run.field("stress"), run.field("stress")))
        self.assertFalse(run.positions.flags.writeable)
        with self.assertRaises(ValueError):
            run.positions[0, 0] = 1

    def test_an_array_is_the_state_of_its_moment_and_outlives_the_run(self):
        run = graupel.Simulation(block())
        start, copy = run.positions, run.positions.copy()
        run.advance_frame()
        self.assertGreater(np.abs(run.positions - start).max(), 1e-4)
        later, stress = run.positions[3], run.field("stress")
        sums = stress.sum()
        del run
        gc.collect()
        graupel.Simulation(block()).run(2)  # other uses of the memory
        np.testing.assert_array_equal(start, copy)
        self.assertEqual(stress.sum(), sums)
        self.assertTrue(np.isfinite(later).all())


class RunTest(unittest.TestCase):
    def test_free_fall(self):
        run = graupel.Simulation(block(), precision="f64")
        before = run.balance()
        run.run(3)
        self.assertAlmostEqual(run.time, 3 / 60, places=12)
        self.assertEqual(run.substeps, 120)
        gained = run.balance()["momentum"][1] - before["momentum"][1]
        self.assertAlmostEqual(gained, -9.8 * 3 / 60 * before["mass"], places=8)

    def test_steps_make_frames(self):
        steps, frames = graupel.Simulation(block()), graupel.Simulation(block())
        count = 1
        while not steps.step():
            count += 1
        frames.advance_frame()
        self.assertEqual(count, 40)
        np.testing.assert_array_equal(steps.positions, frames.positions)

    def test_progress_is_told_every_frame(self):
        seen = []
        graupel.Simulation(block(frames=3)).run(progress=seen.append)
        self.assertEqual(seen, [1, 2, 3])

        def fail(frame):
            raise LookupError(frame)
        with self.assertRaises(LookupError):
            graupel.Simulation(block(frames=3)).run(progress=fail)

    def test_seeds_choose_particles(self):
        one, same, other = (graupel.Simulation(block(), seed=seed) for seed in (1, 1, 2))
        np.testing.assert_array_equal(one.positions, same.positions)
        self.assertFalse(np.array_equal(one.positions, other.positions))

    def test_a_saved_state_goes_on_to_the_byte(self):
        run, other = graupel.Simulation(block("sand")), graupel.Simulation(block("sand"))
        run.advance_frame()
        state = run.save_state()
        run.advance_frame()
        other.load_state(state)
        other.advance_frame()
        np.testing.assert_array_equal(run.positions, other.positions)
        with self.assertRaises(graupel.InputError):
            graupel.Simulation(block("jelly")).load_state(state)
        with self.assertRaises(graupel.InputError):
            other.load_state(state[:100])

    def test_a_state_is_saved_between_frames_alone(self):
        run = graupel.Simulation(block())
        run.step()
        with self.assertRaisesRegex(graupel.ConfigError, "inside of one"):
            run.save_state()
        run.advance_frame()
        run.save_state()

    def test_volumes_keep_the_mass_of_a_restart(self):
        builder = graupel.SceneBuilder(size=(0.48, 0.48, 0.48), dx=0.02).material("water", preset="water")
        builder.source("water", "box", size=(0.1, 0.1, 0.1), position=(0.24, 0.24, 0.24), particles_per_cell=27)
        run = graupel.Simulation(builder.scene(frames=1))
        self.assertEqual(run.volumes.shape, (run.particle_count,))
        again = graupel.Simulation(run.scene.with_particles(run.positions, materials="water", volumes=run.volumes))
        self.assertAlmostEqual(again.balance()["mass"], run.balance()["mass"], delta=1e-6)

    def test_runs_that_blow_up_say_so(self):
        keys = block().to_dict()
        keys["time_step"]["substeps_per_frame"] = 1
        with self.assertRaisesRegex(graupel.DivergedError, "matter"):
            graupel.Simulation(graupel.Scene.from_dict(keys)).run(50)

    def test_settings_that_are_not_possible(self):
        with self.assertRaisesRegex(graupel.ConfigError, "precision"):
            graupel.Simulation(block(), precision="f16")
        with self.assertRaisesRegex(graupel.ConfigError, "tpu"):
            graupel.Simulation(block(), device="tpu")
        with self.assertRaises(graupel.ConfigError):
            graupel.Simulation(block()).run(-1)
        if graupel.cuda_available():
            self.skipTest("there is a GPU")
        self.assertIsInstance(graupel.Simulation(block(), device="auto").positions, np.ndarray)
        with self.assertRaisesRegex(graupel.ConfigError, "(?i)cuda|gpu"):
            graupel.Simulation(block(), device="cuda")


class ThreadsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.run_ = graupel.Simulation(large())

    def test_other_threads_run_meanwhile(self):
        """Counts in 1 ms pauses while a frame is made: with the GIL held the count would stay near 0."""
        counted, done = [0], threading.Event()

        def count():
            while not done.is_set():
                counted[0] += 1
                time.sleep(0.001)
        run = graupel.Simulation(large())
        thread = threading.Thread(target=count)
        thread.start()
        begin, before = time.perf_counter(), counted[0]
        for _ in range(40):
            run.step()
        seconds, during = time.perf_counter() - begin, counted[0] - before
        done.set()
        thread.join()
        self.assertGreater(during, 20 * seconds)

    def test_a_second_thread_is_refused(self):
        errors, begun = [], threading.Event()

        def other():
            begun.wait()
            time.sleep(0.05)
            for _ in range(100):
                try:
                    self.run_.positions
                except RuntimeError as error:
                    errors.append(str(error))
                    return
        thread = threading.Thread(target=other)
        thread.start()
        begun.set()
        for _ in range(30):
            self.run_.step()
        thread.join()
        self.assertTrue(errors and "another thread" in errors[0])

    def test_ctrl_c_ends_a_run_of_short_frames(self):
        self.addCleanup(signal.signal, signal.SIGINT, signal.getsignal(signal.SIGINT))
        signal.signal(signal.SIGINT, signal.default_int_handler)
        run, begin = graupel.Simulation(block()), time.perf_counter()
        run.advance_frame()
        frames = int(20 / (time.perf_counter() - begin))  # of 20 s or so
        timer = threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT))
        begin = time.perf_counter()
        timer.start()
        with self.assertRaises(KeyboardInterrupt):
            run.run(frames)
        self.assertLess(time.perf_counter() - begin, 5)

    def test_a_thread_in_a_call_does_not_spoil_the_end_of_the_interpreter(self):
        code = ("import threading, time, graupel; from scenes import block; run = graupel.Simulation(block()); "
                "threading.Thread(target=run.run, args=(10**6,), daemon=True).start(); time.sleep(0.5)")
        here = os.path.dirname(os.path.abspath(__file__))
        for _ in range(3):
            done = subprocess.run([sys.executable, "-c", code], cwd=here, capture_output=True, text=True, check=False,
                                  timeout=60)
            self.assertEqual((done.returncode, done.stderr), (0, ""))

    def test_ctrl_c_ends_a_frame_between_two_substeps(self):
        self.addCleanup(signal.signal, signal.SIGINT, signal.getsignal(signal.SIGINT))
        signal.signal(signal.SIGINT, signal.default_int_handler)  # shells let background processes ignore it
        run = graupel.Simulation(large())
        timer = threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT))
        begin = time.perf_counter()
        timer.start()
        with self.assertRaises(KeyboardInterrupt):
            run.run()
        self.assertLess(time.perf_counter() - begin, 5)
        self.assertGreater(run.substeps, 0)
        steps = run.substeps
        run.step()  # it goes on
        self.assertEqual(run.substeps, steps + 1)
        self.assertTrue(np.isfinite(run.positions).all())


if __name__ == "__main__":
    unittest.main()
