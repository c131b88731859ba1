"""HDF5: splits of LagrangeBench and of Graupel. A group a trajectory, 00000, 00001, ..., with position [T, N, dim] and
particle_type [N]; Graupel's have their scene and times too (docs/reference/file_formats.md). Every number in a file is distrusted;
the same content gives the same bytes (no times in the file)."""
import math
import os

import h5py
import numpy as np

from .errors import InputError, Unreadable, writing
from .series import Series, displacement

FORMAT = "graupel-trajectory"
LARGEST_RATIO = 1100  # deflate shrinks at most 1032 times
LARGEST_CHUNK = 1 << 30
LARGEST_SIZE = 1 << 31
KNOWN_FILTERS = {h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_FLETCHER32}
PROBLEMS = (OSError, RuntimeError, KeyError, ValueError, TypeError, AttributeError, UnicodeError, MemoryError)


class guarded:
    """Turns what goes wrong while `path` is read into InputError."""

    def __init__(self, path):
        self.path = path

    def __enter__(self):
        return self

    def __exit__(self, kind, error, trace):
        if isinstance(error, (Unreadable, *PROBLEMS)) and not isinstance(error, InputError):
            raise InputError(f"cannot read '{self.path}' ({error}). The file is damaged, cut short or of another kind; make "
                             "it again or choose another") from error


def member(group, name, kind):
    """A hard link to a group or dataset."""
    link = group.get(name, getlink=True)
    if link is None:
        raise Unreadable(f"it lacks '{name}'")
    if not isinstance(link, h5py.HardLink):
        raise Unreadable(f"'{name}' is one of the links that lead elsewhere, which are refused")
    found = group[name]
    if not isinstance(found, kind):
        raise Unreadable(f"'{name}' is no {kind.__name__.lower()}")
    return found


def dataset(group, name, rank, kinds, file_size):
    """A dataset of `rank` dimensions whose plain numbers lie in this file, behind known filters, in a believable size."""
    found = member(group, name, h5py.Dataset)
    if found.shape is None or len(found.shape) != rank:
        raise Unreadable(f"'{name}' does not have {rank} dimensions")
    if found.dtype.kind not in kinds or found.dtype.itemsize > 8:
        raise Unreadable(f"'{name}' does not hold {'real' if kinds == 'f' else 'whole'} numbers")
    if found.external or found.is_virtual:
        raise Unreadable(f"'{name}' keeps its values elsewhere, which is refused")
    properties = found.id.get_create_plist()
    for i in range(properties.get_nfilters()):
        code = properties.get_filter(i)[0]
        if code not in KNOWN_FILTERS:
            raise Unreadable(f"'{name}' uses HDF5 filter {code}, which is not read (shuffle, deflate and fletcher32 are; "
                             "h5repack -f GZIP=1 converts)")
    bytes_claimed = math.prod(found.shape) * found.dtype.itemsize
    if bytes_claimed // LARGEST_RATIO > file_size or found.id.get_storage_size() > file_size:
        raise Unreadable(f"'{name}' claims more values than the file can hold")
    if found.chunks and math.prod(found.chunks) * found.dtype.itemsize > LARGEST_CHUNK:
        raise Unreadable(f"'{name}' has chunks that are too large (at most 1 GiB)")
    return found


class Hdf5Split:
    """Trajectories of a file: groups that have positions."""

    def __init__(self, path):
        self.path = path
        with guarded(path):
            self.file_size = os.path.getsize(path)
            self.file = h5py.File(path, "r")
            names = sorted(self.file)
            self.groups = [name for name in names if "position" in member(self.file, name, (h5py.Group, h5py.Dataset))
                           ] if names else []
        if not self.groups:
            raise InputError(f"'{path}' holds no trajectory. Make it again, or choose another")
        self.count = len(self.groups)

    def series(self, i, usable=None):
        where = f"'{self.path}': trajectory {self.groups[i]}"
        with guarded(self.path):
            group = member(self.file, self.groups[i], h5py.Group)
            position = dataset(group, "position", 3, "f", self.file_size)
            frames, particles, axes = position.shape
            if axes not in (2, 3):
                raise Unreadable("'position' is not 2- or 3-dimensional")
            if not 0 < frames <= LARGEST_SIZE or not 0 < particles <= LARGEST_SIZE:
                raise Unreadable("'position' has a number of frames or particles that is not believable")
            types = dataset(group, "particle_type", 1, "iu", self.file_size)
            if types.shape[0] != particles:
                raise Unreadable("'particle_type' and 'position' have different numbers of particles")
            with np.errstate(over="ignore"):
                values = position[:frames if usable is None else usable].astype(np.float32, copy=False)
            return Series(where, values, types[:].astype(np.int64))


class LagrangeBenchSplit(Hdf5Split):
    def read(self, i):
        return self.series(i)


class GraupelSplit(Hdf5Split):
    """Particle types are Graupel's. Runs in the plane have two dimensions; frames from a divergence on are left out."""

    def __init__(self, path):
        super().__init__(path)
        self.dimensions = 3

    def header(self, i):
        """scene_json and frame_time of a trajectory."""
        with guarded(self.path):
            attributes = member(self.file, self.groups[i], h5py.Group).attrs
            scene, frame_time = attributes.get("scene_json", ""), float(attributes.get("frame_time", 1 / 60))
            if isinstance(scene, bytes):
                scene = scene.decode()
            if not isinstance(scene, str) or not (math.isfinite(frame_time) and frame_time > 0):
                raise Unreadable("a trajectory has a damaged header")
            return scene, frame_time

    def read(self, i):
        where = f"'{self.path}': trajectory {i}"
        with guarded(self.path):
            group = member(self.file, self.groups[i], h5py.Group)
            diverged = int(group.attrs.get("diverged_at_frame", -1))
            if diverged == 0:
                raise InputError(f"{where} has no usable frame. Leave it out")
            if "active" in group:
                raise InputError(f"{where} has particles that come or go, which other formats do not know. Convert scenes "
                                 "without emitters, sinks and open walls")
            series = self.series(i, diverged if diverged > 0 else None)
            series.where = where
            series.position = series.position[:, :, :self.dimensions]
            if "material_property" in group:
                values = dataset(group, "material_property", 2, "f", self.file_size)
                if values.shape != (series.particles, 1):
                    raise Unreadable("'material_property' and 'position' have different numbers of particles")
                series.material_property = values[:, 0].astype(np.float32)
            return series


def is_own(path):
    """Files of Graupel say so; LagrangeBench's say nothing."""
    with guarded(path), h5py.File(path, "r") as file:
        return file.attrs.get("format") in (FORMAT, FORMAT.encode())


def create_file(path):
    return h5py.File(path, "w", libver=("earliest", "v110"))


def create_group(file, number):
    properties = h5py.h5p.create(h5py.h5p.GROUP_CREATE)
    properties.set_obj_track_times(False)
    return h5py.Group(h5py.h5g.create(file.id, f"{number:05d}".encode(), gcpl=properties))


def store(group, name, values, units, description, **layout):
    out = group.create_dataset(name, data=values, track_times=False, **layout)
    out.attrs["units"], out.attrs["description"] = units, description


def write_lagrangebench_split(path, count, source):
    """LagrangeBench reads one number of frames from a split: all trajectories must have it."""
    with writing(path), create_file(path) as file:
        frames = None
        for i in range(count):
            series = source(i)
            if frames not in (None, series.frames):
                raise InputError(f"{series.where} has {series.frames} frames, those before it {frames}, and LagrangeBench "
                                 "reads one number for all. Make them equal, or convert to gns")
            frames, axes = series.frames, series.dimensions
            chunk_particles = min(series.particles, (1 << 20) // axes)
            chunk_frames = min(max((1 << 20) // (chunk_particles * axes), 1), frames, 8)
            group = create_group(file, i)
            store(group, "position", series.position.astype("<f4"), "m", "Particle positions [frame, particle, axis]",
                  chunks=(chunk_frames, chunk_particles, axes), compression="gzip", compression_opts=4)
            store(group, "particle_type", series.particle_type.astype("<i4"), "",
                  "0 fluid, 1 wall, 2 moving wall, 3 rigid body")
            file.flush()


def write_graupel_split(path, count, source, scene_of, made_by):
    """`scene_of` gives the scene of a series (scenes.Scene). Velocities at the start are the difference of the first two
    frames."""
    with writing(path), create_file(path) as file:
        file.attrs["format"], file.attrs["format_version"], file.attrs["complete"] = FORMAT, np.int64(1), np.int64(0)
        for i in range(count):
            series = source(i)
            _write_trajectory(create_group(file, i), series, scene_of(series), made_by)
            file.flush()
        file.attrs.modify("complete", np.int64(1))


def _write_trajectory(group, series, scene, made_by):
    for key, value in (("scene_json", scene.text), ("seed", np.uint64(0)), ("made_by", made_by),
                       ("frame_time", np.float64(scene.frame_time)), ("diverged_at_frame", np.int64(-1))):
        group.attrs[key] = value
    position = series.position
    if series.dimensions == 2:
        plane = np.full(position.shape[:2] + (1,), scene.plane, np.float32)
        position = np.concatenate([position, plane], axis=2)
    frames, particles = position.shape[:2]
    chunk_frames = min(max((4 << 20) // (12 * particles), 1), 8)
    chunk_particles = min(particles, (4 << 20) // (12 * chunk_frames))
    filters = dict(shuffle=True, compression="gzip", compression_opts=1, fletcher32=True)
    store(group, "position", position.astype("<f4", copy=False), "m", "Particle positions [frame, particle, axis]",
          maxshape=(None, particles, 3), chunks=(chunk_frames, chunk_particles, 3), **filters)
    store(group, "time", np.arange(frames) * scene.frame_time, "s", "Time of each frame", maxshape=(None,), chunks=(512,))
    store(group, "particle_type", series.particle_type.astype("<i4"), "", "3 obstacle, 4 jelly, 5 water, 6 sand, 8 snow")
    if frames > 1:
        velocity = displacement(position[0], position[1], scene.period()) * (1 / scene.frame_time)
        store(group, "initial_velocity", velocity.astype("<f4"), "m/s", "Velocities in the first frame [particle, axis]",
              chunks=(chunk_particles, 3), **filters)
    if series.material_property is not None:
        store(group, "material_property", series.material_property.astype("<f4")[:, None], "",
              "Material property of each particle, as GNS stores it")
