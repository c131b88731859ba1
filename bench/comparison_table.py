#!/usr/bin/python3
"""Markdown tables of what `graupel compare --json` measured, and the file without its curves for bench/compare/.

    bench/comparison_table.py RESULT.json [--scenes] [--keep bench/compare/NAME.json]

Means over the scenes, the chaos floor (two MPM runs of one scene) in the first row; --scenes: a table a scene instead."""
import argparse
import json
import math
import statistics

COLUMNS = [("ms a frame", "frame_ms"), ("position MSE, 20 frames [m²]", "position_mse_20"),
           ("all frames [m²]", "position_mse_all"), ("Sinkhorn [m²]", "sinkhorn"), ("density error", "density_error"),
           ("occupancy IoU", "occupancy_iou"), ("clump sizes", "clump_size_error"), ("local density", "local_density_error")]


def number(value):
    """Two significant digits, as the floors allow no more."""
    if value is None or not math.isfinite(value):
        return ""
    text = f"{value:.2g}"
    return text.replace("e-0", "e-")


def short(model):
    return model.replace("models/", "").replace(".safetensors", "")


def mean(rows, key):
    values = [row[key] for row in rows if isinstance(row.get(key), (int, float)) and math.isfinite(row[key])]
    return statistics.fmean(values) if values else None


def table(rows, models):
    lines = ["| model | " + " | ".join(title for title, _ in COLUMNS) + " |", "|---" * (len(COLUMNS) + 1) + "|"]
    floors = [mean(rows, "floor_" + key) for _, key in COLUMNS]
    if any(value is not None for value in floors):
        lines.append("| chaos floor | " + " | ".join(number(value) for value in floors) + " |")
    for model in models:
        own = [row for row in rows if row["model"] == model]
        lines.append(f"| {short(model)} | " + " | ".join(number(mean(own, key)) for _, key in COLUMNS) + " |")
    return "\n".join(lines)


def compact(value):
    """Without curves and with five significant digits: enough for every figure that is quoted."""
    if isinstance(value, dict):
        return {k: compact(v) for k, v in value.items() if k not in ("curves", "floor_curves", "true_kinetic_energy", "step_search_s")}
    if isinstance(value, list):
        return [compact(v) for v in value]
    return float(f"{value:.5g}") if isinstance(value, float) else value


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("result")
    parser.add_argument("--scenes", action="store_true")
    parser.add_argument("--keep")
    options = parser.parse_args()
    result = json.load(open(options.result))
    rows = result["results"]
    models = list(dict.fromkeys(row["model"] for row in rows))
    if options.scenes:
        for scene in dict.fromkeys(row["scene"] for row in rows):
            print(f"\n**{scene}**\n\n" + table([row for row in rows if row["scene"] == scene], models))
    else:
        print(table(rows, models))
    if options.keep:
        kept = {key: compact(value) for key, value in result.items() if key not in ("mean", "geometric_mean")}
        lines = [json.dumps({k: v for k, v in row.items() if k != "materials"}) for row in kept.pop("results")]
        head = json.dumps(kept, indent=1)[:-2]
        with open(options.keep, "w") as out:  # a row of the table a line
            out.write(head + ',\n "results": [\n  ' + ",\n  ".join(lines) + "\n ]\n}\n")


if __name__ == "__main__":
    main()
