"""Compares two files that Graupel wrote, number by number; what depends on time or place alone is left out by name."""
import json
import math
import struct

import h5py
import numpy as np

# Attributes and keys that tell of the run and not of its result.
VOLATILE = {"command", "commit", "created", "date", "host", "hostname", "graupel_version", "version", "program", "seconds",
            "wall_seconds", "solver_seconds", "scenes_per_second", "steps_per_second", "threads", "machine", "path", "file",
            "provenance", "peak_bytes", "run_id", "training_command"}


class Difference:
    """The largest difference found, where it is, and what differs in kind (shape, missing names)."""

    def __init__(self):
        self.largest, self.place, self.broken = 0.0, "", []

    def number(self, place, a, b):
        a, b = np.asarray(a), np.asarray(b)
        if a.shape != b.shape or a.dtype != b.dtype:
            self.broken.append(f"{place}: {a.dtype}{list(a.shape)} for {b.dtype}{list(b.shape)}")
            return
        if a.tobytes() == b.tobytes() or (a.dtype.kind not in "fiub" and a.tolist() == b.tolist()):
            return
        if a.dtype.kind not in "fiub":
            self.broken.append(f"{place}: {str(a)[:40]} for {str(b)[:40]}")
            return
        gap = np.abs(a.astype(np.float64) - b.astype(np.float64))
        if a.dtype.kind == "f" and not np.array_equal(np.isfinite(a), np.isfinite(b)):
            self.broken.append(f"{place}: finite numbers in other places")
            return
        gap = np.nan_to_num(gap, nan=0.0, posinf=0.0)
        at = int(np.argmax(gap)) if gap.size else 0
        worst = float(gap.flat[at]) if gap.size else 0.0
        if worst == 0:
            worst = 5e-324  # other bits of equal numbers: -0, or the payload of a NaN
        if worst > self.largest:
            self.largest, self.place = worst, f"{place}{list(map(int, np.unravel_index(at, gap.shape)))}"

    def __bool__(self):
        return bool(self.largest or self.broken)


def compare_hdf5(a, b, found):
    with h5py.File(a) as one, h5py.File(b) as other:
        names = [set(), set()]
        one.visit(names[0].add)
        other.visit(names[1].add)
        found.broken += [f"{n} is only in one file" for n in sorted(names[0] ^ names[1])]
        for name in sorted(names[0] & names[1]) + ["/"]:
            for key in sorted(set(one[name].attrs) | set(other[name].attrs)):
                if key in VOLATILE:
                    continue
                if key not in one[name].attrs or key not in other[name].attrs:
                    found.broken.append(f"attribute {name}.{key} is only in one file")
                else:
                    compare_text_or_number(f"{name}.{key}", one[name].attrs[key], other[name].attrs[key], found)
            if isinstance(one[name], h5py.Dataset):
                compare_text_or_number(name, one[name][()], other[name][()], found)


def compare_text_or_number(place, a, b, found):
    if isinstance(a, (str, bytes)) or isinstance(b, (str, bytes)):
        try:
            compare_json_values(place, json.loads(a), json.loads(b), found)
        except (ValueError, TypeError):
            if a != b:
                found.broken.append(f"{place}: {str(a)[:40]!r} for {str(b)[:40]!r}")
    else:
        found.number(place, a, b)


def read_safetensors(path):
    with open(path, "rb") as file:
        (size,) = struct.unpack("<Q", file.read(8))
        header = json.loads(file.read(size))
        data = file.read()
    types = {"F32": "<f4", "F64": "<f8", "F16": "<f2", "I64": "<i8", "I32": "<i4", "U8": "u1", "BF16": "<u2", "I16": "<i2"}
    tensors = {}
    for name, entry in header.items():
        if name != "__metadata__":
            begin, end = entry["data_offsets"]
            tensors[name] = np.frombuffer(data[begin:end], types[entry["dtype"]]).reshape(entry["shape"])
    return tensors


def compare_safetensors(a, b, found):
    one, other = read_safetensors(a), read_safetensors(b)
    found.broken += [f"tensor {n} is only in one file" for n in sorted(set(one) ^ set(other))]
    for name in sorted(set(one) & set(other)):
        found.number(name, one[name], other[name])


def compare_json_values(place, a, b, found):
    if isinstance(a, dict) and isinstance(b, dict):
        for key in a:
            if key in VOLATILE:
                continue
            if key not in b:
                found.broken.append(f"{place}.{key} is missing")
            else:
                compare_json_values(f"{place}.{key}", a[key], b[key], found)
    elif isinstance(a, list) and isinstance(b, list):
        if len(a) != len(b):
            found.broken.append(f"{place}: {len(a)} items for {len(b)}")
        for i, (x, y) in enumerate(zip(a, b)):
            compare_json_values(f"{place}[{i}]", x, y, found)
    elif isinstance(a, (int, float)) and isinstance(b, (int, float)) and not isinstance(a, bool):
        if not (a == b or (math.isnan(a) and math.isnan(b))):
            found.number(place, float(a), float(b))
    elif a != b:
        found.broken.append(f"{place}: {str(a)[:40]!r} for {str(b)[:40]!r}")


def compare_json_lines(a, b, found):
    one, other = ([json.loads(line) for line in open(path) if line.strip()] for path in (a, b))
    compare_json_values("", one, other, found)


def compare_bytes(a, b, found):
    one, other = open(a, "rb").read(), open(b, "rb").read()
    if one != other:
        at = next((i for i, (x, y) in enumerate(zip(one, other)) if x != y), min(len(one), len(other)))
        found.broken.append(f"byte {at} of {len(one)} and {len(other)}")


KINDS = {".h5": compare_hdf5, ".safetensors": compare_safetensors, ".jsonl": compare_json_lines, ".bin": compare_bytes,
         ".state": compare_bytes}


def compare_files(reference, new):
    """The Difference of two files, by the kind that their name tells."""
    found = Difference()
    KINDS[reference.suffix](reference, new, found)
    return found
