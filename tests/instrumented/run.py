#!/usr/bin/env python3
"""Runs the test programs of a build with sanitizers, or with counts of lines, and counts what the sanitizers report.

    tests/instrumented/run.py build-sanitize-address [--jobs 2] [--limit 1800] [--output bench/sanitizers_address.txt]

Each program runs in parts (GoogleTest's shards), so that many cores share it. left_out.txt names tests that are not
run, with the reason. The result names, for every report, its
kind and the first place of this tree in its stack; reports of the same kind and place count once. Exit code 1 where
there is a report, or a test that fails or runs out of time.
"""
import argparse
import collections
import concurrent.futures
import os
import pathlib
import re
import resource
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
HERE = pathlib.Path(__file__).resolve().parent

# A report's first line, for each sanitizer.
FIRST_LINE = re.compile(
    r"ERROR: AddressSanitizer: (?P<address>[\w-]+)|(?P<leak>ERROR: LeakSanitizer)|"
    r"WARNING: ThreadSanitizer: (?P<thread>[^(\n]+)|FATAL: ThreadSanitizer(?P<fatal>.*)|"
    r"(?P<where>\S+:\d+):\d+: runtime error: (?P<undefined>.*)")
FRAME = re.compile(r"^\s+#\d+ .*?(?P<file>/\S+?):(?P<line>\d+)", re.M)


def options(kind, logs):
    """Environment of the runs: reports go to files in `logs`, a run goes on after one."""
    common = f"log_path={logs}/san:exitcode=66:suppressions={HERE}"
    env = dict(os.environ, GTEST_COLOR="no", GOMP_SPINCOUNT="0")
    env.setdefault("OMP_NUM_THREADS", "4")
    if kind == "address":
        # Containers filled by libraries that were compiled without it look overrun.
        env["ASAN_OPTIONS"] = f"{common}/address.supp:halt_on_error=0:detect_container_overflow=0:allocator_may_return_null=1"
        env["LSAN_OPTIONS"] = f"suppressions={HERE}/leaks.supp:print_suppressions=0"
        env["UBSAN_OPTIONS"] = f"{common}/undefined.supp:print_stacktrace=1"
    elif kind == "thread":
        env["TSAN_OPTIONS"] = f"{common}/thread.supp:halt_on_error=0:history_size=4:allocator_may_return_null=1"
    return env


def left_out():
    """The GoogleTest filter of all tests but those of left_out.txt."""
    lines = (line.split("#")[0].split() for line in (HERE / "left_out.txt").read_text().splitlines())
    return "-" + ":".join(words[0] for words in lines if words)


def large_stack():
    """std::regex recurses for every character, and frames are larger with a sanitizer. Unlimited is not taken by all."""
    hard = resource.getrlimit(resource.RLIMIT_STACK)[1]
    resource.setrlimit(resource.RLIMIT_STACK, (256 << 20 if hard < 0 else min(hard, 256 << 20), hard))


def reports(text):
    """(kind, place) of every report in a log of a sanitizer."""
    found = []
    starts = list(FIRST_LINE.finditer(text))
    for start, end in zip(starts, starts[1:] + [None]):
        body = text[start.end():end.start() if end else None]
        place = next((f"{os.path.relpath(m['file'], ROOT)}:{m['line']}" for m in FRAME.finditer(body)
                      if m["file"].startswith(str(ROOT) + "/")), "outside this tree")
        if start["where"]:
            place = os.path.relpath(start["where"], ROOT) if start["where"].startswith("/") else start["where"]
        kind = (start["address"] or start["thread"] or start["undefined"] or ("leak" if start["leak"] else "fatal"))
        if start["leak"]:  # one report lists all leaks of a process
            for leak in body.split("leak of ")[1:]:
                place = next((f"{os.path.relpath(m['file'], ROOT)}:{m['line']}" for m in FRAME.finditer(leak)
                              if m["file"].startswith(str(ROOT) + "/")), "outside this tree")
                found.append(("leak", place, leak))
            continue
        found.append((re.sub(r"0x[0-9a-f]+|-?\d[\d.e+]*", "N", kind.strip()), place, body))
    return found


def run_part(program, part, parts, kind, limit):
    """One shard: its tests, its reports, its time."""
    with tempfile.TemporaryDirectory(prefix="graupel_san_") as logs:
        env = dict(options(kind, logs), GTEST_TOTAL_SHARDS=str(parts), GTEST_SHARD_INDEX=str(part))
        begin = time.time()
        out = pathlib.Path(logs) / "stdout"
        with open(out, "wb") as stream:
            try:
                status = subprocess.run([program, f"--gtest_filter={left_out()}"], env=env, preexec_fn=large_stack,
                                        stdout=stream, stderr=subprocess.STDOUT, timeout=limit, cwd=ROOT).returncode
            except subprocess.TimeoutExpired:
                status = "time"
        text = "".join(p.read_text(errors="replace") for p in sorted(pathlib.Path(logs).glob("san.*")))
        output = out.read_text(errors="replace")
        started = re.findall(r"^\[ RUN      \] (.*)$", output, re.M)
        failed = re.findall(r"^\[  FAILED  \] ([\w./]+)(?:, where.*)? \(\d+ ms\)$", output, re.M)
        passed = len(re.findall(r"^\[       OK \] ", output, re.M))
        skipped = len(re.findall(r"^\[  SKIPPED \] .*ms\)$", output, re.M))
        unfinished = []
        if len(started) > passed + skipped + len(failed):
            unfinished = [started[-1]]
        messages = {}
        for name in failed:
            body = output[output.index(f"[ RUN      ] {name}"):output.index(f"[  FAILED  ] {name}")]
            messages[name] = body.strip().splitlines()[1:7]
        return dict(program=os.path.basename(program), part=part, status=status, seconds=time.time() - begin,
                    passed=passed, failed=failed, skipped=skipped, unfinished=unfinished, messages=messages,
                    reports=reports(text), tail=output[-2000:])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--limit", type=int, default=1800, help="seconds for a part of a program")
    parser.add_argument("--total", type=int, default=10 ** 6, help="seconds for all; what has not begun then is counted")
    parser.add_argument("--parts", type=int, default=0, help="parts of a program (0: one a job)")
    parser.add_argument("--only", default="*", help="test programs, such as 'mpm*'")
    parser.add_argument("--commit", default="")
    parser.add_argument("--output")
    parser.add_argument("--log", help="all reports, whole")
    args = parser.parse_args()
    build = pathlib.Path(args.build).resolve()
    cache = (build / "CMakeCache.txt").read_text()
    kind = re.search(r"^GRAUPEL_SANITIZE:\w+=(\w+)$", cache, re.M)
    if not kind:
        sys.exit(f"{build} was built without sanitizers; 'cmake --preset sanitize-address' makes a build with them")
    kind = kind[1]
    programs = sorted(str(p) for p in build.glob(args.only + "_test") if os.access(p, os.X_OK))
    parts = args.parts or max(1, args.jobs)
    begin = time.time()
    results, not_begun = [], []

    def work(job):
        left = args.total - (time.time() - begin)
        if left < 5:
            return not_begun.append(job)
        result = run_part(*job, parts, kind, min(args.limit, left))
        results.append(result)
        print(f"{result['program']} {result['part'] + 1}/{parts}: {result['passed']} passed, {len(result['failed'])} failed, "
              f"{len(result['reports'])} reports, {result['seconds']:.0f} s, status {result['status']}", flush=True)

    with concurrent.futures.ThreadPoolExecutor(args.jobs) as pool:
        list(pool.map(work, [(program, part) for part in range(parts) for program in programs]))

    commit = args.commit or subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True,
                                           text=True).stdout.strip()
    lines = [f"commit  {commit}", "command ./run " + (kind if kind == "coverage" else f"sanitize {kind}"),
             f"machine {os.cpu_count()} logical processors, {args.jobs} parts at once, {time.time() - begin:.0f} s", ""]
    by_program = collections.defaultdict(list)
    for result in results:
        by_program[result["program"]].append(result)
    bad = len(not_begun)
    for program, group in sorted(by_program.items()):
        failed = [name for r in group for name in r["failed"]]
        unfinished = [name for r in group for name in r["unfinished"]]
        bad += len(failed) + len(unfinished)
        lines.append(f"{program}: {sum(r['passed'] for r in group)} passed, {len(failed)} failed, {len(unfinished)} unfinished, "
                     f"{sum(r['skipped'] for r in group)} skipped, {sum(len(r['reports']) for r in group)} reports, "
                     f"{sum(r['seconds'] for r in group):.0f} s")
        lines += [f"    failed: {name}" for name in failed]
        lines += [f"    unfinished (crash or out of time): {name}" for name in unfinished]
    if not_begun:
        lines.append(f"{len(not_begun)} parts were not begun: out of time")
    kinds = collections.Counter((kind_, place) for r in results for kind_, place, _ in r["reports"])
    lines.append("")
    lines += [f"report: {what} at {place} ({count} times)" for (what, place), count in sorted(kinds.items())]
    lines += ["", f"{sum(r['passed'] for r in results)} passed, {bad} failed, {len(kinds)} different reports"]
    text = "\n".join(lines) + "\n"
    print(text)
    if args.output:
        pathlib.Path(args.output).write_text(text)
    if args.log:
        with open(args.log, "w") as log:
            seen = collections.Counter()
            for result in results:
                for name, message in result["messages"].items():
                    log.write(f"=== failed {result['program']} {name}\n" + "\n".join(message) + "\n")
                if result["unfinished"]:
                    log.write(f"=== unfinished {result['unfinished']} status {result['status']}\n{result['tail']}\n")
                for what, place, body in result["reports"]:
                    seen[(what, place)] += 1
                    if seen[(what, place)] <= 2:
                        log.write(f"=== {what} at {place} ({result['program']})\n{body[:6000]}\n")
    sys.exit(1 if bad or kinds else 0)


if __name__ == "__main__":
    main()
