"""Signed distances of obstacles (docs/reference/networks.md, sections 3.1 and 3.2)."""
import math

import numpy as np


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
