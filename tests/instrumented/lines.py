#!/usr/bin/env python3
"""The share of lines that the tests of a build with counts have run, by folder.

    tests/instrumented/lines.py build-coverage [--output bench/coverage.txt] [--commit HASH]

Reads gcov's JSON for every object file. A line that several object files hold (headers, templates, kernels compiled for
several instruction sets) counts once, and as run where any of them ran it. Tests, benchmarks and examples are not counted.
"""
import argparse
import collections
import concurrent.futures
import json
import os
import pathlib
import subprocess

ROOT = pathlib.Path(__file__).resolve().parents[2]
FOLDERS = ["core", "io", "nn", "sparsegrid", "mpm", "graph", "rom", "hybrid", "compare", "validation", "train", "experiments",
           "library", "apps"]


def lines_of(notes):
    """(file, line) -> whether it ran, for one object file; nothing ran where no program with it was started."""
    done = subprocess.run(["gcov", "--json-format", "--stdout", str(notes)], capture_output=True, cwd=notes.parent)
    found = {}
    for text in done.stdout.splitlines():
        for entry in json.loads(text)["files"]:
            path = os.path.normpath(os.path.join(ROOT, entry["file"]))
            name = os.path.relpath(path, ROOT)
            if name.split("/")[0] not in FOLDERS:
                continue
            for line in entry["lines"]:
                key = (name, line["line_number"])
                found[key] = found.get(key, False) or line["count"] > 0
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build")
    parser.add_argument("--output")
    parser.add_argument("--commit", default="")
    parser.add_argument("--least", action="store_true", help="also the twenty files with most lines that no test runs")
    args = parser.parse_args()
    build = pathlib.Path(args.build).resolve()
    ran = {}
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        for found in pool.map(lines_of, sorted(build.rglob("*.gcno"))):
            for key, value in found.items():
                ran[key] = ran.get(key, False) or value
    commit = args.commit or subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True,
                                           text=True).stdout.strip()
    total, covered = collections.Counter(), collections.Counter()
    missing = collections.Counter()
    for (name, _), value in ran.items():
        for key in (name.split("/")[0], "all"):
            total[key] += 1
            covered[key] += value
        missing[name] += not value
    rows = [f"commit  {commit}", "command ./run coverage (without a GPU: what only a GPU runs does not count)", "",
            f"{'folder':<12} {'lines':>7} {'run':>7} {'%':>6}"]
    for folder in [f for f in FOLDERS if total[f]] + ["all"]:
        rows.append(f"{folder:<12} {total[folder]:>7} {covered[folder]:>7} {100 * covered[folder] / max(1, total[folder]):>6.1f}")
    if args.least:
        rows += [""] + [f"{count:>5} not run: {name}" for name, count in missing.most_common(20)]
    text = "\n".join(rows) + "\n"
    print(text)
    if args.output:
        pathlib.Path(args.output).write_text(text)


if __name__ == "__main__":
    main()
