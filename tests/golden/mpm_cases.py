"""MPM: every material in both precisions, shared scenes, saved states, data sets."""
import json

from builds import ROOT
from cases import Case, device_words, shared

MATERIALS = ["water", "jelly", "snow", "sand", "tait_water", "honey", "dry_sand", "wet_sand", "neo_hookean", "metal", "cake",
             "toothpaste", "foam", "taichi_water", "taichi_sand", "taichi_snow"]
SCENES = ["mixed_blocks", "mixed_bowl", "mixed_torus", "sand_column", "sand_cone", "snow_pyramid", "water_steps"]


def material_scene(material):
    """A box of the material falls with spin onto a wedge, a ball and a frictional floor."""
    return {
        "name": f"golden_{material}",
        "domain": {"size": [0.6, 0.6, 0.6], "dx": 0.02, "walls": "separate", "wall_cells": 3,
                   "faces": {"y_low": {"kind": "separate", "friction": 0.3}}},
        "materials": {"body": {"preset": material}},
        "sources": [{"shape": "box", "size": [0.16, 0.12, 0.16], "position": [0.3, 0.3, 0.3], "material": "body",
                     "velocity": [0.4, -2.0, 0.2]}],
        "obstacles": [{"shape": "half_sphere", "radius": 0.1, "position": [0.36, 0.06, 0.3], "friction": 0.2}],
        "frames": 20, "frame_time": 1 / 120, "seed": 3}


def material_case(material, precision, device):
    def prepare(folder):
        (folder / "scene.json").write_text(json.dumps(material_scene(material)))

    def commands(folder):
        return [["simulate", str(folder / "scene.json"), "-o", str(folder / "run.h5"), "--precision", precision, "--fields",
                 "stress,affine,deformation_gradient,plastic", "--save-state", str(folder / "run.state"),
                 *device_words(device)]]
    return Case(f"mpm {material} {precision} {device}", "mpm", commands, ["run.h5"], prepare=prepare)


def scene_case(name, device, environment=None, label=""):
    def commands(folder):
        return [["simulate", shared(name), "--frames", "20", "-o", str(folder / "run.h5"), *device_words(device)]]
    return Case(f"mpm scene {name} {device}{label}", "mpm", commands, ["run.h5"], environment=environment or {})


def data_set_case(device):
    def commands(folder):
        return [["generate", str(ROOT / "scenes/recipes/hgn.json"), "-o", str(folder / "data"), "--set", "counts.train=3",
                 "--set", "counts.valid=1", "--set", "counts.test=1", "--set", "frames=20", *device_words(device)]]
    return Case(f"generate hgn {device}", "mpm", commands, ["data/train.h5", "data/valid.h5", "data/test.h5"])


def mpm_cases(device):
    precisions = ["f32", "f64"] if device == "cpu" else ["f32"]
    cases = [material_case(material, precision, device) for material in MATERIALS for precision in precisions]
    cases += [scene_case(name, device) for name in SCENES]
    if device == "cpu":
        cases += [scene_case("mixed_bowl", device, {"GRAUPEL_SIMD": isa}, f" {isa}") for isa in ("baseline", "avx2")]
    return cases + [data_set_case(device)]
