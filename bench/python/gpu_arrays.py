"""Times of the Python package on a GPU: a frame, its positions as a CUDA tensor and in NumPy, and a batch of scenes
beside the same scenes one after another. Medians of 9 frames.

    python3 bench/python/gpu_arrays.py       (graupel installed with CUDA, and torch)
"""
import statistics
import time

import numpy as np
import torch

import graupel

STEPS = {"policy": "fixed", "substeps_per_frame": 50}


def timed(work, seconds):
    start = time.perf_counter()
    result = work()
    torch.cuda.synchronize()
    seconds.append(time.perf_counter() - start)
    return result


def arrays():
    builder = graupel.SceneBuilder(size=(1, 1, 1), dx=0.0125).material("water", preset="water")
    builder.source("water", "box", size=(0.5, 0.5, 0.5), position=(0.5, 0.4, 0.5))
    run = graupel.Simulation(builder.scene(frames=9, time_step=STEPS), device="cuda")
    frame, tensor, copied = [], [], []
    for _ in range(9):
        timed(run.advance_frame, frame)
        on_gpu = timed(lambda: torch.from_dlpack(run.positions), tensor)
        on_host = timed(run.positions.numpy, copied)
    assert on_gpu.is_cuda and np.array_equal(on_gpu.cpu().numpy(), on_host)
    times = (f"{name} {1e3 * statistics.median(seconds):.2f} ms"
             for name, seconds in (("frame", frame), ("as a CUDA tensor", tensor), ("then in NumPy", copied)))
    print(f"{torch.cuda.get_device_name()}, {run.particle_count} particles: {', '.join(times)}")


def block(place):
    builder = graupel.SceneBuilder(size=(0.5, 0.5, 0.5), dx=0.02).material("water", preset="water")
    builder.source("water", "box", size=(0.16, 0.16, 0.16), position=(0.2 + 0.002 * place, 0.25, 0.25))
    return builder.scene(frames=20, time_step=STEPS)


def batch():
    scenes = [block(place) for place in range(32)]
    together, alone = [], []
    for _ in range(3):
        runs = graupel.Batch(scenes, device="cuda")
        timed(lambda: runs.run(20), together)
        timed(lambda: [graupel.Simulation(scene, device="cuda").run(20) for scene in scenes], alone)
    print(f"32 scenes of {len(runs.positions[0])} particles, 20 frames: together {statistics.median(together):.3f} s, "
          f"one after another {statistics.median(alone):.3f} s")


if __name__ == "__main__":
    arrays()
    batch()
