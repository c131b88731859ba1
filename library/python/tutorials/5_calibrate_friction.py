"""Calibrate a friction angle to a measured run-out, with batches of MPM. Run it: python 5_calibrate_friction.py

A column of sand collapses in a slice (two dimensions). How far it runs tells its friction angle. Runs with different
angles advance together as a `graupel.Batch`, each as it would alone: one a thread, or with device="cuda" many on a GPU.
Two batches suffice: a coarse one over all angles, and one around the best.
"""
import numpy as np

import graupel

keys = (graupel.SceneBuilder(size=(1.2, 0.4, 0.4), dx=0.0125, dimensions=2,
                             faces={"y_low": {"kind": "separate", "friction": 0.5}})
        .material("sand", preset="taichi_sand", friction_angle=30)
        .source("sand", "box", size=(0.16, 0.24, 0.1), position=(0.6, 0.1575, 0.2), sampling="jittered_lattice")
        .scene(name="column", frames=40)).to_dict()


def column(angle):
    """The scene with sand of this friction angle [degrees]."""
    sand = {**keys["materials"]["sand"], "friction_angle": float(angle)}
    return graupel.Scene.from_dict({**keys, "materials": {"sand": sand}})


def run_out(positions):
    """Half the width [m] that holds 96 % of the sand."""
    low, high = np.quantile(positions[:, 0], (0.02, 0.98))
    return (high - low) / 2


def run_outs(angles):
    """Run-outs [m] at the end of a run for each angle."""
    batch = graupel.Batch([column(angle) for angle in angles])
    batch.run()
    assert not any(batch.diverged), batch.diverged
    return np.array([run_out(positions) for positions in batch.positions])


def angle_at(measured, angles, found):
    """From the straight line through the batch: sand that rubs more runs less far."""
    slope, offset = np.polyfit(angles, found, 1)
    return (measured - offset) / slope


# The measurement. Here it comes from a run with another arrangement of particles, whose angle nobody tells below.
truth = 33.0
experiment = graupel.Simulation(column(truth), seed=99)
experiment.run()
measured = run_out(experiment.positions)
print(f"measured run-out: {measured:.4f} m")

coarse = np.linspace(22, 44, 5)
guess = angle_at(measured, coarse, run_outs(coarse))
print(f"first batch: {guess:.1f} degrees")
fine = np.linspace(guess - 4, guess + 4, 5)
found = angle_at(measured, fine, run_outs(fine))
print(f"second batch: {found:.1f} degrees (the measurement was made with {truth})")
assert abs(found - truth) < 2
