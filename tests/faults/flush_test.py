#!/usr/bin/python3
"""A kill between any two writes of a flush costs no frame that was flushed before, also where the indices of chunks
grow a level (64 chunks, 512 frames).

    tests/faults/flush_test.py [--frames 524] [--calls 60]     # the last so many writes of a run of so many frames

Needs build/graupel and the library of inject.cpp.
"""
import argparse
import json
import os
import re
import shutil
import sys
import tempfile

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import faulty  # noqa: E402
import scenarios  # noqa: E402

FLUSHED_AT_ONCE = 8  # frames


def recovered(part):
    """Frames that --recover finds; 0 where it finds none."""
    code, text = faulty.call([faulty.GRAUPEL, "inspect", "--recover", part.removesuffix(".part")])
    count = re.search(r"^ *frames: *(\d+)$", text, re.M)
    return int(count[1]) if code == 0 and count else 0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, default=524)
    parser.add_argument("--calls", type=int, default=60)
    options = parser.parse_args()
    scene = {**scenarios.SCENE, "frames": options.frames, "frame_time": 0.0002,
             "time_step": {"policy": "fixed", "substeps_per_frame": 1}}
    with tempfile.TemporaryDirectory(dir="/dev/shm" if os.path.isdir("/dev/shm") else None) as place:
        with open(os.path.join(place, "scene.json"), "w", encoding="utf-8") as file:
            json.dump(scene, file)
        run = scenarios.Simulate(place, ["--forces"])
        os.makedirs(run.out)
        writes = faulty.run(run.words(), run.out).calls["write"]
        flushed, lost, tried = 0, [], 0
        for at in range(max(1, writes - options.calls), writes + 1):
            shutil.rmtree(run.out)
            os.makedirs(run.out)
            faulty.run(run.words(), run.out, faulty.Fault("write", at, "kill", False))
            if not os.path.exists(run.out + "/run.h5.part"):
                break  # the trajectory has its name
            tried += 1
            count = recovered(run.out + "/run.h5.part")
            if count < flushed or count % FLUSHED_AT_ONCE not in (0, (options.frames + 1) % FLUSHED_AT_ONCE):
                lost.append(f"killed at write {at} of {writes}: {count} frames recovered, of {flushed}")
            if flushed == 0:
                first = count
            flushed = max(flushed, count)
    print("\n".join(lost))
    if lost or first < options.frames - 6 * FLUSHED_AT_ONCE or flushed <= first:
        sys.exit(f"flush_test: {len(lost)} of {tried} kills cost flushed frames ({first} to {flushed} were recovered)")
    print(f"{tried} kills between writes, {first} to {flushed} frames recovered, none lost that was flushed")


if __name__ == "__main__":
    main()
