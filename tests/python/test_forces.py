"""Forces on obstacles and walls: of a run, in files, over more or less than a frame."""
import os
import subprocess
import tempfile
import unittest

import numpy as np

import graupel
from graupel._program import PROGRAM
from scenes import block

QUANTITIES = ("impulse", "force", "torque", "reference")


def on_floor():
    """A block of jelly that falls on the floor and an obstacle in its first frames."""
    builder = graupel.SceneBuilder(size=(0.48, 0.48, 0.48), dx=0.02).material("jelly", preset="jelly")
    builder.source("jelly", "box", size=(0.16, 0.08, 0.08), position=(0.24, 0.11, 0.24), velocity=(0.5, -2, 0))
    builder.obstacle("box", size=(0.06, 0.1, 0.1), position=(0.36, 0.11, 0.24))
    return builder.scene(name="floor", frames=4, time_step={"policy": "fixed", "substeps_per_frame": 40})


class RunTest(unittest.TestCase):
    def test_they_are_arrays_by_obstacle_and_wall(self):
        run = graupel.Simulation(block(), forces=True)
        run.advance_frame()
        forces = run.contact_forces()
        self.assertEqual(forces["names"][-6:], ["wall_x_low", "wall_x_high", "wall_y_low", "wall_y_high",
                                                "wall_z_low", "wall_z_high"])
        for name in ("impulse", "force", "torque", "reference"):
            self.assertEqual(forces[name].shape, (len(forces["names"]), 3))
            self.assertEqual(forces[name].dtype, np.float64)
        np.testing.assert_allclose(forces["impulse"], forces["force"] * run.time, atol=1e-15)

    def test_a_run_without_them_says_how(self):
        with self.assertRaisesRegex(graupel.ConfigError, "forces=True"):
            graupel.Simulation(block()).contact_forces()

    def test_inside_of_a_frame_they_are_of_the_part_that_is_done(self):
        run = graupel.Simulation(on_floor(), forces=True)
        self.assertEqual(np.abs(run.contact_forces()["impulse"]).max(), 0)
        run.run(2)
        whole = run.contact_forces()["impulse"]
        begin = run.time
        run.step()
        part = run.contact_forces()
        self.assertLess(np.abs(part["impulse"]).max(), 0.5 * np.abs(whole).max())
        np.testing.assert_allclose(part["impulse"], part["force"] * (run.time - begin), rtol=1e-9, atol=1e-15)
        state = graupel.Simulation(on_floor(), forces=True).save_state()
        run.load_state(state)
        self.assertEqual(np.abs(run.contact_forces()["impulse"]).max(), 0)


class FileTest(unittest.TestCase):
    def setUp(self):
        place = tempfile.TemporaryDirectory()
        self.addCleanup(place.cleanup)
        self.file = os.path.join(place.name, "run.h5")

    def recorded(self):
        """contact_forces() of every frame: name -> [frames, k, 3]."""
        run = graupel.Simulation(on_floor(), forces=True)
        rows = [run.contact_forces()]
        for _ in range(4):
            run.advance_frame()
            rows.append(run.contact_forces())
        self.assertGreater(np.abs(rows[-1]["impulse"][0]).max(), 0)  # on the obstacle
        return {name: np.stack([row[name] for row in rows]) for name in QUANTITIES}

    def test_files_have_those_of_every_frame(self):
        made = graupel.simulate(on_floor(), self.file, forces=True)
        expected = self.recorded()
        self.assertEqual(made.forces["names"][:2], ["obstacle_0", "wall_x_low"])
        for name in QUANTITIES:
            self.assertEqual(made.forces[name].shape, (5, 7, 3))
            np.testing.assert_array_equal(made.forces[name], expected[name])
        made.write(self.file + "2")
        np.testing.assert_array_equal(graupel.Trajectory(self.file + "2").forces["torque"], expected["torque"])
        table = self.file + ".csv"
        subprocess.run([PROGRAM, "export", self.file, "-f", "csv", "-o", table], check=True, capture_output=True)
        self.assertTrue(os.path.exists(table))

    def test_files_without_them_have_none(self):
        self.assertIsNone(graupel.simulate(on_floor(), self.file, 1).forces)
        self.assertIsNone(graupel.rollout(graupel.model_path("hgn"), graupel.Scene.from_file(
            graupel.scene_path("shared/water_steps")), 1).forces)

    def test_frames_that_are_further_apart_have_the_impulse_of_all_between(self):
        run, every = graupel.Simulation(on_floor(), forces=True), self.recorded()
        with graupel.TrajectoryWriter(self.file, run) as writer:
            for count in (0, 1, 3):
                run.run(count)
                writer.append(run)
        forces = graupel.Trajectory(self.file).forces
        np.testing.assert_array_equal(forces["impulse"][:2], every["impulse"][:2])
        np.testing.assert_allclose(forces["impulse"][2], every["impulse"][2:].sum(axis=0), rtol=1e-12, atol=1e-15)
        for name in ("force", "torque"):
            np.testing.assert_allclose(forces[name][2], every[name][2:].mean(axis=0), rtol=1e-9, atol=1e-12)
        np.testing.assert_array_equal(forces["reference"][2], every["reference"][4])

    def test_parts_of_frames_add_up(self):
        run, every = graupel.Simulation(on_floor(), forces=True), self.recorded()
        with graupel.TrajectoryWriter(self.file, run) as writer:
            writer.append(run)
            for _ in range(70):  # 40 substeps a frame
                run.step()
            writer.append(run)
            run.advance_frame()
            writer.append(run)
        forces, times = graupel.Trajectory(self.file).forces, graupel.Trajectory(self.file).times
        np.testing.assert_allclose(forces["impulse"].sum(axis=0), every["impulse"][:3].sum(axis=0), rtol=1e-9,
                                   atol=1e-14)
        np.testing.assert_allclose(forces["force"][1:] * np.diff(times)[:, None, None], forces["impulse"][1:],
                                   rtol=1e-9, atol=1e-14)

    def test_a_run_from_a_state_goes_on_in_the_file(self):
        run, every = graupel.Simulation(on_floor(), forces=True), self.recorded()
        with graupel.TrajectoryWriter(self.file, run) as writer:
            writer.append(run)
            run.advance_frame()
            writer.append(run)
            other = graupel.Simulation(on_floor(), forces=True)
            other.load_state(run.save_state())
            other.advance_frame()
            writer.append(other)
        np.testing.assert_array_equal(graupel.Trajectory(self.file).forces["impulse"], every["impulse"][:3])

    def test_a_run_without_them_does_not_go_on_in_the_file(self):
        run = graupel.Simulation(on_floor(), forces=True)
        with graupel.TrajectoryWriter(self.file, run) as writer:
            writer.append(run)
            other = graupel.Simulation(on_floor())
            other.advance_frame()
            with self.assertRaisesRegex(graupel.ConfigError, "forces=True"):
                writer.append(other)
        self.assertEqual(len(graupel.Trajectory(self.file)), 1)


if __name__ == "__main__":
    unittest.main()
