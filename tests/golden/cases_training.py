"""Training: losses of 100 steps, gradients, weights and both moments of Adam; fits of reduced models.

Gradients cannot be seen from outside, so the first moment of Adam after one step stands for them: without a limit of the
gradient's norm it is the gradient times 1 - beta_1."""

from case import Case, Skip
from data_sets import data_set
from outputs import metrics_values, weights_values

COMMON = {"batch_scenes": 2, "log_interval": 1, "checkpoint_interval": 1000000, "validation_interval": 1000000,
          "validation_samples": 2, "rollout_scenes": 0, "warm_up_steps": 0, "mixed_precision": "false"}
NETWORKS = {
    "hgn-activations": ("hgn", {"hgn.latent": 16, "hgn.levels": 3}),
    "hgn-messages": ("hgn", {"hgn.latent": 16, "hgn.levels": 3, "hgn.aggregation": "messages"}),
    "hgn-bundle": ("hgn", {"hgn.latent": 16, "hgn.levels": 3, "hgn.bundle": 2, "push_steps": 1}),
    # A smaller radius than the default's: 30 neighbours instead of 150.
    "gns": ("gns", {"gns.latent": 16, "gns.message_passing": 3, "gns.radius": 0.02}),
}
GPU_NETWORKS = {
    "hgn-activations": ("hgn", {}),
    "hgn-messages": ("hgn", {"hgn.aggregation": "messages"}),
    "gns": ("gns", {"gns.message_passing": 3}),
}
REDUCED = {
    "factored": {"samples": 100, "latents": 2, "deformation_modes": 6, "stress_modes": 6, "affine_modes": 6, "calibration_runs": 1},
    "spread-clusters": {"samples": 100, "sample_rule": "spread", "cluster": 2, "latents": 2, "deformation_modes": 6,
                        "stress_modes": 6, "affine_modes": 6, "calibration_runs": 1},
    "networks": {"field": "mlp", "latents": 2, "samples": 100, "calibration_runs": 1, "mlp.deformation_beta": 4, "mlp.stress_beta": 4,
                 "mlp.affine_beta": 4, "mlp.deformation_epochs": 1, "mlp.field_epochs": 1, "mlp.batch_particles": 200},
}


def set_words(settings):
    return [word for key, value in settings.items() for word in ("--set", f"{key}={value}")]


def need_training(context):
    for build in (context.reference, context.new):
        if not build.has("graupel-train"):
            raise Skip(f"no graupel-train in '{build.folder}' (built without libtorch)")


def train(kind, settings, steps, device="cpu", mixed=False):
    def outputs(build, folder, context):
        need_training(context)
        words = {**COMMON, "clip_norm": 0 if steps == 1 else 5, **settings}
        if mixed:
            words["mixed_precision"] = "true"
        run = folder / "run"
        build.run(["graupel-train", kind, "--data", data_set("random", context), "--out", run, "--steps", steps, "--seed", 3,
                   "--device", device, *set_words(words)], context.inputs)
        checkpoint = sorted((run / "checkpoints").glob("step-*"))[-1]
        values = metrics_values(run / "metrics.jsonl")
        for path in sorted(checkpoint.glob("*.safetensors")):
            values.update(weights_values(path, f"{path.stem}/"))
        return values
    return outputs


def fit(settings):
    def outputs(build, folder, context):
        need_training(context)
        build.run(["graupel-train", "nsf", "--data", data_set("sweep", context), "--out", folder / "run", "--seed", 3,
                   "--device", "cpu", *set_words(settings)], context.inputs)
        return weights_values(folder / "run" / "weights.safetensors")
    return outputs


def cases(source, device):
    made = []
    for name, (kind, settings) in NETWORKS.items():
        made.append(Case(f"train/{name}/gradient", train(kind, settings, 1)))
        made.append(Case(f"train/{name}/100_steps", train(kind, settings, 100)))
    for name, settings in REDUCED.items():
        made.append(Case(f"fit/{name}", fit(settings)))
    if device == "cuda":
        for name, (kind, settings) in GPU_NETWORKS.items():
            for mixed in (False, True):
                word = "bf16" if mixed else "f32"
                made.append(Case(f"gpu/train/{name}/{word}/gradient", train(kind, settings, 1, "cuda", mixed), against_itself=True))
                made.append(Case(f"gpu/train/{name}/{word}/100_steps", train(kind, settings, 100, "cuda", mixed), against_itself=True))
    return made
