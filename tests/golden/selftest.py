#!/usr/bin/python3
"""Tests the comparison itself: a build equals itself, and one changed float of one trajectory fails, with its place.

    tests/golden/selftest.py [BUILD_FOLDER]"""

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from difference import differences
from outputs import Values

HERE = Path(__file__).resolve().parent
CASE = "mpm/mixed/f32"
# A program that runs the true one and then moves one coordinate of what it wrote by one bit.
PERTURBED = """#!{python}
import subprocess, sys
import h5py, numpy as np
code = subprocess.run(["{program}"] + sys.argv[1:]).returncode
if code == 0 and "-o" in sys.argv:
    with h5py.File(sys.argv[sys.argv.index("-o") + 1], "r+") as file:
        positions = file["00000/position"]
        frame = positions[5]
        frame[17, 1] = np.nextafter(frame[17, 1], np.float32(9))
        positions[5] = frame
sys.exit(code)
"""


def expect(condition, message, shown=""):
    if not condition:
        print(f"selftest: {message}\n{shown}", file=sys.stderr)
        sys.exit(1)


def compare(build, reference, more=()):
    command = [sys.executable, str(HERE / "compare_builds.py"), "--reference-build", str(reference), "--reference-source",
               str(HERE.parents[1]), "--build", str(build), "--only", CASE, *more]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    return done.returncode, done.stdout


def test_differences():
    """Bits, tolerances, missing arrays, other shapes, not-a-number."""
    values = {"x": Values(np.array([[1.0, 2.0]], np.float32), "m", ("frame", "particle"), "position")}
    def with_array(array):
        return {"x": Values(np.asarray(array), "m", ("frame", "particle"), "position")}
    expect(not differences(values, with_array(np.array([[1, 2]], np.float32))), "equal arrays differ")
    moved = with_array(np.array([[1, 2.001]], np.float32))
    expect("frame 0, particle 1" in differences(values, moved)[0].text, "the place of a difference is not named")
    expect(differences(values, moved, 1e-2)[0].excess <= 1, "a difference within the tolerance fails")
    expect(differences(values, moved, 1e-4)[0].excess > 1, "a difference beyond the tolerance passes")
    expect(differences(values, with_array(np.array([[1, np.nan]], np.float32)), 1.0)[0].excess > 1, "not-a-number passes")
    expect(differences(values, with_array(np.array([[1, 2]], np.float64)), 1.0)[0].excess > 1, "another type passes")
    expect(differences(values, {}, 1.0)[0].excess > 1, "a missing array passes")
    zero = {"x": Values(np.array([0.0]))}
    expect(differences(zero, {"x": Values(np.array([-0.0]))}), "a zero of another sign passes as the same bits")


def main():
    build = Path(sys.argv[1] if len(sys.argv) > 1 else HERE.parents[1] / "build").resolve()
    test_differences()
    code, output = compare(build, build)
    expect(code == 0 and "1 passed, 0 failed" in output and "bit-equal" in output, "a build differs from itself", output)
    with tempfile.TemporaryDirectory() as folder:
        fake = Path(folder) / "graupel"
        fake.write_text(PERTURBED.format(python=sys.executable, program=build / "graupel"))
        fake.chmod(0o755)
        code, output = compare(folder, build)
        expect(code == 1 and "0 passed, 1 failed" in output, "a changed float passes", output)
        expect("00000/position" in output and "frame 5, particle 17, component 1" in output, "its place is not named", output)
        fake.write_text("#!/bin/sh\necho broken >&2\nexit 4\n")
        code, output = compare(folder, build)
        expect(code == 1 and "exit code 4" in output and "broken" in output, "a program that fails passes", output)
        bad = Path(folder) / "explained.json"
        bad.write_text('{"cases": {"mpm/*": {"decision": "docs/decisions/none.md"}}}')
        code, output = compare(build, build, ["--explained", str(bad)])
        expect(code == 2 and "names no decision" in output, "an exemption without a decision is taken", output)
    code, output = compare("/nowhere", build)
    expect(code == 2 and "no program" in output, "a build that is not there is not told of", output)
    print("selftest: passed")


if __name__ == "__main__":
    main()
