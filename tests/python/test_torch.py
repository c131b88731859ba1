"""PyTorch: the HGN module gives the numbers of the C++ code; windows of data sets. Skipped where torch is not there."""
import copy
import io
import os
import pickle
import shutil
import subprocess
import sys
import tempfile
import unittest

import numpy as np

import graupel
from scenes import block

try:
    import torch
except ImportError:
    torch = None


class LazyTest(unittest.TestCase):
    def test_graupel_alone_imports_no_torch(self):
        code = "import graupel, sys; assert 'torch' not in sys.modules"
        subprocess.run([sys.executable, "-c", code], check=True)


@unittest.skipIf(torch is None, "torch is not installed")
class HgnTest(unittest.TestCase):
    def compare(self, name, scene, frames):
        """Accelerations from a true history among obstacles, against those of the C++ code."""
        run = graupel.Simulation(scene)
        history = []
        for frame in range(frames):
            run.advance_frame()
            history = history[-5:] + [run.positions]
        model = graupel.NetworkModel(graupel.model_path(name))
        theirs = model.accelerations(scene, history, run.particle_types)
        module = graupel.torch.HGN(graupel.model_path(name))
        with torch.no_grad():
            mine = module.accelerations(scene, history, run.particle_types)
        self.assertEqual(tuple(mine.shape), (2, run.particle_count, 3))
        error = np.linalg.norm(mine[0].numpy() - theirs) / np.linalg.norm(theirs)
        self.assertLess(error, 1e-5, name)
        self.assertGreater(np.linalg.norm(theirs), 1e-3)
        return error

    def test_accelerations_are_those_of_the_cpp_code(self):
        import graupel.torch  # noqa: F401
        scene = graupel.Scene.from_file(graupel.scene_path("shared/mixed_blocks"))
        for name in ("hgn", "hgn-general"):
            error = self.compare(name, scene, 24)
            print(f"{name}: relative difference {error:.1e}", file=sys.stderr)

    def test_other_weights_give_other_accelerations(self):
        from graupel.torch import HGN
        scene = graupel.Scene.from_file(graupel.scene_path("shared/water_steps"))
        model = graupel.NetworkModel(graupel.model_path("hgn"))
        history, types = model.start(scene)
        module = HGN(graupel.model_path("hgn"))
        with torch.no_grad():
            before = module.accelerations(scene, history, types)
            module.get_parameter("up.1.0.gather.weight")[:] *= 1.01
            after = module.accelerations(scene, history, types)
        self.assertGreater(float((after - before).norm() / before.norm()), 1e-5)

    def test_gradients_reach_all_weights_and_the_features(self):
        from graupel.torch import HGN
        scene = graupel.Scene.from_file(graupel.scene_path("shared/water_steps"))
        module = HGN(graupel.model_path("hgn"))
        history, types = graupel.NetworkModel(graupel.model_path("hgn")).start(scene)
        some = slice(0, 2000)
        features, rows, origin = module.features(scene, history[:, some], types[some])
        features.requires_grad_(True)
        module(features, rows, torch.tensor(history[-1, some]), origin).square().sum().backward()
        self.assertTrue(all(p.grad is not None and torch.isfinite(p.grad).all() for p in module.parameters()))
        self.assertGreater(float(features.grad.abs().sum()), 0)

    def test_the_state_has_the_names_of_the_file(self):
        from graupel.torch import HGN
        from graupel.torch.hgn import read_safetensors
        path = graupel.model_path("hgn")
        self.assertEqual(set(HGN(path).state_dict()), set(read_safetensors(path)[1]))

    def test_copies_and_pickles_have_the_weights(self):
        from graupel.torch import HGN
        scene = graupel.Scene.from_file(graupel.scene_path("shared/water_steps"))
        history, types = graupel.NetworkModel(graupel.model_path("hgn")).start(scene)
        history, types = history[:, :500], types[:500]
        with tempfile.TemporaryDirectory() as folder, torch.no_grad():
            file = os.path.join(folder, "hgn.safetensors")
            shutil.copy(graupel.model_path("hgn"), file)
            module = HGN(os.path.relpath(file))
            module.get_parameter("up.1.0.gather.weight")[:] *= 1.01
            wanted = module.accelerations(scene, history, types)
            saved = io.BytesIO()
            torch.save(module, saved)
            saved.seek(0)
            twin = copy.deepcopy(module)
            for other in (twin, pickle.loads(pickle.dumps(module)), torch.load(saved, weights_only=False)):
                self.assertTrue(torch.equal(other.accelerations(scene, history, types), wanted))
            twin.get_parameter("decoder.layer2.weight")[:] = 0
            self.assertTrue(torch.equal(module.accelerations(scene, history, types), wanted))
            averaged = torch.optim.swa_utils.AveragedModel(module)
            averaged.update_parameters(module)
            pickled = pickle.dumps(module)
        elsewhere = pickle.loads(pickled)
        self.assertEqual(set(elsewhere.state_dict()), set(module.state_dict()))
        with self.assertRaisesRegex(graupel.InputError, "hgn.safetensors"):
            elsewhere.features(scene, history, types)

    def test_other_models_are_refused(self):
        from graupel.torch import HGN
        with self.assertRaisesRegex(graupel.InputError, "gns"):
            HGN(graupel.model_path("gns"))
        with self.assertRaises(graupel.InputError):
            HGN(graupel.model_path("nsf-jelly"))


@unittest.skipIf(torch is None, "torch is not installed")
class WindowsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.place = tempfile.TemporaryDirectory()
        cls.file = os.path.join(cls.place.name, "valid.h5")
        graupel.simulate(block("sand"), cls.file, 9)

    @classmethod
    def tearDownClass(cls):
        cls.place.cleanup()

    def test_windows_are_those_of_the_trajectory(self):
        from graupel.torch import WindowDataset
        windows = WindowDataset(self.place.name, "valid", history=2, predicted=1, stride=3)
        truth = np.asarray(graupel.Trajectory(self.file).positions)
        self.assertEqual(len(windows), 3)
        for i in (0, 1, 2, -1):
            item = windows[i]
            first = item["frame"]
            np.testing.assert_array_equal(item["positions"].numpy(), truth[first:first + 4])
        self.assertEqual([windows[i]["frame"] for i in range(3)], [0, 3, 6])
        self.assertEqual(set(windows[0]["particle_types"].tolist()), {6})
        self.assertEqual(set(windows[0]["materials"].tolist()), {0})
        with self.assertRaises(IndexError):
            windows[3]

    def test_items_are_independent(self):
        from graupel.torch import WindowDataset
        windows = WindowDataset(self.file)
        item = windows[0]
        item["particle_types"][:] = -7
        item["materials"][:] = -7
        self.assertEqual(set(windows[0]["particle_types"].tolist()), {6})
        self.assertEqual(set(windows[1]["materials"].tolist()), {0})

    def test_a_loader_reads_in_workers(self):
        from graupel.torch import WindowDataset
        windows = WindowDataset(self.file)
        windows[0]
        self.assertEqual(len(pickle.loads(pickle.dumps(windows))), len(windows))
        loader = torch.utils.data.DataLoader(windows, batch_size=None, num_workers=2, multiprocessing_context="spawn")
        loaded = [item["positions"] for item in loader]
        self.assertEqual(len(loaded), 4)
        for i, positions in enumerate(loaded):
            np.testing.assert_array_equal(positions.numpy(), windows[i]["positions"].numpy())

    def test_what_is_not_possible_is_told(self):
        from graupel.torch import WindowDataset
        with self.assertRaisesRegex(graupel.ConfigError, "window of 50 frames"):
            WindowDataset(self.file, history=48)
        with self.assertRaisesRegex(graupel.InputError, "train.h5"):
            WindowDataset(self.place.name)
        with self.assertRaises(graupel.ConfigError):
            WindowDataset(self.file, stride=0)


if __name__ == "__main__":
    unittest.main()
