"""Scenes: what is known of another program's trajectory and what is chosen for the rest, and what Graupel's say of theirs.
The program itself gives every key its default and checks it (`graupel convert SCENE.json WHOLE.json`)."""
import json
import math
import os
import subprocess
import tempfile

import numpy as np

from .errors import ConfigError, ConvertError, InputError
from .metadata import Metadata, parse_json
from .series import MATERIALS, SPLITS, name_of

RADIUS_IN_CELLS = 2.24  # 0.035 m to 1/64 m, the ratio of the HGN paper
FEWEST_CELLS = 16  # along an edge, as scenes need
WALL_CELLS = 3
BODIES = ("obstacles", "emitters", "sinks", "kinematic_regions", "sources")
FACES = ("x_low", "x_high", "y_low", "y_high", "z_low", "z_high")


class Program:
    """Graupel itself."""

    def __init__(self, path):
        self.path = path
        self.version = self._run(["--version"]).strip()

    def _run(self, arguments):
        environment = {"GOMP_SPINCOUNT": "20000", **os.environ}  # which the program would start itself once more with
        try:
            done = subprocess.run([self.path, *arguments], capture_output=True, text=True, env=environment, check=False)
        except OSError as error:
            raise ConfigError(f"cannot start '{self.path}' ({error}), which knows the scenes. Build it by ./run build, or "
                              "name it: GRAUPEL_PROGRAM=build/graupel") from error
        if done.returncode != 0:
            error = ConvertError(done.stderr.strip().removeprefix("graupel: "))
            error.code = done.returncode
            raise error
        return done.stdout

    def whole_scene(self, scene, overrides=()):
        """The scene with every key, as text."""
        with tempfile.TemporaryDirectory(prefix="graupel_convert_") as folder:
            given, made = os.path.join(folder, "scene.json"), os.path.join(folder, "whole.json")
            with open(given, "w", encoding="utf-8") as file:
                json.dump(scene, file)
            words = [word for change in overrides for word in ("--set", change)]
            try:
                self._run(["convert", given, made, *words])
            except ConvertError as error:
                error.args = (str(error).replace(given, "scene"),)
                raise
            with open(made, encoding="utf-8") as file:
                return file.read()


class Scene:
    """A scene with every key."""

    def __init__(self, text):
        self.text, self.root = text, json.loads(text)
        domain = self.root["domain"]
        self.frame_time, self.dx, self.dimensions = self.root["frame_time"], domain["dx"], domain["dimensions"]
        self.plane = domain["origin"][2] + domain["size"][2] / 2
        distance = domain["wall_cells"] * self.dx
        margins = [distance, distance, 0 if self.dimensions == 2 else distance]
        self.low = [origin + margin for origin, margin in zip(domain["origin"], margins)]
        self.high = [origin + size - margin for origin, size, margin in zip(domain["origin"], domain["size"], margins)]

    def periodic(self):
        faces = self.root["domain"]["faces"]
        return [axis < self.dimensions and faces.get(FACES[2 * axis], {}).get("kind") == "periodic" for axis in range(3)]

    def period(self):
        return [high - low if periodic else 0.0 for low, high, periodic in zip(self.low, self.high, self.periodic())]


class SceneMaker:
    """Scenes of another program's trajectories. Known: walls (the bounds; periodic where the metadata say so), frame time,
    the materials' models. Chosen: grid_spacing and gravity of the metadata where it has them; else grid cells of 1/2.24 of
    the connectivity radius, no gravity. Bodies are the bounding boxes of each material's particles in the first frame."""

    def __init__(self, program, metadata, form, overrides):
        self.program, self.metadata, self.form, self.overrides = program, metadata, form, overrides
        self.first = None

    def __call__(self, series):
        try:
            scene = Scene(self.program.whole_scene(self._known(series), self.overrides))
        except ConvertError as error:
            error.args = (f"the scene of {series.where}: {error}",)
            raise
        self.first = self.first or scene
        return scene

    def _dx(self):
        m = self.metadata
        extents = [high - low for low, high in m.bounds]
        if m.grid_spacing is not None:
            return m.grid_spacing
        wished = min(m.radius / RADIUS_IN_CELLS, min(extents) / FEWEST_CELLS)
        periodic = [extent for extent, is_periodic in zip(extents, m.periodic) if is_periodic]
        return min(periodic) / math.ceil(min(periodic) / wished - 1e-9) if periodic else wished

    def _known(self, series):
        m, dx = self.metadata, self._dx()
        origin, size = [0.0, 0.0, 0.0], [1.0, 1.0, 1.0]
        for axis, (low, high) in enumerate(m.bounds):
            origin[axis], size[axis] = low - WALL_CELLS * dx, high - low + 2 * (WALL_CELLS * dx)
        faces = {FACES[2 * axis + side]: {"kind": "periodic"} for axis in range(m.dimensions) if m.periodic[axis]
                 for side in (0, 1)}
        sources, materials = [], {}
        for word, number in MATERIALS.items():
            mine = series.particle_type == number
            if mine.any():
                materials[word] = {"model": word}
                sources.append(self._source(word, series.position[0][mine].astype(np.float64), dx))
        if not sources:
            raise InputError(f"{series.where} has obstacle particles alone, no material. Leave it out")
        return {"name": m.name,
                "description": f"Converted from {self.form}: obstacles are particles, if any; sources are the bounding boxes "
                               "of the particles",
                "domain": {"dimensions": m.dimensions, "origin": origin, "size": size, "dx": dx, "wall_cells": WALL_CELLS,
                           "faces": faces},
                "gravity": m.gravity or [0, 0, 0], "materials": materials, "sources": sources,
                "frames": series.frames - 1, "frame_time": m.frame_time}

    @staticmethod
    def _source(word, position, dx):
        """position f64 [n, axes]"""
        low, high = position.min(axis=0), position.max(axis=0)
        axes = len(low)
        middle, size = ((low + high) * 0.5).tolist(), np.maximum(high - low, dx).tolist()
        cells = 1.0
        for edge in size:
            cells *= edge / dx
        if axes == 2:
            middle.append(0.5)
            size.append(dx)
        return {"shape": "box", "material": word, "position": middle, "size": size,
                "particles_per_cell": min(max(len(position) / cells, 1e-3), 1000.0)}


def own_metadata(program, splits):
    """What the scenes of Graupel's splits (name to GraupelSplit) have in common, and how many of them have obstacles that
    are no particles."""
    common, with_obstacles, known = None, 0, {}
    for split in splits.values():
        for i in range(split.count):
            where = f"'{split.path}': trajectory {i}"
            text, frame_time = split.header(i)
            if not text:
                raise InputError(f"{where} has no scene, which its walls are known from. Use data of 'graupel generate'")
            found, obstacles = _facts(program, text, where, known)
            found.frame_time = frame_time
            common = common or found
            if any(getattr(common, key) != getattr(found, key) for key in ("dimensions", "bounds", "periodic", "frame_time")):
                raise InputError(f"{where} has other walls, dimensions or frame times than the first one, and other formats "
                                 "know one for all. Convert them apart")
            with_obstacles += obstacles
        split.dimensions = common.dimensions
    return common, with_obstacles


def _facts(program, text, where, known):
    """Domain, gravity and times of a stored scene. Its bodies are left out: their geometry need not be there any more.
    `known` are the answers so far."""
    try:
        root = parse_json(text, "scene", ConfigError)
        if not isinstance(root, dict) or not isinstance(root.get("materials"), dict) or not root["materials"]:
            raise ConfigError("it has no materials")
        obstacles, name = bool(root.get("obstacles")), str(root.get("name", ""))
        root.update(dict.fromkeys(BODIES, []))
        root["sources"] = [{"shape": "box", "size": [1, 1, 1], "position": [0, 0, 0], "material": next(iter(root["materials"]))}]
        for key in ("name", "description", "seed", "frames"):
            root.pop(key, None)
        key = json.dumps(root)
        if key not in known:
            known[key] = Scene(program.whole_scene(root))
    except ConvertError as error:
        raise InputError(f"{where} has a damaged scene ({error}). Make the data set again") from error
    scene = known[key]
    axes = scene.dimensions
    return Metadata(name=name, dimensions=axes, bounds=[list(pair) for pair in zip(scene.low, scene.high)][:axes],
                    periodic=scene.periodic()[:axes], grid_spacing=scene.dx, gravity=scene.root["gravity"]), obstacles


def graupel_metadata(scene, metadata, splits, types, motion):
    """metadata.json of Graupel's own data sets: as `generate` writes it, of the training split and its types. The
    distance of particles is that of the input's metadata, else that in the first source."""
    train, frame_time, spacing = splits["train"], scene.frame_time, metadata.particle_spacing
    if spacing is None:
        spacing = float(scene.dx / np.cbrt(scene.root["sources"][0]["particles_per_cell"]))
    out = {"case": scene.root["name"], "solver": "MPM", "dim": 3, "dx": spacing, "dt": frame_time,
           "write_every": 1, "t_end": frame_time * (train.most_frames - 1), "sequence_length": train.most_frames - 1}
    for name in SPLITS:
        if name in splits:
            out["sequence_length_" + name] = splits[name].most_frames - 1
            out["num_trajs_" + name] = splits[name].trajectories
    return {**out, "num_particles_max": max(split.most_particles for split in splits.values()),
            "periodic_boundary_conditions": scene.periodic(),
            "bounds": [list(pair) for pair in zip(scene.low, scene.high)],
            "default_connectivity_radius": metadata.radius, **motion,
            "material_names": {str(number): name_of(number) for number in sorted(types)}}
