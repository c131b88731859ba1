"""Splits of geoelements/gns: train.npz, valid.npz, test.npz. A zip archive of .npy members, which are pickled arrays of
Python objects: (positions [T, N, dim], particle types [N]) or (positions, particle types, material property [N])."""
import io
import os
import zipfile
import zlib

import numpy as np

from .errors import InputError, Unreadable, writing
from .pickles import Array, printable, read_pickle
from .series import Series

COMMON_MEMBER = "gns_data.npy"
LARGEST_RATIO = 1100  # deflate unfolds at most 1032 times
UNWATCHED, MOST_RATIO = 1 << 26, 30  # larger members of positions of moving particles shrink to a third at most
MOST_HEADER = 10000


def shape_text(shape):
    return "(" + ", ".join(map(str, shape)) + (",)" if len(shape) == 1 else ")")


def read_member(archive, info):
    """Bytes of a member, as many as it claims."""
    if info.file_size // LARGEST_RATIO > info.compress_size:
        raise Unreadable("it claims more bytes than it can unfold to")
    if info.file_size > max(UNWATCHED, MOST_RATIO * info.compress_size):
        raise Unreadable(f"its {info.compress_size} bytes unfold to {info.file_size}, more than {MOST_RATIO} times as many, "
                         "as positions never do")
    if info.file_size > os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"):
        raise Unreadable(f"it unfolds to {info.file_size} bytes, more than this machine's memory")
    try:
        with archive.open(info) as file:
            data = file.read(info.file_size + 1)  # and compares the checksum
    except (zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError, EOFError, OSError, ValueError) as error:
        raise Unreadable(str(error) or "it is cut short") from error
    if len(data) != info.file_size:
        raise Unreadable("it is cut short")
    return data


def object_array(data):
    """The array of objects in an .npy file."""
    file = io.BytesIO(data)
    if not data.startswith(b"\x93NUMPY"):
        raise Unreadable("it is no .npy array (its first bytes are not \\x93NUMPY)")
    try:
        version = np.lib.format.read_magic(file)
        if version not in ((1, 0), (2, 0), (3, 0)):
            raise ValueError(f"its .npy version is {version[0]} (read are 1 to 3)")
        # Version 3 differs in the encoding of names alone.
        read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, _, element = read(file, max_header_size=MOST_HEADER)
    except (ValueError, TypeError, EOFError, SyntaxError, UnicodeError, MemoryError, RecursionError) as error:
        raise Unreadable(f"its .npy header is damaged: {str(error)[:100]}") from error
    if element != np.dtype(object):
        raise Unreadable(f"it holds numbers of type '{element.str[:20]}', not the objects (positions, particle types) of a "
                         "trajectory")
    root = read_pickle(data[file.tell():])
    if not isinstance(root, Array) or root.values is None or not root.objects:
        raise Unreadable("its pickle holds no array of objects")
    if root.shape != shape:
        raise Unreadable(f"its .npy header says the shape {shape_text(shape)[:60]}, its pickle {shape_text(root.shape)}")
    return root


def is_group(value):
    return isinstance(value, (tuple, list)) or isinstance(value, Array) and value.objects and len(value.shape) == 1


def items_of(value):
    return value.values if isinstance(value, Array) else list(value)


def numbers(value, name):
    if not isinstance(value, Array) or value.values is None or value.objects:
        raise Unreadable(f"its {name} are no array of numbers")
    return value.values


def real_numbers(array):
    if array.dtype.kind != "f" or array.dtype.itemsize not in (4, 8):
        raise Unreadable(f"it has elements of type '{array.dtype.str[1:]}' where real numbers of 32 or 64 bits are needed")
    with np.errstate(over="ignore"):
        return np.ascontiguousarray(array, np.float32)


def whole_numbers(array):
    if array.dtype.kind not in "iu":
        raise Unreadable(f"it has elements of type '{array.dtype.str[1:]}' where whole numbers are needed")
    if array.dtype.kind == "u" and array.size and int(array.max()) >= 1 << 63:
        raise Unreadable("a whole number is above 2^63")
    return array.astype(np.int64)


def for_each_particle(part, name, particles, read):
    """Values of a part that is one number, or one for each particle."""
    array = numbers(part, name)
    values = read(array)
    if array.ndim == 0:
        return np.full(particles, values.reshape(-1)[0], values.dtype)
    if not (array.ndim == 1 or array.ndim == 2 and array.shape[1] == 1) or values.size != particles:
        raise Unreadable(f"its {name} have the shape {shape_text(array.shape)}, not ({particles},) as the positions say")
    return values.reshape(particles)


def series_of(items):
    if len(items) not in (2, 3):
        raise Unreadable(f"a trajectory has {len(items)} parts (2, positions and particle types, or 3, with a material "
                         "property)")
    array = numbers(items[0], "positions")
    if array.ndim != 3 or array.shape[2] not in (2, 3) or array.shape[0] < 1 or array.shape[1] < 1:
        raise Unreadable(f"its positions have the shape {shape_text(array.shape)}, not (frames, particles, 2 or 3)")
    particles = array.shape[1]
    if type(items[1]) is int:
        types = np.full(particles, items[1], np.int64)
    else:
        types = for_each_particle(items[1], "particle types", particles, whole_numbers)
    values = None
    if len(items) == 3 and type(items[2]) in (int, float):
        values = np.full(particles, items[2], np.float32)
    elif len(items) == 3:
        values = for_each_particle(items[2], "material properties", particles, real_numbers)
    return Series("", real_numbers(array), types, values)


class GnsSplit:
    """Reads the two layouts there are: a member a trajectory, in the archive's order, whatever its name; or all in one
    member called gns_data."""

    def __init__(self, path):
        self.path, self.together = path, None
        try:
            self.archive = zipfile.ZipFile(path)
        except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError, EOFError, UnicodeError, LookupError) as error:
            raise InputError(f"cannot read '{path}' ({error}). Give a whole .npz archive") from error
        self.members = self.archive.infolist()
        if not self.members:
            raise InputError(f"cannot read '{path}' (it has no members). Make the archive again")
        self._check_names()
        self.count = len(self.members)
        self.common = next((m for m in self.members if m.filename == COMMON_MEMBER), None)
        if self.common:
            self.together = self._guarded(self.common, lambda: object_array(read_member(self.archive, self.common)))
            shape = self.together.shape
            if len(shape) not in (1, 2) or shape[0] < 1:
                raise InputError(f"'{path}': cannot read '{COMMON_MEMBER}' (its array of trajectories has the shape "
                                 f"{shape_text(shape)}). Give data of geoelements/gns, or make the file again")
            self.count = shape[0]

    def _check_names(self):
        names = set()
        for name in (member.filename for member in self.members):
            problem = ("that is given twice" if name in names else "" if name.endswith(".npy") and "/" not in name else
                       "whose name is no array's (NAME.npy)")
            if problem:
                raise InputError(f"cannot read '{self.path}' (it has a member '{printable(name)}' {problem}). Give data of "
                                 "geoelements/gns, or make the archive again")
            names.add(name)

    def _guarded(self, member, body):
        try:
            return body()
        except Unreadable as problem:
            raise InputError(f"'{self.path}': cannot read '{member.filename}' ({problem}). Give data of geoelements/gns, or "
                             "make the file again") from problem

    def read(self, i):
        member = self.common or self.members[i]
        series = self._guarded(member, lambda: series_of(self._items(i)))
        series.where = f"'{self.path}': '{member.filename}'" + (f", trajectory {i}" if self.common else "")
        return series

    def _items(self, i):
        if not self.common:
            root = object_array(read_member(self.archive, self.members[i]))
            if len(root.shape) > 1:
                raise Unreadable(f"its array of objects has the shape {shape_text(root.shape)}, not (2,) or (3,)")
            wrapped = len(root.values) == 1 and is_group(root.values[0])
            return items_of(root.values[0]) if wrapped else root.values
        if len(self.together.shape) == 2:
            width = self.together.shape[1]
            return self.together.values[i * width:(i + 1) * width]
        if not is_group(self.together.values[i]):
            raise Unreadable(f"trajectory {i} is no tuple of arrays")
        return items_of(self.together.values[i])


def member_bytes(series):
    parts = [np.ascontiguousarray(series.position, "<f4"), series.particle_type.astype("<i8")]
    if series.material_property is not None:
        parts.append(series.material_property.astype("<f4"))
    objects = np.empty(len(parts), object)
    for i, part in enumerate(parts):
        objects[i] = part
    file = io.BytesIO()
    np.lib.format.write_array(file, objects, version=(1, 0), allow_pickle=True)
    return file.getvalue()


def write_gns_split(path, count, source):
    """A member "simulation_trajectory_<i>" a trajectory; one is in memory at a time. The same data give the same bytes."""
    with writing(path), zipfile.ZipFile(path, "w") as archive:
        for i in range(count):
            info = zipfile.ZipInfo(f"simulation_trajectory_{i}.npy", (1980, 1, 1, 0, 0, 0))
            info.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(info, member_bytes(source(i)), compresslevel=1)  # positions hardly shrink
