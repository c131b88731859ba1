"""metadata.json: what GNS (DeepMind, geoelements) and LagrangeBench read, and the few keys of Graupel that are needed to
come back."""
import dataclasses
import json
import math
import os

from .errors import InputError

MOST_BYTES = 16 << 20
RADIUS_IN_SPACINGS = 1.45  # LagrangeBench's own choice


@dataclasses.dataclass
class Metadata:
    name: str = ""
    dimensions: int = 3
    bounds: list = None  # [dimensions][low, high], m
    periodic: list = None  # [dimensions]
    frame_time: float = 0.0  # dt * write_every, s
    radius: float = 0.0  # connectivity radius, m
    particle_spacing: float = None  # "dx", m
    grid_spacing: float = None  # m
    gravity: list = None  # [3], m/s^2

    def period(self):
        return [high - low if periodic else 0.0 for (low, high), periodic in zip(self.bounds, self.periodic)]


def parse_json(text, name, error=InputError):
    def once(pairs):
        out = {}
        for key, value in pairs:
            if key in out:
                raise ValueError(f"the key '{key}' is given twice")
            out[key] = value
        return out

    def no_number(word):
        raise ValueError(f"{word} is no number of JSON")

    try:
        return json.loads(text, object_pairs_hook=once, parse_constant=no_number)
    except (ValueError, RecursionError) as problem:
        raise error(f"'{name}' is not valid JSON ({problem}). Correct the file") from problem


def read_json(path):
    try:
        if os.path.getsize(path) > MOST_BYTES:
            raise InputError(f"'{path}' is too large for JSON (at most {MOST_BYTES} bytes). Give another")
        with open(path, encoding="utf-8-sig") as file:  # editors may put a byte order mark before it
            return parse_json(file.read(), path)
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot read '{path}' ({error}). Give the data set with its metadata.json") from error


def is_number(value):
    return type(value) in (int, float) and math.isfinite(value)


def is_list(value, length, good=is_number):
    return isinstance(value, list) and len(value) == length and all(good(item) for item in value)


class Reader:
    def __init__(self, path, root):
        self.path, self.root = path, root

    def fail(self, key, wanted):
        if key in self.root:
            found = json.dumps(self.root[key])
            found = "is " + (found if len(found) <= 60 else found[:57] + "...")
        else:
            found = "is missing"
        raise InputError(f"'{self.path}': '{key}' {found} (needed: {wanted}). Correct the file")

    def get(self, key, good, wanted):
        if key not in self.root or not good(self.root[key]):
            self.fail(key, wanted)
        return self.root[key]

    def whole(self, key, low, high):
        return int(self.get(key, lambda v: is_number(v) and v == math.floor(v) and low <= v <= high,
                            f"a whole number from {low} to {high}"))

    def positive(self, key):
        return float(self.get(key, lambda v: is_number(v) and v > 0, "a number above 0"))

    def optional(self, key, read):
        return read(key) if key in self.root else None

    def read(self):
        dim = self.whole("dim", 2, 3)
        out = Metadata(dimensions=dim)
        if isinstance(self.root.get("case"), str):
            out.name = self.root["case"]
        out.bounds = self.get("bounds", lambda v: is_list(v, dim, lambda p: is_list(p, 2) and p[0] < p[1]),
                              f"{dim} pairs [low, high], low below high, as dim says")
        out.bounds = [[float(low), float(high)] for low, high in out.bounds]
        # Some of LagrangeBench's data sets of two dimensions list three.
        out.periodic = self.optional("periodic_boundary_conditions", lambda key: self.get(
            key, lambda v: any(is_list(v, n, lambda b: isinstance(b, bool)) for n in (dim, 3)),
            f"{dim} times true or false, as dim says"))
        out.periodic = (out.periodic or [False] * dim)[:dim]
        out.frame_time = self.positive("dt") * (self.optional("write_every", lambda key: self.whole(key, 1, 10**9)) or 1)
        out.radius = self.positive("default_connectivity_radius")
        for key, value in self.root.items():  # numbers of frames are known from the data
            if key.startswith("sequence_length") and value is not None:
                self.whole(key, 1, 1 << 31)
        for key in ("vel_mean", "vel_std", "acc_mean", "acc_std"):
            least = key.endswith("std")
            self.get(key, lambda v: is_list(v, dim, lambda x: is_number(x) and (not least or x >= 0)),
                     f"{dim} numbers, {'0 or more, ' if least else ''}as dim says")
        out.particle_spacing = self.optional("dx", self.positive)
        out.grid_spacing = self.optional("grid_spacing", self.positive)
        out.gravity = self.optional("gravity", lambda key: [float(x) for x in self.get(
            key, lambda v: is_list(v, 3), "3 numbers")])
        return out


def read_metadata(path):
    """Where GNS's file has one part for the training and one for rollouts, that of the training counts."""
    root = read_json(path)
    if not isinstance(root, dict):
        raise InputError(f"'{path}' holds no JSON object. Correct the file")
    part = root.get("train")
    return Reader(path, part if isinstance(part, dict) else root).read()


@dataclasses.dataclass
class SplitFigures:
    trajectories: int = 0
    fewest_frames: int = 0
    most_frames: int = 0
    most_particles: int = 0
    property: bool = False

    def count(self, series):
        self.fewest_frames = min(self.fewest_frames, series.frames) if self.trajectories else series.frames
        self.most_frames = max(self.most_frames, series.frames)
        self.most_particles = max(self.most_particles, series.particles)
        self.property = self.property or series.material_property is not None
        self.trajectories += 1


def own_keys(metadata, type_names):
    """Keys that only Graupel reads, and that others pass over."""
    out = {}
    if metadata.grid_spacing is not None:
        out["grid_spacing"] = metadata.grid_spacing
    if metadata.gravity is not None:
        out["gravity"] = metadata.gravity
    out["material_names"] = {str(number): type_names[number] for number in sorted(type_names)}
    return out


def gns_metadata(metadata, splits, motion, type_names):
    """sequence_length is the number of frames, null where it differs."""
    fewest = min(split.fewest_frames for split in splits.values())
    most = max(split.most_frames for split in splits.values())
    with_property = any(split.property for split in splits.values())
    dim = metadata.dimensions
    out = {"case": metadata.name, "bounds": metadata.bounds, "sequence_length": most if fewest == most else None,
           "default_connectivity_radius": metadata.radius, "dim": dim, "dt": metadata.frame_time, **motion,
           # Inputs of a node: 5 velocities, distances to the walls, 16 numbers of the type, the property; of an edge: a
           # vector and its length.
           "nnode_in": 5 * dim + 2 * dim + 16 + (1 if with_property else 0), "nedge_in": dim + 1}
    if with_property:
        out["material_feature_len"] = 1
    if metadata.particle_spacing is not None:
        out["dx"] = metadata.particle_spacing
    return {**out, **own_keys(metadata, type_names)}


def tfrecord_metadata(metadata, splits, motion, type_names):
    """The keys of learning_to_simulate; sequence_length is the number of frames less one."""
    most = max(split.most_frames for split in splits.values())
    return {"case": metadata.name, "bounds": metadata.bounds, "sequence_length": most - 1,
            "default_connectivity_radius": metadata.radius, "dim": metadata.dimensions, "dt": metadata.frame_time, **motion,
            **own_keys(metadata, type_names)}


def lagrangebench_metadata(metadata, splits, motion, type_names):
    """Sequence lengths are the number of frames less one."""
    most = max(split.most_frames for split in splits.values())
    spacing = metadata.particle_spacing
    out = {"case": metadata.name, "solver": "MPM", "dim": metadata.dimensions,
           "dx": spacing if spacing is not None else metadata.radius / RADIUS_IN_SPACINGS, "dt": metadata.frame_time,
           "t_end": metadata.frame_time * (most - 1), "write_every": 1}
    for name in sorted(splits):
        out["sequence_length_" + name] = splits[name].most_frames - 1
        out["num_trajs_" + name] = splits[name].trajectories
    out["num_particles_max"] = max(split.most_particles for split in splits.values())
    return {**out, "periodic_boundary_conditions": metadata.periodic, "bounds": metadata.bounds,
            "default_connectivity_radius": metadata.radius, **motion, **own_keys(metadata, type_names)}


def json_text(value):
    """Indented by two, with lists of plain values on one line."""
    return _entry("", value, "", True)


def _entry(key, value, indent, last):
    comma = "\n" if last else ",\n"
    nested = isinstance(value, dict) and value or isinstance(value, list) and any(isinstance(v, (list, dict)) for v in value)
    if not nested:
        return indent + key + json.dumps(value, ensure_ascii=False) + comma
    parts = [(json.dumps(k, ensure_ascii=False) + ": ", v) for k, v in value.items()] if isinstance(value, dict) else [
        ("", v) for v in value]
    inner = "".join(_entry(k, v, indent + "  ", i + 1 == len(parts)) for i, (k, v) in enumerate(parts))
    start, end = "{}" if isinstance(value, dict) else "[]"
    return indent + key + start + "\n" + inner + indent + end + comma
