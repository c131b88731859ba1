"""A scene and the features that a network has of it (docs/reference/networks.md, section 2)."""
import math

import numpy as np

from numpy_cell_normals import cell_normals
from numpy_obstacles import Obstacle, signed_distance


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
