"""Rollouts of every shipped weights file: networks and reduced models, on every instruction set and kind of products."""

import json

import small_scenes
from case import Case
from instruction_sets import arithmetic
from outputs import json_values, trajectory_values

FRAMES = 20
SCENES = ("mixed_blocks", "mixed_bowl", "mixed_torus")


def rollout(weights, scene, words=(), environment=None):
    def outputs(build, folder, context):
        path = small_scenes.write(scene, folder / "scene.json") if isinstance(scene, dict) else scene
        build.run(["graupel", "rollout", weights, path, "-o", folder / "out.h5", "--json", folder / "out.json", *words],
                  context.inputs, environment)
        return {**trajectory_values(folder / "out.h5"), **json_values(folder / "out.json")}
    return outputs


def small_scene_of_networks():
    """Water, sand and snow of 1,300 particles: slow networks reach 20 frames of it."""
    materials = {word: {"preset": f"taichi_{word}"} for word in ("water", "sand", "snow")}
    places = {"water": [0.35, 0.5, 0.5], "sand": [0.5, 0.55, 0.5], "snow": [0.65, 0.5, 0.52]}
    return {"name": "golden", "domain": {"size": [1, 1, 1], "dx": 0.015625}, "materials": materials,
            "sources": [{"shape": "box", "size": [0.06, 0.06, 0.06], "position": at, "material": word, "velocity": [0, -2, 0]}
                        for word, at in places.items()],
            "obstacles": [{"shape": "sphere", "radius": 0.2, "position": [0.5, 0.25, 0.5]}],
            "time_step": {"policy": "fixed", "substeps_per_frame": 54}, "seed": 3}


def sets_of(card):
    """Words that set the scene as in the card of a reduced model (models/*.json)."""
    return [word for change in card["check"].get("set", []) for word in ("--set", change)]


def cases(source, device):
    made = []
    for path in sorted((source / "models").glob("*.json")):
        card, name = json.loads(path.read_text()), path.stem
        weights, scene = f"models/{card['weights']}", card["check"]["scene"]
        reduced = not name.startswith(("hgn", "gns"))
        frames = ["--frames", FRAMES]
        for arithmetic_name, environment in arithmetic():
            if reduced:
                if not arithmetic_name.endswith("+f32"):
                    continue
                set_name = arithmetic_name.removesuffix("+f32")
                words = sets_of(card) + frames + ["--device", "cpu"]
                made.append(Case(f"reduced/{name}/f32/{set_name}", rollout(weights, scene, words, environment)))
                made.append(Case(f"reduced/{name}/f64/{set_name}", rollout(weights, scene, words + ["--f64"], environment), "f64"))
                continue
            made.append(Case(f"rollout/{name}/small/{arithmetic_name}",
                             rollout(weights, small_scene_of_networks(), frames + ["--device", "cpu"], environment)))
            if name.startswith("hgn"):
                for shared in SCENES:
                    made.append(Case(f"rollout/{name}/{shared}/{arithmetic_name}",
                                     rollout(weights, f"scenes/shared/{shared}.json", frames + ["--device", "cpu"], environment)))
        if not reduced:
            made.append(Case(f"rollout/{name}/uncorrected", rollout(weights, small_scene_of_networks(), frames + [
                "--device", "cpu", "--no-free-flight", "--no-project", "--density-limit", 0])))
            if device == "cuda":
                for shared in SCENES:
                    made.append(Case(f"gpu/rollout/{name}/{shared}",
                                     rollout(weights, f"scenes/shared/{shared}.json", frames + ["--device", "cuda"])))
    return made
