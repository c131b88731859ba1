"""Runs from arrays of positions, velocities, deformation gradients and materials."""
import os
import tempfile
import unittest

import numpy as np

import graupel
from scenes import block


def lattice(n=6):
    axis = 0.2 + 0.01 * np.arange(n)
    return np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)


class ParticlesTest(unittest.TestCase):
    def test_a_run_goes_on_from_the_arrays_of_a_frame(self):
        for preset in ("jelly", "sand", "water"):
            scene = block(preset)
            run = graupel.Simulation(scene)
            run.run(3)
            moved = scene.with_particles(run.positions, velocities=run.velocities,
                                         deformation_gradients=run.field("deformation_gradient"),
                                         affine_velocities=run.field("affine"), plastic=run.field("plastic"))
            other = graupel.Simulation(moved)
            np.testing.assert_allclose(other.field("stress"), run.field("stress"), rtol=1e-2,
                                       atol=5e-3 * np.abs(run.field("stress")).max())
            run.run(2)
            other.run(2)
            self.assertLess(np.abs(run.positions - other.positions).max(), 1e-5, preset)

    def test_energy_of_a_stretched_block(self):
        keys = block().to_dict()
        keys["materials"]["matter"].update(youngs_modulus=1e5, poissons_ratio=0)
        keys["materials"]["matter"].pop("preset", None)
        x = lattice(10)
        stretch = np.tile(np.diag([1.1, 1, 1]), (len(x), 1, 1))
        run = graupel.Simulation(graupel.Scene.from_dict(keys).with_particles(
            x, deformation_gradients=stretch, volumes=np.full(len(x), 1e-6)), precision="f64")
        self.assertAlmostEqual(run.balance()["elastic"], 1e-3 * 5e4 * 0.01, places=5)  # V mu (s - 1)^2

    def test_materials_by_name_and_by_place(self):
        keys = block().to_dict()
        keys["materials"]["wet"] = {"preset": "water"}
        scene = graupel.Scene.from_dict(keys)
        self.assertEqual(scene.materials, ["matter", "wet"])
        x = lattice()[:4]
        by_name = graupel.Simulation(scene.with_particles(x, materials=["wet", "matter", "matter", "wet"]))
        by_place = graupel.Simulation(scene.with_particles(x, materials=np.array([1, 0, 0, 1])))
        np.testing.assert_array_equal(by_name.particle_types, by_place.particle_types)
        self.assertEqual(list(by_name.particle_types), [5, 4, 4, 5])
        with self.assertRaisesRegex(graupel.ConfigError, r"materials\[2\] = 9 .*allowed: 0 to 1"):
            scene.with_particles(x, materials=[0, 1, 9, 1])
        with self.assertRaisesRegex(graupel.ConfigError, "'wett' is not in the scene"):
            scene.with_particles(x, materials="wett")
        with self.assertRaisesRegex(graupel.ConfigError, "2 materials"):
            scene.with_particles(x)

    def test_lists_and_other_types_are_arrays(self):
        x = lattice()
        scene = block()
        run = graupel.Simulation(scene.with_particles(x.astype(np.float32)[::2].tolist()))
        self.assertEqual(run.particle_count, len(x[::2]))
        every_other = graupel.Simulation(scene.with_particles(x[::2]))
        np.testing.assert_allclose(run.positions, every_other.positions)

    def test_errors_name_particle_value_and_what_is_allowed(self):
        scene, x = block(), lattice()
        bad = x.copy()
        bad[17, 1] = np.nan
        with self.assertRaisesRegex(graupel.ConfigError, r"position\[17\] = \(.*nan.*finite"):
            scene.with_particles(bad)
        bad[17, 1] = 3
        with self.assertRaisesRegex(graupel.ConfigError, r"position\[17\] = \(.*3, .*allowed: \(0.06, 0.06, 0.06\) to"):
            scene.with_particles(bad)
        with self.assertRaisesRegex(graupel.ConfigError, rf"velocity has another length.*allowed: {len(x)}"):
            scene.with_particles(x, velocities=np.zeros((5, 3)))
        with self.assertRaisesRegex(graupel.ConfigError, r"velocities has the wrong shape \(\[5, 2\]"):
            scene.with_particles(x, velocities=np.zeros((5, 2)))
        with self.assertRaisesRegex(graupel.ConfigError, "positions is no array"):
            scene.with_particles([[0, 0, 0], [0, 0]])
        with self.assertRaisesRegex(graupel.ConfigError, "det F > 0"):
            scene.with_particles(x, deformation_gradients=np.tile(-np.eye(3), (len(x), 1, 1)))
        inside = scene.with_mesh([[0.1, 0.1, 0.1], [0.4, 0.1, 0.1], [0.1, 0.1, 0.4], [0.1, 0.4, 0.1]],
                                 [[0, 1, 2], [1, 0, 3], [2, 1, 3], [0, 2, 3]])
        with self.assertRaisesRegex(graupel.ConfigError, "obstacle 0"):
            graupel.Simulation(inside.with_particles([[0.15, 0.15, 0.15]]))

    def test_the_scene_of_a_file_says_that_it_lacks_them(self):
        with tempfile.TemporaryDirectory() as folder:
            made = graupel.simulate(block().with_particles(lattice()), os.path.join(folder, "run.h5"), 1)
            self.assertEqual(made.particle_count, len(lattice()))
            with self.assertRaisesRegex(graupel.InputError, "in memory are not stored"):
                made.scene

    def test_two_dimensions_take_pairs(self):
        keys = block().to_dict()
        keys["domain"]["dimensions"] = 2
        keys["sources"][0]["angular_velocity"] = [0, 0, 0]
        scene = graupel.Scene.from_dict(keys)
        run = graupel.Simulation(scene.with_particles(lattice()[:, :2][::6], velocities=np.ones((36, 2))))
        np.testing.assert_allclose(run.positions[:, 2], 0.24)
        np.testing.assert_allclose(run.velocities, np.tile([1, 1, 0], (36, 1)))


if __name__ == "__main__":
    unittest.main()
