#!/usr/bin/python3
"""Tests the comparison itself: a build equals itself, and one changed float of one trajectory fails, with its place.

    tests/golden/selftest.py [BUILD_FOLDER]"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import small_scenes
from builds import Build, GoldenError, check_alike
from case import Case, Context
from difference import differences
from outputs import Values

HERE = Path(__file__).resolve().parent
CASE = "mpm/tait_water/f32"  # bit_equal in explained.json
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


def fake_build(folder, text="", cache=""):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "graupel").write_text("#!/bin/sh\n" + text)
    (folder / "graupel").chmod(0o755)
    (folder / "CMakeCache.txt").write_text(cache)
    return Build("fake", folder, folder)


def test_builds(folder):
    """A program sees the variables of its case and none of the caller's; builds of other settings are refused."""
    build = fake_build(folder / "a", "echo simd=$GRAUPEL_SIMD products=$GRAUPEL_PRODUCTS")
    os.environ["GRAUPEL_PRODUCTS"] = "bf16"
    output = build.run(["graupel"], folder, {"GRAUPEL_SIMD": "avx2"})
    del os.environ["GRAUPEL_PRODUCTS"]
    expect(output.strip() == "simd=avx2 products=", "a program has other variables than its case gives", output)
    cuda = fake_build(folder / "b", cache="GRAUPEL_CUDA:BOOL=ON\nCMAKE_CUDA_COMPILER:FILEPATH=/nvcc\nGRAUPEL_NATIVE:BOOL=ON\n")
    none = fake_build(folder / "c", cache="GRAUPEL_CUDA:BOOL=ON\nCMAKE_CUDA_COMPILER:FILEPATH=NOTFOUND\nGRAUPEL_NATIVE:BOOL=ON\n")
    check_alike(cuda, cuda)
    try:
        check_alike(cuda, none)
        message = ""
    except GoldenError as error:
        message = str(error)
    expect("GRAUPEL_CUDA ('ON', 'OFF')" in message and "GRAUPEL_NATIVE" not in message, "unlike builds are compared", message)


def test_chaos_floors(folder):
    """What is explained may differ by twice what the reference does when its start moves by ulps, and by no more."""
    builds = [fake_build(folder / name) for name in ("reference", "new")]

    def verdict(new, explained, nudges=3, spread=0.1):
        def outputs(build, _, context, nudge=0):
            x = spread * (-1) ** nudge if nudge else 0.0  # 0, -spread, spread: they differ by 2 spread
            return {"position": Values(np.array([new if build is builds[1] else x], np.float32), "m", ("particle",), "position")}
        return Case("mpm/x", outputs, nudges=nudges).run(Context(*builds, folder, "cpu", 1, explained)).verdict

    entry = {"mpm/*": {"decision": "a decision"}}
    expect(verdict(0.39, entry) == "pass", "a difference within twice the chaos floor fails")
    expect(verdict(0.41, entry) == "FAIL", "a difference beyond twice the chaos floor passes")
    expect(verdict(0.39, entry, nudges=0) == "FAIL", "a case without further runs has a chaos floor")
    expect(verdict(1e-6, entry, spread=0.0) == "pass", "a difference within the tolerance needs a chaos floor")
    expect(verdict(1e-6, {}) == "FAIL", "an unexplained difference passes by the chaos floor")
    kept = {"mpm/*": {"decision": "a decision", "bit_equal": ["mpm/x*"]}}
    expect(verdict(1e-6, kept) == "FAIL" and verdict(0.0, kept) == "pass", "a case that must be bit-equal may differ")

    scene = small_scenes.block_on_sphere(["water"])
    start = np.float32(scene["sources"][0]["position"])
    for nudge, (axis, ulps) in enumerate(((None, 0),) + small_scenes.NUDGES):
        moved = (np.float32(small_scenes.nudged(scene, nudge)["sources"][0]["position"]) - start) / np.spacing(start)
        expect(all(moved[d] == (ulps if d == axis else 0) for d in range(3)), "a start is not moved by its ulps", str(moved))


def main():
    build = Path(sys.argv[1] if len(sys.argv) > 1 else HERE.parents[1] / "build").resolve()
    test_differences()
    with tempfile.TemporaryDirectory() as folder:
        test_builds(Path(folder))
        test_chaos_floors(Path(folder))
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
