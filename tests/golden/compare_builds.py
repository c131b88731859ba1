#!/usr/bin/python3
"""Compares the working tree's programs with those of a reference commit: results bit by bit, interface and speeds.

Prints a row a case; exit code 0: none failed, 1: some did, 2: it could not begin. tests/golden/README.md says how to use it."""

import argparse
import json
import shutil
import sys
import tempfile
import time
from dataclasses import asdict
from fnmatch import fnmatch
from pathlib import Path

import cases_data
import cases_interface
import cases_mpm
import cases_rollouts
import cases_speed
import cases_training
from builds import Build, GoldenError, check_alike, configure_and_build, reference_source, settings_of, source_of
from case import Context, read_explained, run_case

REPOSITORY = Path(__file__).resolve().parents[2]
REFERENCE = "84e7df0"


def arguments(words):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--reference", default=REFERENCE, metavar="COMMIT", help="commit to compare with (default %(default)s)")
    parser.add_argument("--reference-source", type=Path, metavar="DIR", help="its source tree, where there is no git history")
    parser.add_argument("--reference-build", type=Path, metavar="DIR", help="a build of it that is there already")
    parser.add_argument("--build", type=Path, default=REPOSITORY / "build", metavar="DIR", help="build to check (default build/)")
    parser.add_argument("--cmake-args", default="", help="further arguments for cmake, in one text")
    parser.add_argument("--device", choices=["cpu", "cuda"], default="cpu", help="cuda: the cases of a GPU too")
    parser.add_argument("--only", action="append", metavar="PATTERN", help="cases with such names (repeatable): 'mpm/*', 'speed/*'")
    parser.add_argument("--skip", action="append", default=[], metavar="PATTERN", help="not these (repeatable)")
    parser.add_argument("--no-speeds", action="store_true", help="leave out speed/*")
    parser.add_argument("--rounds", type=int, default=3, help="measurements of a speed on each side (default %(default)s)")
    parser.add_argument("--explained", type=Path, default=Path(__file__).with_name("explained.json"), help="cases that may differ")
    parser.add_argument("--work", type=Path, help="folder for what runs leave (default: a temporary one)")
    parser.add_argument("--list", action="store_true", help="print the names of the cases")
    parser.add_argument("--json", metavar="OUT", help="write the rows as JSON to this file")
    return parser.parse_args(words)


def sides(options):
    """The two builds; makes the reference's where none is given."""
    if options.reference_build:
        folder = options.reference_build
        source = options.reference_source or source_of(folder)
    else:
        source = options.reference_source or reference_source(REPOSITORY, options.reference)
        folder = REPOSITORY / "build" / "golden" / (options.reference_source.resolve().name if options.reference_source
                                                    else options.reference) / "build"
        configure_and_build(source.resolve(), folder, settings_of(options.build), options.cmake_args.split())
    return Build("reference", folder, source), Build("new", options.build, REPOSITORY)


def chosen_cases(options, source):
    groups = [cases_mpm, cases_rollouts, cases_training, cases_data, cases_interface, cases_speed]
    cases = [case for group in groups for case in group.cases(source, options.device)]
    return [case for case in cases
            if (not options.only or any(fnmatch(case.name, pattern) for pattern in options.only))
            and not any(fnmatch(case.name, pattern) for pattern in options.skip)
            and not (options.no_speeds and case.name.startswith("speed/"))]


def compare(options):
    reference, new = sides(options)
    cases = chosen_cases(options, reference.source)
    if options.list:
        print("\n".join(case.name for case in cases))
        return 0
    if not cases:
        raise GoldenError("no case has such a name (see --list)")
    work = Path(options.work or tempfile.mkdtemp(prefix="graupel-golden-")).resolve()
    check_alike(reference, new)
    context = Context(reference, new, work, options.device, options.rounds, read_explained(options.explained, REPOSITORY))
    rows, start = [], time.time()
    print(f"reference {reference.folder}, new {new.folder}")
    try:
        for case in cases:
            for row in run_case(case, context):
                rows.append(row)
                print(f"{row.verdict:8}{row.name:52} {row.result}" + (f"  [tolerance {row.tolerance}]" if row.tolerance not in ("", "0") else ""),
                      flush=True)
                for line in row.details if row.verdict == "FAIL" else []:
                    print(f"            {line}", flush=True)
    finally:
        if not options.work:
            shutil.rmtree(work, ignore_errors=True)
        counts = {word: sum(row.verdict == word for row in rows) for word in ("pass", "FAIL", "skipped")}
        counts["explained"] = sum(row.verdict == "pass" and row.explained for row in rows)
        if options.json:
            Path(options.json).write_text(json.dumps({"reference": str(reference.folder), "new": str(new.folder), **counts,
                                                      "seconds": time.time() - start, "rows": [asdict(row) for row in rows]}, indent=1))
    print(f"{counts['pass']} passed, {counts['FAIL']} failed, {counts['skipped']} skipped in {time.time() - start:.0f} s; "
          f"{counts['explained']} of the passed differ as a decision explains")
    return 1 if counts["FAIL"] else 0


if __name__ == "__main__":
    try:
        sys.exit(compare(arguments(sys.argv[1:])))
    except GoldenError as error:
        print(f"compare_builds: {error}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        sys.exit(130)
