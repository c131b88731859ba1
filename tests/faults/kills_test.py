#!/usr/bin/python3
"""Kills at random times, two programs on one output, and narrow machines: nothing is lost or mixed.

    tests/faults/kills_test.py                        # the quick part: a few of each
    tests/faults/kills_test.py --all --json out.json  # 100 kills of simulate, 100 of generate, 30 of training
"""
import argparse
import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import faulty  # noqa: E402
import scenarios  # noqa: E402


def duration(scenario):
    begin = time.monotonic()
    scenario.count()
    return (time.monotonic() - begin) / 2


def kill_at_random(scenario, times, draw):
    """Kills, then goes on; a third is killed once more while going on."""
    whole = duration(scenario)
    counts, problems = {"kills": 0, "ended before": 0}, []
    kill = faulty.Fault("time", 0, "kill", False)
    while counts["kills"] < times:
        scenario.fresh()
        for again in range(1 + (draw.random() < 1 / 3)):
            with subprocess.Popen(scenario.words(), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                                  env=faulty.environment()) as child:
                time.sleep(draw.uniform(0, whole))
                child.kill()
            counts["kills" if child.returncode == -signal.SIGKILL else "ended before"] += 1
            if again == 0 and not scenario.may_be_killed_again:
                break
        done = faulty.Run(child.returncode, "", {}, 1, "")
        found = scenario.problems(done, kill, False)
        problems += [f"{scenario.name}, killed: {problem}" for problem in found]
    return counts, problems


def two_at_once(words, outputs, equal):
    """Two programs on one output. One at least succeeds, the other does too or says why not; outputs are whole."""
    children = [subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, env=faulty.environment(),
                                 text=True) for _ in range(2)]
    texts = [child.communicate(timeout=120)[0] for child in children]
    codes = sorted(child.returncode for child in children)
    problems = []
    if codes[0] != 0 or codes[1] not in (0, faulty_code):
        problems.append(f"exit codes {codes}: {[text.splitlines()[-1:] for text in texts]}")
    for child, text in zip(children, texts):
        if child.returncode != 0 and not scenarios.REMEDY.search(text):
            problems.append(f"no remedy: {text.splitlines()[-1:]}")
    problems += [f"'{name}' is missing or mixed" for name in outputs if not equal(name)]
    return codes, problems


faulty_code = scenarios.OUTPUT_FAILED


def both(scenario, draw, times):
    """two_at_once of a scenario."""
    scenario.count()
    counts, problems = {}, []
    for _ in range(times):
        scenario.fresh()
        outputs = [name for name in scenario.outputs if not scenarios.re.search(scenario.may_lie_about, name)]
        codes, found = two_at_once(scenario.words(), outputs, lambda name: os.path.exists(
            os.path.join(scenario.out, name)) and scenario.whole(name))
        left = {name for name in scenarios.files_in(scenario.out) - scenario.outputs
                if not scenarios.re.search(scenario.may_lie_about, name)}
        if left:
            found.append(f"leftover {sorted(left)}")
        key = "both succeed" if codes == [0, 0] else "one succeeds"
        counts[key] = counts.get(key, 0) + 1
        problems += [f"two at once, {scenario.name}: {problem}" for problem in found]
    return counts, problems


class Tmpfs:
    """A small file system; needs root."""

    def __init__(self, place, options):
        self.path = os.path.join(place, "tmpfs")
        os.makedirs(self.path, exist_ok=True)
        self.mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", options, "tmpfs", self.path], check=False,
                                      stderr=subprocess.DEVNULL).returncode == 0

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.mounted:
            subprocess.run(["umount", self.path], check=True)


def full_disk(scenario_list, place, options):
    """Every verb on a file system that is too small for its output: exit code 5, remedy, nothing cut."""
    counts, problems = {"runs": 0}, []
    for scenario in scenario_list:
        scenario.count()
        with Tmpfs(place, options) as disk:
            if not disk.mounted:
                return None, []
            scenario.out = os.path.join(disk.path, "out")
            scenario.fresh()
            code, text = faulty.call(scenario.words())
            counts["runs"] += 1
            done = faulty.Run(code, text, {}, 1, "")
            fault = faulty.Fault("write", 0, "ENOSPC", True)
            scenario.go_on = lambda *_: []
            found = scenario.problems(done, fault, False)
            if code == 0:
                found.append("it fits")
            problems += [f"{options}, {scenario.name}: {problem}" for problem in found]
    return counts, problems


def narrow_machines(scenario, place):
    """The same bytes without a home, in other locales, with 1 GB of memory."""
    scenario.count()
    counts, problems = {}, []

    def attempt(name, extra=None, prepare=None):
        scenario.fresh()
        code, text = faulty.call(scenario.words(), extra, prepare=prepare)
        counts[name] = 1
        if code != 0:
            problems.append(f"{scenario.name}, {name}: {code}: {text.splitlines()[-1:]}")
        else:
            problems.extend(f"{scenario.name}, {name}: '{file}' differs" for file in scenario.outputs
                            if not scenarios.re.search(scenario.may_lie_about, file) and not scenario.whole(file))

    attempt("no HOME", {"HOME": None, "TMPDIR": None, "USER": None})
    attempt("TZ and LANG that are not there", {"LC_ALL": "xx_YY.UTF-8", "TZ": "Nowhere/None"})
    gigabyte = 1 << 30
    attempt("1 GB of memory", prepare=lambda: resource.setrlimit(resource.RLIMIT_AS, (gigabyte, gigabyte)))
    made = os.path.join(place, "locale")
    os.makedirs(made, exist_ok=True)
    for name in ("de_DE", "tr_TR"):
        target = os.path.join(made, name + ".UTF-8")
        if not os.path.exists(target) and (shutil.which("localedef") is None or subprocess.run(
                ["localedef", "-i", name, "-f", "UTF-8", target], check=False, capture_output=True).returncode > 1):
            continue
        attempt(f"locale {name}", {"LOCPATH": made, "LC_ALL": name + ".UTF-8", "LANG": name + ".UTF-8"})
    return counts, problems


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--all", action="store_true")
    parser.add_argument("--seed", default="1")
    parser.add_argument("--json", help="file that takes the counts")
    options = parser.parse_args()
    simulated, trained, pairs = (100, 30, 5) if options.all else (3, 1, 1)
    draw = random.Random(options.seed)
    training = os.path.exists(faulty.TRAIN)
    results, problems = {}, []

    def note(name, outcome):
        counts, found = outcome
        problems.extend(found)
        if counts is None:
            print(f"skipped {name}: mounting a file system needs root")
            return
        results[name] = {**counts, "problems": len(found)}
        print(name, results[name], *found, sep="\n    ", flush=True)

    with tempfile.TemporaryDirectory(dir="/dev/shm" if os.access("/dev/shm", os.W_OK) else None) as place:
        scenarios.make_sources(place, training)
        state = ["--save-state", "OUT/run.state", "--save-every", "6"]

        def simulate(name="simulate", saved=()):
            return scenarios.Simulate(place, saved, name)

        note("SIGKILL, simulate", kill_at_random(simulate(), simulated // 2 + 1, draw))
        note("SIGKILL, simulate --save-state",
             kill_at_random(simulate("simulate --save-state", state), simulated // 2 + 1, draw))
        note("SIGKILL, generate", kill_at_random(scenarios.Generate(place), simulated, draw))
        if training:
            note("SIGKILL, training", kill_at_random(scenarios.Train(place), trained, draw))
        shared = [simulate(), scenarios.Generate(place), scenarios.Export(place, "vtp"),
                  scenarios.Export(place, "usda"), scenarios.Export(place, "vdb")]
        for scenario in shared:
            note(f"two at once, {scenario.name}", both(scenario, draw, pairs))
        small = [simulate(), scenarios.Generate(place), scenarios.Export(place, "vtp"),
                 scenarios.Export(place, "vdb"), scenarios.Export(place, "usda")]
        note("disk of 16 kB", full_disk(small, place, "size=16k"))
        note("no inodes", full_disk(small, place, "nr_inodes=3"))
        for scenario in [simulate(), scenarios.Generate(place), scenarios.Export(place, "usda")]:
            note(f"narrow machines, {scenario.name}", narrow_machines(scenario, place))
    if options.json:
        with open(options.json, "w", encoding="utf-8") as file:
            json.dump(results, file, indent=1)
    print(f"{len(problems)} problems")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
