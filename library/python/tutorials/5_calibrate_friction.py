"""Calibrate a friction angle to a measured run-out, with batches of MPM. Run it: python 5_calibrate_friction.py

A column of sand collapses in a slice (two dimensions). How far it runs tells its friction angle. A batch of runs with
different angles is a sweep of `graupel.generate`: its scenes advance together, one a thread. Two batches suffice: a
coarse one over all angles, and one around the best.
"""
import json
from pathlib import Path

import numpy as np

import graupel

keys = (graupel.SceneBuilder(size=(1.2, 0.4, 0.4), dx=0.0125, dimensions=2,
                             faces={"y_low": {"kind": "separate", "friction": 0.5}})
        .material("sand", preset="taichi_sand", friction_angle=30)
        .source("sand", "box", size=(0.16, 0.24, 0.1), position=(0.6, 0.1575, 0.2), sampling="jittered_lattice")
        .scene(name="column", frames=40)).to_dict()
Path("column.json").write_text(json.dumps(keys), encoding="utf-8")


def run_out(trajectory):
    """Half the width [m] that holds 96 % of the sand at the end."""
    low, high = np.quantile(trajectory.positions[-1][:, 0], (0.02, 0.98))
    return (high - low) / 2


def batch(name, angles):
    """Run-outs [m] of a run for each angle."""
    recipe = {"name": name, "scene": str(Path("column.json").resolve()), "valid": [], "test": [],
              "parameters": [{"name": "angle", "unit": "degrees", "key": "materials.sand.friction_angle",
                              "values": [float(a) for a in angles]}]}
    graupel.generate(recipe, name)
    runs = {t.parameters["angle"]: run_out(t) for t in graupel.open(f"{name}/train.h5")}
    return np.array([runs[a] for a in sorted(runs)])


def angle_at(measured, angles, run_outs):
    """From the straight line through the batch: sand that rubs more runs less far."""
    slope, offset = np.polyfit(angles, run_outs, 1)
    return (measured - offset) / slope


# The measurement. Here it comes from a run with another arrangement of particles, whose angle nobody tells below.
truth = 33.0
keys["materials"]["sand"]["friction_angle"] = truth
measured = run_out(graupel.simulate(graupel.Scene.from_dict(keys), "measured.h5", seed=99))
print(f"measured run-out: {measured:.4f} m")

coarse = np.linspace(22, 44, 5)
guess = angle_at(measured, coarse, batch("coarse", coarse))
print(f"first batch: {guess:.1f} degrees")
fine = np.linspace(guess - 4, guess + 4, 5)
found = angle_at(measured, fine, batch("fine", fine))
print(f"second batch: {found:.1f} degrees (the measurement was made with {truth})")
assert abs(found - truth) < 2
