"""What programs leave, as named arrays: trajectories, saved states, weights, results in JSON. Volatile things are left out by name."""

import json
import struct
from dataclasses import dataclass

import h5py
import numpy as np

# Text that tells how a file was made, or by which words; the numbers beside it are compared.
VOLATILE_ATTRIBUTES = {"made_by", "scene_json", "units", "description"}
# Results that depend on the clock, the machine's memory or the name of a file.
VOLATILE_KEYS = {"seconds", "solver_seconds", "updates_per_second", "seconds_per_frame", "seconds_per_step",
                 "seconds_to_refine", "scenes_per_second", "peak_bytes", "output", "saved_state", "device", "threads",
                 "command", "version", "run", "weights", "data", "folder", "read_seconds"}


@dataclass
class Values:
    """An array to compare; `axes` name its places, `kind` says which tolerance binds it (position or other)."""
    array: np.ndarray
    unit: str = ""
    axes: tuple = ()
    kind: str = "other"


def trajectory_values(path):
    """Every dataset and the numeric attributes of an HDF5 file of trajectories."""
    values = {}

    def visit(name, item):
        if isinstance(item, h5py.Dataset):
            leaf = name.rsplit("/", 1)[-1]
            array = item[()]
            axes = ("frame", "particle", "component")[:array.ndim]
            if leaf in ("particle_type", "initial_velocity", "material_property"):
                axes = ("particle", "component")[:array.ndim]
            unit = item.attrs.get("units", "")
            unit = unit.decode() if isinstance(unit, bytes) else str(unit)
            values[name] = Values(array, unit, axes, "position" if leaf == "position" else "other")
        for key, value in item.attrs.items():
            if key not in VOLATILE_ATTRIBUTES and np.asarray(value).dtype.kind in "iufb":
                values[f"{name}@{key}"] = Values(np.atleast_1d(value))

    with h5py.File(path, "r") as file:
        file.visititems(visit)
    return values


STATE_ARRAYS = (("position", 3, "m"), ("velocity", 3, "m/s"), ("affine_velocity", 9, "1/s"),
                ("deformation_gradient", 9, ""), ("stress", 6, "Pa"), ("internal", 1, ""), ("volume", 1, "m^3"))
TILE = 16


def state_values(path):
    """Particles of a saved state of the CPU's solver, in the order of the scene's sources (docs/reference/file_formats.md)."""
    with open(path, "rb") as file:
        data = file.read()
    if not data.startswith(b"graupel-state 1\n"):
        raise ValueError(f"'{path}' does not begin as a saved state")
    length, = struct.unpack_from("<Q", data, 16)
    header = json.loads(data[24:24 + length])
    scalar, n = (8 if header["precision"] == "f64" else 4), header["particles"]
    # The file ends with the state (its particles, its checksum) and the file's checksum.
    state = data[len(data) - 8 - header["state_bytes"]:len(data) - 8]
    padded = -(-n // TILE) * TILE
    numbers = sum(width for _, width, _ in STATE_ARRAYS)
    at = len(state) - 8 - padded * (numbers * scalar + 8)
    if at < 0:
        raise ValueError(f"'{path}' is shorter than its particles")
    arrays = {}
    for name, width, unit in STATE_ARRAYS:
        tiles = np.frombuffer(state, f"<f{scalar}", padded * width, at).reshape(-1, width, TILE)
        arrays[name] = (tiles.transpose(0, 2, 1).reshape(padded, width)[:n], unit)
        at += padded * width * scalar
    material = np.frombuffer(state, "<i4", padded, at)[:n]
    source_index = np.frombuffer(state, "<i4", padded, at + 4 * padded)[:n]
    order = np.argsort(source_index, kind="stable")
    if not np.array_equal(source_index[order], np.arange(n)):
        raise ValueError(f"'{path}' has an order of particles that is not known")
    values = {f"state/{name}": Values(array[order], unit, ("particle", "component"),
                                      "position" if name == "position" else "other")
              for name, (array, unit) in arrays.items()}
    values["state/material"] = Values(material[order], "", ("particle",))
    return values


SAFETENSOR_TYPES = {"F64": "<f8", "F32": "<f4", "F16": "<f2", "I64": "<i8", "I32": "<i4", "I16": "<i2", "U8": "u1",
                    "BOOL": "u1", "BF16": "<u2"}


def weights_values(path, prefix=""):
    """Tensors of a .safetensors file; its metadata tell of the making and are left out."""
    with open(path, "rb") as file:
        data = file.read()
    length, = struct.unpack_from("<Q", data)
    header = json.loads(data[8:8 + length])
    values = {}
    for name, tensor in header.items():
        if name == "__metadata__":
            continue
        begin, end = tensor["data_offsets"]
        bits = data[8 + length + begin:8 + length + end]
        array = np.frombuffer(bits, SAFETENSOR_TYPES[tensor["dtype"]]).reshape(tensor["shape"])
        if tensor["dtype"] == "BF16":
            array = (array.astype(np.uint32) << 16).view(np.float32)
        values[prefix + name] = Values(array)
    return values


def json_values(path, prefix="json/"):
    """Numbers of a result in JSON, without those of VOLATILE_KEYS."""
    values = {}

    def visit(node, name):
        if isinstance(node, dict):
            for key, child in node.items():
                if key not in VOLATILE_KEYS:
                    visit(child, f"{name}/{key}" if name else key)
        elif isinstance(node, list):
            for i, child in enumerate(node):
                visit(child, f"{name}[{i}]")
        elif isinstance(node, (int, float)):
            values[prefix + name] = Values(np.atleast_1d(np.asarray(node)))

    with open(path) as file:
        visit(json.load(file), "")
    return values


def metrics_values(path, names=("loss", "gradient_norm", "learning_rate")):
    """Columns of metrics.jsonl, a value a logged step."""
    columns = {name: [] for name in names}
    with open(path) as file:
        for line in file:
            row = json.loads(line)
            for name in names:
                if name in row:
                    columns[name].append(row[name])
    return {f"metrics/{name}": Values(np.asarray(column), "", ("step",)) for name, column in columns.items()}
