#!/usr/bin/python3
"""Compares this tree's build with a reference commit's: results bit by bit, interfaces, speeds (README.md)."""
import argparse
import json
import os
import pathlib
import shlex
import sys
import tempfile
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
from builds import ROOT, Build, reference_build  # noqa: E402
from comparison import compare_files  # noqa: E402
from interface import interface_rows  # noqa: E402
from mpm_cases import mpm_cases  # noqa: E402
from rollout_cases import rollout_cases  # noqa: E402
from speeds import speed_rows  # noqa: E402
from training_cases import training_cases  # noqa: E402

GROUPS = ["mpm", "rollout", "reduced", "training", "interface", "speed"]
LARGEST_TOLERANCE = {"f64": 1e-9, "f32": 1e-5}


def read_explained():
    explained = json.loads((pathlib.Path(__file__).parent / "explained.json").read_text())
    for name, entry in explained.items():
        if "decision" not in entry or not (ROOT / "docs" / "decisions" / entry["decision"]).exists():
            sys.exit(f"golden: explained.json, '{name}': 'decision' must name a file of docs/decisions")
        limit = LARGEST_TOLERANCE["f64" if "f64" in name else "f32"]
        if entry.get("tolerance", 0) > limit and "field_tolerance" not in entry:
            sys.exit(f"golden: explained.json, '{name}': tolerance {entry['tolerance']} (allowed: at most {limit})")
    return explained


def run_both(case, builds, folder):
    """Runs the case in each build; returns an error text or ''."""
    for label, build in builds:
        place = folder / label
        place.mkdir(parents=True)
        if case.prepare:
            case.prepare(place)
        for words in case.commands(place):
            done = build.run(words, case.environment)
            if done.returncode:
                return f"{label}: exit {done.returncode}: {(done.stderr or done.stdout).strip()[-160:]}"
    return ""


def compare_case(case, builds, explained):
    """(passed, text): the largest difference over all outputs beside its tolerance."""
    with tempfile.TemporaryDirectory(prefix="golden-") as folder:
        folder = pathlib.Path(folder)
        problem = run_both(case, builds, folder)
        if problem:
            return False, problem
        tolerance, worst, place = explained.get(case.name, {}).get("tolerance", 0), 0.0, ""
        skipped = explained.get(case.name, {}).get("except", [])
        for output in case.outputs:
            found = compare_files(folder / "reference" / output, folder / "new" / output)
            if found.broken:
                return False, f"{output}: {found.broken[0]}"
            if found.largest > worst and not any(word in found.place for word in skipped):
                worst, place = found.largest, f"{output} {found.place}"
        if worst == 0:
            return True, "bit-equal"
        return worst <= tolerance, f"max difference {worst:.3g} at {place} (tolerance {tolerance:g})"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--reference", default="84e7df0", help="commit to compare with")
    parser.add_argument("--reference-build", help="build folder of the reference, instead of building it")
    parser.add_argument("--reference-source", help="sources of the reference, where there is no git history")
    parser.add_argument("--build", default=str(ROOT / "build"), help="build folder of this tree")
    parser.add_argument("--cmake-args", default="", help="arguments for the reference's cmake")
    parser.add_argument("--device", default="cpu", choices=["cpu", "cuda"])
    parser.add_argument("--only", default=",".join(GROUPS), help="groups: " + ", ".join(GROUPS))
    parser.add_argument("--filter", default="", help="only cases whose name holds this text")
    parser.add_argument("--rounds", type=int, default=3, help="of each speed, each build in turn")
    parser.add_argument("--json", help="write all rows to this file")
    parser.add_argument("--list", action="store_true", help="name the cases and stop")
    options = parser.parse_args()
    groups = options.only.split(",")
    for group in groups:
        if group not in GROUPS:
            parser.error(f"unknown group '{group}' (allowed: {', '.join(GROUPS)})")

    cases = mpm_cases(options.device) + rollout_cases(options.device) + training_cases(options.device)
    cases = [case for case in cases if case.group in groups and options.filter in case.name]
    if options.list:
        print("\n".join(case.name for case in cases))
        return 0
    explained = read_explained()
    reference = reference_build(options.reference, options.reference_build, options.reference_source,
                                shlex.split(options.cmake_args), os.cpu_count())
    new = Build(options.build, ROOT)
    rows = []

    def report(name, passed, text):
        rows.append({"name": name, "passed": bool(passed), "result": text})
        print(f"{'ok  ' if passed else 'FAIL'}  {name}: {text}", flush=True)

    begin = time.time()
    for case in cases:
        report(case.name, *compare_case(case, [("reference", reference), ("new", new)], explained))
    if "interface" in groups:
        for name, problem in interface_rows(reference, new, explained):
            report(name, not problem, problem or "kept")
    if "speed" in groups:
        for name, ratio, spread, limit, problem in speed_rows(reference, new, options.device, options.rounds, explained,
                                                              options.filter):
            report(f"speed {name}", not problem,
                   problem if ratio != ratio else f"time {ratio:.3f} of the reference's (its spread {spread:.3f}, limit {limit:.3f})")
    failed = sum(not row["passed"] for row in rows)
    print(f"{time.time() - begin:.0f} s\n{len(rows) - failed} passed, {failed} failed")
    if options.json:
        text = json.dumps({"reference": options.reference, "device": options.device, "rows": rows}, indent=1)
        pathlib.Path(options.json).write_text(text + "\n")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
