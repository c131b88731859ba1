"""Arrays of runs on a GPU by DLPack. The protocol itself is tried on the CPU too."""
import gc
import importlib.util
import unittest

import numpy as np

import graupel
from scenes import block

HAS_GPU = graupel.cuda_available()
HAS_TORCH = importlib.util.find_spec("torch") is not None
NAMES = {"positions": 3, "velocities": 3, "stress": 6, "affine": 9, "deformation_gradient": 9, "plastic": 1}


def emitting():
    """A scene whose particles come during the run."""
    builder = graupel.SceneBuilder(size=(0.48, 0.48, 0.48), dx=0.02).material("water", preset="water")
    builder.emitter("water", "box", size=(0.08, 0.04, 0.08), position=(0.24, 0.36, 0.24), velocity=(0, -1.5, 0),
                    emission="stream", end_time=0.2)
    return builder.scene(frames=6, time_step={"policy": "fixed", "substeps_per_frame": 40})


def of(run, name):
    return getattr(run, name) if name in ("positions", "velocities") else run.field(name)


class RowsTest(unittest.TestCase):
    """GpuArray over a run on the CPU, whose NumPy arrays are known."""

    def test_values_and_shapes_are_those_of_numpy(self):
        for scene in (block("sand"), emitting()):
            run = graupel.Simulation(scene)
            run.run(3)
            for name in NAMES:
                rows = run._on_device(name)
                self.assertEqual(rows.shape, of(run, name).shape)
                self.assertEqual((rows.dtype, len(rows)), (np.float32, run.particle_count))
                np.testing.assert_array_equal(np.from_dlpack(rows), of(run, name))
                np.testing.assert_array_equal(rows.numpy(), of(run, name))
                np.testing.assert_array_equal(rows[3:5], of(run, name)[3:5])
        self.assertLess(run.active.sum(), run.particle_count)  # there were particles that are not in the run

    def test_it_works_with_numpy(self):
        run = graupel.Simulation(block())
        rows, plain = run._on_device("positions"), run.positions
        np.testing.assert_array_equal(plain - rows, 0 * plain)
        self.assertEqual(np.asarray(rows, dtype=np.float64).dtype, np.float64)
        self.assertEqual(rows[:, 1].mean(), plain[:, 1].mean())
        self.assertIn("float32 [", repr(rows))
        with self.assertRaises(ValueError):
            np.array(rows, copy=False)

    def test_it_stays_as_it_is(self):
        run = graupel.Simulation(block())
        rows = np.from_dlpack(run._on_device("positions"))
        start = rows.copy()
        run.advance_frame()
        self.assertGreater(np.abs(np.from_dlpack(run._on_device("positions")) - start).max(), 1e-4)
        del run
        gc.collect()
        graupel.Simulation(block()).run(2)  # other uses of the memory
        np.testing.assert_array_equal(rows, start)

    @unittest.skipUnless(HAS_TORCH, "torch is not installed")
    def test_arrays_of_runs_on_the_cpu_are_tensors_too(self):
        import torch
        run = graupel.Simulation(block())
        np.testing.assert_array_equal(torch.from_dlpack(run._on_device("positions")).numpy(), run.positions)


@unittest.skipUnless(HAS_GPU, "no GPU here, or a package without CUDA")
class GpuTest(unittest.TestCase):
    def runs(self):
        """One with the kernels for small scenes, one with those for large ones, one with the portable ones."""
        wide = graupel.SceneBuilder(size=(1, 1, 1), dx=0.0125).material("water", preset="water")
        wide.source("water", "box", size=(0.5, 0.3, 0.5), position=(0.5, 0.4, 0.5))
        scenes = [block(), emitting(), wide.scene(frames=2)]
        for scene in scenes:
            for forces in (False, True):
                run = graupel.Simulation(scene, device="cuda", forces=forces)
                run.run(2)
                yield run

    def test_arrays_are_on_the_gpu(self):
        for run in self.runs():
            for name, components in NAMES.items():
                rows = of(run, name)
                self.assertIsInstance(rows, graupel.GpuArray)
                self.assertEqual(rows.__dlpack_device__()[0], 2)
                self.assertEqual(int(np.prod(rows.shape)), components * run.particle_count)
                self.assertTrue(np.isfinite(rows.numpy()).all())
            np.testing.assert_allclose(run.velocities.numpy()[run.active == 0], 0)

    def test_they_have_the_numbers_of_frames_in_files(self):
        import os
        import tempfile
        for run in self.runs():
            with tempfile.TemporaryDirectory() as folder:
                path = os.path.join(folder, "run.h5")
                fields = [name for name in NAMES if name not in ("positions", "velocities")]
                with graupel.TrajectoryWriter(path, run, ",".join(fields)) as writer:
                    writer.append(run)
                written = graupel.Trajectory(path)
                np.testing.assert_array_equal(run.positions.numpy(), written.positions[0])
                np.testing.assert_array_equal(run.velocities.numpy(), written.velocities[0])
                for name in fields:
                    np.testing.assert_array_equal(run.field(name).numpy(), written.field(name)[0], name)

    @unittest.skipUnless(HAS_TORCH, "torch is not installed")
    def test_tensors_share_the_memory_and_outlive_the_run(self):
        import torch
        run = graupel.Simulation(block(), device="cuda")
        start = torch.from_dlpack(run.positions)
        self.assertEqual((start.device.type, start.dtype, tuple(start.shape)),
                         ("cuda", torch.float32, (run.particle_count, 3)))
        self.assertEqual(start.data_ptr(), torch.from_dlpack(run.positions).data_ptr())
        copy = start.cpu()
        run.run(2)
        later = torch.from_dlpack(run.positions)
        self.assertGreater((later - start).abs().max().item(), 1e-4)
        np.testing.assert_array_equal(later.cpu().numpy(), run.positions.numpy())
        del run
        gc.collect()
        graupel.Simulation(block(), device="cuda").run(1)  # other uses of the memory
        self.assertTrue(torch.equal(start.cpu(), copy))

    @unittest.skipUnless(HAS_TORCH, "torch is not installed")
    def test_other_streams_see_whole_arrays(self):
        import torch
        run, stream = graupel.Simulation(block(), device="cuda"), torch.cuda.Stream()
        for _ in range(5):
            run.advance_frame()
            with torch.cuda.stream(stream):
                mean = torch.from_dlpack(run.positions).double().mean(0)
            stream.synchronize()
            np.testing.assert_allclose(mean.cpu().numpy(), run.positions.numpy().astype(np.float64).mean(0), rtol=1e-12)

    def test_batches_are_on_the_gpu(self):
        batch = graupel.Batch([block(), emitting(), block("sand")], device="cuda")
        batch.run(2)
        for i, scene in enumerate(batch.scenes):
            alone = graupel.Simulation(scene, device="cuda")
            alone.run(2)
            for name in NAMES:
                rows = getattr(batch, name)[i] if name in ("positions", "velocities") else batch.field(name)[i]
                self.assertEqual(rows.__dlpack_device__()[0], 2)
                np.testing.assert_array_equal(rows.numpy(), of(alone, name).numpy(), name)


if __name__ == "__main__":
    unittest.main()
