"""The interface: the README's commands of the reference run, flags are accepted, results in JSON keep their keys."""

import json
import re
import shlex
import shutil

from case import Check, Row, explanation
from data_sets import RECIPES, data_set
from builds import ProgramFailed

VERBS = (["simulate"], ["rollout"], ["compare"], ["generate"], ["launch"], ["convert"], ["export"], ["inspect"], ["demo"],
         ["bench", "mpm"], ["bench", "graph"], ["bench", "rom"], ["bench", "validate"])
TRAINED = ("hgn", "gns", "nsf", "time")
# What a verb needs before it looks at further words, so that an unknown flag is what it complains about.
NEEDED = {"simulate": ["none.json"], "rollout": ["none.safetensors", "none.json"], "compare": ["--scenes", "none", "--models", "mpm"],
          "generate": ["none.json", "-o", "none"], "launch": ["-n", "1", "none"], "convert": ["none", "none2"],
          "export": ["none.h5"], "inspect": ["none"]}
# README's commands in small: what is added to each, by its verb.
SHORTER = {"simulate": ["--frames", "4"], "rollout": ["--frames", "4"], "compare": ["--frames", "3", "--no-floors"],
           "generate": [word for change in RECIPES["random"][1] for word in ("--set", change)],
           "train": ["--steps", "2", "--set", "hgn.latent=16"], "launch": ["--steps", "2", "--set", "hgn.latent=16", "--device", "cpu"]}


def verdict_row(name, context, problem, result):
    entry = explanation(context.explained, name)
    if problem and entry:
        return Row(name, f"{problem} ({entry['decision']})", "explained", "pass")
    return Row(name, problem or result, "", "FAIL" if problem else "pass")


def readme_commands(source):
    """Words of the indented `build/graupel ..` lines of the README."""
    commands = []
    for line in (source / "README.md").read_text().splitlines():
        if line.startswith("    build/graupel "):
            commands.append(shlex.split(line, comments=True)[1:])
    return commands


def run_readme(name, context):
    """In a folder with the reference's scenes and models, by the new programs."""
    commands = readme_commands(context.inputs)
    if not commands:
        return [Row(name, "the reference's README has no commands", "", "FAIL")]
    folder = context.work / "commands"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for link in ("scenes", "models"):
        (folder / link).symlink_to(context.inputs / link)
    rows = []
    for words in commands:
        verb = words[0]
        row_name = f"{name}/" + "_".join(word for word in words if not word.startswith("-"))[:70].replace("/", "-")
        if "--resume" in words:
            words = words + ["--frames", "6"]
        elif "truth" not in " ".join(words):
            words = words + SHORTER.get(verb, [])
        if verb in ("train", "launch"):
            shutil.rmtree(folder / "runs", ignore_errors=True)  # each makes a new run
            if not context.new.has("graupel-train"):
                rows.append(Row(row_name, "built without libtorch", "", "skipped"))
                continue
        if verb == "launch":
            words = ["2" if word == "4" else word for word in words]
        if verb == "rollout" and words[1].startswith("runs/") and not (folder / words[1]).exists():
            rows.append(Row(row_name, "no weights without training", "", "skipped"))
            continue
        code, output = context.new.run(["graupel", *words], folder, {"CUDA_VISIBLE_DEVICES": ""}, check=False)
        last = (output.strip().splitlines() or [""])[-1][:200]
        rows.append(verdict_row(row_name, context, "" if code == 0 else f"exit code {code}: {last}", "exit code 0"))
    return rows


def flags_of(help_text):
    """{flag: words that its value may have} of a program's --help."""
    flags = {}
    for line in help_text.splitlines():
        found = re.match(r"\s+((?:-\w,)?--[\w-]+|-\w(?=[ ,]))(?:\{\w+\})?(?: (\S+))?", line)
        if found:
            words = re.search(r"\{([\w,.:-]+)\}", line.split("  ")[1] if line.startswith("  ") and "  " in line[2:] else line)
            for flag in found.group(1).split(","):
                flags[flag] = set(words.group(1).split(",")) if words and "," in words.group(1) else set()
    return flags


def help_of(build, verb):
    words = build.bench(verb[1]) if verb[0] == "bench" else ["graupel-train" if verb[0] in TRAINED else "graupel", *verb]
    return build.run(words + ["--help"], "/"), words


def accepted(build, words, verb, flag):
    """A flag that the help does not name may live on as an alias."""
    code, output = build.run([*words, *NEEDED.get(verb[-1], []), flag, "1"], "/", check=False)
    return not re.search(r"not expected|unknown|did you mean", output) and code != 127


def check_flags(name, context):
    rows = []
    for verb in [*VERBS, *([word] for word in TRAINED)]:
        row_name = f"{name}/{'-'.join(verb)}"
        if verb[0] in TRAINED and not (context.reference.has("graupel-train") and context.new.has("graupel-train")):
            rows.append(Row(row_name, "built without libtorch", "", "skipped"))
            continue
        try:
            old = flags_of(help_of(context.reference, verb)[0])
            new_help, words = help_of(context.new, verb)
        except ProgramFailed as error:
            rows.append(verdict_row(row_name, context, str(error), ""))
            continue
        new = flags_of(new_help)
        lost = [flag for flag in old if flag not in new and not accepted(context.new, words, verb, flag)]
        lost += [f"{flag} {word}" for flag in old if flag in new for word in sorted(old[flag] - new[flag]) if new[flag]]
        rows.append(verdict_row(row_name, context, f"no longer accepted: {', '.join(lost)}" if lost else "", f"{len(old)} flags"))
    return rows


def json_commands(validation):
    """Words of every verb that writes results, by name; OUT stands for an output. `validation`: the case that is run."""
    steps = "scenes/shared/water_steps.json"
    return {
        "simulate": ["graupel", "simulate", steps, "-o", "OUT.h5", "--frames", "2"],
        "rollout": ["graupel", "rollout", "models/hgn.safetensors", steps, "-o", "OUT.h5", "--frames", "2"],
        "rollout-reduced": ["graupel", "rollout", "models/nsf-sand.safetensors", "scenes/shared/sand_column.json", "-o", "OUT.h5"],
        "compare": ["graupel", "compare", "--scenes", steps, "--models", "mpm,mpm:coarse,mpm:fast,models/hgn.safetensors",
                    "--frames", "6", "--no-floors"],
        "inspect-scene": ["graupel", "inspect", "scenes/shared/mixed_bowl.json"],
        "inspect-weights": ["graupel", "inspect", "models/hgn.safetensors"],
        "inspect-reduced": ["graupel", "inspect", "models/nsf-sand.safetensors"],
        "generate": ["graupel", "generate", "scenes/recipes/hgn.json", "-o", "OUT", *SHORTER["generate"]],
        "bench-mpm": ["bench", "mpm", "--particles", "4096", "--material", "water"],
        "bench-graph": ["bench", "graph", "--frames", "3", "--settle", "3"],
        "bench-validate": ["bench", "validate", "--case", validation],
    }


def keys_of(node, path=""):
    """Paths of all keys; the items of a list count together."""
    keys = set()
    if isinstance(node, dict):
        for key, child in node.items():
            keys |= {f"{path}/{key}"} | keys_of(child, f"{path}/{key}")
    elif isinstance(node, list):
        for child in node:
            keys |= keys_of(child, path + "[]")
    return keys


def json_keys(build, words, folder, inputs):
    """Keys of the result of one command."""
    folder.mkdir(parents=True)
    if words[0] == "bench":
        words = [*build.bench(words[1]), *words[2:]]
    words = [str(folder / "out") + word[3:] if word.startswith("OUT") else word for word in words]
    build.run([*words, "--device", "cpu", "--json", folder / "result.json"], inputs)
    return keys_of(json.loads((folder / "result.json").read_text()))


def check_json(name, context):
    rows, folder = [], context.work / "json"
    shutil.rmtree(folder, ignore_errors=True)
    validation = context.reference.run([*context.reference.bench("validate"), "--list"], "/").split()[0]
    for verb, words in json_commands(validation).items():
        row_name = f"{name}/{verb}"
        try:
            old = json_keys(context.reference, words, folder / "reference" / verb, context.inputs)
            new = json_keys(context.new, words, folder / "new" / verb, context.inputs)
        except ProgramFailed as error:
            rows.append(verdict_row(row_name, context, str(error), ""))
            continue
        lost = sorted(old - new)
        rows.append(verdict_row(row_name, context, f"keys lost: {', '.join(lost[:6])}" if lost else "", f"{len(old)} keys"))
    return rows


def cases(source, device):
    return [Check("interface/commands", run_readme), Check("interface/flags", check_flags), Check("interface/json", check_json)]
