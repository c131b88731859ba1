"""Weights in PyTorch: the shipped HGN as a torch.nn.Module. Run it: python 4_weights_in_pytorch.py

Its accelerations are those of Graupel's own code, and it can be differentiated: here, by where the water is.
"""
import numpy as np
import torch

import graupel
from graupel.torch import HGN

scene = graupel.Scene.from_file(graupel.scene_path("shared/water_steps"))
run = graupel.Simulation(scene)
history = []
for frame in range(30):
    run.advance_frame()
    history = history[-5:] + [run.positions]   # the network sees six positions

path = graupel.model_path("hgn")
theirs = graupel.NetworkModel(path).accelerations(scene, history, run.particle_types)
network = HGN(path)
print(f"{sum(p.numel() for p in network.parameters())} weights, names as in the file:",
      ", ".join(list(network.state_dict())[:3]), "...")
with torch.no_grad():
    mine = network.accelerations(scene, history, run.particle_types)
difference = np.linalg.norm(mine[0].numpy() - theirs) / np.linalg.norm(theirs)
print(f"relative difference of the accelerations: {difference:.1e}")
assert difference < 1e-5

# A frame by hand: x' = 2 x - x_before + a. `graupel.rollout` adds the corrections of docs/reference/method.md.
following = 2 * history[-1] - history[-2] + mine[0].numpy()
run.advance_frame()
truth = run.positions
still = 2 * history[-1] - history[-2]
print(f"error of one frame: network {abs(following - truth).mean():.2e} m, "
      f"constant velocity {abs(still - truth).mean():.2e} m")
assert abs(following - truth).mean() < abs(still - truth).mean()

# How a particle's acceleration depends on the features of others: its neighbours' alone, as far as the grid reaches.
features, rows, origin = network.features(scene, history, run.particle_types)
features.requires_grad_(True)
acceleration = network(features, rows, torch.tensor(history[-1]), origin)[0]
acceleration[0, 1].backward()
influence = features.grad.norm(dim=1).numpy()
distance = np.linalg.norm(history[-1] - history[-1][0], axis=1)
near, far = influence[distance < 0.05].mean(), influence[distance > 0.15].mean()
print(f"influence of a particle within 5 cm {near:.1e}, beyond 15 cm {far:.1e}")
assert near > far
