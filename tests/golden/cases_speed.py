"""Speeds: both builds in turn, several times; the ratio of medians against 3 % and what the reference differs from itself."""

import json
from fnmatch import fnmatch
from statistics import median

from case import Check, Row
from cases_training import need_training, set_words
from data_sets import data_set

LIMIT = 1.03
# Pattern, limit of the ratio (None: only reported), reason.
EXEMPT = (
    ("speed/cpu/train/*", 1.5, "training on the CPU by autograd"),
    ("speed/gpu/train/hgn-messages", None, "the paper's message form on a GPU"),
)


def times_in(node, path=""):
    """{place: seconds} of keys with seconds_per_<something> (its "all" where it has parts) and us_per_step; rows of a list by their words."""
    times = {}
    if isinstance(node, dict):
        for key, child in node.items():
            if key == "us_per_step" and isinstance(child, (int, float)):
                times[f"{path}step"] = 1e-6 * child
            elif "seconds_per_" in key:
                whole = child.get("all") if isinstance(child, dict) else child
                if isinstance(whole, (int, float)):
                    times[path + key.replace("seconds_per_", "")] = float(whole)
            else:
                times.update(times_in(child, f"{path}{key}." if not isinstance(child, list) else path))
    elif isinstance(node, list):
        for i, child in enumerate(node):
            words = [str(v) for v in child.values() if isinstance(v, str)] if isinstance(child, dict) else []
            name = " ".join(w.rsplit("/", 1)[-1] for w in words[:3]) or str(i)
            size = f" {child['particles']}" if isinstance(child, dict) and "particles" in child else ""
            below = times_in(child, f"{path}{name}{size}.")
            if times.keys() & below.keys():
                below = times_in(child, f"{path}{name}{size} ({i}).")
            times.update(below)
    return times


def bench(kind, words):
    def measure(build, context, folder):
        own = [word(context) if callable(word) else word for word in words]
        build.run([*build.bench(kind), *own, "--json", folder / "speed.json"], context.inputs)
        times = times_in(json.loads((folder / "speed.json").read_text()))
        if not times:
            raise ValueError(f"bench {kind} writes no time that is known")
        return times
    return measure


def training(kind, settings, device, steps):
    """Seconds a step, of the second half of the steps."""
    def measure(build, context, folder):
        need_training(context)
        run = folder / f"run-{build.name}-{len(list(folder.iterdir()))}"
        common = {"log_interval": 1, "checkpoint_interval": 1000000, "validation_interval": 1000000, "validation_samples": 2,
                  "rollout_scenes": 0}
        build.run(["graupel-train", kind, "--data", data_set("random", context), "--out", run, "--steps", steps, "--seed", 3,
                   "--device", device, *set_words({**common, **settings})], context.inputs)
        seconds = {}
        for line in (run / "metrics.jsonl").read_text().splitlines():
            row = json.loads(line)
            if "loss" in row:
                seconds[row["step"]] = row["seconds"]
        half = steps // 2
        return {"step": (seconds[steps] - seconds[half]) / (steps - half)}
    return measure


def fitted_model(context):
    """A reduced model of the sweep, fitted by the reference."""
    need_training(context)
    run = context.work / "data" / "reduced"
    if not run.exists():
        context.reference.run(["graupel-train", "nsf", "--data", data_set("sweep", context), "--out", run, "--device", "cpu",
                               *set_words({"samples": 100, "latents": 2, "calibration_runs": 1})], context.inputs)
    return run / "weights.safetensors"


def sweep(context):
    return data_set("sweep", context)


def judged(name, rounds):
    """One row for each time of the rounds [(reference, new)]; a time that only one has is no row."""
    rows = []
    for place in rounds[0][0]:
        if any(place not in side for pair in rounds for side in pair):
            rows.append(Row(f"{name}: {place}", "not measured by the new build", "", "FAIL"))
            continue
        reference, new = [pair[0][place] for pair in rounds], [pair[1][place] for pair in rounds]
        middle = median(reference)
        if middle <= 0:
            continue
        spread = max(abs(value / middle - 1) for value in reference)
        ratio = median(new) / middle
        limit, reason = next(((limit, reason) for pattern, limit, reason in EXEMPT if fnmatch(name, pattern)), (LIMIT, ""))
        allowed = None if limit is None else limit + spread
        text = f"{middle * 1e3:.4g} -> {median(new) * 1e3:.4g} ms, ratio {ratio:.3f}, reference against itself {100 * spread:.1f} %"
        said = "reported" if allowed is None else f"{allowed:.3f}"
        rows.append(Row(f"{name}: {place}", text, f"{said} ({reason})" if reason else said,
                        "FAIL" if allowed is not None and ratio > allowed else "pass"))
    return rows


def interleaved(measure):
    def rows(name, context):
        folder = context.work / name.replace("/", "-")
        folder.mkdir(parents=True, exist_ok=True)

        def one_round(flipped):
            pair = [None, None]
            for side in ((1, 0) if flipped else (0, 1)):
                pair[side] = measure((context.reference, context.new)[side], context, folder)
            return pair

        rounds = [one_round(i % 2 == 1) for i in range(context.rounds)]
        found = judged(name, rounds)
        if any(row.verdict == "FAIL" for row in found):  # once more as many, before it counts
            rounds += [one_round(i % 2 == 1) for i in range(context.rounds)]
            found = judged(name, rounds)
        return found
    return rows


NETWORKS = "mpm,mpm:coarse,models/hgn.safetensors,models/hgn-general.safetensors"


def cases(source, device):
    cpu = ["--device", "cpu"]
    measures = {
        "speed/cpu/mpm/one_thread": bench("mpm", [*cpu, "--threads", 1]),
        "speed/cpu/mpm/all_threads": bench("mpm", cpu),
        "speed/cpu/mpm/f64": bench("mpm", [*cpu, "--threads", 1, "--precision", "f64", "--particles", 13824]),
        "speed/cpu/graph": bench("graph", [*cpu, "--frames", 30, "--settle", 60, "--models", NETWORKS]),
        "speed/cpu/rom": bench("rom", [fitted_model, sweep, "--against", "mpm", *cpu]),
        "speed/cpu/train/hgn": training("hgn", {"batch_scenes": 4}, "cpu", 24),
        "speed/cpu/train/gns": training("gns", {"batch_scenes": 2, "gns.message_passing": 3, "gns.radius": 0.02}, "cpu", 12),
    }
    if device == "cuda":
        gpu = ["--device", "cuda"]
        measures.update({
            "speed/gpu/mpm": bench("mpm", [*gpu, "--particles", 39304, 1000000]),
            "speed/gpu/mpm/late": bench("mpm", [*gpu, "--particles", 39304, "--phase", "late"]),
            "speed/gpu/mpm/batch": bench("mpm", [*gpu, "--recipe", "scenes/recipes/hgn.json", "--batch", 1, 64, "--frames", 30]),
            "speed/gpu/graph": bench("graph", [*gpu, "--frames", 60, "--settle", 60, "--particles", 3600, 52000, "--models", NETWORKS]),
            "speed/gpu/rom": bench("rom", [fitted_model, sweep, "--instances", 16, *gpu]),
            "speed/gpu/train/hgn": training("hgn", {"batch_scenes": 16}, "cuda", 400),
            "speed/gpu/train/hgn-messages": training("hgn", {"batch_scenes": 16, "hgn.aggregation": "messages"}, "cuda", 200),
            "speed/gpu/train/gns": training("gns", {"batch_scenes": 4}, "cuda", 200),
        })
    return [Check(name, interleaved(measure)) for name, measure in measures.items()]
