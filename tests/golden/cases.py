"""What a case is: commands that both builds run with the same input, and the files whose contents must agree."""
import dataclasses
import pathlib
from typing import Callable, Dict, List, Optional

from builds import ROOT


@dataclasses.dataclass
class Case:
    """`commands(folder)` gives the words of each command; `outputs` are the files in `folder` that are compared."""
    name: str
    group: str
    commands: Callable[[pathlib.Path], List[List[str]]]
    outputs: List[str]
    environment: Dict[str, str] = dataclasses.field(default_factory=dict)
    prepare: Optional[Callable[[pathlib.Path], None]] = None  ## writes inputs that both builds share


def device_words(device):
    return ["--device", device]


def shared(name):
    return str(ROOT / "scenes" / "shared" / f"{name}.json")


def weights(name):
    return str(ROOT / "models" / f"{name}.safetensors")
