"""Scenes of about a thousand particles: a block of one material falls askew onto an obstacle between walls."""

import json
import re

import numpy as np

MATERIALS = ("water", "jelly", "snow", "sand", "neo_hookean", "metal", "cake", "toothpaste", "foam", "stationary")
PRESETS = ("tait_water", "honey", "dry_sand", "wet_sand", "taichi_water", "taichi_sand", "taichi_snow")
# Softer and weaker than the defaults, so that the block yields, breaks or flows within 20 frames.
CONSTANTS = {
    "water": {"viscosity": 0.5, "equation_of_state": "tait"},
    "jelly": {"youngs_modulus": 1e5},
    "snow": {"youngs_modulus": 1.4e5},
    "sand": {"youngs_modulus": 3.5e5, "cohesion": 50},
    "neo_hookean": {"youngs_modulus": 1e5},
    "metal": {"youngs_modulus": 2e5, "yield_stress": 2e3, "hardening_modulus": 1e4},
    "cake": {"youngs_modulus": 1e5, "yield_stress": 2e3, "softening_modulus": 2e4},
    "toothpaste": {"youngs_modulus": 1e5, "yield_stress": 200, "consistency": 20, "flow_index": 0.8},
    "foam": {"youngs_modulus": 1e5, "yield_stress": 200, "consistency": 20, "flow_index": 0.8},
    "stationary": {},
}


def block_on_sphere(materials, **more):
    """Blocks of these materials over a sphere; `more` replaces top-level keys."""
    sources = []
    for i, word in enumerate(materials):
        stands = word == "stationary"  # beside the sphere, below where a second block falls
        sources.append({"shape": "box", "size": [0.09, 0.08, 0.09], "material": word,
                        "position": [0.304, 0.09, 0.304] if stands else [0.16 + 0.11 * i, 0.27, 0.19],
                        "velocity": [0, 0, 0] if stands else [0.5, -2, 0.3],
                        "angular_velocity": [0, 0, 0] if stands else [1, 3, 2]})
    scene = {
        "name": "golden", "domain": {"size": [0.4, 0.4, 0.4], "dx": 0.015625, "walls": "separate", "wall_friction": 0.2,
                                     "faces": {"x_low": {"kind": "stick"}, "z_low": {"kind": "slip"}}},
        "materials": {word: {"preset": word} if word in PRESETS else {"model": word, **CONSTANTS[word]} for word in materials},
        "sources": sources,
        "obstacles": [{"shape": "sphere", "radius": 0.07, "position": [0.2, 0.1, 0.2]}],
        "frames": 20, "seed": 7,
    }
    scene.update(more)
    return scene


FULL_TILES = [0.0932, 0.08, 0.09]
FIXED = {"policy": "fixed", "substeps_per_frame": 60}
# What a run may have beside materials; each is one case.
FORMS = {
    "cubic_spline": block_on_sphere(["jelly"], transfer={"scheme": "rpic", "spline": "cubic", "damping": 1}),
    "pic": block_on_sphere(["water"], transfer={"scheme": "pic"}),
    "periodic": block_on_sphere(["water"], domain={"size": [0.40625, 0.4, 0.4], "dx": 0.015625, "faces": {
        "x_low": {"kind": "periodic"}, "x_high": {"kind": "periodic"}}}),
    "open_wall": block_on_sphere(["sand"], domain={"size": [0.4, 0.4, 0.4], "dx": 0.015625, "faces": {
        "y_low": {"kind": "open"}}}, obstacles=[]),
    "moving_obstacle": block_on_sphere(["snow"], obstacles=[
        {"shape": "box", "size": [0.1, 0.1, 0.1], "position": [0.2, 0.1, 0.2], "rotation_axis": [1, 1, 0],
         "rotation_angle": 30, "motion": {"kind": "constant", "velocity": [0.1, 0.2, 0], "spin": 2}}]),
    "emitter_and_sink": block_on_sphere(["water"], emitters=[
        {"shape": "box", "size": [0.06, 0.02, 0.06], "position": [0.2, 0.33, 0.2], "material": "water",
         "velocity": [0, -2, 0], "end_time": 0.3}],
        sinks=[{"shape": "half_space", "normal": [0, 1, 0], "position": [0, 0.075, 0]}]),
    "scripted": block_on_sphere(["jelly"], kinematic_regions=[
        {"shape": "box", "size": [0.4, 0.03, 0.4], "position": [0.2, 0.3, 0.2], "motion": {}, "release_time": 0.1}]),
    "mixed": block_on_sphere(["water", "sand"], time_step=FIXED),
}


def full_tiles(material):
    """1,408 particles: tiles of 16 lanes that are all full, so that no particle takes the code for numbers."""
    scene = block_on_sphere([material])
    scene["sources"][0]["size"] = FULL_TILES
    return scene


def read(path):
    """A scene's file, which may have comments; files that it names are found from any folder."""
    scene = json.loads(re.sub(r"(?m)^\s*//.*$", "", path.read_text()))
    for obstacle in scene.get("obstacles", []):
        if "file" in obstacle:
            obstacle["file"] = str((path.parent / obstacle["file"]).resolve())
    return scene


# Axis and units in the last place. Chaos takes few branches, and a run shows one.
NUDGES = ((0, 1), (1, 1), (2, 1), (0, -1), (1, 2), (1, 3))


def nudged(scene, nudge):
    """The scene with its bodies moved by some units in the last place of f32 (NUDGES[nudge - 1]); nudge 0: as it is."""
    scene = json.loads(json.dumps(scene))
    if nudge:
        axis, ulps = NUDGES[nudge - 1]
        for source in scene["sources"]:
            x = np.float32(source["position"][axis])
            source["position"][axis] = float(x + ulps * np.spacing(x))
    return scene


def write(scene, path):
    path.write_text(json.dumps(scene))
    return path
