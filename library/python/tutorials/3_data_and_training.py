"""Make data and train: random scenes by `generate`, a loop in PyTorch. Run it: python 3_data_and_training.py

`graupel train` trains networks from scratch, on GPUs and several processes; this is the loop in the small, for losses
and networks of your own. The body of the shipped network is kept, a new decoder learns from nothing on two scenes.
"""
import numpy as np
import torch

import graupel
from graupel.torch import HGN, WindowDataset

# Two training runs and one to validate, of 12 frames. Runs that blow up are drawn anew by themselves.
graupel.generate(graupel.scene_path("recipes/hgn"), "data", seed=1, connectivity_radius=0.035,
                 changes={"counts.train": 2, "counts.valid": 1, "counts.test": 0, "frames": 12})
train, valid = (WindowDataset("data", split, history=5, predicted=1) for split in ("train", "valid"))
print(f"{len(train)} windows to train, {len(valid)} to validate")
scenes = {split: [t.scene for t in graupel.open(f"data/{split}.h5")] for split in ("train", "valid")}

torch.manual_seed(0)
network = HGN(graupel.model_path("hgn"))
network.requires_grad_(False)
for parameter in network.decoder.parameters():
    fan_in = parameter.shape[-1]
    torch.nn.init.normal_(parameter, std=fan_in**-0.5 if parameter.dim() == 2 else 0)
    parameter.requires_grad_(True)


def loss_of(split, item, particles=1500):
    """Mean square of the error of the normalised acceleration, over some particles."""
    x, types = item["positions"][:, :particles], item["particle_types"][:particles]
    truth = x[-1] - 2 * x[-2] + x[-3]
    predicted = network.accelerations(scenes[split][item["trajectory"]], x[:-1].numpy(), types.numpy())[0]
    return (((predicted - truth) / network.normalization.acceleration_std) ** 2).mean()


def validation():
    with torch.no_grad():
        return float(np.mean([loss_of("valid", valid[i]) for i in range(0, len(valid), 2)]))


before = validation()
optimizer = torch.optim.Adam(network.decoder.parameters(), lr=2e-3)
for step in range(20):
    optimizer.zero_grad()
    loss = loss_of("train", train[step % len(train)])
    loss.backward()
    optimizer.step()
    print(f"step {step}: loss {loss.item():.3f}")
after = validation()
print(f"validation: {before:.3f} before, {after:.3f} after")
assert after < 0.8 * before
