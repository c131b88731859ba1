"""Own mesh: water over a tent made of triangles, by the solver and by a graph network. Run it: python 2_own_mesh.py

Meshes come from files (key `file` of an obstacle: .obj, .ply, .stl) or from arrays, as here. They must be closed, with
triangles counter-clockwise seen from outside.
"""
import numpy as np

import graupel

# A prism: a tent of 0.3 m along z, 0.24 m wide, 0.12 m high.
x, y, z = 0.12, 0.12, 0.15
vertices = np.array([[-x, 0, -z], [x, 0, -z], [0, y, -z], [-x, 0, z], [x, 0, z], [0, y, z]])
triangles = [[0, 2, 1], [3, 4, 5],            # the two ends
             [0, 1, 4], [0, 4, 3],            # the bottom
             [1, 2, 5], [1, 5, 4],            # the right side
             [2, 0, 3], [2, 3, 5]]            # the left side

# The network was trained with this grid (dx), frame time and water: a shipped scene brings them.
shipped = graupel.Scene.from_file(graupel.scene_path("shared/water_steps")).to_dict()
keys = {key: shipped[key] for key in ("domain", "materials", "frame_time", "gravity")}
keys["sources"] = [{"material": "water", "shape": "box", "size": [0.15, 0.15, 0.15], "position": [0.53, 0.4, 0.5]}]
keys["frames"] = 25
scene = graupel.Scene.from_dict(keys).with_mesh(vertices, triangles, position=(0.5, 0.08, 0.5))

run = graupel.Simulation(scene)
run.run()
model = graupel.NetworkModel(graupel.model_path("hgn"))
for remark in model.remarks(scene):
    print("beyond its training:", remark)
predicted = model.rollout(scene)

for name, positions in (("solver", run.positions), ("network", predicted.positions[-1])):
    left = (positions[:, 0] < 0.5).mean()
    print(f"{name}: {100 * left:.0f} % of the water went left, mean height {positions[:, 1].mean():.3f} m")

# Nothing is inside of the tent: below the roof, that is where |x - 0.5| / 0.12 + (y - 0.08) / 0.12 < 1.
for positions in (run.positions, predicted.positions[-1]):
    px, py, pz = (positions - [0.5, 0.08, 0.5]).T
    depth = 1 - abs(px) / 0.12 - py / 0.12
    inside = (abs(pz) < 0.14) & (py > 0.01) & (depth > 0.1)
    assert inside.mean() < 0.01, inside.mean()
