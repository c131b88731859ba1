"""Training: 100 losses and gradients of each network. Adam's first moment after one step is (1 - beta1) times the
(clipped) gradient, so the checkpoints of steps 1 and 100 hold both; reduced models: the weights of a quick fit."""
from builds import ROOT
from cases import Case, device_words

SMALL_HGN = ["hgn.latent=32", "hgn.levels=3", "hgn.message_passing=2"]
SMALL_GNS = ["gns.latent=16", "gns.message_passing=2", "gns.radius=0.02"]
NETWORKS = {"hgn activations": ("hgn", SMALL_HGN + ["hgn.aggregation=activations"]),
            "hgn messages": ("hgn", SMALL_HGN + ["hgn.aggregation=messages"]),
            "gns": ("gns", SMALL_GNS)}


def training_case(label, network, settings, device):
    settings = settings + ["batch_scenes=2", "log_interval=1", "checkpoint_interval=99", "validation_interval=1000000",
                           "mixed_precision=false", "warm_up_steps=0"]

    def commands(folder):
        data = ["generate", str(ROOT / "scenes/recipes/hgn.json"), "-o", str(folder / "data"), "--set", "counts.train=2",
                "--set", "counts.valid=1", "--set", "counts.test=1", "--set", "frames=12", "--set", "groups.count=2",
                "--device", "cpu"]
        sets = [word for setting in settings for word in ("--set", setting)]
        run = ["train", network, "--data", str(folder / "data"), "--seed", "5", *sets, *device_words(device)]
        return [data, [*run, "--out", str(folder / "first"), "--steps", "100", "--stop-step", "1"],
                [*run, "--out", str(folder / "run"), "--steps", "100"]]
    first, last = "first/checkpoints/step-00000001/", "run/checkpoints/step-00000100/"
    files = ["weights.safetensors", "adam_m.safetensors", "adam_v.safetensors"]
    return Case(f"training {label} {device}", "training", commands,
                [first + f for f in files] + [last + f for f in files] + ["run/metrics.jsonl"])


def reduced_training_case():
    def commands(folder):
        return [["generate", str(ROOT / "scenes/recipes/nsf_jelly_quick.json"), "-o", str(folder / "data"), "--device", "cpu"],
                ["train", "nsf", "--data", str(folder / "data"), "--out", str(folder / "run"), "--set",
                 "calibration_runs=2", "--device", "cpu"]]
    return Case("training nsf jelly quick", "training", commands, ["run/weights.safetensors"])


def training_cases(device):
    cases = [training_case(label, network, settings, device) for label, (network, settings) in NETWORKS.items()]
    return cases + ([reduced_training_case()] if device == "cpu" else [])
