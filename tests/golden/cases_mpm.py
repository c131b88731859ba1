"""MPM: every material word in f32 and f64 on every instruction set, the forms of a scene, shared scenes, saved states."""

import re

import small_scenes
from case import Case
from instruction_sets import instruction_sets
from outputs import json_values, state_values, trajectory_values

FIELDS = "stress,affine,deformation_gradient,plastic"

def simulate(scene, words=(), environment=None, state=True, statistics=True):
    """`scene`: a dictionary, or a path in the reference's tree. `statistics`: the run's results in JSON, too."""
    def outputs(build, folder, context, nudge=0):
        path = scene
        if isinstance(scene, dict) or nudge:
            whole = scene if isinstance(scene, dict) else small_scenes.read(context.inputs / scene)
            path = small_scenes.write(small_scenes.nudged(whole, nudge), folder / "scene.json")
        command = ["graupel", "simulate", path, "-o", folder / "out.h5", "--json", folder / "out.json", "--fields", FIELDS, *words]
        if state:
            command += ["--save-state", folder / "out.state"]
        build.run(command, context.inputs, environment)
        values = trajectory_values(folder / "out.h5")
        if statistics:
            values.update(json_values(folder / "out.json"))
        if state:
            values.update(state_values(folder / "out.state"))
        return values
    return outputs


def resumed(build, folder, context, nudge=0):
    """A run that stops after 8 frames and goes on: its trajectory, which must be that of the whole run, too."""
    scene = small_scenes.write(small_scenes.nudged(small_scenes.block_on_sphere(["snow"]), nudge), folder / "scene.json")
    build.run(["graupel", "simulate", scene, "-o", folder / "a.h5", "--frames", 8, "--save-state", folder / "a.state",
               "--device", "cpu"], context.inputs)
    values = state_values(folder / "a.state")
    build.run(["graupel", "simulate", "--resume", folder / "a.state", "--frames", 20], context.inputs)
    return {**values, **trajectory_values(folder / "a.h5")}


def material_words(source):
    """Those of small_scenes, and any that the reference knows beyond them is an error: it would go unseen."""
    folders = (source / "core", source / "core" / "scene")  # of the reference, and of later trees
    text = next((folder / "material_config.h" for folder in folders if (folder / "material_config.h").exists())).read_text()
    words = set(re.findall(r'\{"(\w+)", MaterialModel::', text))
    unknown = words - set(small_scenes.MATERIALS)
    if unknown:
        raise ValueError(f"small_scenes.py has no constants of {', '.join(sorted(unknown))}")
    return [word for word in small_scenes.MATERIALS if word in words]


def case_on_cpu(name, outputs, precision="f32"):
    return Case(name, outputs, precision, nudges=len(small_scenes.NUDGES) if precision == "f32" else 0)


def cases(source, device):
    cpu = ["--device", "cpu"]
    made = []
    words = material_words(source)
    scenes = {word: small_scenes.block_on_sphere([word] if word != "stationary" else ["stationary", "water"]) for word in words}
    scenes.update({f"full_tiles/{word}": small_scenes.full_tiles(word) for word in ("water", "snow", "sand")})
    for word, scene in scenes.items():
        moved_by_lanes = word.startswith("full_tiles/")  # but the sound speeds of particles at obstacles are not theirs
        for precision in ("f32", "f64"):
            for name in instruction_sets():
                run = simulate(scene, cpu + ["--precision", precision], {"GRAUPEL_SIMD": name}, statistics=not moved_by_lanes)
                made.append(case_on_cpu(f"mpm/{word}/{precision}/{name}", run, precision))
    for word in small_scenes.PRESETS:
        made.append(case_on_cpu(f"mpm/{word}/f32", simulate(small_scenes.block_on_sphere([word]), cpu)))
    for form, scene in small_scenes.FORMS.items():
        # Runs whose particles come and go keep who is present behind the particles: their states are not read.
        stays = form not in ("emitter_and_sink", "open_wall", "scripted")
        for precision in ("f32", "f64"):
            made.append(case_on_cpu(f"mpm/{form}/{precision}", simulate(scene, cpu + ["--precision", precision], state=stays),
                                    precision))
    for path in sorted((source / "scenes" / "shared").glob("*.json")):
        made.append(case_on_cpu(f"mpm/{path.stem}/f32", simulate(f"scenes/shared/{path.name}", cpu + ["--frames", 20])))
    made.append(case_on_cpu("mpm/mixed_blocks/f64", simulate("scenes/shared/mixed_blocks.json",
                                                             cpu + ["--frames", 20, "--precision", "f64"]), "f64"))
    made.append(case_on_cpu("mpm/dam_break/f32", simulate("scenes/plane/dam_break.json", cpu + ["--frames", 20])))
    made.append(case_on_cpu("mpm/one_thread/f32", simulate("scenes/shared/mixed_torus.json",
                                                           cpu + ["--frames", 20, "--threads", 1])))
    made.append(case_on_cpu("mpm/resumed/f32", resumed))
    if device == "cuda":
        gpu = ["--device", "cuda"]
        for word in words:
            scene = scenes[word]
            made.append(Case(f"gpu/mpm/{word}", simulate(scene, gpu, state=False)))
            fixed = dict(scene, time_step=small_scenes.FIXED)
            made.append(Case(f"gpu/mpm/{word}/fixed_steps", simulate(fixed, gpu, state=False)))
        for form, scene in small_scenes.FORMS.items():
            made.append(Case(f"gpu/mpm/{form}", simulate(scene, gpu, state=False)))
        for path in sorted((source / "scenes" / "shared").glob("*.json")):
            made.append(Case(f"gpu/mpm/{path.stem}", simulate(f"scenes/shared/{path.name}", gpu + ["--frames", 20], state=False)))
    return made
