"""Rollouts of every shipped file on every instruction set, with both kinds of products."""
import pathlib

from builds import ROOT
from cases import Case, device_words, shared, weights

# Reduced models run on the scene that they were trained for: a file, or the first run of a quick sweep.
REDUCED_SCENES = {"nsf-sand": "scenes/shared/sand_column.json", "nsf-metal": "scenes/recipes/nsf_metal_quick.json",
                  "nsf-jelly": "scenes/recipes/nsf_jelly_quick.json"}


def rollout_case(model, scene, device, environment, label, group):
    def commands(folder):
        return [["rollout", weights(model), str(scene), "--frames", "20", "-o", str(folder / "run.h5"),
                 *device_words(device)]]
    return Case(f"{group} {model} {pathlib.Path(scene).stem} {device}{label}", group, commands, ["run.h5"], environment)


def reduced_case(model, source, device, environment, label):
    def commands(folder):
        scene, before = str(ROOT / source), []
        if "recipes" in source:
            before = [["generate", scene, "-o", str(folder / "data"), "--device", "cpu"]]
            scene = str(folder / "data" / "test.h5")
        return before + [["rollout", weights(model), scene, "-o", str(folder / "run.h5"), *device_words(device)]]
    return Case(f"reduced {model} {device}{label}", "reduced", commands, ["run.h5"], environment)


def instruction_sets(device):
    if device != "cpu":
        return [({}, "")]
    flags = open("/proc/cpuinfo").read()
    sets = ["baseline"] + [isa for isa, flag in (("avx2", " avx2 "), ("avx512", " avx512vl ")) if flag in flags]
    return [({"GRAUPEL_SIMD": isa}, f" {isa}") for isa in sets] + [({"GRAUPEL_PRODUCTS": "f32"}, " f32 products")]


def rollout_cases(device):
    cases = []
    for environment, label in instruction_sets(device):
        for model in ("hgn", "hgn-small", "gns"):
            for scene in ("mixed_bowl", "water_steps"):
                if model != "gns" or scene == "water_steps" and "baseline" not in label:
                    cases.append(rollout_case(model, shared(scene), device, environment, label, "rollout"))
        if "products" not in label:
            cases += [reduced_case(model, source, device, environment, label) for model, source in REDUCED_SCENES.items()]
    return cases
