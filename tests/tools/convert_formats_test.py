#!/usr/bin/env python3
"""The formats that tools/convert.py reads and writes, pickles, GNS and LagrangeBench: what comes back, what is refused.

Runs by tests/run_all.sh, or: /usr/bin/python3 tests/tools/convert_formats_test.py. Needs numpy and h5py.
"""
import io
import os
import pickle
import struct
import unittest
import warnings
import zipfile

import h5py
import numpy as np

from convert_case import Case, objects, sample
from graupel_convert import errors, gns, hdf5, pickles, tfrecord


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

    def test_members_that_unfold_too_far_are_refused(self):
        still = np.zeros((2, 3_000_000, 3), np.float32)
        np.savez_compressed(self.path("a.npz"), a=objects(still, 5))
        self.refused(errors.InputError, ("'a.npy'", "more than 30 times as many"),
                     lambda: gns.GnsSplit(self.path("a.npz")).read(0))

    def test_foreign_and_doubled_members_are_refused(self):
        good = objects(sample(4, 3, 2).position, np.array([5, 6, 5]))
        np.savez(self.path("a.npz"), x=good)
        with zipfile.ZipFile(self.path("a.npz")) as archive:
            data = archive.read("x.npy")
        for names, words in ((("x.npy", "readme.txt"), "'readme.txt' whose name is no array's"),
                             (("../x.npy",), "'../x.npy' whose name"), (("x.npy", "x.npy"), "'x.npy' that is given twice")):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                with zipfile.ZipFile(self.path("b.npz"), "w") as archive:
                    for name in names:
                        archive.writestr(name, data)
            self.refused(errors.InputError, ("b.npz'", words), lambda: gns.GnsSplit(self.path("b.npz")))

    def test_headers_of_another_shape_are_refused(self):
        for shape in ((10 ** 18,), (3,), ()):
            file = io.BytesIO()
            np.lib.format.write_array_header_1_0(file, {"descr": "|O", "fortran_order": False, "shape": shape})
            pickle.dump(objects(sample(4, 3, 2).position, 5), file, protocol=4)
            with zipfile.ZipFile(self.path("a.npz"), "w") as archive:
                archive.writestr("a.npy", file.getvalue())
            self.refused(errors.InputError, "its .npy header says the shape", lambda: gns.GnsSplit(self.path("a.npz")).read(0))


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


def crc_bit_by_bit(data):
    crc = 0xFFFFFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0x82F63B78 if crc & 1 else 0)
    return crc ^ 0xFFFFFFFF


def records(data):
    """The records of a TFRecord file, whose sums are checked."""
    while data:
        length, sum_of_length = struct.unpack("<QI", data[:12])
        record, (sum_of_record,) = data[12:12 + length], struct.unpack("<I", data[12 + length:16 + length])
        for content, told in ((data[:8], sum_of_length), (record, sum_of_record)):
            crc = crc_bit_by_bit(content)
            assert ((crc >> 15 | crc << 17 & 0xFFFFFFFF) + 0xA282EAD8) % (1 << 32) == told
        yield record
        data = data[16 + length:]


def fields(message):
    """(number, content) of a protocol buffer's message of lengths and varints."""
    at = 0

    def varint():
        nonlocal at
        value = shift = 0
        while True:
            byte = message[at]
            at += 1
            value |= (byte & 0x7F) << shift
            shift += 7
            if byte < 0x80:
                return value
    while at < len(message):
        tag = varint()
        if tag & 7 == 0:
            yield tag >> 3, varint()
            continue
        assert tag & 7 == 2
        length = varint()
        yield tag >> 3, message[at:at + length]
        at += length


def entries(message):
    """A map from text to messages."""
    return {dict(fields(entry))[1].decode(): dict(fields(entry))[2] for _, entry in fields(message)}


class TfRecords(Case):
    def test_sums_are_those_of_the_standard(self):
        self.assertEqual(tfrecord.crc32c(b"123456789"), 0xE3069283)
        self.assertEqual(tfrecord.crc32c(b""), 0)
        data = np.random.default_rng(1).integers(0, 256, 5000, np.uint8).tobytes()
        for length in (1, 1023, 1024, 2047, 2048, 2049, 5000):
            self.assertEqual(tfrecord.crc32c(data[:length]), crc_bit_by_bit(data[:length]), length)

    def test_trajectories_are_examples(self):
        all_series = [sample(4, 5, 3), sample(4, 300, 3, 8.0)]
        tfrecord.write_tfrecord_split(self.path("train.tfrecord"), 2, all_series.__getitem__)
        with open(self.path("train.tfrecord"), "rb") as file:
            found = list(records(file.read()))
        self.assertEqual(len(found), 2)
        for key, (record, series) in enumerate(zip(found, all_series)):
            example = dict(fields(record))
            context, lists = entries(example[1]), entries(example[2])
            self.assertEqual(dict(fields(dict(fields(context["key"]))[3]))[1], bytes([key]))
            types = dict(fields(dict(fields(context["particle_type"]))[1]))[1]
            np.testing.assert_array_equal(np.frombuffer(types, "<i8"), series.particle_type)
            frames = [dict(fields(dict(fields(feature))[1]))[1] for _, feature in fields(lists["position"])]
            positions = np.frombuffer(b"".join(frames), "<f4").reshape(series.position.shape)
            np.testing.assert_array_equal(positions, series.position)

    def test_other_numbers_of_frames_are_refused(self):
        all_series = [sample(4, 5, 3), sample(5, 5, 3)]
        self.refused(errors.InputError, "5 frames, others have 4", tfrecord.write_tfrecord_split,
                     self.path("train.tfrecord"), 2, all_series.__getitem__)


if __name__ == "__main__":
    unittest.main(verbosity=1)
