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
from ._plain import change_words, json_text, output_path
from ._program import PROGRAM

_KINDS = {kind.exit_code: kind for kind in (ConfigError, InputError, DivergedError, IoError)}


def _end(child):
    """Returns when it has ended, with what it writes kept; after Ctrl-C subprocess waits for a quarter of a second."""
    child.terminate()
    try:
        child.wait(timeout=20)
    except subprocess.TimeoutExpired:
        child.kill()


def run_program(*words) -> str:
    """What the program writes to standard output. Raises by its exit code; Ctrl-C ends it too."""
    if not PROGRAM.is_file():
        raise ConfigError(f"the program is not in {PROGRAM.parent}. Install the wheel that 'pip wheel .' makes")
    with subprocess.Popen([str(PROGRAM), *map(str, words)], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                          encoding="utf-8", errors="surrogateescape") as child:
        try:
            output, messages = child.communicate()
        except BaseException:
            _end(child)
            raise
    if child.returncode == 0:
        return output
    if child.returncode in (130, -2):
        raise KeyboardInterrupt
    told = [line for line in messages.splitlines() if line.startswith("graupel: ")]
    text = messages.strip()[-2000:] if not told else messages[messages.rindex(told[-1]):].strip()[len("graupel: "):]
    raise _KINDS.get(child.returncode, Error)(text or f"graupel {words[0]} ended with status {child.returncode}")


def _flags(changes, options):
    """--key value of every option that is not None; of changes --set key=value. A value never is a flag."""
    given = [("set", change) for change in change_words(changes)] + list(options.items())
    words = []
    for key, value in given:
        if value is None or value is False:
            continue
        flag = "--" + key.replace("_", "-")
        text = os.fsdecode(value) if isinstance(value, (bytes, os.PathLike)) else str(value)
        words += [flag] if value is True else [f"{flag}={text}"] if text.startswith("-") else [flag, text]
    return words


def _word(path):
    """A path that is no flag."""
    text = os.fsdecode(path)
    return os.path.join(".", text) if text.startswith("-") else text


def _model_words(models):
    for word in map(os.fsdecode, models):
        if "," in word or not word:
            raise ConfigError(f"the model '{word}' has {'a comma' if word else 'no name'} (allowed: names and paths "
                              "without commas). Give several models as a list; rename a file")
    return ",".join(map(os.fsdecode, models))


def _bodies(keys, *kinds):
    """The bodies of a scene's dict that are dicts; others are for the program to refuse."""
    lists = (keys.get(kind) for kind in kinds)
    return (body for bodies in lists if isinstance(bodies, (list, tuple)) for body in bodies if isinstance(body, dict))


def _with_whole_paths(value, key=""):
    """A copy of a scene's or a recipe's keys, in which relative paths of files begin at the working directory. What a
    sweep sets is relative to its scene, as in a file."""
    if key in ("set", "parameters"):
        return value
    if isinstance(value, dict):
        return {name: _with_whole_paths(item, name) for name, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_with_whole_paths(item, key) for item in value]
    if key in ("file", "meshes", "level_sets", "scene") and isinstance(value, (str, os.PathLike)) and os.fspath(value):
        return os.path.abspath(value)
    return value


def _file_of(what, stack, name):
    """The path of a file; dicts and scenes are written to one that lives as long as `stack`."""
    if isinstance(what, (str, bytes, os.PathLike)):
        return _word(what)
    if not isinstance(what, (Scene, dict)):
        raise TypeError(f"{name} is a '{type(what).__name__}' (allowed: a path, a dict, a Scene)")
    keys = what.to_dict() if isinstance(what, Scene) else what
    if any(body.get("shape") in ("points", "mesh") and not body.get("file")
           for body in _bodies(keys, "sources", "obstacles")):
        raise ConfigError("a scene with particles or meshes in memory is known to this process alone. Give it files")
    file = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="graupel-"))) / f"{name}.json"
    file.write_text(json_text(_with_whole_paths(keys), name), encoding="utf-8")
    return str(file)


def generate(recipe, out, *, changes: dict | None = None, fields: str | None = None, shard: str | None = None,
             batch: int | None = None, minutes: float | None = None, connectivity_radius: float | None = None,
             seed: int | None = None, device: str | None = None, threads: int | None = None) -> dict:
    """Makes a data set of random scenes, or of a parameter sweep, in the folder `out`; what was made, as a dict.

    recipe: a file (scene_path('recipes/hgn')) or its dict, whose files are relative to the working directory; changes:
    {'counts.train': 10}; fields as in simulate(); shard 'I/N': every N-th scene from I on; connectivity_radius [m] for
    metadata.json. Complete scenes are skipped, so an interrupted call goes on. Raises ConfigError, InputError,
    DivergedError, IoError.
    """
    out = _word(output_path("out", out))
    with ExitStack() as stack:
        output = run_program("generate", _file_of(recipe, stack, "recipe"), "-o", out, "--json", "-",
                             *_flags(changes, {"fields": fields, "shard": shard, "batch": batch, "minutes": minutes,
                                               "connectivity_radius": connectivity_radius, "seed": seed,
                                               "device": device, "threads": threads}))
    return json.loads(output)


def compare(scenes, models, *, frames: int | None = None, changes: dict | None = None, split: str | None = None,
            training_runs=None, floors: bool = True, one_step_only: bool = False, seed: int | None = None,
            device: str | None = None, threads: int | None = None, report=None, csv=None, pictures=None) -> dict:
    """Holds models against MPM on scenes; the comparison as a dict (docs/reference/metrics.md).

    scenes: one or several of Scene, dict (its files are relative to the working directory), or path (of a scene, a
    folder, a data set, a recipe); models: 'mpm', 'mpm:coarse', 'corrections-only', ... or weights files, whose paths
    have no commas. report, csv, pictures: files and a folder to write too. Raises ConfigError, InputError,
    DivergedError, IoError.
    """
    single = isinstance(scenes, (str, bytes, os.PathLike, dict, Scene))
    if not single and not isinstance(scenes, (list, tuple)):
        raise TypeError(f"scenes is a '{type(scenes).__name__}' (allowed: a path, a dict, a Scene, or a list of these)")
    names = [models] if isinstance(models, (str, bytes, os.PathLike)) else list(models)
    if not scenes or not names:
        raise ConfigError(f"there are no {'models' if scenes else 'scenes'} to compare (allowed: 1 or more). Name one")
    outputs = {"report": report, "csv": csv, "pictures": pictures}
    outputs = {name: output_path(name, path) for name, path in outputs.items() if path is not None}
    with ExitStack() as stack:
        files = [_file_of(scene, stack, f"scene{i}")
                 for i, scene in enumerate([scenes] if single else scenes)]
        output = run_program("compare", *files, f"--models={_model_words(names)}", "--json", "-",
                             *_flags(changes, {"frames": frames, "split": split, "training_runs": training_runs,
                                               "no_floors": not floors, "one_step_only": one_step_only, "seed": seed,
                                               "device": device, "threads": threads, **outputs}))
    return json.loads(output)
