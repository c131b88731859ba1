"""`generate`: bytes of small data sets of random scenes and of a sweep."""

import re

import numpy as np

from case import Case
from data_sets import generate_words
from outputs import Values, json_values, trajectory_values

NUMBER = re.compile(rb"-?\d+(\.\d+)?([eE][+-]?\d+)?")


def generate(kind, device, more=()):
    def outputs(build, folder, context, nudge=0):
        # Of random scenes: their boxes are up to four units in the last place larger.
        size = ["--set", f"groups.size={np.float32(0.04) + nudge * np.spacing(np.float32(0.04)):.9g}"] if nudge else []
        build.run(generate_words(kind, folder / "set", device) + list(more) + size, context.inputs)
        values = {}
        for split in ("train", "valid", "test"):
            path = folder / "set" / f"{split}.h5"
            if path.exists():
                values.update({f"{split}/{name}": v for name, v in trajectory_values(path).items()})
        path = folder / "set" / "metadata.json"
        if path.exists():
            values.update(json_values(path, "metadata/"))
            text = NUMBER.sub(b"#", path.read_bytes())
            values["metadata's text"] = Values(np.frombuffer(text, np.uint8), "", ("byte",))
        return values
    return outputs


def cases(source, device):
    made = [Case("generate/random", generate("random", "cpu"), nudges=4), Case("generate/sweep", generate("sweep", "cpu"))]
    if device == "cuda":
        many = ["--set", "counts.train=16", "--batch", 64]
        made += [Case("gpu/generate/random/batch", generate("random", "cuda", many)),
                 Case("gpu/generate/sweep", generate("sweep", "cuda"))]
    return made
