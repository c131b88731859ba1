#!/usr/bin/env python3
"""tools/convert.py as a command, metadata and particle types: what comes back, what is refused and in which words, what
an unhappy end leaves.

Runs by tests/run_all.sh, or: /usr/bin/python3 tests/tools/convert_test.py. Needs numpy and h5py; the tests with
scenes need the program in build/.
"""
import json
import os
import pathlib
import signal
import subprocess
import sys
import unittest

import h5py
import numpy as np

from convert_case import Case, EXAMPLE, PROGRAM, ROOT, TOOL, sample
from graupel_convert import conversion, errors, gns, hdf5, metadata, series


class Metadata(Case):
    def read(self, value):
        with open(self.path("metadata.json"), "w", encoding="utf-8") as file:
            file.write(json.dumps(value))
        return metadata.read_metadata(self.path("metadata.json"))

    def test_of_both_programs_is_read(self):
        m = self.read(EXAMPLE)
        self.assertEqual((m.dimensions, m.bounds, m.frame_time, m.radius), (2, [[0.1, 0.9], [0.1, 0.9]], 0.0025, 0.015))
        self.assertEqual((m.periodic, m.gravity, m.grid_spacing), ([False, False], None, None))
        m = self.read({**EXAMPLE, "case": "RPF", "write_every": 100, "dx": 0.02, "sequence_length": None,
                       "periodic_boundary_conditions": [True, False, True]})  # three also in the plane
        self.assertEqual((m.name, m.frame_time, m.particle_spacing, m.periodic), ("RPF", 0.25, 0.02, [True, False]))
        wide = {**EXAMPLE, "bounds": [[0.1, 1.9], [0.1, 0.9]]}
        self.assertEqual(self.read({"train": EXAMPLE, "rollout": wide}).bounds[0][1], 0.9)

    def test_missing_keys_are_named(self):
        for key in EXAMPLE:
            if key != "sequence_length":
                self.refused(errors.InputError, f"'{key}' is missing", self.read, {k: v for k, v in EXAMPLE.items() if k != key})

    def test_bad_values_are_named(self):
        for key, value, words in (
                ("dim", 4, "is 4 (needed: a whole number from 2 to 3)"), ("dim", 2.5, "is 2.5"), ("dim", "2", 'is "2"'),
                ("dt", 0, "is 0 (needed: a number above 0)"), ("dt", None, "is null"),
                ("write_every", 0, "a whole number from 1"), ("default_connectivity_radius", -1, "is -1"),
                ("dx", 0, "a number above 0"), ("sequence_length", -3, "is -3"), ("sequence_length_train", "many", 'is "many"'),
                ("gravity", [0, -9.8], "needed: 3 numbers"), ("grid_spacing", "small", "a number above 0"),
                ("bounds", [[0, 1]], "needed: 2 pairs"), ("bounds", [[0, 1], [1, 0]], "low below high"), ("bounds", 1, "2 pairs"),
                ("vel_mean", [0, 0, 0], "needed: 2 numbers, as dim says"), ("vel_std", [1, -1], "2 numbers, 0 or more"),
                ("acc_mean", [0, "x"], "needed: 2 numbers"), ("periodic_boundary_conditions", [1, 0], "2 times true or false"),
                ("periodic_boundary_conditions", [True], "2 times true or false")):
            self.refused(errors.InputError, ("metadata.json", f"'{key}' ", words), self.read, {**EXAMPLE, key: value})

    def test_a_byte_order_mark_is_passed_over(self):
        with open(self.path("m.json"), "w", encoding="utf-8-sig") as file:
            json.dump(EXAMPLE, file)
        self.assertEqual(metadata.read_metadata(self.path("m.json")).dimensions, EXAMPLE["dim"])
        with open(self.path("m.json"), "w", encoding="utf-16") as file:
            json.dump(EXAMPLE, file)
        self.refused(errors.InputError, "m.json", metadata.read_metadata, self.path("m.json"))

    def test_files_that_are_no_json_are_named(self):
        for text in ('{"dim": 2,}', '{"dim": 2, "dim": 3}', '{"dim": NaN}', "[" * 100000):
            with open(self.path("m.json"), "w", encoding="utf-8") as file:
                file.write(text)
            self.refused(errors.InputError, "m.json", metadata.read_metadata, self.path("m.json"))
        self.refused(errors.InputError, "missing.json", metadata.read_metadata, self.path("missing.json"))

    def test_what_is_written(self):
        m = self.read({**EXAMPLE, "gravity": [0, -9.8, 0], "grid_spacing": 0.01})
        motion = {key: EXAMPLE[key] for key in ("vel_mean", "vel_std", "acc_mean", "acc_std")}
        splits = {"train": metadata.SplitFigures(2, 30, 30, 9), "test": metadata.SplitFigures(1, 30, 30, 12)}
        out = metadata.gns_metadata(m, splits, motion, {5: "water"})
        self.assertEqual((out["sequence_length"], out["nnode_in"], out["nedge_in"]), (30, 30, 3))
        self.assertEqual(self.read(json.loads(metadata.json_text(out))), metadata.Metadata(**{**vars(m)}))
        uneven = metadata.gns_metadata(m, {"train": metadata.SplitFigures(2, 20, 30, 9, True)}, motion, {})
        self.assertEqual((uneven["sequence_length"], uneven["nnode_in"], uneven["material_feature_len"]), (None, 31, 1))
        out = metadata.lagrangebench_metadata(m, splits, motion, {0: "water"})
        self.assertEqual((out["sequence_length_train"], out["num_trajs_train"], out["num_particles_max"]), (29, 2, 12))
        self.assertAlmostEqual(out["dx"], 0.015 / 1.45)


class Types(Case):
    def test_map_both_ways(self):
        for form, theirs, ours in (("gns", [3, 4, 5, 6, 7, 8], [3, 4, 5, 6, 7, 8]),
                                   ("lagrangebench", [0, 1, 2, 4, 6, 7, 8], [5, 3, 13, 4, 6, 7, 8])):
            table = series.TypeTable(form)
            self.assertEqual(table.to_ours(np.array(theirs), "x").tolist(), ours)
            self.assertEqual(table.to_theirs(np.array(ours), "x").tolist(), theirs)
        table = series.TypeTable("gns", "0=metal,5=sand,1=obstacle")
        self.assertEqual(table.to_ours(np.array([0, 5, 1, 3]), "x").tolist(), [10, 6, 3, 3])
        self.assertEqual(table.to_theirs(np.array([10, 6, 3]), "x").tolist(), [0, 5, 1])

    def test_unknown_ones_are_named(self):
        self.refused(errors.InputError, ("types 0, 1 of gns", "--types 0=jelly,1=jelly"), series.TypeTable("gns").to_ours,
                     np.array([5, 0, 1, 0]), "x")
        self.refused(errors.InputError, ("(metal, foam)", "--types N=metal,N=foam"), series.TypeTable("gns").to_theirs,
                     np.array([5, 10, 12]), "x")
        self.refused(errors.InputError, "numbers from 0 to 8", series.TypeTable("gns", "9=metal").to_theirs, np.array([10]), "x")
        for text in ("water", "=water", "x=water", "5.5=water", "-1=water"):
            self.refused(errors.ConfigError, f"'{text}' is not NUMBER=MATERIAL", series.TypeTable, "gns", text)
        self.refused(errors.ConfigError, "Did you mean 'water'?", series.TypeTable, "gns", "5=watr")

    def test_statistics_are_of_particles_that_move_by_themselves_through_periodic_walls(self):
        x = np.zeros((5, 2, 2), np.float32)
        x[:, 0, 0], x[:, 1, 0] = [0, 1, 3, 7, 15], [0, -1000, 9, 8, 7]
        motion = series.Motion(2)
        motion.add_series(x[:4], np.array([6, 3]), [0, 0])
        figures = motion.figures()
        self.assertAlmostEqual(figures["vel_mean"][0], 7 / 3)
        self.assertAlmostEqual(figures["vel_std"][0], (7 - 49 / 9) ** 0.5)
        self.assertEqual((figures["acc_mean"][0], figures["acc_std"][0]), (1.5, 0.5))
        motion = series.Motion(2)
        motion.add_series(np.array([[[7.5, 1]], [[7.9, 1]], [[0.3, 1]]], np.float32), np.array([5]), [8, 0])
        self.assertAlmostEqual(motion.figures()["vel_mean"][0], 0.4, 6)


class Command(Case):
    """The tool as users start it."""

    def convert(self, *arguments, code=0, words=(), tool=(sys.executable, TOOL), **environment):
        done = subprocess.run([*tool, *arguments], capture_output=True, text=True, check=False,
                              env={**os.environ, "GRAUPEL_PROGRAM": PROGRAM, **environment})
        self.assertEqual(done.returncode, code, done.stderr)
        for word in [words] if isinstance(words, str) else words:
            self.assertIn(word, done.stderr + done.stdout)
        return done

    def gns_set(self, run=None, name="foreign", **changes):
        os.makedirs(self.path(name), exist_ok=True)
        gns.write_gns_split(self.path(name, "train.npz"), 1, lambda i: run or sample(4, 6, 2))
        with open(self.path(name, "metadata.json"), "w", encoding="utf-8") as file:
            json.dump({**EXAMPLE, "bounds": [[0, 8], [0, 8]], "default_connectivity_radius": 0.5, **changes}, file)
        return self.path(name)

    def test_there_and_back_keeps_every_bit(self):
        for axes in (2, 3):
            run, name = sample(6, 5, axes), f"gns{axes}"
            cube = {"dim": axes, "bounds": [[0, 8]] * axes, "gravity": [0, -1, 0]}
            cube.update({key: EXAMPLE[key][:1] * axes for key in ("vel_mean", "vel_std", "acc_mean", "acc_std")})
            self.convert(self.gns_set(run, name, **cube), self.path(name + "-own"), words="gns to graupel")
            self.convert(self.path(name + "-own"), self.path("x"), code=2, words="format graupel already")
            for form in ("gns", "lagrangebench"):
                there, back = self.path(f"{name}-{form}"), self.path(f"{name}-{form}-back")
                self.convert(self.path(name + "-own"), there, "--format", form)
                self.convert(there, back)
                with h5py.File(self.path(name + "-own", "train.h5")) as one, h5py.File(back + "/train.h5") as other:
                    for key in ("position", "particle_type", "time", "initial_velocity"):
                        np.testing.assert_array_equal(one["00000"][key][:], other["00000"][key][:])
                    was, now = (json.loads(file["00000"].attrs["scene_json"]) for file in (one, other))
                    for key in ("domain", "gravity", "frame_time", "frames", "sources", "materials"):
                        self.assertEqual(was[key], now[key], key)
                with open(there + "/metadata.json", encoding="utf-8") as file:
                    there = json.load(file)
                with open(self.path(name + "-own", "metadata.json"), encoding="utf-8") as file:
                    own = json.load(file)
                for key in ("vel_mean", "vel_std", "acc_mean", "acc_std", "bounds"):
                    np.testing.assert_allclose(there[key], own[key][:axes], rtol=1e-9, atol=1e-12)

    def test_foreign_data_get_a_scene(self):
        run = sample(4, 6, 2)
        run.material_property = np.arange(6, dtype=np.float32)
        run.particle_type[0] = 3
        self.convert(self.gns_set(run), self.path("own"), "--set", "gravity=[0,-1,0]", "--types", "6=snow",
                     words="--set gns.radius=0.5 --set gns.wall_clamp=4.0 --set gns.dimensions=2")
        with h5py.File(self.path("own", "train.h5")) as file:
            group = file["00000"]
            self.assertEqual(group["particle_type"][:].tolist(), [3, 8, 5, 8, 5, 8])
            self.assertAlmostEqual(group["time"][3], 0.0075)
            self.assertEqual(group["position"][0, 1].tolist(), [0.25, 0.3125, 0.5])
            scene = json.loads(group.attrs["scene_json"])
            self.assertEqual((scene["gravity"], scene["domain"]["dimensions"], len(scene["sources"])), ([0, -1, 0], 2, 2))
            self.assertAlmostEqual(scene["domain"]["dx"], 0.5 / 2.24)
        self.convert(self.path("own"), self.path("again"), "-f", "gns", "--types=6=snow")
        self.same(gns.GnsSplit(self.path("again", "train.npz")).read(0), run)

    def test_periodic_walls_stay(self):
        run = sample(3, 1, 2)
        run.position = np.array([[[7.5, 1]], [[7.9, 1]], [[0.3, 1]]], np.float32)
        foreign = self.gns_set(run, periodic_boundary_conditions=[True, False])
        os.remove(foreign + "/train.npz")
        run.particle_type = np.array([0])
        hdf5.write_lagrangebench_split(foreign + "/train.h5", 1, lambda i: run)
        self.convert(foreign, self.path("own"))
        self.convert(self.path("own"), self.path("back"), "--format", "lagrangebench")
        with open(self.path("back", "metadata.json"), encoding="utf-8") as file:
            back = json.load(file)
        self.assertEqual(back["periodic_boundary_conditions"], [True, False])
        self.assertAlmostEqual(back["vel_mean"][0], 0.4, 6)
        self.convert(foreign, self.path("gns"), "--format", "gns", code=3, words="periodic walls")

    def test_bad_input_leaves_nothing(self):
        def refused(words, code, *arguments, run=None, **changes):
            foreign = self.gns_set(run, **changes)
            before = sorted(os.listdir(self.folder))
            self.convert(foreign, self.path("out"), *arguments, code=code, words=words)
            self.assertEqual(sorted(os.listdir(self.folder)), before)

        bad = sample(4, 6, 2)
        bad.position[1, 2, 1] = np.nan
        refused("not finite (frame 1, particle 2)", 3, run=bad)
        bad = sample(4, 6, 2)
        bad.position[3, 4, 0] = 1e30
        refused("over 10 domains away from metadata.json's bounds (frame 3, particle 4)", 3, run=bad)
        refused("has 1 frame (allowed: 2 and more", 3, run=sample(1, 6, 2))
        bad = sample(4, 6, 2)
        bad.particle_type = np.array([5, 0, 1, 5, 5, 5])
        refused("types 0, 1 of gns", 3, run=bad)
        bad.particle_type = np.full(6, 3)
        refused("obstacle particles alone", 3, run=bad)
        refused("has 3 dimensions, metadata.json says dim 2", 3, run=sample(4, 6, 3))
        refused("'dt' is 0", 3, dt=0)
        refused("of the format gns already", 2, "--format", "gns")
        refused("--set changes the scenes", 2, "--format", "lagrangebench", "--set", "gravity=[0,0,0]")
        refused("dx", 2, "--set", "domain.dx=-1")
        refused("gravty", 2, "--set", "gravty=[0,0,0]")
        refused("--split valid is not in", 2, "--split", "valid")
        refused("--split 'all' is not known", 2, "--split", "all")
        refused("--format", 2, "--format", "npz")
        refused("Did you mean 'sand'?", 2, "--types", "5=sandd")
        refused("is for weights", 2, "--numbers", "f16")
        refused("an argument is empty", 2, "--json", "")
        refused("an argument is empty", 2, "--json=")
        self.convert(self.gns_set(), "", code=2, words="an argument is empty")
        self.convert(self.folder, self.path("out"), code=3, words="holds no data set")
        self.convert(self.path("nowhere"), self.path("out"), code=3, words="is no folder")

    def test_output_that_is_there_stays(self):
        os.makedirs(self.path("out"))
        with open(self.path("out", "mine.txt"), "w", encoding="utf-8") as file:
            file.write("mine")
        self.convert(self.gns_set(), self.path("out"), code=2, words="not empty")
        self.assertEqual(os.listdir(self.path("out")), ["mine.txt"])
        os.remove(self.path("out", "mine.txt"))
        self.convert(self.gns_set(), self.path("out") + "/")
        self.assertIn("train.h5", os.listdir(self.path("out")))

    def test_a_signal_leaves_nothing(self):
        from graupel_convert.command import Progress
        handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
        progress = Progress()
        try:
            os.kill(os.getpid(), signal.SIGTERM)
            self.refused(errors.Interrupted, "nothing was written", progress, 1, 2)
        finally:
            for number, handler in handlers.items():
                signal.signal(number, handler)
        self.assertRaises(errors.Interrupted, self._interrupted_folder)
        self.assertEqual(os.listdir(self.folder), [])

    def test_json_takes_the_place_of_nothing_that_is_read_or_made(self):
        folder, out = self.gns_set(), self.path("out")
        kept = {file.name: file.read_bytes() for file in pathlib.Path(folder).iterdir()}
        os.link(self.path("foreign", "train.npz"), self.path("link.json"))
        for name in ("foreign/train.npz", "foreign/metadata.json", "link.json", "foreign/../foreign/train.npz"):
            self.convert(folder, out, "--json", self.path(name), code=2, words="would overwrite the input")
        for name in ("out", "out/train.h5", "out/dataset.json"):
            self.convert(folder, out, "--json", self.path(name), code=2, words="would overwrite the output")
        self.convert(folder, out, "--json", self.folder, code=5, words="it is a folder")
        self.convert(folder, out, "--json", self.path("none", "a.json"), code=5, words="there is no folder")
        self.assertEqual(sorted(os.listdir(self.folder)), ["foreign", "link.json"])
        self.assertEqual(kept, {file.name: file.read_bytes() for file in pathlib.Path(folder).iterdir()})
        self.convert(folder, out, "--json", self.path("out", "result.json"))
        with open(self.path("out", "result.json"), encoding="utf-8") as file:
            self.assertEqual(json.load(file)["from"], "gns")
        self.assertEqual(sorted(os.listdir(out)), ["dataset.json", "metadata.json", "result.json", "train.h5"])

    def test_json_is_whole_or_not_there(self):
        from graupel_convert import outputs
        os.symlink("/dev/full", self.path("full"))
        self.refused(errors.OutputError, "Free space on that disk", outputs.write_text, self.path("full"), "{}")
        outputs.write_text(self.path("a.json"), "{}")
        with self.assertRaises(UnicodeEncodeError):  # an end in the middle
            outputs.write_text(self.path("a.json"), "[]" * 100000 + "\ud800")
        with open(self.path("a.json"), encoding="utf-8") as file:
            self.assertEqual(file.read(), "{}")
        self.assertEqual(sorted(os.listdir(self.folder)), ["a.json", "full"])

    def _interrupted_folder(self):
        with conversion.AsideFolder(self.path("out")) as folder:
            folder.write_json("a.json", {})
            raise errors.Interrupted("now")

    def test_a_full_disk_leaves_nothing(self):
        disk = self.path("disk")
        os.makedirs(disk)
        run = sample(40, 500, 2)
        run.position = np.random.default_rng(1).random((40, 500, 2), np.float32)
        self.gns_set(run)
        self.convert(self.path("foreign"), self.path("bench"), "--format", "lagrangebench", "--types", "5=water")
        for source, form in (("bench", "gns"), ("foreign", "lagrangebench"), ("foreign", "graupel")):
            if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", disk], capture_output=True).returncode:
                self.skipTest("no tmpfs can be mounted here (needs root)")
            try:
                self.convert(self.path(source), disk + "/out", "--format", form, code=5, words="Free space on that disk")
                self.assertEqual(os.listdir(disk), [])
            finally:
                subprocess.run(["umount", disk], check=True)

    def test_missing_libraries_are_named(self):
        with open(self.path("numpy.py"), "w", encoding="utf-8") as file:
            file.write("raise ImportError('none here')")
        self.convert("a", "b", code=2, words="Install python3-numpy and python3-h5py", PYTHONPATH=self.folder)

    def test_the_verb_starts_the_tool(self):
        if not os.path.exists(PROGRAM):
            self.skipTest("build/graupel is not there")
        verb = (PROGRAM, "convert")
        self.convert("--help", tool=verb, words="--connectivity-radius")
        done = self.convert(self.gns_set(), self.path("a b; echo x"), "--format", "lagrangebench", "--json", "-", tool=verb)
        self.assertEqual(json.loads(done.stdout)["splits"]["train"]["most_frames"], 4)
        self.assertTrue(os.path.exists(self.path("a b; echo x", "train.h5")))
        self.convert("a", "b", tool=verb, code=2, words="python3-numpy", PATH=self.folder)
        self.convert("a", "b", tool=verb, code=2, words="GRAUPEL_TOOLS", GRAUPEL_TOOLS=self.folder)

    def test_scenes_are_written_with_every_key(self):
        scene = os.path.join(ROOT, "scenes/shared/water_steps.json")
        if not os.path.exists(PROGRAM):
            self.skipTest("build/graupel is not there")
        verb = (PROGRAM, "convert")
        self.convert(scene, self.path("whole.json"), "--set", "frames=7", tool=verb)
        with open(self.path("whole.json"), encoding="utf-8") as file:
            whole = json.load(file)
        self.assertEqual((whole["frames"], whole["domain"]["wall_cells"]), (7, 3))


if __name__ == "__main__":
    unittest.main(verbosity=1)
