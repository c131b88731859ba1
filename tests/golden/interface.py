"""What users rely on: every flag of every verb of the reference is still taken, and JSON results keep their keys."""
import json
import re
import tempfile

VERBS = ["demo", "bench mpm", "bench graph", "bench rom", "bench validate", "generate", "simulate", "train hgn", "train gns",
         "train nsf", "launch", "rollout", "compare", "export", "convert", "inspect"]
RESULTS = {"simulate": ["simulate", "scenes/shared/water_steps.json", "--frames", "2", "-o", "{folder}/a.h5", "--json", "-"],
           "rollout": ["rollout", "models/hgn-small.safetensors", "scenes/shared/water_steps.json", "--frames", "2", "-o",
                       "{folder}/b.h5", "--json", "-"],
           "inspect": ["inspect", "scenes/shared/mixed_bowl.json", "--json", "{folder}/d.json"],
           "compare": ["compare", "--scenes", "scenes/shared/sand_column.json", "--models", "mpm:coarse", "--frames", "3",
                       "--no-floors", "--json", "{folder}/c.json"]}


def flags_of(build, verb):
    text = build.run([*verb.split(), "--help"]).stdout
    return set(re.findall(r"(?<![\w-])--[a-z][a-z0-9-]*", text.split("Examples:")[0]))


def keys_of(value, place=""):
    if isinstance(value, dict):
        for key, inner in value.items():
            yield f"{place}/{key}"
            yield from keys_of(inner, f"{place}/{key}")
    elif isinstance(value, list) and value:
        yield from keys_of(value[0], f"{place}[]")


def result_keys(build, words):
    with tempfile.TemporaryDirectory() as folder:
        words = [word.format(folder=folder) for word in words]
        done = build.run(words)
        if done.returncode:
            return None, done.stderr.strip()[-200:]
        last = words[-1]
        return set(keys_of(json.loads(done.stdout if last == "-" else open(last).read()))), ""


def interface_rows(reference, new, explained):
    """(name, problem or '') for each verb and result."""
    for verb in VERBS:
        allowed = set(explained.get(f"flags {verb}", {}).get("removed", []))
        gone = []
        for flag in sorted(flags_of(reference, verb) - flags_of(new, verb) - allowed):
            # An alias may be hidden from the help: the parser then asks for its value or goes on to another error.
            told = new.run([*verb.split(), flag]).stderr
            if re.search(r"(not expected|unknown|no such|INVALID).*" + re.escape(flag), told) or "not expected" in told:
                gone.append(flag)
        yield f"flags {verb}", f"not taken any more: {' '.join(gone)}" if gone else ""
    for name, words in RESULTS.items():
        (before, problem), (after, trouble) = result_keys(reference, words), result_keys(new, words)
        allowed = set(explained.get(f"keys {name}", {}).get("removed", []))
        missing = sorted((before or set()) - (after or set()) - allowed)
        yield f"keys {name}", problem or trouble or (f"missing: {' '.join(missing[:6])}" if missing else "")
