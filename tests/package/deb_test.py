#!/usr/bin/env python3
"""The Debian packages of build-deb/ in a fresh Debian 12: installed by apt, run, the examples built against the
library.

    sudo python3 tests/package/deb_test.py [BUILD] [--keep FOLDER]

Needs root, debootstrap and its mirror. FOLDER keeps the system for the next call. Not part of tests/run_all.sh.
"""
import argparse
import glob
import json
import os
import shutil
import subprocess
import sys
import tempfile

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))


def run(*words, **options):
    done = subprocess.run(words, check=False, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, **options)
    if done.returncode != 0:
        sys.exit(f"deb_test: '{' '.join(words)}' failed with status {done.returncode}\n{done.stdout[-3000:]}")
    return done.stdout


class Debian:
    """A system in a folder."""

    def __init__(self, folder):
        self.folder = folder
        if not os.path.exists(os.path.join(folder, "usr/bin/apt-get")):
            run("debootstrap", "--variant=minbase", "bookworm", folder)
        run("mount", "-t", "proc", "proc", os.path.join(folder, "proc"))

    def close(self):
        run("umount", os.path.join(self.folder, "proc"))

    def run(self, line):
        return run("chroot", self.folder, "/bin/sh", "-c", "LC_ALL=C DEBIAN_FRONTEND=noninteractive; "
                   "export LC_ALL DEBIAN_FRONTEND; " + line)

    def take(self, *files):
        for file in files:
            shutil.copy(file, os.path.join(self.folder, "tmp"))


def try_program(debian, package):
    debian.run(f"apt-get install -y -q --no-install-recommends /tmp/{os.path.basename(package)}")
    facts = json.loads(debian.run("graupel doctor --json - 2>/dev/null"))["facts"]
    assert "avx2" in facts["instruction set"] or "baseline" in facts["instruction set"], facts
    debian.run("test -s /usr/share/man/man1/graupel-simulate.1 -a -s /usr/share/zsh/vendor-completions/_graupel "
               "-a -s /usr/share/fish/vendor_completions.d/graupel.fish")
    debian.run("bash -c 'source /usr/share/bash-completion/completions/graupel && complete -p graupel'")
    debian.run("cd /tmp && graupel simulate /usr/share/graupel/scenes/shared/water_steps.json -o steps.h5 --frames 3")
    debian.run("cd /tmp && graupel rollout /usr/share/graupel/models/hgn.safetensors "
               "/usr/share/graupel/scenes/shared/water_steps.json -o predicted.h5 --frames 4")
    debian.run("cd /tmp && graupel export steps.h5 --surface --format usda --frames 3")
    assert os.path.getsize(glob.glob(os.path.join(debian.folder, "tmp/steps_surface_usda/*.usda"))[0]) > 10000
    print("graupel: installed, simulates, predicts, exports")


def try_library(debian, package):
    debian.run(f"apt-get install -y -q --no-install-recommends /tmp/{os.path.basename(package)} g++ cmake make")
    debian.run("cmake -S /usr/share/doc/graupel/examples -B /tmp/examples && cmake --build /tmp/examples -j 2 && "
               "cd /tmp/examples && ctest --output-on-failure")
    print("libgraupel-dev: the examples build and run")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("build", nargs="?", default=os.path.join(ROOT, "build-deb"))
    parser.add_argument("--keep", metavar="FOLDER")
    options = parser.parse_args()
    packages = sorted(glob.glob(os.path.join(options.build, "*.deb")))
    program = [file for file in packages if os.path.basename(file).startswith("graupel_")]
    library = [file for file in packages if os.path.basename(file).startswith("libgraupel-dev_")]
    if not program or not library:
        sys.exit(f"deb_test: there are no packages in '{options.build}'. Run cpack there")
    folder = options.keep or tempfile.mkdtemp(prefix="graupel-deb-")
    debian = Debian(folder)
    try:
        debian.take(program[0], library[0])
        try_program(debian, program[0])
        try_library(debian, library[0])
    finally:
        debian.close()
        if not options.keep:
            shutil.rmtree(folder)


if __name__ == "__main__":
    main()
