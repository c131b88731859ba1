"""The conversion: reads a folder of one format, writes a folder of another, aside until all of it is written."""
import os
import shutil

import numpy as np

from .errors import ConfigError, InputError, OutputError, writing
from .gns import GnsSplit, write_gns_split
from .hdf5 import GraupelSplit, LagrangeBenchSplit, is_own, write_graupel_split, write_lagrangebench_split
from .metadata import SplitFigures, gns_metadata, json_text, lagrangebench_metadata, read_metadata, tfrecord_metadata
from .scenes import SceneMaker, graupel_metadata, own_metadata
from .series import SPLITS, Motion, TypeTable, name_of
from .tfrecord import write_tfrecord_split

FARTHEST = 10  # edges of the domain that particles may be outside of it
READERS = {"graupel": GraupelSplit, "gns": GnsSplit, "lagrangebench": LagrangeBenchSplit}


def split_file(form, split):
    return split + {"gns": ".npz", "tfrecord": ".tfrecord"}.get(form, ".h5")


def format_of_folder(folder):
    if not os.path.isdir(folder):
        raise InputError(f"'{folder}' is no folder. Give the folder that holds train.h5 or train.npz")
    found, found_in = None, None
    for split in SPLITS:
        for ending in (".h5", ".npz"):
            path = os.path.join(folder, split + ending)
            if not os.path.isfile(path):
                continue
            form = "gns" if ending == ".npz" else "graupel" if is_own(path) else "lagrangebench"
            if found not in (None, form):
                raise InputError(f"'{folder}' holds data of two formats ('{found_in}' is {found}, '{path}' {form}). Give them "
                                 "folders of their own")
            found, found_in = form, path
    if not found:
        raise InputError(f"'{folder}' holds no data set (train, valid or test, .h5 or .npz). Give the folder with these files")
    return found


class AsideFolder:
    """A folder that takes its name when all is in it, and is removed otherwise."""

    def __init__(self, target):
        self.target = os.path.abspath(target)
        if os.path.lexists(self.target) and not (os.path.isdir(self.target) and not os.listdir(self.target)):
            raise ConfigError(f"'{target}' is there already and not empty. Name a new folder, or remove that one")
        self.path = f"{self.target}.{os.getpid()}.part"
        with writing(self.path):
            os.makedirs(self.path)

    def __enter__(self):
        return self

    def __exit__(self, kind, error, trace):
        if kind is None:
            try:
                for name in sorted(os.listdir(self.path)):
                    self._sync(os.path.join(self.path, name))
                os.rename(self.path, self.target)
                return
            except OSError as problem:
                shutil.rmtree(self.path, ignore_errors=True)
                raise OutputError(f"cannot make '{self.target}' ({problem}). Choose a folder you may write to") from problem
        shutil.rmtree(self.path, ignore_errors=True)

    @staticmethod
    def _sync(path):
        descriptor = os.open(path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)

    def file(self, name):
        return os.path.join(self.path, name)

    def write_json(self, name, value):
        with writing(self.file(name)), open(self.file(name), "w", encoding="utf-8") as file:
            file.write(json_text(value))


class Conversion:
    """`options` are the flags of the command, `program` is Graupel, `progress(done, total)` may raise to stop."""

    def __init__(self, options, program, progress):
        self.options, self.program, self.progress = options, program, progress
        self.source, self.target = format_of_folder(options.input), options.format
        self._open()
        self._check_flags()
        self.table = TypeTable(self.target if self.source == "graupel" else self.source, options.types)
        self.figures, self.type_names, self.train_types = {}, {}, set()
        self.done, self.total = 0, sum(split.count for split in self.splits.values())
        self.scenes = SceneMaker(program, self.metadata, self.source, options.set)
        self.motion = None

    def _open(self):
        folder, radius = self.options.input, self.options.connectivity_radius
        card = os.path.join(folder, "metadata.json")
        metadata = read_metadata(card) if self.source != "graupel" or os.path.isfile(card) else None
        paths = self._paths(folder)
        if self.source == "graupel" and metadata is None and radius is None:
            raise ConfigError(f"the radius within which particles are connected is not known ('{card}' is not there). Give it: "
                              "--connectivity-radius 0.035")
        self.splits = {name: READERS[self.source](path) for name, path in paths.items()}
        self.with_obstacles, self.metadata = 0, metadata
        if self.source == "graupel":
            self.metadata, self.with_obstacles = own_metadata(self.program, self.splits)
            self.metadata.radius = metadata.radius if metadata else 0.0
            self.metadata.particle_spacing = metadata.particle_spacing if metadata else None
        elif not self.metadata.name:
            self.metadata.name = os.path.basename(os.path.abspath(folder))
        if radius is not None:
            self.metadata.radius = radius

    def _paths(self, folder):
        paths = {}
        for name in SPLITS:
            path = os.path.join(folder, split_file(self.source, name))
            asked = name in self.options.split
            if asked and not os.path.isfile(path):
                raise ConfigError(f"--split {name} is not in '{folder}' (no '{os.path.basename(path)}'). Leave it out")
            if (asked or not self.options.split) and os.path.isfile(path):
                paths[name] = path
        return paths

    def _check_flags(self):
        if self.source == self.target:
            raise ConfigError(f"'{self.options.input}' is a data set of the format {self.source} already. Choose another "
                              "--format")
        if self.options.set and self.target != "graupel":
            raise ConfigError(f"--set changes the scenes of our own data sets, and --format {self.target} has none. Leave it "
                              "out")
        if self.target in ("gns", "tfrecord") and any(self.metadata.periodic):
            raise InputError(f"'{self.options.input}' has periodic walls, which {self.target} does not know. Convert to lagrangebench or "
                             "graupel")

    def run(self):
        write = {"gns": write_gns_split, "lagrangebench": write_lagrangebench_split, "tfrecord": write_tfrecord_split,
                 "graupel": self._write_own}[self.target]
        with AsideFolder(self.options.output) as folder:
            for name, split in self.splits.items():
                write(folder.file(split_file(self.target, name)), split.count, lambda i, n=name, s=split: self._next(n, s, i))
            self._write_metadata(folder)
            folder.write_json("dataset.json", self._card())

    def _write_own(self, path, count, source):
        write_graupel_split(path, count, source, self.scenes, f"converted from {self.source}")

    def _next(self, name, split, i):
        """Trajectory i with the output's numbers of types, checked and counted."""
        series = split.read(i)
        if series.dimensions != self.metadata.dimensions:
            raise InputError(f"{series.where} has {series.dimensions} dimensions, metadata.json says dim "
                             f"{self.metadata.dimensions}. Correct metadata.json")
        self._check_positions(series)
        if self.source != "graupel":
            series.particle_type = self.table.to_ours(series.particle_type, series.where)
        self._count(name, series)
        self._number_types(series)
        self.done += 1
        self.progress(self.done, self.total)
        return series

    def _check_positions(self, series):
        if series.frames < 2:
            raise InputError(f"{series.where} has {series.frames} frame (allowed: 2 and more, which make a velocity). Leave that "
                             "run out")
        bounds = np.array(self.metadata.bounds)
        far = FARTHEST * (bounds[:, 1] - bounds[:, 0]).max()
        for bad, problem in ((~np.isfinite(series.position), "that is not finite"),
                             ((series.position < bounds[:, 0] - far) | (series.position > bounds[:, 1] + far),
                              f"that is over {FARTHEST} domains away from metadata.json's bounds")):
            places = np.argwhere(bad)
            if len(places):
                raise InputError(f"{series.where} has a position {problem} (frame {places[0][0]}, particle {places[0][1]}). Leave "
                                 "that run out")

    def _count(self, name, series):
        self.figures.setdefault(name, SplitFigures()).count(series)
        if name == next(iter(self.splits)):  # the training split, or else the first there is
            self.motion = self.motion or Motion(self.metadata.dimensions)
            self.motion.add_series(series.position, series.particle_type, self.metadata.period())
            self.train_types.update(np.unique(series.particle_type).tolist())

    def _number_types(self, series):
        if self.target == "graupel":
            return
        ours = series.particle_type
        table = self.table if self.source == "graupel" else TypeTable(self.target)
        series.particle_type = table.to_theirs(ours, series.where)
        kinds, first = np.unique(ours, return_index=True)
        for kind, place in zip(kinds, first):
            self.type_names.setdefault(int(series.particle_type[place]), name_of(int(kind)))

    def _write_metadata(self, folder):
        """Graupel's own data sets have metadata of their training split alone, as those of `generate`."""
        motion = self.motion.figures()
        if self.target == "tfrecord":
            text = tfrecord_metadata(self.metadata, self.figures, motion, self.type_names)
        elif self.target == "gns":
            text = gns_metadata(self.metadata, self.figures, motion, self.type_names)
        elif self.target == "lagrangebench":
            text = lagrangebench_metadata(self.metadata, self.figures, motion, self.type_names)
        elif "train" not in self.figures:
            return
        else:
            motion = {key: values + [0.0] * (3 - len(values)) for key, values in motion.items()}
            text = graupel_metadata(self.scenes.first, self.metadata, self.figures, self.train_types, motion)
        folder.write_json("metadata.json", text)

    def _card(self):
        """dataset.json: where the data come from, and what was chosen."""
        out = {"converted_from": {"format": self.source, "folder": os.path.abspath(self.options.input)}, "format": self.target}
        if self.options.types:
            out["types"] = self.options.types
        if self.options.set:
            out["set"] = self.options.set
        if self.target == "graupel":
            out["initial_velocity"] = "difference of the first two frames"
        if self.with_obstacles:
            out["trajectories_whose_obstacles_are_left_out"] = self.with_obstacles
        out["made_by"] = self.program.version
        return out
