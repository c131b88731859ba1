"""Graupel: water, sand, snow and solids among obstacles, by the material point method and by learned simulators.

    import graupel
    scene = graupel.Scene.from_file(graupel.scene_path("shared/water_steps"))
    run = graupel.Simulation(scene)
    run.run(60)
    print(run.positions[:, 1].mean())

All units are SI, y is up. docs/guide/python.md explains the package.
"""
from ._errors import ConfigError, DivergedError, Error, InputError, IoError
from ._machine import load_module as _load_module

_load_module()

from ._graupel import (  # noqa: E402
    Batch,
    DataSet,
    Frame,
    FrameArrays,
    GpuArray,
    NetworkModel,
    ReducedModel,
    Scene,
    Simulation,
    Trajectory,
    TrajectoryWriter,
    __version__,
    cuda_available,
    instruction_set,
    num_threads,
    open,
    set_num_threads,
)
from . import convert  # noqa: E402
from ._builder import SceneBuilder  # noqa: E402
from ._runs import rollout, simulate  # noqa: E402
from ._shared import model_path, scene_path  # noqa: E402
from ._verbs import compare, generate  # noqa: E402

__all__ = [
    "Batch", "ConfigError", "DataSet", "DivergedError", "Error", "Frame", "FrameArrays", "GpuArray", "InputError",
    "IoError", "NetworkModel", "ReducedModel", "Scene", "SceneBuilder", "Simulation", "Trajectory", "TrajectoryWriter",
    "__version__", "compare", "convert", "cuda_available", "generate", "instruction_set", "model_path", "num_threads",
    "open", "rollout", "scene_path", "set_num_threads", "simulate",
]
