#!/usr/bin/python3
"""Calls of the system that fail, one at a time: outputs stay whole, flushed frames are kept, the message says what to do.

    tests/faults/faults_test.py                       # the quick part: a few faults of each kind
    tests/faults/faults_test.py --all --json out.json # every call, or a sample of many; minutes
    tests/faults/faults_test.py --all --only export   # scenarios whose name contains this

Needs build/graupel, build/graupel-train (training only) and the library of inject.cpp.
"""
import argparse
import collections
import json
import os
import sys
import tempfile
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import faulty  # noqa: E402
import scenarios  # noqa: E402

# Faults of each variant at most: of system calls and of allocations.
QUICK, ALL = (1, 1), (60, 60)


def try_scenario(scenario, most, kinds, seed, out):
    """Counts by kind and variant; prints what is wrong."""
    calls = scenario.count()
    table = collections.OrderedDict()
    for kind in faulty.KINDS:
        if kind not in kinds:
            continue
        for fault in sorted(faulty.faults_of(kind, calls, most[kind == "allocate"], f"{seed} {scenario.name}"),
                            key=lambda one: one.error != "kill"):
            old = bool(scenario.old) and fault.at % 2 == 1
            scenario.fresh(old)
            done = faulty.run(scenario.words(), scenario.out, fault)
            row = table.setdefault(f"{fault.kind} {fault.error}{' lasting' if fault.lasting else ''}"
                                   f"{' ' + fault.callers if kind == 'allocate' else ''}", collections.Counter())
            row["runs"] += 1
            if done.failed == 0:
                row["not reached"] += 1  # threads that take turns differently
                continue
            row["success" if done.code == scenario.expected_code else "signal" if done.code < 0 else
                f"exit {done.code}"] += 1
            problems = scenario.problems(done, fault, old)
            if problems and done.code < 0 and "libgomp" in done.text:
                row["abort in an OpenMP region"] += 1
                print(f"{scenario.name}: {faulty.describe(fault)}: abort in an OpenMP region", file=out)
                continue
            row["problems"] += bool(problems)
            for problem in problems:
                print(f"{scenario.name}: {faulty.describe(fault)} ({os.path.basename(done.first)}): {problem}",
                      file=out, flush=True)
                if done.code < 0 and fault.error != "kill":
                    print("    " + "\n    ".join(done.text.splitlines()[-25:]), file=out, flush=True)
    return {"calls": calls["any"], "of_the_program": calls["program"]["allocate"], "faults": table}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--all", action="store_true", help="every call, or a sample of many")
    parser.add_argument("--only", default="", help="scenarios whose name contains this")
    parser.add_argument("--kinds", help="of calls; default all, in the quick part write, sync and rename")
    parser.add_argument("--most", type=int, help="faults of each variant at most")
    parser.add_argument("--seed", default="1")
    parser.add_argument("--json", help="file that takes the counts")
    options = parser.parse_args()
    most = (options.most, options.most) if options.most else ALL if options.all else QUICK
    kinds = (options.kinds or (",".join(faulty.KINDS) if options.all else "write,sync,rename")).split(",")
    for kind in set(kinds) - set(faulty.KINDS):
        parser.error(f"--kinds: '{kind}' (allowed: {', '.join(faulty.KINDS)})")
    training = os.path.exists(faulty.TRAIN)
    results, failed = {}, 0
    with tempfile.TemporaryDirectory(dir="/dev/shm" if os.access("/dev/shm", os.W_OK) else None) as place:
        scenarios.make_sources(place, training)
        for scenario in scenarios.scenarios(place, training):
            if options.only not in scenario.name:
                continue
            start = time.monotonic()
            results[scenario.name] = try_scenario(scenario, most, kinds, options.seed, sys.stdout)
            total = sum(results[scenario.name]["faults"].values(), collections.Counter())
            failed += total["problems"]
            print(f"{scenario.name}: {dict(total)}, {time.monotonic() - start:.0f} s", flush=True)
    if options.json:
        with open(options.json, "w", encoding="utf-8") as file:
            json.dump(results, file, indent=1)
    print(f"{failed} faults with problems")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
