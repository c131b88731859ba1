"""The graph networks and the frames that follow (docs/reference/networks.md, sections 4 to 6)."""
import numpy as np

from numpy_features import encoder_input
from numpy_weights import leaky


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
