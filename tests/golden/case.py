"""A case of a comparison, and the row that it prints."""

import json
import shutil
import time
from dataclasses import dataclass, field
from fnmatch import fnmatch
from itertools import combinations
from pathlib import Path
from typing import Callable

import numpy as np

from builds import GoldenError, ProgramFailed
from difference import differences

TOLERANCES = {"f32": 1e-5, "f64": 1e-9}  # of positions [m], where a decision explains the difference
RELATIVE = {"f32": 1e-3, "f64": 1e-8}    # of every other array, of its largest value
FLOORS = 2  # times what runs of the reference differ by


@dataclass
class Row:
    name: str
    result: str
    tolerance: str
    verdict: str  # pass, FAIL or skipped
    details: list = field(default_factory=list)
    seconds: float = 0.0
    explained: bool = False  # it differs, and a decision says why


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
    against_itself: bool = False  # not the same bytes in every run: bounded by FLOORS times what two runs of the reference differ
    # An explained difference may grow by chaos. `outputs(.., nudge=k)`, k = 1..nudges, are runs whose start is moved by
    # units in the last place. Of the reference's run and these, the largest difference of any two is the chaos floor.
    nudges: int = 0

    def run(self, context):
        entry = explanation(context.explained, self.name)
        tolerance = TOLERANCES[self.precision] if entry else 0.0
        relative = RELATIVE[self.precision] if entry else 0.0
        decision = f" ({entry['decision']})" if entry else ""
        reference = self._side(context.reference, context, "reference")
        new = self._side(context.new, context, "new")
        found = differences(reference, new, tolerance, relative)
        if not found:
            return Row(self.name, f"bit-equal ({count_of(reference)})", "0", "pass")
        over, worst, allowed, floor = [d for d in found if d.excess > 1], found[0], f"{tolerance:g} m" if entry else "0", ""
        if over and (self.against_itself or (entry and self.nudges)):
            own = self._floors(reference, context)
            over = [d for d in over if not d.largest <= FLOORS * own.get(d.name, 0.0)]
            worst = (over or found)[0]
            allowed, floor = f"{FLOORS} x floor", f"; {self._floor_name()}: {own.get(worst.name, 0.0):.3g}"
        return Row(self.name, worst.text + floor, allowed + decision, "FAIL" if over else "pass",
                   [d.text for d in (over or found)[:5]], explained=bool(entry))

    def _floor_name(self):
        return "reference against itself" if self.against_itself else "reference moved by ulps"

    def _floors(self, reference, context):
        """Largest difference of every array between any two runs of the reference."""
        nudges = [0] if self.against_itself else range(1, self.nudges + 1)
        runs = [reference] + [self._side(context.reference, context, "again", nudge) for nudge in nudges]
        own = {}
        for one, other in combinations(runs, 2):
            for d in differences(one, other):
                if not np.isfinite(d.largest):
                    raise ValueError(f"no chaos floor: of the reference's own runs, {d.text}")
                own[d.name] = max(own.get(d.name, 0.0), d.largest)
        return own

    def _side(self, build, context, side, nudge=0):
        folder = context.work / self.name.replace("/", "-") / side
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        try:
            values = self.outputs(build, folder, context, **({"nudge": nudge} if nudge else {}))
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
    """Cases that may differ: {"cases": {"mpm/*/f32": {"decision": "docs/decisions/....md", "reason": ".."}}}.

    "bit_equal": patterns of cases of this entry that may not."""
    with open(path) as file:
        cases = json.load(file)["cases"]
    for name, entry in cases.items():
        if not (Path(repository) / entry.get("decision", "?")).is_file():
            raise GoldenError(f"{path}: '{name}' names no decision that exists ('{entry.get('decision')}')")
    return cases


def explanation(explained, name):
    entry = next((entry for pattern, entry in explained.items() if fnmatch(name, pattern)), None)
    return None if entry and any(fnmatch(name, pattern) for pattern in entry.get("bit_equal", [])) else entry


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
