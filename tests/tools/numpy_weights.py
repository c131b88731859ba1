"""The file of weights and its layers (docs/reference/networks.md, section 1)."""
import json
import struct

import numpy as np


def read_safetensors(path):
    """(metadata, tensors), the tensors as f64."""
    types = {"F64": "<f8", "F32": "<f4", "F16": "<f2", "BF16": "<u2", "I8": "<i1"}
    with open(path, "rb") as file:
        header = json.loads(file.read(struct.unpack("<Q", file.read(8))[0]))
        data = file.read()
    metadata = header.pop("__metadata__")
    tensors = {}
    for name, entry in header.items():
        begin, end = entry["data_offsets"]
        values = np.frombuffer(data[begin:end], types[entry["dtype"]])
        if entry["dtype"] == "BF16":
            values = (values.astype(np.uint32) << 16).view(np.float32)
        tensors[name] = values.astype(np.float64).reshape(entry["shape"])
    for name in [name for name, entry in header.items() if entry["dtype"] == "I8"]:
        tensors[name] = (tensors[name] * tensors.pop(name + ".scale")[:, None]).astype(np.float32).astype(np.float64)
    return metadata, tensors


def write_safetensors(path, metadata, tensors):
    """As F32."""
    header, data = {"__metadata__": metadata}, b""
    for name, values in sorted(tensors.items()):
        one = np.ascontiguousarray(values, "<f4").tobytes()
        header[name] = {"dtype": "F32", "shape": list(values.shape), "data_offsets": [len(data), len(data) + len(one)]}
        data += one
    text = json.dumps(header).encode()
    with open(path, "wb") as file:
        file.write(struct.pack("<Q", len(text)) + text + data)


def with_more_inputs(path, target):
    """A network that sees materials' constants and contact, from one that does not: random weights of those columns."""
    metadata, tensors = read_safetensors(path)
    prefix = metadata["architecture"] + "."
    metadata.update({prefix + "material_constants": "true", prefix + "contact": "true"})
    weight = tensors["encoder.layer1.weight"]
    before = weight.shape[1] - int(metadata[prefix + "embedding"])
    more = np.random.default_rng(1).uniform(-0.3, 0.3, (len(weight), 14)).astype(np.float32)
    tensors["encoder.layer1.weight"] = np.concatenate([weight[:, :before], more, weight[:, before:]], axis=1)
    write_safetensors(target, metadata, tensors)


class Network:
    def __init__(self, path):
        self.metadata, self.tensors = read_safetensors(path)
        self.architecture = self.metadata["architecture"]

    def setting(self, name, default=None):
        return self.metadata.get(f"{self.architecture}.{name}", default)

    def number(self, name, default=None):
        return float(self.setting(name, default))

    def flag(self, name):
        return self.setting(name, "false") == "true"

    def linear(self, name, x):
        return x @ self.tensors[name + ".weight"].T + self.tensors[name + ".bias"]

    def fcn(self, name, x, slope, hidden_layers=1, norm=True):
        for layer in range(1, hidden_layers + 1):
            x = leaky(self.linear(f"{name}.layer{layer}", x), slope)
        y = self.linear(f"{name}.layer{hidden_layers + 1}", x)
        if not norm:
            return y
        y = y - y.mean(axis=1, keepdims=True)
        y /= np.sqrt((y * y).mean(axis=1, keepdims=True) + 1e-5)
        return y * self.tensors[name + ".norm.weight"] + self.tensors[name + ".norm.bias"]


def leaky(x, slope):
    return np.where(x >= 0, x, slope * x)
