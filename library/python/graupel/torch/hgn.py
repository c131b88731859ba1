"""The hierarchical graph network of docs/reference/networks.md, section 4, as a torch module."""
from __future__ import annotations

import json
import os
import struct

import numpy
import torch
from torch import nn

from .._errors import ConfigError, InputError
from .._graupel import NetworkModel, Scene

SLOPE = 0.01  # of LeakyReLU below 0
TYPES = {"F64": "<f8", "F32": "<f4", "F16": "<f2", "BF16": "<u2", "I8": "<i1"}


def read_safetensors(path):
    """(metadata, {name: f32 array}) of a file that Graupel has read, and so checked."""
    with open(path, "rb") as file:
        header = json.loads(file.read(struct.unpack("<Q", file.read(8))[0]))
        data = file.read()
    tensors = {}
    for name, entry in header.items():
        if name == "__metadata__":
            continue
        begin, end = entry["data_offsets"]
        values = numpy.frombuffer(data[begin:end], TYPES[entry["dtype"]])
        if entry["dtype"] == "BF16":
            values = (values.astype(numpy.uint32) << 16).view(numpy.float32)
        tensors[name] = values.astype(numpy.float32).reshape(entry["shape"])
    for name in [name for name, entry in header.items() if entry.get("dtype") == "I8"]:
        tensors[name] *= tensors.pop(name + ".scale")[:, None]  # nn/quantization.h
    return header["__metadata__"], tensors


class Level:
    """Cells of a level of the grid: coordinates i64 [cells, 3], sorted, each once."""

    BITS = 20  # of a coordinate

    def __init__(self, coordinates):
        self.coordinates = torch.unique(coordinates, dim=0)
        self.keys, order = torch.sort(self._key(self.coordinates))
        self.coordinates = self.coordinates[order]

    @classmethod
    def _key(cls, coordinates):
        x, y, z = (coordinates + (1 << (cls.BITS - 1))).unbind(-1)
        return (((x << cls.BITS) | y) << cls.BITS) | z

    def find(self, coordinates):
        """Places [..] of cells; -1 where there is none."""
        key = self._key(coordinates)
        place = torch.searchsorted(self.keys, key).clamp(max=len(self.keys) - 1)
        return torch.where(self.keys[place] == key, place, -1)

    def messages(self):
        """(sender, receiver, direction from sender to receiver) of neighbours that share a face."""
        steps = torch.cat([-torch.eye(3, dtype=torch.int64), torch.eye(3, dtype=torch.int64)]).to(self.keys.device)
        sender = self.find(self.coordinates[:, None] + steps)
        receiver, slot = torch.nonzero(sender >= 0, as_tuple=True)
        return sender[receiver, slot], receiver, -steps[slot]


class OwnCode:
    """Graupel's own reader of a weights file. Copies share it; a pickle holds the path and reads it when asked."""

    def __init__(self, path):
        self.path, self._model = path, None

    def model(self):
        if self._model is None:
            self._model = NetworkModel(self.path)
        return self._model

    def __deepcopy__(self, memo):
        return self

    def __reduce__(self):
        return OwnCode, (self.path,)


class HGN(nn.Module):
    """An HGN with the weights of a file. Its parameters have the file's names: state_dict() is that of the file.

    forward() is the network alone, differentiable in weights and inputs; features() and accelerations() bring the
    scene. Copies and pickles (copy.deepcopy, torch.save) have the weights of the module; features() and accelerations()
    of a pickle need the file where it was. Networks in the plane and those of the paper's form (aggregation 'messages')
    are refused.
    """

    def __init__(self, weights):
        """Raises InputError for a file that holds no HGN, ConfigError for one of another form."""
        super().__init__()
        weights = os.path.abspath(os.fsdecode(weights))
        self._own = OwnCode(weights)
        self._own.model()  # checks the file
        metadata, tensors = read_safetensors(weights)
        if metadata.get("architecture") != "hgn":
            raise InputError(f"'{weights}' holds no HGN ({metadata.get('architecture')}). Give weights of "
                             "`graupel train hgn`")
        setting = lambda name, default=None: metadata.get("hgn." + name, default)  # noqa: E731
        if setting("aggregation", "messages") != "activations":
            raise ConfigError(f"'{weights}' aggregates messages (allowed here: activations). Run it by NetworkModel")
        if int(setting("dimensions", 3)) != 3:
            raise ConfigError(f"'{weights}' is for two dimensions (allowed here: 3). Run it by NetworkModel")
        self.history, self.bundle = int(setting("history")), int(setting("bundle", 1))
        self.levels, self.iterations = int(setting("levels")), int(setting("message_passing"))
        self.spacing, self.p2g_scale = float(setting("spacing")), float(setting("p2g_scale"))
        for name, values in tensors.items():
            self._add(name, torch.from_numpy(values))

    def _add(self, name, values):
        *path, leaf = name.split(".")
        module = self
        for part in path:
            if part not in module._modules:
                module.add_module(part, nn.Module())
            module = module._modules[part]
        if path[0] == "normalization":
            module.register_buffer(leaf, values)
        else:
            module.register_parameter(leaf, nn.Parameter(values))

    def _linear(self, name, x):
        module = self.get_submodule(name)
        return nn.functional.linear(x, module.weight, module.bias)

    def _gather(self, name, *parts):
        return nn.functional.leaky_relu(self._linear(name + ".gather", torch.cat(parts, dim=1)), SLOPE)

    def _fcn(self, name, *parts, norm=True):
        hidden = nn.functional.leaky_relu(self._linear(name + ".layer1", torch.cat(parts, dim=1)), SLOPE)
        y = self._linear(name + ".layer2", hidden)
        if not norm:
            return y
        module = self.get_submodule(name + ".norm")
        return nn.functional.layer_norm(y, y.shape[1:], module.weight, module.bias, eps=1e-5)

    @staticmethod
    def _sum_at(receiver, rows, count):
        return rows.new_zeros(count, rows.shape[1]).index_add(0, receiver, rows)

    def _pass_level(self, name, messages, f):
        sender, receiver, direction = messages
        direction = direction.to(f.dtype)
        for k in range(self.iterations):
            one = f"{name}.{k}"
            sent = self._gather(one, f[sender], f[receiver], direction)
            f = f + self._fcn(one + ".cell", self._sum_at(receiver, sent, len(f)), f)
        return f

    def forward(self, features, embedding_rows, positions, origin):
        """Accelerations [bundle, n, 3] m/frame^2 of the next frames.

        features [n, width] and embedding_rows i64 [n] as features() makes them, positions [n, 3] m of the newest frame,
        origin: three numbers [m] of the grid's origin.
        """
        dtype, device = features.dtype, features.device
        x = positions.to(torch.float64) - torch.as_tensor(origin, dtype=torch.float64, device=device)
        u = x / self.spacing - 0.5
        base = torch.floor(u.detach())
        offset = u - base
        corner = torch.tensor([[k & 1, k >> 1 & 1, k >> 2] for k in range(8)], device=device)
        weight = torch.where(corner == 1, offset[:, None], 1 - offset[:, None]).prod(dim=2)
        cells = base.to(torch.int64)[:, None] + corner
        grid = [Level(cells.reshape(-1, 3))]
        for _ in range(1, self.levels):
            grid.append(Level(grid[-1].coordinates >> 1))
        messages = [level.messages() for level in grid]
        pair_cell = grid[0].find(cells.reshape(-1, 3))
        pair_particle = torch.arange(len(features), device=device).repeat_interleave(8)
        to_centre = (corner - offset[:, None]).reshape(-1, 3).to(dtype)  # (centre - x) / spacing
        pair_weight = weight.reshape(-1, 1).to(dtype)

        particles = torch.cat([features, self.embedding.weight[embedding_rows]], dim=1)
        f_p = self._fcn("encoder", particles)
        sent = pair_weight * self._gather("particle_to_grid", f_p[pair_particle], to_centre)
        f = [self._fcn("particle_to_grid", self.p2g_scale * self._sum_at(pair_cell, sent, len(grid[0].keys)))]
        f[0] = self._pass_level("down.0", messages[0], f[0])
        octants = []
        for level in range(self.levels - 1):
            fine, coarse = grid[level], grid[level + 1]
            parent = coarse.find(fine.coordinates >> 1)
            octant = ((fine.coordinates & 1) - 0.5).to(dtype)  # (centre_fine - centre_coarse) / spacing_fine
            octants.append((parent, octant))
            sent = self._gather(f"restrict.{level}", f[level], -octant)
            f.append(self._fcn(f"restrict.{level}", self._sum_at(parent, sent, len(coarse.keys))))
            f[level + 1] = self._pass_level(f"down.{level + 1}", messages[level + 1], f[level + 1])
        for level in reversed(range(self.levels - 1)):
            parent, octant = octants[level]
            f[level] = f[level] + self._fcn(f"prolong.{level}", f[level + 1][parent], f[level], octant)
            f[level] = self._pass_level(f"up.{level}", messages[level], f[level])
        sent = pair_weight * self._gather("grid_to_particle", f[0][pair_cell], f_p[pair_particle], -to_centre)
        f_p = f_p + self._fcn("grid_to_particle", self._sum_at(pair_particle, sent, len(features)), f_p)
        output = self._fcn("decoder", f_p, norm=False).reshape(len(features), self.bundle, 3)
        return (output * self.normalization.acceleration_std + self.normalization.acceleration_mean).transpose(0, 1)

    def features(self, scene: Scene, history, particle_types):
        """(features [n, width], embedding_rows [n], origin) of forward(), by Graupel's own code.

        history [history + 1, n, 3] m, newest last; of scenes with one material of each law.
        """
        own = self._own.model()
        features, rows, origin = own.features(scene, numpy.asarray(history), numpy.asarray(particle_types))
        like = self.embedding.weight
        return (torch.tensor(features, dtype=like.dtype, device=like.device),
                torch.tensor(rows, dtype=torch.int64, device=like.device), origin)

    def accelerations(self, scene: Scene, history, particle_types):
        """[bundle, n, 3] m/frame^2: x' = 2 x - x_before + a, without Graupel's corrections."""
        features, rows, origin = self.features(scene, history, particle_types)
        newest = torch.tensor(numpy.asarray(history)[-1], device=features.device)
        return self.forward(features, rows, newest, origin)
