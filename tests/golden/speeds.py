"""Speeds of both builds, in turn, so that a slow moment of the machine meets both."""
import json
import statistics
import tempfile

from builds import ROOT


def bench_mpm(material, threads, device):
    def measure(build, folder):
        out = f"{folder}/speed.json"
        words = ["bench", "mpm", "--material", material, "--particles", "39304", "--device", device, "--threads", str(threads),
                 "--json", out]
        return 1 / find(run(build, words, out), "updates_per_second")
    return f"mpm {material}, {device}, {threads} threads", measure


def bench_rollout(model, device):
    def measure(build, folder):
        out = f"{folder}/speed.json"
        run(build, ["bench", "graph", "--models", f"models/{model}.safetensors", "--frames", "20", "--settle", "10", "--device",
                    device, "--json", out], out)
        return find(json.load(open(out)), "ms", "frame_ms", "ms_per_frame", "median_ms")
    return f"rollout {model}, {device}", measure


def reduced_run(model, scene):
    def measure(build, folder):
        out = f"{folder}/speed.json"
        return find(run(build, ["rollout", f"models/{model}.safetensors", scene, "-o", f"{folder}/r.h5", "--json", out,
                                "--device", "cpu"], out), "solver_seconds", "seconds", "ms_per_frame", "frame_ms")
    return f"reduced {model}", measure


def training(network, settings, device):
    def measure(build, folder):
        data = f"{folder}/data-{network}"
        run(build, ["generate", str(ROOT / "scenes/recipes/hgn.json"), "-o", data, "--set", "counts.train=2", "--set",
                    "counts.valid=1", "--set", "counts.test=1", "--set", "frames=12", "--device", "cpu"])
        out = tempfile.mkdtemp(dir=folder)
        words = ["train", network, "--data", data, "--out", f"{out}/run", "--steps", "24", "--device", device, "--set",
                 "log_interval=8", "--set", "validation_interval=1000000", "--set", "batch_scenes=2"]
        run(build, words + [word for s in settings for word in ("--set", s)])
        lines = [json.loads(line) for line in open(f"{out}/run/metrics.jsonl")]
        rates = [line["scenes_per_second"] for line in lines if "scenes_per_second" in line]
        return 1 / statistics.median(rates[1:])
    return f"training {network}, {device}", measure


def run(build, words, out=None):
    done = build.run(words)
    if done.returncode:
        raise RuntimeError(f"{' '.join(words)}: {done.stderr.strip()[-300:]}")
    return json.load(open(out)) if out else None


def find(value, *names):
    """The first number of one of these names, in depth."""
    if isinstance(value, dict):
        for name in names:
            if isinstance(value.get(name), (int, float)):
                return value[name]
        value = list(value.values())
    if isinstance(value, list):
        for inner in value:
            number = find(inner, *names)
            if number is not None:
                return number
    return None


def measurements(device):
    threads = [1, 2] if device == "cpu" else [0]
    rows = [bench_mpm(material, n, device) for material in ("water", "jelly", "snow", "sand") for n in threads]
    rows += [bench_rollout(model, device) for model in ("hgn", "hgn-small", "gns")]
    rows += [training("hgn", ["hgn.latent=64"] if device == "cpu" else [], device),
             training("gns", ["gns.latent=32", "gns.message_passing=3", "gns.radius=0.02"] if device == "cpu" else [], device)]
    if device == "cpu":
        rows += [reduced_run("nsf-sand", "scenes/shared/sand_column.json"), reduced_run("nsf-metal", "scenes/nsf/metal.json")]
    return rows


def speed_rows(reference, new, device, rounds, explained, only):
    """(name, new/reference time, spread of the reference, limit, problem) for each measurement."""
    for name, measure in measurements(device):
        if only and only not in name:
            continue
        times = {"reference": [], "new": []}
        try:
            with tempfile.TemporaryDirectory() as folder:
                for turn in range(rounds):
                    order = [("reference", reference), ("new", new)]
                    for which, build in order if turn % 2 == 0 else order[::-1]:
                        times[which].append(measure(build, folder))
        except (RuntimeError, TypeError, KeyError) as error:
            yield name, float("nan"), 0.0, 0.0, str(error)[-200:]
            continue
        best = {which: min(values) for which, values in times.items()}
        spread = statistics.median(times["reference"]) / best["reference"] - 1
        limit = explained.get(f"speed {name}", {}).get("limit", 1.03) + spread
        ratio = best["new"] / best["reference"]
        yield name, ratio, spread, limit, "" if ratio <= limit else "slower"
