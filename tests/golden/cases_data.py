"""`generate`: bytes of small data sets of random scenes and of a sweep."""

import numpy as np

from case import Case
from data_sets import generate_words
from outputs import Values, trajectory_values


def generate(kind, device, more=()):
    def outputs(build, folder, context):
        build.run(generate_words(kind, folder / "set", device) + list(more), context.inputs)
        values = {}
        for split in ("train", "valid", "test"):
            path = folder / "set" / f"{split}.h5"
            if path.exists():
                values.update({f"{split}/{name}": v for name, v in trajectory_values(path).items()})
        path = folder / "set" / "metadata.json"
        if path.exists():
            values["metadata.json"] = Values(np.frombuffer(path.read_bytes(), np.uint8), "", ("byte",))
        return values
    return outputs


def cases(source, device):
    made = [Case("generate/random", generate("random", "cpu")), Case("generate/sweep", generate("sweep", "cpu"))]
    if device == "cuda":
        many = ["--set", "counts.train=16", "--batch", 64]
        made += [Case("gpu/generate/random/batch", generate("random", "cuda", many)),
                 Case("gpu/generate/sweep", generate("sweep", "cuda"))]
    return made
