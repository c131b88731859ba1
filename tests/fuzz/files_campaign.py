#!/usr/bin/env python3
"""Damaged files through the program: mutates good HDF5 and VDB files in their parts and counts how the verbs end.

    tests/fuzz/files_campaign.py [--build BUILD] [--count N] [--seed S] [--keep FOLDER] [--json FILE] [--readers]

Good files are made by the program first: a run with forces and fields, one with an emitter, a data set, obstacles.
Each mutant goes through one verb. A run is bad that ends by a signal, takes more than --seconds of the processor (or 20
times as long without an end) or more memory than --megabytes, or ends with exit code 1 (a text of the standard
library). FOLDER takes the mutants of bad runs. Exit code 1 where there was one.

With --readers, 500 mutants at a time go through the checkers and readers in one process, `graupel_read_files` (build
it first), which takes a tenth of the time or less. SIGTERM ends the campaign with the report of what was done.
"""
import argparse
import collections
import json
import math
import os
import random
import resource
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import threading

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
EXTREME = [0, 1, 2, 7, 8, 15, 16, 127, 128, 255, 256, 4095, 65535, 1 << 31, (1 << 32) - 1, 1 << 32, 1 << 40, 1 << 62,
           1 << 63, (1 << 64) - 16, (1 << 64) - 8, (1 << 64) - 1]
SCENE = """{ "name": "small", "domain": { "dx": 0.04 }, "frames": 12,
  "materials": { "water": { "preset": "taichi_water" } },
  "sources": [{ "shape": "box", "size": [0.15, 0.15, 0.15], "position": [0.5, 0.5, 0.5], "material": "water" }],
  "obstacles": [%s]%s }"""
SPHERE = '{ "shape": "sphere", "radius": 0.1, "position": [0.5, 0.25, 0.5] }'
BATCH = 500  # mutants that are written before they are read
EMITTER = """, "emitters": [{ "shape": "box", "size": [0.1, 0.1, 0.1], "position": [0.3, 0.7, 0.3], "material": "water",
  "velocity": [0, -1, 0], "end_time": 0.1, "rate": 300 }]"""


def limit(seconds):
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_CPU, (math.ceil(seconds), math.ceil(seconds) + 1))
    resource.setrlimit(resource.RLIMIT_AS, (24 << 30, 24 << 30))


def run(program, words, cwd, seconds):
    """Exit code (negative: signal; "time": beyond the limit), output, seconds of the processor and largest memory in MB
    of it and of its children that have ended."""
    process = subprocess.Popen([program, *words], cwd=cwd, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                               preexec_fn=lambda: limit(seconds))
    late = threading.Timer(20 * seconds, process.kill)
    late.start()
    output = process.stdout.read().decode(errors="replace")
    _, status, usage = os.wait4(process.pid, 0)
    late.cancel()
    process.stdout.close()
    took = usage.ru_utime + usage.ru_stime
    code = os.waitstatus_to_exitcode(status)
    process.returncode = code
    return "time" if code in (-signal.SIGKILL, -signal.SIGXCPU) else code, output, took, usage.ru_maxrss / 1024


def hdf5_parts(content):
    """Byte ranges by part: superblock, index of chunks, global heap, raw chunks, other metadata."""
    marks = bytearray(b"m" * len(content))
    marks[:96] = b"s" * min(96, len(content))
    at = content.find(b"GCOL")
    while at >= 0:
        size = min(struct.unpack_from("<Q", content, at + 8)[0], 1 << 20)
        marks[at:at + size] = b"h" * len(marks[at:at + size])
        at = content.find(b"GCOL", at + 4)
    at = content.find(b"TREE\x01")
    while at >= 0:
        level, used = content[at + 5], struct.unpack_from("<H", content, at + 6)[0]
        for dimensions in (2, 3, 4):  # one more than the dataset's
            key = 8 + 8 * dimensions
            first = at + 24
            entries = [struct.unpack_from("<I", content, first + i * (key + 8))[0] for i in range(used)
                       if first + (i + 1) * (key + 8) <= len(content)]
            starts = [struct.unpack_from("<Q", content, first + i * (key + 8) + key)[0] for i in range(len(entries))]
            if entries and level == 0 and all(0 < s < len(content) and 0 < n < 1 << 24 and s + n <= len(content)
                                              for s, n in zip(starts, entries)):
                marks[at:first + used * (key + 8) + key] = b"i" * (24 + used * (key + 8) + key)
                for start, size in zip(starts, entries):
                    marks[start:start + size] = b"r" * size
                break
        at = content.find(b"TREE\x01", at + 4)
    names = {"s": "superblock", "h": "global heap", "i": "chunk index", "r": "chunks", "m": "headers"}
    return {name: places for letter, name in names.items()
            if (places := [i for i, mark in enumerate(marks[:len(content)]) if mark == ord(letter)])}


def vdb_parts(content):
    """A file of OpenVDB has its texts first, then topology and values of each grid."""
    first = min(1200, len(content) // 3)
    return {"header and metadata": range(first), "topology and values": range(first, len(content))}


def mutate(content, places, draw):
    """The content with one to four changes that begin in these places."""
    changed = bytearray(content)
    for _ in range(draw.choice((1, 1, 1, 2, 4))):
        at = draw.choice(places)
        kind = draw.randrange(8)
        if kind < 2:
            changed[at] ^= 1 << draw.randrange(8)
        elif kind < 3:
            changed[at] = draw.randrange(256)
        elif kind < 6:
            width = draw.choice((1, 2, 4, 8))
            value = draw.choice(EXTREME) & ((1 << 8 * width) - 1)
            changed[at:at + width] = value.to_bytes(width, "little")[:len(changed) - at]
        elif kind < 7:
            size = draw.choice((8, 64, 512))
            source = draw.randrange(max(1, len(content) - size))
            changed[at:at + size] = content[source:source + size][:len(changed) - at]
        else:
            size = draw.choice((4, 16, 256))
            changed[at:at + size] = bytes(len(changed[at:at + size]))
        if len(changed) != len(content):
            changed = changed[:len(content)]
    return bytes(changed[:at]) if draw.random() < 0.04 and at > 8 else bytes(changed)


class Readers:
    """A process of graupel_read_files."""

    def __init__(self, options):
        self.seconds = options.seconds
        program = os.path.join(os.path.abspath(options.build), "graupel_read_files")
        self.process = subprocess.Popen(
            [program, str(options.seconds)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
            text=True, errors="replace",
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (24 << 30, 24 << 30)))

    def read(self, lines):
        """How each ended, as run() says it, until one ends the process."""
        self.process.stdin.write("".join(lines))
        self.process.stdin.flush()
        for _ in lines:
            late = threading.Timer(20 * self.seconds, self.process.kill)
            late.daemon = True
            late.start()
            answer = self.process.stdout.readline()
            late.cancel()
            if not answer:
                code = self.process.wait()
                yield "time" if code in (-signal.SIGKILL, -signal.SIGXCPU) else code, "", 0, 0
                return
            code, took, memory, message = answer.split(" ", 3)
            yield int(code), message, float(took), float(memory)

    def end(self):
        self.process.kill()  # all is answered, or no longer wanted
        self.process.stdin.close()
        self.process.wait()
        self.process.stdout.close()


class Campaign:
    """Good files, verbs and counts."""

    def __init__(self, options):
        self.options = options
        self.program = os.path.join(os.path.abspath(options.build), "graupel")
        self.folder = tempfile.mkdtemp(prefix="graupel-campaign-", dir="/dev/shm" if options.readers else None)
        self.weights = os.path.join(ROOT, "models", "hgn.safetensors")
        self.counts = collections.Counter()
        self.bad = []
        self.slowest, self.largest = 0.0, 0.0

    def make(self, *words):
        code, output, _, _ = run(self.program, words, self.folder, 300)
        if code != 0:
            sys.exit(f"files_campaign: '{' '.join(words)}' ended with {code}\n{output[-2000:]}")

    def write(self, name, text):
        with open(os.path.join(self.folder, name), "w", encoding="utf-8") as file:
            file.write(text)

    def good_files(self):
        """Name, content and parts of each."""
        self.write("plain.json", SCENE % (SPHERE, ""))
        self.write("inflow.json", SCENE % (SPHERE, EMITTER))
        self.write("vdb.json", SCENE % ('{ "shape": "vdb", "file": "mutant.vdb" }', ""))
        self.make("simulate", "plain.json", "-o", "run.h5", "--forces", "--fields", "stress,affine", "--write-obstacles",
                  "body.vdb", "--threads", "1")
        self.make("simulate", "inflow.json", "-o", "inflow.h5", "--threads", "1")
        self.make("export", "run.h5", "--surface", "--format", "vdb", "--frames", "3", "-o", "surface")
        surface = sorted(os.listdir(os.path.join(self.folder, "surface")))[0]
        files = []
        for name, parts in (("run.h5", hdf5_parts), ("inflow.h5", hdf5_parts), ("body.vdb", vdb_parts),
                            (os.path.join("surface", surface), vdb_parts)):
            with open(os.path.join(self.folder, name), "rb") as file:
                content = file.read()
            files.append((os.path.basename(name), content, parts(content)))
        return files

    def verbs(self, ending):
        if ending == ".vdb":
            return {"inspect": ["inspect", "mutant.vdb"],
                    "simulate": ["simulate", "vdb.json", "-o", "out.h5", "--frames", "1"]}
        return {"inspect": ["inspect", "mutant.h5"], "recover": ["inspect", "--recover", "part.h5"],
                "export": ["export", "mutant.h5", "--format", "vtp", "-o", "out"],
                "rollout": ["rollout", self.weights, "mutant.h5", "--start", "truth:6", "--frames", "8", "-o", "out.h5"]}

    def clean(self):
        for name in ("out.h5", "out", "part.h5", "part.h5.part", "mutant.h5", "mutant.vdb"):
            path = os.path.join(self.folder, name)
            if os.path.isdir(path):
                shutil.rmtree(path)
            elif os.path.exists(path):
                os.remove(path)

    def outcome(self, code, output, memory):
        if code == "time" or (isinstance(code, int) and code < 0):
            return f"BAD: {code if code == 'time' else f'signal {-code}'}"
        if code == 1:
            return "BAD: exit code 1"
        if memory > self.options.megabytes:
            return "BAD: memory"
        for text, name in (("crashed on it", "library crashed in the check"),
                           ("does not come to an end", "library looped in the check"),
                           ("MiB of memory for it", "library took memory in the check")):
            if text in output:
                return name
        return "success" if code == 0 else f"refused, exit code {code}"

    def mutant(self, number, files):
        """Name of the good file, part, content, and what draws on."""
        draw = random.Random(self.options.seed * 1000003 + number)
        name, content, parts = files[draw.randrange(len(files))]
        names = sorted(parts)
        # Damaged heaps loop in HDF5, for a second each.
        weights = [0.2 if self.options.readers and part == "global heap" else 1 for part in names]
        part = draw.choices(names, weights)[0]
        return name, part, mutate(content, parts[part], draw), draw

    def one(self, number, files):
        name, part, mutant, draw = self.mutant(number, files)
        ending = os.path.splitext(name)[1]
        verb, words = draw.choice(sorted(self.verbs(ending).items()))
        self.clean()
        target = "part.h5.part" if verb == "recover" else "mutant" + ending
        with open(os.path.join(self.folder, target), "wb") as file:
            file.write(mutant)
        code, output, took, memory = run(self.program, [*words, "--threads", "1"], self.folder, self.options.seconds)
        self.count(number, name, part, verb, mutant, (code, output, took, memory))

    def count(self, number, name, part, verb, mutant, ended):
        code, output, took, memory = ended
        ending = os.path.splitext(name)[1]
        self.slowest, self.largest = max(self.slowest, took), max(self.largest, memory)
        outcome = self.outcome(code, output, memory)
        self.counts[(ending, part, outcome)] += 1
        if outcome.startswith("BAD"):
            self.bad.append({"number": number, "file": name, "part": part, "verb": verb, "outcome": outcome,
                             "seconds": round(took, 1), "megabytes": round(memory), "output": output[-400:]})
            print(json.dumps(self.bad[-1]), flush=True)
            if self.options.keep:
                os.makedirs(self.options.keep, exist_ok=True)
                with open(os.path.join(self.options.keep, f"{self.options.seed}-{number}{ending}"), "wb") as file:
                    file.write(mutant)

    def through_readers(self, numbers, files):
        """These mutants, one after the other through one process, which is started again after one that ends it."""
        made, lines = [], []
        for number in numbers:
            name, part, mutant, draw = self.mutant(number, files)
            verb = "recover" if name.endswith(".h5") and draw.randrange(4) == 0 else "read"
            path = os.path.join(self.folder, f"{number}{os.path.splitext(name)[1]}")
            with open(path + (".part" if verb == "recover" else ""), "wb") as file:
                file.write(mutant)
            made.append((number, name, part, verb, mutant))
            lines.append(f"{verb} {path}\n")
        done = 0
        while done < len(made):
            reader = Readers(self.options)
            try:
                for ended in reader.read(lines[done:]):
                    number, name, part, verb, mutant = made[done]
                    if verb == "recover" and self.outcome(ended[0], ended[1], ended[3]).startswith("BAD"):
                        ended = self.recovered(mutant)
                    self.count(number, name, part, verb, mutant, ended)
                    done += 1
            finally:
                reader.end()
        for line in lines:
            path = line.split(" ", 1)[1].rstrip()
            for name in (path, path + ".part"):
                if os.path.exists(name):
                    os.remove(name)

    def recovered(self, mutant):
        """How the program's recovery ends, which checks its own copy of the file as well."""
        self.clean()
        with open(os.path.join(self.folder, "part.h5.part"), "wb") as file:
            file.write(mutant)
        return run(self.program, [*self.verbs(".h5")["recover"], "--threads", "1"], self.folder, self.options.seconds)

    def report(self):
        table = {}
        for (ending, part, outcome), n in sorted(self.counts.items()):
            table.setdefault(f"{ending} {part}", {})[outcome] = n
        return {"runs": sum(self.counts.values()), "seed": self.options.seed, "parts": table, "bad": self.bad,
                "slowest_s": round(self.slowest, 1), "largest_MB": round(self.largest)}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", default=os.path.join(ROOT, "build"))
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=60)
    parser.add_argument("--megabytes", type=float, default=1500)
    parser.add_argument("--readers", action="store_true")
    parser.add_argument("--keep", metavar="FOLDER")
    parser.add_argument("--json", metavar="FILE")
    campaign = Campaign(parser.parse_args())
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # with the report of what was done
    try:
        files = campaign.good_files()
        for first in range(0, campaign.options.count, BATCH):
            numbers = range(first, min(first + BATCH, campaign.options.count))
            if campaign.options.readers:
                campaign.through_readers(numbers, files)
                continue
            for number in numbers:
                campaign.one(number, files)
    finally:
        shutil.rmtree(campaign.folder)
        report = campaign.report()
        if campaign.options.json:
            with open(campaign.options.json, "w", encoding="utf-8") as file:
                json.dump(report, file, indent=1)
        for part, outcomes in report["parts"].items():
            print(f"{part:32} " + ", ".join(f"{n} {outcome}" for outcome, n in outcomes.items()))
        print(f"{report['runs']} runs, {len(campaign.bad)} bad, slowest {report['slowest_s']} s, largest "
              f"{report['largest_MB']} MB")
    sys.exit(1 if campaign.bad else 0)


if __name__ == "__main__":
    main()
