"""Whole runs: of the solver into a file, of learned and reduced models into memory."""
import json
import os
import struct

from ._errors import ConfigError, DivergedError, InputError
from ._graupel import NetworkModel, ReducedModel, Scene, Simulation, Trajectory, TrajectoryWriter
from ._plain import output_path


def architecture_of(weights) -> str:
    """'hgn', 'gns', 'nsf', 'crom', 'coarse_mpm' of a weights file. Raises InputError."""
    try:
        with open(weights, "rb") as file:
            length = struct.unpack("<Q", file.read(8))[0]
            if length > 100_000_000:
                raise ValueError("a header of over 100 MB")
            return json.loads(file.read(length))["__metadata__"]["architecture"]
    except FileNotFoundError as error:
        raise InputError(f"cannot read '{os.fsdecode(weights)}' (there is no such file). Give the path of a weights "
                         "file, or graupel.model_path(NAME)") from error
    except (OSError, ValueError, KeyError, TypeError, RecursionError, struct.error) as error:
        raise InputError(f"'{os.fsdecode(weights)}' holds no model of Graupel ({error}). Give a .safetensors file that "
                         "`graupel train` made") from error


def load_model(weights):
    """The NetworkModel or ReducedModel of a weights file. Raises InputError, ConfigError."""
    architecture = architecture_of(weights)
    if architecture == "coarse_mpm":
        raise ConfigError(f"'{os.fsdecode(weights)}' holds constants of coarse MPM (allowed: graph networks and "
                          "reduced-order models). Run it by graupel.compare() or `graupel rollout`")
    return NetworkModel(weights) if architecture in ("hgn", "gns") else ReducedModel(weights)


def _checked(scene) -> Scene:
    """The Scene of a path or of a dict, whose files are relative to the working directory; a Scene as it is."""
    if isinstance(scene, Scene):
        return scene
    if isinstance(scene, dict):
        return Scene.from_dict(scene)
    if isinstance(scene, (str, bytes, os.PathLike)):
        return Scene.from_file(os.fsdecode(scene))
    raise TypeError(f"scene is a '{type(scene).__name__}' (allowed: a path, a dict, a Scene)")


def rollout(weights, scene: Scene | dict | str | os.PathLike, frames: int | None = None, **options) -> Trajectory:
    """Predicts a scene with the graph network or reduced-order model of a weights file.

    scene: a Scene, a dict whose files are relative to the working directory, or the path of a scene file. `options` are
    those of NetworkModel.rollout() or ReducedModel.rollout(), which this calls. For many scenes make the model once.
    """
    return load_model(weights).rollout(_checked(scene), frames, **options)


def simulate(scene: Scene | dict | str | os.PathLike, path, frames: int | None = None, *, device: str = "cpu",
             precision: str = "f32", seed: int | None = None, fields: str = "", forces: bool = False,
             progress=None) -> Trajectory:
    """Runs a scene with the solver into an HDF5 file and opens it.

    scene: as in rollout(); `fields`: of Simulation.field(), comma-separated, stored with every frame; `forces`: store
    those on obstacles and walls (Trajectory.forces); progress(frame) after each frame. A run that blows up ends with
    DivergedError and leaves the frames before in the file. The file takes the place of nothing that the scene was read
    from (ConfigError).
    """
    path = output_path("path", path)
    scene = _checked(scene)
    count = scene.frames if frames is None else frames
    if count < 0:
        raise ConfigError(f"frames must not be negative ({count}). Use 0 or more")
    run = Simulation(scene, device, precision, seed, forces)
    writer = TrajectoryWriter(path, run, fields)
    writer.append(run)
    for frame in range(1, count + 1):
        try:
            run.advance_frame()
        except DivergedError:
            writer.finish(frame)
            raise
        writer.append(run)
        if progress is not None:
            progress(frame)
    writer.finish()
    return Trajectory(path)
