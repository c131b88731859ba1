"""Verbs of the program as functions: data sets and comparisons as plain data, errors as exceptions."""
from __future__ import annotations

import json
import os
import subprocess
import tempfile
from contextlib import ExitStack
from pathlib import Path

from ._errors import ConfigError, DivergedError, Error, InputError, IoError
from ._graupel import Scene
from ._plain import change_words, json_text
from ._program import PROGRAM

_KINDS = {kind.exit_code: kind for kind in (ConfigError, InputError, DivergedError, IoError)}


def run_program(*words) -> str:
    """What the program writes to standard output. Raises by its exit code; Ctrl-C ends it too."""
    if not PROGRAM.is_file():
        raise ConfigError(f"the program is not in {PROGRAM.parent}. Install the wheel that 'pip wheel .' makes")
    with subprocess.Popen([str(PROGRAM), *map(str, words)], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                          text=True) as child:
        try:
            output, messages = child.communicate()
        except BaseException:
            child.terminate()
            raise
    if child.returncode == 0:
        return output
    if child.returncode in (130, -2):
        raise KeyboardInterrupt
    told = [line for line in messages.splitlines() if line.startswith("graupel: ")]
    text = messages.strip()[-2000:] if not told else messages[messages.rindex(told[-1]):].strip()[len("graupel: "):]
    raise _KINDS.get(child.returncode, Error)(text or f"graupel {words[0]} ended with status {child.returncode}")


def _flags(changes, options):
    """--key value of every option that is not None; of changes --set key=value."""
    words = [word for change in change_words(changes) for word in ("--set", change)]
    for key, value in options.items():
        if value is None or value is False:
            continue
        words.append("--" + key.replace("_", "-"))
        if value is not True:
            words.append(os.fsdecode(value) if isinstance(value, (bytes, os.PathLike)) else str(value))
    return words


def _file_of(what, stack, name):
    """The path of a file; dicts and scenes are written to one that lives as long as `stack`."""
    if isinstance(what, (str, bytes, os.PathLike)):
        return os.fsdecode(what)
    if not isinstance(what, (Scene, dict)):
        raise TypeError(f"{name} is a '{type(what).__name__}' (allowed: a path, a dict, a Scene)")
    keys = what.to_dict() if isinstance(what, Scene) else what
    if any(body.get("shape") in ("points", "mesh") and not body.get("file")
           for kind in ("sources", "obstacles") for body in keys.get(kind, [])):
        raise ConfigError("a scene with particles or meshes in memory is known to this process alone. Give it files")
    file = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="graupel-"))) / f"{name}.json"
    file.write_text(json_text(keys, name), encoding="utf-8")
    return str(file)


def generate(recipe, out, *, changes: dict | None = None, fields: str | None = None, shard: str | None = None,
             batch: int | None = None, minutes: float | None = None, connectivity_radius: float | None = None,
             seed: int | None = None, device: str | None = None, threads: int | None = None) -> dict:
    """Makes a data set of random scenes, or of a parameter sweep, in the folder `out`; what was made, as a dict.

    recipe: a file (scene_path('recipes/hgn')) or its dict, with absolute paths; changes: {'counts.train': 10}; fields
    as in simulate(); shard 'I/N': every N-th scene from I on; connectivity_radius [m] for metadata.json. Complete
    scenes are skipped, so an interrupted call goes on. Raises ConfigError, InputError, DivergedError, IoError.
    """
    with ExitStack() as stack:
        output = run_program("generate", _file_of(recipe, stack, "recipe"), "-o", os.fsdecode(out), "--json", "-",
                             *_flags(changes, {"fields": fields, "shard": shard, "batch": batch, "minutes": minutes,
                                               "connectivity_radius": connectivity_radius, "seed": seed,
                                               "device": device, "threads": threads}))
    return json.loads(output)


def compare(scenes, models, *, frames: int | None = None, changes: dict | None = None, split: str | None = None,
            training_runs=None, floors: bool = True, one_step_only: bool = False, seed: int | None = None,
            device: str | None = None, threads: int | None = None, report=None, csv=None, pictures=None) -> dict:
    """Holds models against MPM on scenes; the comparison as a dict (docs/reference/metrics.md).

    scenes: one or several of Scene, dict, or path (of a scene, a folder, a data set, a recipe); models: 'mpm',
    'mpm:coarse', 'corrections-only', ... or weights files. report, csv, pictures: files and a folder to write too.
    Raises ConfigError, InputError, DivergedError, IoError.
    """
    single = isinstance(scenes, (str, bytes, os.PathLike, dict, Scene))
    if not single and not isinstance(scenes, (list, tuple)):
        raise TypeError(f"scenes is a '{type(scenes).__name__}' (allowed: a path, a dict, a Scene, or a list of these)")
    names = [models] if isinstance(models, (str, bytes, os.PathLike)) else list(models)
    if not scenes or not names:
        raise ConfigError(f"there are no {'models' if scenes else 'scenes'} to compare (allowed: 1 or more). Name one")
    with ExitStack() as stack:
        files = [_file_of(scene, stack, f"scene{i}")
                 for i, scene in enumerate([scenes] if single else scenes)]
        output = run_program("compare", *files, "--models", ",".join(map(os.fsdecode, names)), "--json", "-",
                             *_flags(changes, {"frames": frames, "split": split, "training_runs": training_runs,
                                               "no_floors": not floors, "one_step_only": one_step_only, "seed": seed,
                                               "device": device, "threads": threads, "report": report, "csv": csv,
                                               "pictures": pictures}))
    return json.loads(output)
