#!/usr/bin/python3
"""The comparison finds a single changed number, a missing name and another shape, and passes equal files."""
import pathlib
import shutil
import struct
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import h5py  # noqa: E402
import numpy as np  # noqa: E402
from builds import ROOT, Build  # noqa: E402
from comparison import compare_files  # noqa: E402
from compare_builds import compare_case, read_explained  # noqa: E402
from mpm_cases import material_case  # noqa: E402


class PerturbedBuild(Build):
    """Runs the same program and then changes one coordinate of one particle by one unit in the last place."""

    def run(self, words, environment=None, timeout=1800):
        done = super().run(words, environment, timeout)
        with h5py.File(words[words.index("-o") + 1], "r+") as file:
            positions = file["00000/position"]
            frame = positions[7]
            frame[5, 1] = np.nextafter(frame[5, 1], np.float32(1))
            positions[7] = frame
        return done


def check(condition, text):
    if not condition:
        sys.exit(f"golden selftest: {text}")


def main():
    folder = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "build"
    build, case = Build(folder, ROOT), material_case("water", "f32", "cpu")
    explained = {**read_explained(), case.name: {}}
    passed, text = compare_case(case, [("reference", build), ("new", build)], explained)
    check(passed and text == "bit-equal", f"a build must equal itself: {text}")
    passed, text = compare_case(case, [("reference", build), ("new", PerturbedBuild(folder, ROOT))], explained)
    check(not passed and "00000/position[7, 5, 1]" in text, f"the changed coordinate must be named: {text}")

    with tempfile.TemporaryDirectory() as place:
        one, other = pathlib.Path(place) / "a.safetensors", pathlib.Path(place) / "b.safetensors"
        header = b'{"w":{"dtype":"F32","shape":[2],"data_offsets":[0,8]}}'
        one.write_bytes(struct.pack("<Q", len(header)) + header + struct.pack("<2f", 1, 2))
        other.write_bytes(struct.pack("<Q", len(header)) + header + struct.pack("<2f", 1, 2.5))
        found = compare_files(one, other)
        check(found.largest == 0.5 and found.place == "w[1]", "a changed weight must be found")
        shutil.copy(one, other)
        check(not compare_files(one, other), "equal weights must pass")
    print("golden selftest: passed")


if __name__ == "__main__":
    main()
