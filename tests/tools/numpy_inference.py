#!/usr/bin/env python3
"""The graph networks of models/ in NumPy, written from docs/reference/networks.md alone, against `graupel rollout`.

Runs by tests/run_all.sh, or: /usr/bin/python3 tests/tools/numpy_inference.py [-v]. Needs numpy, h5py and the program in
build/ (GRAUPEL_PROGRAM names another). Section numbers are those of the page.
"""
import json
import math
import os
import shutil
import struct
import subprocess
import sys
import tempfile
import unittest

import h5py
import numpy as np

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
PROGRAM = os.environ.get("GRAUPEL_PROGRAM", os.path.join(ROOT, "build", "graupel"))


# 1. The file of weights


def read_safetensors(path):
    """(metadata, tensors), the tensors as f64."""
    types = {"F64": "<f8", "F32": "<f4", "F16": "<f2", "BF16": "<u2"}
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


# 3. Obstacles


def rotation_of(body):
    axis = np.array(body.get("rotation_axis", [0, 1, 0]), float)
    x, y, z = axis / np.linalg.norm(axis)
    angle = math.radians(body.get("rotation_angle", 0))
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross


def to_segment(p, a, b):
    edge = b - a
    t = np.clip(((p - a) @ edge) / (edge @ edge), 0, 1)
    return np.linalg.norm(p - a - t[:, None] * edge, axis=1)


def to_triangle(p, a, b, c):
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal)
    outside = np.zeros(len(p), bool)
    for u, v in ((a, b), (b, c), (c, a)):
        outside |= (p - u) @ np.cross(v - u, normal) > 0
    edges = np.minimum(to_segment(p, a, b), np.minimum(to_segment(p, b, c), to_segment(p, c, a)))
    return np.where(outside, edges, np.abs((p - a) @ normal))


def exact_distance(body, p):
    """Signed distance [n] of points [n, 3] in the body's own frame (section 3.1)."""
    shape = body["shape"]
    r = np.hypot(p[:, 0], p[:, 2])
    y = p[:, 1]
    if shape in ("box", "half_box"):
        half = np.array(body["size"], float) / 2
        if shape == "half_box":
            p = p + [0, half[1] / 2, 0]
            half = half * [1, 0.5, 1]
        q = np.abs(p) - half
        deepest = q.max(axis=1)
        return np.where(deepest > 0, np.linalg.norm(np.maximum(q, 0), axis=1), deepest)
    if shape == "sphere":
        return np.linalg.norm(p, axis=1) - body["radius"]
    if shape == "half_sphere":
        radius, length = body["radius"], np.linalg.norm(p, axis=1)
        below = np.hypot(np.maximum(r - radius, 0), y)
        above = np.where(length > radius, length - radius, -np.minimum(radius - length, y))
        return np.where(y < 0, below, above)
    if shape == "cylinder":
        q, h = r - body["radius"], np.abs(y) - body["height"] / 2
        return np.where((q <= 0) & (h <= 0), np.maximum(q, h), np.hypot(np.maximum(q, 0), np.maximum(h, 0)))
    height = body["height"]
    below_tip = (height / 2 - y) / height
    if shape == "cone":
        radius, ry = body["radius"], np.stack([r, y], axis=1)
        rim, tip, foot = np.array([radius, -height / 2]), np.array([0, height / 2]), np.array([0, -height / 2])
        distance = np.minimum(to_segment(ry, foot, rim), to_segment(ry, rim, tip))
        return np.where((y > -height / 2) & (r < radius * below_tip), -distance, distance)
    if shape == "pyramid":
        hx, hz = body["size"][0] / 2, body["size"][2] / 2
        p = np.abs(p) * [1, 0, 1] + p * [0, 1, 0]
        tip = np.array([0, height / 2, 0])
        corner = [np.array([sx * hx, -height / 2, sz * hz]) for sx, sz in ((1, -1), (1, 1), (-1, 1))]
        base = np.linalg.norm([np.maximum(p[:, 0] - hx, 0), p[:, 1] + height / 2, np.maximum(p[:, 2] - hz, 0)], axis=0)
        distance = np.minimum(base, np.minimum(to_triangle(p, corner[0], tip, corner[1]),
                                               to_triangle(p, corner[2], corner[1], tip)))
        inside = (y > -height / 2) & (p[:, 0] < hx * below_tip) & (p[:, 2] < hz * below_tip)
        return np.where(inside, -distance, distance)
    raise NotImplementedError(f"obstacles of shape {shape} are grids of OpenVDB")


CORNERS = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])


def trilinear(v, t):
    """Value [n] and gradient [n, 3] at t [n, 3] in cells with corner values v [n, 2, 2, 2]."""
    x, y, z = (t[:, d] for d in range(3))
    slope_z = v[:, :, :, 1] - v[:, :, :, 0]
    line = v[:, :, :, 0] + z[:, None, None] * slope_z
    slope_y = line[:, :, 1] - line[:, :, 0]
    plane = line[:, :, 0] + y[:, None] * slope_y
    plane_z = slope_z[:, :, 0] + y[:, None] * (slope_z[:, :, 1] - slope_z[:, :, 0])
    slope_x = plane[:, 1] - plane[:, 0]
    gradient = [slope_x, slope_y[:, 0] + x * (slope_y[:, 1] - slope_y[:, 0]),
                plane_z[:, 0] + x * (plane_z[:, 1] - plane_z[:, 0])]
    return plane[:, 0] + x * slope_x, np.stack(gradient, axis=1)


class Obstacle:
    def __init__(self, body, voxel, band):
        self.body, self.voxel, self.band = body, voxel, band
        self.rotation, self.position = rotation_of(body), np.array(body.get("position", [0, 0, 0]), float)
        self.is_plane = body["shape"] == "plane"

    def values(self, voxels):
        """Values of the level set's grid at whole voxels [..., 3]."""
        flat = exact_distance(self.body, voxels.reshape(-1, 3) * self.voxel)
        return np.clip(flat, -self.band, self.band).astype(np.float32).astype(np.float64).reshape(voxels.shape[:-1])

    def may_contain(self, x):
        """False where phi > 0 for certain: outside the body's box and two voxels around it."""
        if self.is_plane:
            return np.ones(len(x), bool)
        local, (low, high) = (x - self.position) @ self.rotation, half_extents(self.body)
        return ((local > low - 2 * self.voxel) & (local < high + 2 * self.voxel)).all(axis=1)

    def corner_values(self, base):
        return self.values(base[:, None, :] + CORNERS).reshape(-1, 2, 2, 2)

    def signed_distance(self, x):
        """phi [n] and outward normal [n, 3] at world points [n, 3] (section 3.2)."""
        local = (x - self.position) @ self.rotation
        band = float(np.float32(self.band))
        if self.is_plane:
            phi, gradient = local[:, 1], np.tile([0.0, 1.0, 0.0], (len(x), 1))
        else:
            index = local / self.voxel
            base = np.floor(index).astype(int)
            phi, gradient = trilinear(self.corner_values(base), index - base)
        beyond = np.abs(phi) >= band
        normal = gradient @ self.rotation.T
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
        normal[beyond] = 0
        return np.clip(phi, -band, band), normal


def signed_distance(obstacles, x):
    """phi [n], normal [n, 3] and number of the nearest obstacle [n], -1 beyond the bands."""
    phi, normal, nearest = np.full(len(x), 1e30), np.zeros((len(x), 3)), np.full(len(x), -1)
    if obstacles:
        phi[:] = np.float32(obstacles[0].band)
    for number, obstacle in enumerate(obstacles):
        one, one_normal = obstacle.signed_distance(x)
        nearer = one < phi
        phi[nearer], normal[nearer], nearest[nearer] = one[nearer], one_normal[nearer], number
    return phi, normal, nearest


# 3.3 Cell normals


def philox(index, obstacle):
    """Uniform numbers [n, 4] in [0, 1) of draws `index` [n] (Philox4x32-10)."""
    mask, shift = np.uint64(0xFFFFFFFF), np.uint64(32)
    index = index.astype(np.uint64)
    c = [index & mask, index >> shift, np.full_like(index, obstacle), np.zeros_like(index)]
    key = [0, 7 * 0x9E3779B9 & 0xFFFFFFFF]
    for _ in range(10):
        a, b = np.uint64(0xD2511F53) * c[0], np.uint64(0xCD9E8D57) * c[2]
        c = [(b >> shift) ^ c[1] ^ np.uint64(key[0]), b & mask, (a >> shift) ^ c[3] ^ np.uint64(key[1]), a & mask]
        key = [key[0] + 0x9E3779B9 & 0xFFFFFFFF, key[1] + 0xBB67AE85 & 0xFFFFFFFF]
    return np.stack(c, axis=1).astype(np.float64) / 2.0**32


def half_extents(body):
    """Box of a body in its own frame."""
    shape = body["shape"]
    if shape in ("box", "half_box", "pyramid"):
        x, y, z = np.array(body["size"], float) / 2
        if shape == "pyramid":
            y = body["height"] / 2
        return np.array([-x, -y, -z]), np.array([x, 0 if shape == "half_box" else y, z])
    r = body["radius"]
    h = body["height"] / 2 if shape in ("cone", "cylinder") else r
    return np.array([-r, 0 if shape == "half_sphere" else -h, -r]), np.array([r, h, r])


def leaves_of(obstacle):
    """First voxels [n, 3] of the 8^3 blocks with a voxel within the band, in the order of the grid's leaves."""
    low, high = half_extents(obstacle.body)
    reach = obstacle.band + obstacle.voxel
    ranges = [np.arange(math.floor((low[d] - reach) / obstacle.voxel / 8),
                        math.floor((high[d] + reach) / obstacle.voxel / 8) + 1) for d in range(3)]
    block = np.stack(np.meshgrid(*ranges, indexing="ij"), axis=-1).reshape(-1, 3) * 8
    centre = exact_distance(obstacle.body, (block + 3.5) * obstacle.voxel)
    block = block[np.abs(centre) < obstacle.band + obstacle.voxel * 4 * math.sqrt(3)]
    order = np.lexsort([(block // size)[:, d] for size in (8, 128, 4096) for d in (2, 1, 0)])
    return block[order]


IN_LEAF = np.stack(np.meshgrid(*[np.arange(8)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)


def grid_candidates(obstacle, number, spacing):
    """Points and normals, in the obstacle's frame, in the order of their draws."""
    leaf = leaves_of(obstacle)
    voxels = leaf[:, None, :] + IN_LEAF
    values = obstacle.values(voxels)
    active = (np.abs(values) < np.float32(obstacle.band)).any(axis=1)
    voxels, values = voxels[active], values[active]
    near = np.flatnonzero(np.abs(values).reshape(-1) <= 1.8 * obstacle.voxel)
    base = voxels.reshape(-1, 3)[near]
    v = obstacle.corner_values(base) / obstacle.voxel
    inside = (v < 0).sum(axis=(1, 2, 3))
    crossed = (inside > 0) & (inside < 8)
    near, base, v = near[crossed], base[crossed], v[crossed]
    strata = max(1, math.ceil(1.5 * obstacle.voxel / spacing))
    per_cell = strata**3
    s = np.arange(per_cell)
    sub = np.stack([s % strata, s // strata % strata, s // strata // strata], axis=1)
    draw = (near[:, None] * per_cell + s).reshape(-1)
    t = (np.tile(sub, (len(near), 1)) + philox(draw, number)[:, :3]) / strata
    base, v = np.repeat(base, per_cell, axis=0), np.repeat(v, per_cell, axis=0)
    phi, gradient = trilinear(v, t)
    keep = phi**2 <= (0.5 * math.sqrt(3) / strata) ** 2 * (gradient**2).sum(axis=1)
    base, v, t, phi, gradient = (a[keep] for a in (base, v, t, phi, gradient))
    usable = np.ones(len(t), bool)
    for _ in range(4):
        moves = usable & (np.abs(phi) > 1e-6)
        t[moves] -= gradient[moves] * (phi[moves] / (gradient[moves] ** 2).sum(axis=1))[:, None]
        phi[moves], gradient[moves] = trilinear(v[moves], t[moves])
        usable &= ~moves | ((gradient**2).sum(axis=1) > 1e-4)
    keep = usable & ((t >= -1e-6) & (t <= 1 + 1e-6)).all(axis=1) & (np.abs(phi) < 1e-5)
    normal = gradient[keep] / np.linalg.norm(gradient[keep], axis=1, keepdims=True)
    return (base[keep] + t[keep]) * obstacle.voxel, normal


def plane_candidates(obstacle, number, spacing, low, high):
    corners = low + CORNERS * (high - low)
    local = (corners - obstacle.position) @ obstacle.rotation
    first, last, step = local.min(axis=0), local.max(axis=0), spacing / 1.5
    columns, rows = (math.ceil((last[d] - first[d]) / step) for d in (0, 2))
    index = np.arange(rows * columns)
    u = philox(index, number)
    x, z = first[0] + (index % columns + u[:, 0]) * step, first[2] + (index // columns + u[:, 1]) * step
    return np.stack([x, 0 * x, z], axis=1), np.tile([0.0, 1.0, 0.0], (len(x), 1))


def throw_darts(x, spacing):
    """Numbers of the candidates [n, 3] that are taken."""
    tile = np.floor(x / spacing / 16).astype(int)
    groups = {}
    for i, place in enumerate(map(tuple, tile)):
        groups.setdefault(place, []).append(i)
    cells, taken, least = {}, [], spacing**2
    u = x / (2 * spacing)
    lowest = np.floor(u - 0.5).astype(int).tolist()
    own, points = np.floor(u).astype(int).tolist(), x.tolist()
    for place in sorted(groups, key=lambda p: (p[0] & 1) | (p[1] & 1) << 1 | (p[2] & 1) << 2):
        tried = groups[place]
        stride = int(0.6180339887 * len(tried)) + 1
        while math.gcd(stride, len(tried)) > 1:
            stride += 1
        for k in range(len(tried)):
            i = tried[k * stride % len(tried)]
            (a, b, c), (px, py, pz) = lowest[i], points[i]
            free = True
            for cell in ((a, b, c), (a + 1, b, c), (a, b + 1, c), (a + 1, b + 1, c), (a, b, c + 1), (a + 1, b, c + 1),
                         (a, b + 1, c + 1), (a + 1, b + 1, c + 1)):
                for qx, qy, qz in cells.get(cell, ()):
                    if (qx - px) ** 2 + (qy - py) ** 2 + (qz - pz) ** 2 < least:
                        free = False
                        break
                if not free:
                    break
            if free:
                taken.append(i)
                cells.setdefault(tuple(own[i]), []).append(points[i])
    return np.array(taken, int)


def cell_normals(obstacles, origin, size, dx):
    """{(i, j, k): unit normal} of the cells that a surface passes through."""
    low, high = np.array(origin, float), np.array(origin, float) + size
    positions, normals = [], []
    for number, obstacle in enumerate(obstacles):
        local, normal = (plane_candidates(obstacle, number, dx / 4, low, high) if obstacle.is_plane else
                         grid_candidates(obstacle, number, dx / 4))
        x = local @ obstacle.rotation.T + obstacle.position
        keep = ((x >= low) & (x <= high)).all(axis=1)
        for other in obstacles:
            if other is not obstacle:
                near = np.flatnonzero(keep)[other.may_contain(x[keep])]
                keep[near] = other.signed_distance(x[near])[0] >= 0
        positions.append(x[keep])
        normals.append((normal @ obstacle.rotation.T)[keep])
    if not positions:
        return {}
    x, n = np.concatenate(positions), np.concatenate(normals)
    taken = throw_darts(x, dx / 4)
    x, n = x[taken], n[taken]
    u = (x - low) / dx + 1e-4 * n
    cell = np.floor(u).astype(int)
    away = (n * (cell + 0.5 - u)).sum(axis=1) < 0
    sums = {}
    for place, one in zip(map(tuple, cell), np.where(away[:, None], -n, n)):
        sums[place] = sums.get(place, 0) + one
    return {place: s / np.linalg.norm(s) for place, s in sums.items() if np.linalg.norm(s) > 1e-9}


# 2. Features


class Environment:
    def __init__(self, scene):
        domain = scene["domain"]
        self.origin, self.size = np.array(domain.get("origin", [0, 0, 0]), float), np.array(domain["size"], float)
        self.dx = domain["dx"]
        voxel = scene.get("obstacle_voxel", self.dx / 2)
        band = scene.get("obstacle_band", max(4 * self.dx, 0.1))
        self.obstacles = [Obstacle(body, voxel, band) for body in scene.get("obstacles", [])]
        self.normals = cell_normals(self.obstacles, self.origin, self.size, self.dx)
        self.materials = scene["materials"]
        walls, friction, faces = (domain.get(key, default) for key, default in
                                  (("walls", "separate"), ("wall_friction", 0), ("faces", {})))
        names = [f"{axis}_{side}" for side in ("low", "high") for axis in "xyz"]
        own = [faces.get(name) or {} for name in names]
        self.walls = [(face.get("kind", walls), face.get("friction", friction)) for face in own]
        self.inset = domain.get("wall_cells", 3) * self.dx


# 2.1 Constants of the material

MODELS = {4: "jelly", 5: "water", 6: "sand", 8: "snow"}


def constants_of(material):
    """[7] of a material with all its constants."""
    law, number = material["model"], lambda key: float(material[key])
    out = np.zeros(7)
    out[0] = math.log(number("bulk_modulus" if law == "water" else "youngs_modulus") / 3e5)
    if law == "water":
        out[1] = math.log(1 + number("viscosity") / 0.01) / 3
    if law == "sand":
        out[2:4] = math.tan(math.radians(number("friction_angle"))), math.log(1 + number("cohesion") / 50)
    if law == "snow":
        out[4:] = (number("hardening") / 10, number("critical_compression") / 0.025, number("critical_stretch") / 0.005)
    return out


def material_constants(environment, particle_type):
    """[n, 7]; of scenes with one material of a law."""
    of_law = {material["model"]: constants_of(material) for material in environment.materials.values()}
    assert len(of_law) == len(environment.materials)
    return np.array([of_law[MODELS[int(kind)]] for kind in particle_type])


# 2.2 Contact


def contact(network, environment, x):
    """[n, 7]; of scenes where nothing moves."""
    low, high = environment.origin + environment.inset, environment.origin + environment.size - environment.inset
    distance = np.concatenate([x - low, high - x], axis=1)
    surfaces = list(environment.walls)
    for face, (kind, _) in enumerate(surfaces):
        if kind in ("open", "periodic"):
            distance[:, face] = np.inf
    phi, _, nearest = signed_distance(environment.obstacles, x)
    surfaces += [(o.body.get("contact", "separate"), o.body.get("friction", 0)) for o in environment.obstacles]
    distance[distance >= network.number("wall_clamp")] = np.inf
    phi = np.where((nearest < 0) | (phi >= network.number("distance_clamp")), np.inf, phi)
    out = np.zeros((len(x), 7))
    for row, (walls, obstacle, which) in enumerate(zip(distance, phi, nearest)):
        face = int(np.argmin(walls))
        if min(walls[face], obstacle) == np.inf:
            continue
        kind, friction = surfaces[face if walls[face] <= obstacle else len(environment.walls) + which]
        out[row, 0] = 0 if kind == "stick" else friction
        out[row, 1 + ("slip", "separate", "stick").index(kind)] = 1
    return out


# 2. The row of features


def features_of(network, environment, history, particle_type):
    """[n, width] of positions [history + 1, n, 3] f32, newest last."""
    mean, std = (network.tensors["normalization.velocity_" + name] for name in ("mean", "std"))
    velocity = np.diff(history, axis=0).astype(np.float64)
    x = history[-1].astype(np.float64)
    parts = [(v - mean) / std for v in velocity[::-1]]
    if network.flag("cell_normal"):
        cell = np.floor((x - environment.origin) / environment.dx).astype(int)
        parts.append(np.array([environment.normals.get(place, np.zeros(3)) for place in map(tuple, cell)]))
    clamp = network.number("wall_clamp")
    parts.append(np.clip(x - environment.origin, -clamp, clamp) / clamp)
    parts.append(np.clip(environment.origin + environment.size - x, -clamp, clamp) / clamp)
    if network.flag("signed_distance"):
        clamp = network.number("distance_clamp")
        phi, normal, _ = signed_distance(environment.obstacles, x)
        parts += [(np.clip(phi, -clamp, clamp) / clamp)[:, None], normal]
    if network.flag("material_constants"):
        parts.append(material_constants(environment, particle_type))
    if network.flag("contact"):
        parts.append(contact(network, environment, x))
    return np.concatenate(parts, axis=1)


def encoder_input(network, environment, history, particle_type):
    row = np.where(particle_type == 13, 2, particle_type)
    features = features_of(network, environment, history, particle_type)
    return np.concatenate([features, network.tensors["embedding.weight"][row]], axis=1)


# 4. The hierarchical graph network


class Level:
    """Cells of a level: coordinates [n, 3], senders [n, 6] (-1: none)."""

    def __init__(self, coordinates):
        self.coordinates = coordinates
        self.number = {place: i for i, place in enumerate(map(tuple, coordinates))}
        steps = [sign * unit for unit in np.eye(3, dtype=int) for sign in (-1, 1)]
        self.neighbor = np.array([[self.number.get(tuple(c + s), -1) for s in steps] for c in coordinates])
        self.direction = -np.array(steps, float)  # from the sender to the receiver


def sum_at(receiver, rows, count):
    out = np.zeros((count, rows.shape[1]))
    np.add.at(out, receiver, rows)
    return out


def hgn(network, particles, position, origin):
    """Normalised accelerations [n, 3 bundle] from the encoder's input [n, width] and positions [n, 3] [m]."""
    slope = 0.01
    act = lambda name, *parts: leaky(network.linear(name + ".gather", np.concatenate(parts, axis=1)), slope)
    fcn = lambda name, *parts: network.fcn(name, np.concatenate(parts, axis=1), slope)
    levels, iterations = int(network.number("levels")), int(network.number("message_passing"))
    spacing = network.number("spacing")
    assert network.setting("aggregation", "messages") == "activations"

    u = (position - origin) / spacing - 0.5
    base = np.floor(u).astype(int)
    offset = u - base
    corner = np.array([[k & 1, k >> 1 & 1, k >> 2] for k in range(8)])
    weight = np.prod(np.where(corner == 1, offset[:, None], 1 - offset[:, None]), axis=2)
    cells = base[:, None] + corner
    grid = [Level(np.unique(cells.reshape(-1, 3), axis=0))]
    for _ in range(1, levels):
        grid.append(Level(np.unique(grid[-1].coordinates >> 1, axis=0)))
    pair_cell = np.array([grid[0].number[c] for c in map(tuple, cells.reshape(-1, 3))])
    pair_particle = np.repeat(np.arange(len(position)), 8)
    to_centre = (corner - offset[:, None]).reshape(-1, 3)  # (centre - x) / R
    pair_weight = weight.reshape(-1, 1)

    def pass_level(name, level, f):
        receiver, slot = np.nonzero(level.neighbor >= 0)
        sender = level.neighbor[receiver, slot]
        for k in range(iterations):
            one = f"{name}.{k}"
            message = act(one, f[sender], f[receiver], level.direction[slot])
            f = f + fcn(one + ".cell", sum_at(receiver, message, len(f)), f)
        return f

    def parents(l):
        parent = np.array([grid[l + 1].number[c] for c in map(tuple, grid[l].coordinates >> 1)])
        return parent, (grid[l].coordinates & 1) - 0.5  # (centre_fine - centre_coarse) / spacing_fine

    f_p = fcn("encoder", particles)
    message = pair_weight * act("particle_to_grid", f_p[pair_particle], to_centre)
    f = [fcn("particle_to_grid", network.number("p2g_scale") * sum_at(pair_cell, message, len(grid[0].coordinates)))]
    f[0] = pass_level("down.0", grid[0], f[0])
    for l in range(levels - 1):
        parent, octant = parents(l)
        message = act(f"restrict.{l}", f[l], -octant)
        f.append(fcn(f"restrict.{l}", sum_at(parent, message, len(grid[l + 1].coordinates))))
        f[l + 1] = pass_level(f"down.{l + 1}", grid[l + 1], f[l + 1])
    for l in reversed(range(levels - 1)):
        parent, octant = parents(l)
        f[l] = f[l] + fcn(f"prolong.{l}", f[l + 1][parent], f[l], octant)
        f[l] = pass_level(f"up.{l}", grid[l], f[l])
    message = pair_weight * act("grid_to_particle", f[0][pair_cell], f_p[pair_particle], -to_centre)
    f_p = f_p + fcn("grid_to_particle", sum_at(pair_particle, message, len(position)), f_p)
    return network.fcn("decoder", f_p, slope, norm=False)


# 5. The graph network simulator


def gns(network, particles, position):
    slope, layers = network.number("leaky_slope"), int(network.number("hidden_layers"))
    fcn = lambda name, *parts: network.fcn(name, np.concatenate(parts, axis=1), slope, layers)
    radius = network.number("radius")
    sender, receiver = [], []
    for r in range(len(position)):
        near = np.flatnonzero(((position - position[r]) ** 2).sum(axis=1) <= float(np.float32(radius)) ** 2)
        sender.append(near)
        receiver.append(np.full(len(near), r))
    sender, receiver = np.concatenate(sender), np.concatenate(receiver)
    offset = (position[sender] - position[receiver]) / radius
    e = fcn("encoder.edge", offset, np.linalg.norm(offset, axis=1, keepdims=True))
    f = fcn("encoder.node", particles)
    for k in range(int(network.number("message_passing"))):
        message = fcn(f"step.{k}.edge", f[sender], f[receiver], e)
        f = f + fcn(f"step.{k}.node", sum_at(receiver, message, len(f)), f)
        e = e + message
    return network.fcn("decoder", f, slope, layers, norm=False)


# 6. The next frames


def predict(network, environment, history, particle_type):
    """Accelerations [bundle, n, 3] [m/frame^2]."""
    inputs = encoder_input(network, environment, history, particle_type)
    x = history[-1].astype(np.float64)
    output = gns(network, inputs, x) if network.architecture == "gns" else hgn(network, inputs, x, environment.origin)
    mean, std = (network.tensors["normalization.acceleration_" + name] for name in ("mean", "std"))
    return output.reshape(len(x), -1, 3).transpose(1, 0, 2) * std + mean


def frames_after(history, acceleration):
    before, now, frames = history[-2].astype(np.float64), history[-1].astype(np.float64), []
    for a in acceleration:
        before, now = now, now + (now - before) + a
        frames.append(now)
    return np.array(frames)


class InferenceTest(unittest.TestCase):
    """One evaluation from a true history, compared with a rollout without corrections."""

    def setUp(self):
        self.folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, self.folder)

    def run_program(self, *arguments):
        done = subprocess.run([PROGRAM, *arguments], cwd=self.folder, capture_output=True, text=True,
                              env={**os.environ, "GRAUPEL_PRODUCTS": "f32"})
        self.assertEqual(done.returncode, 0, done.stderr)

    def history_of(self, scene, first, *changes):
        """Six frames from `first` on, as a trajectory of their own; (positions, types, environment)."""
        self.run_program("simulate", scene, "-o", "truth.h5", "--frames", str(first + 5), "--no-velocity", *changes)
        with h5py.File(os.path.join(self.folder, "truth.h5"), "r+") as file:
            group = file["00000"]
            history, times = group["position"][first:first + 6], group["time"][:6]
            for name, values in (("position", history), ("time", times)):
                attributes = dict(group[name].attrs)
                del group[name]
                data = group.create_dataset(name, data=values)
                for key, value in attributes.items():
                    data.attrs[key] = value
            scene = json.loads(group.attrs["scene_json"])
            return history, group["particle_type"][:], Environment(scene)

    def compare(self, weights, history, types, environment, most):
        """`weights`: a file, or the name of a shipped one."""
        path = weights if os.path.isabs(weights) else os.path.join(ROOT, "models", weights + ".safetensors")
        network = Network(path)
        bundle = int(network.number("bundle", 1))
        acceleration = predict(network, environment, history, types)
        mine = frames_after(history, acceleration)
        self.run_program("rollout", path, "truth.h5", "--start", "truth:6", "--frames", str(bundle), "--no-project", "--no-free-flight", "--density-limit", "0",
                         "-o", "predicted.h5", "--device", "cpu")
        with h5py.File(os.path.join(self.folder, "predicted.h5")) as file:
            theirs = file["00000/position"][1:].astype(np.float64)
        error = np.linalg.norm(mine[0] - theirs[0]) / np.linalg.norm(acceleration[0])
        furthest = np.abs(mine - theirs).max()
        if "-v" in sys.argv:
            print(f"{weights}: {len(types)} particles, relative error of the acceleration {error:.1e}, "
                  f"largest difference of {bundle} frames {furthest:.1e} m")
        self.assertLess(error, most)
        self.assertLess(furthest, 1e-6)

    def test_hgn(self):
        """Five rotated bodies: box, half sphere, cone, pyramid, half box."""
        scene = os.path.join(ROOT, "scenes", "shared", "mixed_blocks.json")
        inputs = self.history_of(scene, 24)
        self.compare("hgn", *inputs, most=2e-5)

    def test_hgn_that_sees_constants_and_contact(self):
        scene = os.path.join(ROOT, "scenes", "shared", "mixed_blocks.json")
        faces = {"y_low": {"kind": "slip", "friction": 0.4}, "x_low": {"kind": "stick"}}
        materials = {
            "water": {"model": "water", "bulk_modulus": 2e5, "viscosity": 0.5},
            "sand": {"model": "sand", "youngs_modulus": 1e6, "friction_angle": 30, "cohesion": 100},
            "snow": {"model": "snow", "youngs_modulus": 1.4e5, "hardening": 9, "critical_compression": 0.02,
                     "critical_stretch": 0.006}}
        inputs = self.history_of(scene, 24, "--set", f"domain.faces={json.dumps(faces)}", "--set",
                                 f"materials={json.dumps(materials)}", "--set", "domain.wall_friction=0.2")
        more = contact(Network(os.path.join(ROOT, "models", "hgn.safetensors")), inputs[2], inputs[0][-1].astype(float))
        self.assertGreater(len(np.unique(more, axis=0)), 3)
        path = os.path.join(self.folder, "more.safetensors")
        with_more_inputs(os.path.join(ROOT, "models", "hgn.safetensors"), path)
        self.compare(path, *inputs, most=2e-5)
        self.compare("hgn-general", *inputs, most=2e-5)

    def test_gns(self):
        """One small ball between a plane, a sphere and a cylinder: GNS has some hundred edges a particle."""
        scene = os.path.join(ROOT, "scenes", "shared", "sand_cone.json")
        ball = [{"shape": "sphere", "radius": 0.03, "position": [0.68, 0.25, 0.56], "material": "sand"}]
        obstacles = [
            {"shape": "plane", "position": [0.6, 0.16, 0.5], "rotation_axis": [0, 0, 1], "rotation_angle": 20},
            {"shape": "sphere", "radius": 0.05, "position": [0.72, 0.18, 0.54]},
            {"shape": "cylinder", "radius": 0.04, "height": 0.2, "position": [0.62, 0.2, 0.6],
             "rotation_axis": [1, 0, 1], "rotation_angle": 60}]
        changes = [word for key, value in (("sources", ball), ("obstacles", obstacles))
                   for word in ("--set", f"{key}={json.dumps(value)}")]
        self.compare("gns", *self.history_of(scene, 4, *changes), most=1e-4)


if __name__ == "__main__":
    unittest.main()
