"""Cell normals of obstacles (docs/reference/networks.md, section 3.3)."""
import math

import numpy as np

from numpy_obstacles import CORNERS, exact_distance, half_extents, trilinear


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
