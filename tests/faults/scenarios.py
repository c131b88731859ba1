"""What is run with faults, and what must hold afterwards: a Scenario for each verb."""
import json
import os
import re
import shutil
import struct

import faulty
import h5py
import numpy

SCENE = {
    "name": "small", "domain": {"dx": 0.045},
    "materials": {"water": {"preset": "taichi_water"}},
    "sources": [{"shape": "box", "size": [0.12, 0.12, 0.12], "position": [0.5, 0.4, 0.5], "velocity": [0, 0, 0],
                 "material": "water"}],
    "obstacles": [{"shape": "sphere", "radius": 0.1, "position": [0.5, 0.15, 0.5]}],
    "time_step": {"policy": "fixed", "substeps_per_frame": 8}, "frame_time": 0.002, "frames": 20}
RECIPE = {"name": "sweep", "scene": "scene.json",
          "parameters": [{"name": "speed", "key": "sources.0.velocity.1", "values": [-2, -1, 0, 1]}],
          "test": [0], "valid": [1], "deflate": 1}
TRAINING = ["hgn.latent=16", "hgn.levels=2", "hgn.message_passing=1", "hgn.embedding=4", "hgn.history=2",
            "hgn.spacing=0.07", "hgn.dx=0.045", "hgn.frame_time=0.002", "batch_scenes=2", "noise_std=1e-4", "log_interval=2",
            "checkpoint_interval=2", "validation_interval=4", "validation_samples=2", "rollout_scenes=0",
            "schedule_minutes=0"]
OUT_OF_MEMORY = 1  # exit code, with a text that says so
OUTPUT_FAILED = 5
REMEDY = re.compile(r"Free space|[Cc]hoose|Check|Use |Name |[Rr]un (it|the same)|[Gg]o on|can be recovered|Set |resume|Allow")


def read(path):
    with open(path, "rb") as file:
        return file.read()


def write(path, text):
    with open(path, "w", encoding="utf-8") as file:
        file.write(text)


def files_in(folder):
    """Paths within the folder."""
    return {os.path.relpath(os.path.join(place, name), folder)
            for place, _, names in os.walk(folder) for name in names}


def weights_of(path):
    """Names, shapes and bytes of a safetensors file; its metadata tell the time."""
    data = read(path)
    length, = struct.unpack("<Q", data[:8])
    header = json.loads(data[8:8 + length])
    header.pop("__metadata__", None)
    return header, data[8 + length:]


def json_without(path, *keys):
    content = json.loads(read(path))
    for key in keys:
        content.pop(key, None)
    return content


def same_content(name, a, b):
    """Whether two files hold the same; what tells the time of the run apart."""
    if read(a) == read(b):
        return True
    if name.endswith(".safetensors"):
        return weights_of(a) == weights_of(b)
    if name.endswith(".vdb"):  # whose identifier is drawn anew
        begin, end = 21, 21 + 36
        a, b = read(a), read(b)
        return a[:begin] == b[:begin] and a[end:] == b[end:]
    if name.endswith("result.json"):
        return json_without(a).keys() == json_without(b).keys()
    if name.endswith("dataset.json"):
        return json_without(a, "made_in") == json_without(b, "made_in")
    return False


def frames_equal(path, reference):
    """Frames of a recovered trajectory; raises where one is not the reference's."""
    with h5py.File(path) as a, h5py.File(reference) as b:
        a, b = a["00000"], b["00000"]
        count, whole = len(a["time"]), len(b["time"])
        names = set()
        b.visititems(lambda name, item: names.add(name) if isinstance(item, h5py.Dataset) else None)
        for name in names:
            expected = b[name][:count] if len(b[name].shape) and b[name].shape[0] == whole else b[name][()]
            if not numpy.array_equal(a[name][()], expected):
                raise AssertionError(f"frames recovered differ in {name}")
    return count


class Scenario:
    """A command, its outputs, and how its user goes on after a failure."""
    expected_code = 0
    old = ()           # outputs that may be there before
    may_be_killed_again = False  # by the same command, which goes on
    may_remain = r"^$"  # names that a failed run may leave beside whole outputs
    may_lie_about = r"^$"  # other files of the folder, which may be there whole or not

    def __init__(self, name, place):
        self.name = name
        self.place = place
        self.out = os.path.join(place, "out")
        self.reference = os.path.join(place, "reference-" + re.sub(r"\W", "-", name))

    def words(self):
        raise NotImplementedError

    def fresh(self, old=False):
        """An empty output folder, or one with files of an earlier run."""
        shutil.rmtree(self.out, ignore_errors=True)
        os.makedirs(self.out)
        self.prepare()
        if old:
            for name in self.old:
                write(os.path.join(self.out, name), "an earlier run's")

    def prepare(self):
        pass

    def count(self):
        """The clean run; its calls by kind."""
        calls = {}
        for callers in ("any", "program"):
            self.fresh()
            clean = faulty.run(self.words(), self.out, callers=callers)
            if clean.code != self.expected_code:
                raise AssertionError(f"{self.name} without faults: {clean.code}\n{clean.text}")
            calls[callers] = clean.calls
        shutil.rmtree(self.reference, ignore_errors=True)
        shutil.copytree(self.out, self.reference)
        self.outputs = files_in(self.reference)
        return calls

    def is_output(self, name):
        return name in self.outputs

    def whole(self, name):
        return same_content(name, os.path.join(self.out, name), os.path.join(self.reference, name))

    def problems(self, done, fault, old):
        """What is wrong after a run with a fault."""
        found = []
        if fault.error != "kill":
            found += self.problems_of_end(done, fault)
        for name in sorted(files_in(self.out)):
            if re.search(self.may_lie_about, name):
                continue
            if self.is_output(name):
                is_old = old and name in self.old and read(os.path.join(self.out, name)) == b"an earlier run's"
                if not is_old and not self.whole(name):
                    found.append(f"'{name}' is neither the old nor the whole new one")
                if is_old and done.code == self.expected_code:
                    found.append(f"'{name}' is the old one after a success")
            elif fault.error != "kill" and not re.search(self.may_remain, name):
                found.append(f"leftover '{name}'")
        if done.code == self.expected_code:
            found += [f"'{name}' is missing after a success" for name in sorted(self.outputs)
                      if not os.path.exists(os.path.join(self.out, name)) and not re.search(self.may_lie_about, name)]
        elif not found:
            found += self.go_on(done, fault)
        return found

    def problems_of_end(self, done, fault):
        if done.code == self.expected_code:
            return []
        if done.code < 0:
            return [f"ended by signal {-done.code}"]
        last = [line for line in done.text.splitlines() if line.startswith("graupel")][-1:]
        if not last:
            return ["no message"]
        if fault.kind in ("allocate", "thread"):
            if fault.kind == "allocate" and done.code == OUT_OF_MEMORY and "out of memory" in last[0]:
                return []
            if fault.kind == "thread" and done.code == OUT_OF_MEMORY and REMEDY.search(last[0]):
                return []
            return [f"exit code {done.code}: {last[0]}"]
        if done.code != OUTPUT_FAILED:
            return [f"exit code {done.code}: {last[0]}"]
        if self.out not in last[0] or not REMEDY.search(last[0]):
            return [f"message without file or remedy: {last[0]}"]
        return []

    def go_on(self, done, fault):
        """After a failure: the same command again has the same result."""
        code, text = faulty.call(self.words())
        if code != self.expected_code:
            return [f"the same command again: {code}: {text.splitlines()[-1:]}"]
        return [f"the same command again: '{name}' differs" for name in sorted(self.outputs)
                if not re.search(self.may_lie_about, name) and not self.whole(name)]


class Simulate(Scenario):
    """Frames that were flushed are recovered, then a saved state goes on to the same bytes."""
    may_remain = r"^run\.h5\.part$"
    may_lie_about = r"^run\.state$"  # of any frame; resuming tells whether it is whole

    def __init__(self, place, options=(), name="simulate"):
        super().__init__(name, place)
        self.options = list(options)
        self.old = ["run.h5"] + (["result.json"] if "--json" in self.options else [])
        self.flushed = {}  # of a kill at the same call: the frames that are recovered at least

    def words(self):
        options = [word.replace("OUT", self.out) for word in self.options]
        return [faulty.GRAUPEL, "simulate", os.path.join(self.place, "scene.json"), "-o", self.out + "/run.h5",
                "--threads", "1", *options]

    def go_on(self, done, fault):
        state, part = self.out + "/run.state", self.out + "/run.h5.part"
        if os.path.exists(state) and (fault.error == "kill" or fault.at % 2 == 0):
            return self.resume(state)
        if not os.path.exists(part):
            return []
        told = re.search(r"run\.h5\.part' .*the (\d+) frames flushed so far can be recovered", done.text)
        os.rename(part, self.out + "/again.h5.part")
        code, text = faulty.call([faulty.GRAUPEL, "inspect", "--recover", self.out + "/again.h5"])
        count = 0
        if code == 0 and os.path.exists(self.out + "/again.h5"):
            try:
                count = frames_equal(self.out + "/again.h5", self.reference + "/run.h5")
            except (AssertionError, KeyError, OSError) as error:
                return [str(error)]
        elif code not in (0, 3):
            return [f"recovering: {code}: {text}"]
        if fault.error == "kill":
            self.flushed[fault.kind, fault.at] = count
        least = max(int(told[1]) if told else 0, self.flushed.get((fault.kind, fault.at), 0))
        return [] if count >= least else [f"{count} frames recovered, of {least} that were flushed"]

    def resume(self, state):
        code, text = faulty.call([faulty.GRAUPEL, "simulate", "--resume", state, "--threads", "1"])
        if code != 0:
            return [f"resuming: {code}: {text.splitlines()[-1:]}"]
        return [] if self.whole("run.h5") else ["the resumed trajectory differs"]


class Diverging(Simulate):
    """A run that blows up keeps its frames and the bad state."""
    expected_code = 4
    may_remain = r"^run\.h5(\.blowup\.h5)?\.part$"

    def __init__(self, place):
        super().__init__(place, ["--set", "time_step.substeps_per_frame=1", "--set", "frame_time=0.02"],
                         "simulate, diverging")


class Resume(Scenario):
    """simulate --resume of a killed run: the state and the frames that it has stay usable."""
    may_remain = r"^run\.h5\.part$"

    def __init__(self, place):
        super().__init__("simulate --resume", place)

    def prepare(self):
        start = Simulate(self.place, ["--save-state", self.out + "/run.state", "--save-every", "6"])
        saved = self.place + "/interrupted"
        if not os.path.exists(saved):
            start.out = self.out
            writes = faulty.run(start.words(), self.out).calls["write"]
            shutil.rmtree(self.out)
            os.makedirs(self.out)
            killed = faulty.run(start.words(), self.out, faulty.Fault("write", writes * 2 // 3, "kill", False))
            if killed.code >= 0 or not os.path.exists(self.out + "/run.h5.part"):
                raise AssertionError(f"no interrupted run: {killed}")
            shutil.copytree(self.out, saved)
        shutil.copytree(saved, self.out, dirs_exist_ok=True)
        for name in files_in(self.out):
            if name not in ("run.state", "run.h5.part"):
                os.remove(os.path.join(self.out, name))

    def words(self):
        return [faulty.GRAUPEL, "simulate", "--resume", self.out + "/run.state", "--threads", "1"]


class Export(Scenario):
    def __init__(self, place, file_format, surface=False):
        super().__init__(f"export {file_format}" + (" --surface" if surface else ""), place)
        self.format, self.surface = file_format, surface

    def words(self):
        output = self.out + ("/forces.csv" if self.format == "csv" else "")
        frames = [] if self.format == "csv" else ["--frames", "0:8:4"]
        return [faulty.GRAUPEL, "export", self.place + "/source/run.h5", "-f", self.format, "-o", output, "--threads",
                "1", *frames, *(["--surface"] if self.surface else [])]


class Generate(Scenario):
    """Interrupted, the same command makes the same data set."""
    may_be_killed_again = True
    may_remain = r"^\.lock$|^parts/[a-z]+-\d{5}\.h5(\.part)?$"  # the latter where a library crashed without memory

    def __init__(self, place):
        super().__init__("generate", place)

    def words(self):
        return [faulty.GRAUPEL, "generate", self.place + "/recipe.json", "-o", self.out, "--threads", "1"]


class Train(Scenario):
    """Resumed, or started again where there is no run yet, it ends with the same weights."""
    may_lie_about = r"^run/(metrics\.\w+|log\.txt|run\.json|command\.txt|config\.json|events\.[\w.]+)$"
    may_remain = r"^run/checkpoints/step-\d+/\w+\.(safetensors|json)$"

    def __init__(self, place):
        super().__init__("train hgn", place)

    def words(self):
        sets = [word for value in TRAINING for word in ("--set", value)]
        return [faulty.TRAIN, "hgn", "--data", self.place + "/data", "--out", self.out + "/run", "--steps", "6",
                "--threads", "1", "--device", "cpu", *sets]

    def is_output(self, name):
        return name in ("run/weights.safetensors", "run/normalization.safetensors")

    def whole(self, name):
        if name.endswith("state.json"):
            return True  # tells times
        return super().whole(name)

    def problems(self, done, fault, old):
        found = super().problems(done, fault, old)
        run = self.out + "/run"
        for name in files_in(self.out):
            if name.endswith(("run.json", "config.json")) and fault.error != "kill" and not read(f"{self.out}/{name}"):
                found.append(f"'{name}' is empty")
            if name.endswith("metrics.jsonl") and done.code == 0:
                found += self.problems_of_log(run)
        return found

    @staticmethod
    def problems_of_log(run):
        rows = [json.loads(line) for line in read(run + "/metrics.jsonl").decode().splitlines()]
        table = read(run + "/metrics.csv").decode().splitlines()
        steps = [row["step"] for row in rows]
        if steps != [2, 4, 4, 6, 6] or [line.split(",")[0] for line in table[1:]] != [str(step) for step in steps]:
            return [f"metrics of steps {steps}, {len(table)} lines"]
        return []

    def go_on(self, done, fault):
        run = self.out + "/run"
        words = self.words()
        if os.path.exists(run + "/config.json"):
            words = [faulty.TRAIN, "hgn", "--resume", run, "--threads", "1", "--device", "cpu"]
        code, text = faulty.call(words)
        if code != 0:
            return [f"going on: {code}: {text.splitlines()[-1:]}"]
        return [f"after going on, '{name}' differs" for name in self.outputs
                if self.is_output(name) and not self.whole(name)] + self.problems_of_log(run)


def make_sources(place, training):
    """The inputs of the scenarios."""
    write(place + "/scene.json", json.dumps(SCENE))
    write(place + "/recipe.json", json.dumps(RECIPE))
    os.makedirs(place + "/source")
    made = [[faulty.GRAUPEL, "simulate", place + "/scene.json", "-o", place + "/source/run.h5", "--forces",
             "--threads", "1"]]
    if training:
        made.append([faulty.GRAUPEL, "generate", place + "/recipe.json", "-o", place + "/data", "--threads", "1"])
    for words in made:
        code, text = faulty.call(words)
        if code != 0:
            raise AssertionError(f"{words}: {code}\n{text}")


def scenarios(place, training):
    """All of them, the quickest verbs first."""
    found = [Simulate(place),
             Simulate(place, ["--save-state", "OUT/run.state", "--save-every", "6", "--forces", "--json",
                              "OUT/result.json", "--write-obstacles", "OUT/obstacles.vdb"], "simulate, all outputs"),
             Resume(place), Diverging(place), Generate(place)]
    found += [Export(place, file_format) for file_format in ("vtp", "ply", "vdb", "bgeo", "usda", "png", "csv")]
    found += [Export(place, file_format, True) for file_format in ("obj", "vdb", "usda")]
    return found + ([Train(place)] if training else [])
