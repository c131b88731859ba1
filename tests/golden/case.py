"""A case of a comparison, and the row that it prints."""

import json
import shutil
import time
from dataclasses import dataclass, field
from fnmatch import fnmatch
from pathlib import Path
from typing import Callable

import numpy as np

from builds import GoldenError, ProgramFailed
from difference import differences

TOLERANCES = {"f32": 1e-5, "f64": 1e-9}  # of positions [m], where a decision explains the difference
RELATIVE = {"f32": 1e-3, "f64": 1e-9}    # of every other array, of its largest value


@dataclass
class Row:
    name: str
    result: str
    tolerance: str
    verdict: str  # pass, FAIL or skipped
    details: list = field(default_factory=list)
    seconds: float = 0.0


@dataclass
class Context:
    """What every case is given."""
    reference: object
    new: object
    work: Path      # a folder of this comparison
    device: str     # cpu, or cuda for the cases of a GPU too
    rounds: int     # of speeds
    explained: dict

    @property
    def inputs(self):
        """Scenes and weights of both sides are the reference's: old files must keep working."""
        return self.reference.source


class Skip(Exception):
    """A case that this machine or these builds cannot run, with the reason."""


@dataclass
class Case:
    """`outputs(build, folder, context)` runs one side and returns its Values by name."""
    name: str
    outputs: Callable
    precision: str = "f32"
    against_itself: bool = False  # not the same bytes in every run: bounded by twice what two runs of the reference differ

    def run(self, context):
        entry = explanation(context.explained, self.name)
        tolerance = TOLERANCES[self.precision] if entry else 0.0
        relative = RELATIVE[self.precision] if entry else 0.0
        said = f"{tolerance:g} m ({entry['decision']})" if entry else "0"
        reference = self._side(context.reference, context, "reference")
        new = self._side(context.new, context, "new")
        found = differences(reference, new, tolerance, relative)
        details = [d.text for d in found[:5]]
        if not found:
            return Row(self.name, f"bit-equal ({count_of(reference)})", said, "pass")
        if self.against_itself and found[0].excess > 1:
            again = self._side(context.reference, context, "again")
            own = {d.name: d.largest for d in differences(reference, again)}
            over = [d for d in found if not d.largest <= 2 * own.get(d.name, 0.0)]
            if over:
                return Row(self.name, over[0].text, "2 x reference against itself", "FAIL", details)
            return Row(self.name, found[0].text, "2 x reference against itself", "pass", details)
        verdict = "pass" if found[0].excess <= 1 else "FAIL"
        return Row(self.name, found[0].text, said, verdict, details)

    def _side(self, build, context, side):
        folder = context.work / self.name.replace("/", "-") / side
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        try:
            values = self.outputs(build, folder, context)
        except (ProgramFailed, OSError, ValueError, LookupError, TypeError) as error:
            raise ProgramFailed(side, "none", f"{side}: {error}") from None
        shutil.rmtree(folder, ignore_errors=True)
        if not values:
            raise GoldenError(f"case {self.name} compares nothing")
        return values


@dataclass
class Check:
    """A case with a rule of its own: `rows(context)` yields Rows."""
    name: str
    rows: Callable

    def run(self, context):
        return self.rows(self.name, context)


def count_of(values):
    return f"{sum(int(np.asarray(v.array).size) for v in values.values()):,} numbers"


def read_explained(path, repository):
    """Cases that may differ: {"cases": {"mpm/*/f32": {"decision": "docs/decisions/....md", "reason": ".."}}}."""
    with open(path) as file:
        cases = json.load(file)["cases"]
    for name, entry in cases.items():
        if not (Path(repository) / entry.get("decision", "?")).is_file():
            raise GoldenError(f"{path}: '{name}' names no decision that exists ('{entry.get('decision')}')")
    return cases


def explanation(explained, name):
    return next((entry for pattern, entry in explained.items() if fnmatch(name, pattern)), None)


def run_case(case, context):
    """All rows of a case; what fails is a row, too."""
    start = time.time()
    try:
        rows = case.run(context)
        rows = rows if isinstance(rows, list) else [rows]
    except Skip as reason:
        rows = [Row(case.name, str(reason), "", "skipped")]
    except ProgramFailed as error:
        rows = [Row(case.name, error.output.strip().splitlines()[-1][:300] if error.output.strip() else str(error), "", "FAIL",
                    error.output.strip().splitlines()[-20:])]
    except (OSError, ValueError, LookupError, TypeError) as error:
        rows = [Row(case.name, f"{type(error).__name__}: {error}", "", "FAIL")]
    for row in rows:
        row.seconds = round((time.time() - start) / len(rows), 2)
    return rows
