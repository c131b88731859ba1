#!/usr/bin/env python3
"""tools/convert.py: what comes back, what is refused and in which words, what an unhappy end leaves.

Runs by tests/run_all.sh, or: /usr/bin/python3 tests/tools/convert_test.py. Needs numpy and h5py; the tests with scenes
need the program in build/.
"""
import io
import json
import os
import pickle
import signal
import shutil
import subprocess
import sys
import tempfile
import unittest
import zipfile

import h5py
import numpy as np

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
TOOL = os.path.join(ROOT, "tools", "convert.py")
PROGRAM = os.environ.get("GRAUPEL_PROGRAM", os.path.join(ROOT, "build", "graupel"))
sys.dont_write_bytecode = True
sys.path.insert(0, os.path.join(ROOT, "tools"))

from graupel_convert import conversion, errors, gns, hdf5, metadata, pickles, series  # noqa: E402

EXAMPLE = {"bounds": [[0.1, 0.9], [0.1, 0.9]], "sequence_length": 320, "default_connectivity_radius": 0.015, "dim": 2,
           "dt": 0.0025, "vel_mean": [5.1e-06, -0.00099], "vel_std": [0.0021, 0.0026], "acc_mean": [5.2e-07, 2.3e-07],
           "acc_std": [0.00025, 0.00029]}  # the example of geoelements/gns's documentation


def sample(frames, particles, axes, shift=0.0):
    """x[t, p, axis] = shift + t + p / 4 + axis / 16, exact in f32; types 5, 6, 5, 6, ..."""
    t, p, a = np.meshgrid(np.arange(frames), np.arange(particles), np.arange(axes), indexing="ij")
    return series.Series("sample", (shift + t + p / 4 + a / 16).astype(np.float32), 5 + np.arange(particles) % 2)


def objects(*parts):
    out = np.empty(len(parts), object)
    for i, part in enumerate(parts):
        out[i] = part
    return out


class Case(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.mkdtemp(prefix="graupel_test_")
        self.addCleanup(shutil.rmtree, self.folder)

    def path(self, *names):
        return os.path.join(self.folder, *names)

    def refused(self, kind, words, body, *arguments):
        with self.assertRaises(kind) as caught:
            body(*arguments)
        for word in [words] if isinstance(words, str) else words:
            self.assertIn(word, str(caught.exception))

    def same(self, a, b):
        self.assertEqual(a.position.dtype, np.float32)
        np.testing.assert_array_equal(a.position, b.position)
        np.testing.assert_array_equal(a.particle_type, b.particle_type)
        if b.material_property is None:
            self.assertIsNone(a.material_property)
        else:
            np.testing.assert_array_equal(a.material_property, b.material_property)


class Hostile:
    def __init__(self, function, *arguments):
        self.call = function, arguments

    def __reduce__(self):
        return self.call


class Pickles(Case):
    def test_arrays_come_back(self):
        x, types = np.array([[1, -2.5], [3, 6e-30]], np.float32), np.array([7, -8, 1 << 40])
        for protocol in (2, 3, 4):
            root = pickles.read_pickle(pickle.dumps(objects(x, types), protocol=protocol))
            np.testing.assert_array_equal(root.values[0].values, x)
            np.testing.assert_array_equal(root.values[1].values, types)

    def test_arrays_of_numpy_two_are_read(self):
        data = pickle.dumps(np.arange(3.0), protocol=2).replace(b"numpy.core.", b"numpy._core.")
        np.testing.assert_array_equal(pickles.read_pickle(data).values, np.arange(3.0))

    def test_hostile_pickles_are_refused_and_run_nothing(self):
        trace = self.path("ran")
        for protocol in range(6):
            data = pickle.dumps(objects(Hostile(os.system, f"touch {trace}"), 1), protocol=protocol)
            self.refused(errors.Unreadable, "refused", pickles.read_pickle, data)
            self.refused(errors.Unreadable, "refused", pickles.read_pickle,
                         pickle.dumps(Hostile(eval, f"open('{trace}', 'w')"), protocol=protocol))
        for protocol in (2, 3, 4, 5):
            data = pickle.dumps(Hostile(os.system, f"touch {trace}"), protocol=protocol)
            self.refused(errors.Unreadable, "system', which is refused", pickles.read_pickle, data)
        self.assertFalse(os.path.exists(trace))
        # The name reaches no terminal as it is.
        self.refused(errors.Unreadable, "'os?[2J.system'", pickles.read_pickle, b"cos\x1b[2J\nsystem\n.")

    def test_names_that_arrays_do_not_need_are_refused(self):
        for name in (b"numpy\nload", b"numpy\nfromfile", b"builtins\neval", b"numpy.core.multiarray\nfromstring",
                     b"graupel_convert.pickles\nopen"):
            self.refused(errors.Unreadable, "which is refused", pickles.read_pickle, b"\x80\x02c" + name + b"\n.")
        self.refused(errors.Unreadable, "'builtins.eval'", pickles.read_pickle, b"\x80\x04\x8c\x08builtins\x8c\x04eval\x93.")

    def test_instructions_that_arrays_do_not_need_are_refused(self):
        for data in (b"\x80\x02}.", b"\x80\x02P1\n.", b"\x80\x02\x82\x01.", b"\x80\x02)\x81.", b"\x80\x02(ios\nsystem\n."):
            self.refused(errors.Unreadable, "refused", pickles.read_pickle, data)
        self.refused(errors.Unreadable, "its protocol is 9", pickles.read_pickle, b"\x80\x09N.")

    def test_calls_of_other_things_are_refused(self):
        for data in (b"K\x01)R.", b"cnumpy\nndarray\n)b.", b"])b.", b"cnumpy.core.multiarray\n_reconstruct\n(K\x01tR.",
                     b"c_codecs\nencode\n(X\x01\0\0\0aX\x05\0\0\0utf-8tR.", b"cnumpy\ndtype\n(X\x04\0\0\0V999tR."):
            self.refused(errors.Unreadable, "its pickle is not read", pickles.read_pickle, data)

    def test_sizes_that_do_not_fit_are_refused(self):
        good = pickle.dumps(np.arange(3, dtype="<f4"), protocol=2)
        self.assertIn(b"K\x03\x85", good)
        self.refused(errors.Unreadable, "an array of 4 elements with 12 bytes", pickles.read_pickle,
                     good.replace(b"K\x03\x85", b"K\x04\x85"))
        self.refused(errors.Unreadable, "4 million", pickles.read_pickle, b"(" + b"N" * 5_000_000 + b"t.")
        self.refused(errors.Unreadable, "4 million", pickles.read_pickle, b"Nr\xff\xff\xff\xff.")
        self.refused(errors.Unreadable, "64 bits", pickles.read_pickle, b"\x8a\x09" + b"\x01" * 9 + b".")

    def test_every_cut_is_refused(self):
        data = pickle.dumps(objects(np.zeros((2, 2), np.float32), np.zeros(2, int)), protocol=4)
        for length in range(len(data)):
            self.refused(errors.Unreadable, "", pickles.read_pickle, data[:length])

    def test_every_changed_byte_is_read_or_refused(self):
        data = pickle.dumps(objects(np.zeros((2, 2), np.float32), np.zeros(2, int)), protocol=3)
        refused = 0
        for place in range(len(data)):
            for flip in (1, 0x20, 0x80, 0xff):
                changed = bytearray(data)
                changed[place] ^= flip
                try:
                    pickles.read_pickle(bytes(changed))
                except errors.Unreadable:
                    refused += 1
        self.assertGreater(refused, 500)


class Gns(Case):
    def read(self, name, **arrays):
        np.savez(self.path(name), **arrays)
        return gns.GnsSplit(self.path(name)).read(0)

    def test_comes_back_bit_for_bit_and_by_the_same_bytes(self):
        for axes in (2, 3):
            runs = [sample(4 + i, 3, axes, i) for i in range(12)]  # 10 and 11 by their numbers, not their names
            if axes == 2:
                for run in runs:
                    run.material_property = np.array([0.25, 0.5, 0.75], np.float32)
            gns.write_gns_split(self.path("a.npz"), 12, lambda i: runs[i])
            gns.write_gns_split(self.path("b.npz"), 12, lambda i: runs[i])
            split = gns.GnsSplit(self.path("a.npz"))
            self.assertEqual(split.count, 12)
            for i, run in enumerate(runs):
                self.same(split.read(i), run)
            with open(self.path("a.npz"), "rb") as a, open(self.path("b.npz"), "rb") as b:
                self.assertEqual(a.read(), b.read())

    def test_the_loader_of_gns_reads_it(self):
        gns.write_gns_split(self.path("a.npz"), 2, lambda i: sample(4 + i, 3, 2, i))
        with np.load(self.path("a.npz"), allow_pickle=True) as file:  # the steps of gns/data_loader.py
            data = [item for _, item in file.items()]
        for i, (x, types) in enumerate(data):
            np.testing.assert_array_equal(x, sample(4 + i, 3, 2, i).position)
            np.testing.assert_array_equal(np.full(x.shape[1], types, int), [5, 6, 5])

    def test_every_layout_is_read(self):
        run = sample(4, 3, 2)
        x, types = run.position, run.particle_type
        alone = np.empty((), object)
        alone[()] = (x, types)
        for arrays in ({"simulation_trajectory_0": objects(x, types)}, {"gns_data": objects((x, types))},
                       {"gns_data": objects([x, types])}, {"gns_data": objects(x, types).reshape(1, 2)}, {"a": alone},
                       {"a": objects(x.astype(np.float64), types.astype(np.int32))},
                       {"a": objects(np.asfortranarray(x), types.astype(np.uint8))},
                       {"a": objects(x.astype(">f4"), types.astype(">i2"))}):
            self.same(self.read("a.npz", **arrays), run)
        for protocol in (2, 3, 4):
            file = io.BytesIO()
            np.lib.format.write_array_header_1_0(file, {"descr": "|O", "fortran_order": False, "shape": (2,)})
            pickle.dump(objects(x, types), file, protocol=protocol)
            with zipfile.ZipFile(self.path("p.npz"), "w") as archive:
                archive.writestr("a.npy", file.getvalue())
            self.same(gns.GnsSplit(self.path("p.npz")).read(0), run)

    def test_one_number_for_all_particles_is_read(self):
        run = sample(4, 3, 2)
        run.particle_type = np.array([5, 5, 5])
        for types in (5, np.int64(5)):
            self.same(self.read("a.npz", gns_data=objects((run.position, types))), run)
        run.material_property = np.full(3, 0.5, np.float32)
        for values in (0.5, np.float64(0.5), np.full((3, 1), 0.5)):
            self.same(self.read("a.npz", gns_data=objects((run.position, 5, values))), run)

    def test_other_contents_are_refused(self):
        x, types = sample(4, 3, 2).position, np.array([5, 6, 5])
        for words, array in (("it holds numbers of type '<f4'", x),
                             ("its positions have the shape (3, 2)", objects(x[0], types)),
                             ("its particle types have the shape (2,), not (3,)", objects(x, types[:2])),
                             ("elements of type 'f8' where whole numbers are needed", objects(x, types.astype(float))),
                             ("elements of type 'f2'", objects(x.astype(np.float16), types)),
                             ("its positions are no array of numbers", objects("x", "y")),
                             ("a trajectory has 1 parts", objects(x))):
            self.refused(errors.InputError, ("a.npz", "'a.npy'", words), lambda a=array: self.read("a.npz", a=a))

    def test_hostile_members_are_refused_by_name(self):
        trace = self.path("ran")
        for name in ("x", "gns_data"):
            np.savez(self.path("evil.npz"), **{name: objects(Hostile(os.system, f"touch {trace}"), 1)})
            self.refused(errors.InputError, ("evil.npz'", f"'{name}.npy'", "system', which is refused"),
                         lambda: gns.GnsSplit(self.path("evil.npz")).read(0))
        self.assertFalse(os.path.exists(trace))

    def test_every_cut_and_changed_byte_of_an_archive_is_read_or_refused(self):
        gns.write_gns_split(self.path("a.npz"), 1, lambda i: sample(4, 3, 3))
        with open(self.path("a.npz"), "rb") as file:
            data = file.read()
        refused = 0
        for place in range(0, len(data), 5):
            changed = bytearray(data)
            changed[place] ^= 0x55
            for content in (data[:place], bytes(changed)):
                with open(self.path("b.npz"), "wb") as file:
                    file.write(content)
                try:
                    gns.GnsSplit(self.path("b.npz")).read(0)
                except errors.InputError:
                    refused += 1
        self.assertGreater(refused, len(data) // 5)

    def test_members_that_claim_too_much_are_refused(self):
        with zipfile.ZipFile(self.path("a.npz"), "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("x.npy", b"x" * 1000)
        with open(self.path("a.npz"), "rb") as file:
            data = bytearray(file.read())
        central = data.index(b"PK\x01\x02")
        data[central + 24:central + 28] = b"\xff\xff\xff\x7f"
        with open(self.path("a.npz"), "wb") as file:
            file.write(data)
        self.refused(errors.InputError, "more bytes than it can unfold to", lambda: gns.GnsSplit(self.path("a.npz")).read(0))


class LagrangeBench(Case):
    def make(self, **changes):
        run = sample(20, 5, 2)
        arguments = {"x": run.position.astype(float), "types": run.particle_type, "dtype": np.float32, **changes}
        self.made = getattr(self, "made", 0) + 1  # readers keep theirs open
        path = self.path(f"a{self.made}.h5")
        with h5py.File(path, "w") as file:
            file.create_dataset("00000/particle_type", data=arguments.pop("types"))
            file.create_dataset("00000/position", data=arguments.pop("x"), **arguments)
        return hdf5.LagrangeBenchSplit(path)

    def test_comes_back_bit_for_bit_and_by_the_same_bytes(self):
        for axes in (2, 3):
            for name in (f"a{axes}.h5", f"b{axes}.h5"):
                hdf5.write_lagrangebench_split(self.path(name), 3, lambda i: sample(20, 5, axes, i))
            split = hdf5.LagrangeBenchSplit(self.path(f"a{axes}.h5"))
            self.assertEqual(split.groups, ["00000", "00001", "00002"])
            for i in range(3):
                self.same(split.read(i), sample(20, 5, axes, i))
            with open(self.path(f"a{axes}.h5"), "rb") as a, open(self.path(f"b{axes}.h5"), "rb") as b:
                self.assertEqual(a.read(), b.read())

    def test_files_of_h5py_are_read(self):
        for changes in ({}, {"compression": "gzip"}, {"dtype": np.float64},
                        {"chunks": (3, 2, 2), "compression": "gzip", "shuffle": True, "fletcher32": True}):
            self.same(self.make(**changes).read(0), sample(20, 5, 2))

    def test_other_contents_are_refused(self):
        run = sample(20, 5, 2)
        for words, changes in (("'position' does not have 3 dimensions", {"x": run.position[:, :, 0]}),
                               ("'position' is not 2- or 3-dimensional", {"x": run.position[:, :, :1]}),
                               ("different numbers of particles", {"types": run.particle_type[:3]}),
                               ("'particle_type' does not hold whole numbers", {"types": run.particle_type.astype(float)}),
                               ("which is not read", {"compression": "lzf", "chunks": (20, 5, 2)})):
            self.refused(errors.InputError, (".h5", words), lambda c=changes: self.make(**c).read(0))
        with h5py.File(self.path("link.h5"), "w") as file:
            file["00000"] = h5py.ExternalLink("a.h5", "00000")
        self.refused(errors.InputError, "links that lead elsewhere", hdf5.LagrangeBenchSplit, self.path("link.h5"))
        self.refused(errors.InputError, "No such file", hdf5.LagrangeBenchSplit, self.path("missing.h5"))

    def test_needs_one_number_of_frames(self):
        self.refused(errors.InputError, "has 5 frames, those before it 4", hdf5.write_lagrangebench_split, self.path("a.h5"), 2,
                     lambda i: sample(4 + i, 2, 3))


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
