"""The two builds: the reference commit is checked out and compiled beside this tree unless a build is given."""
import os
import pathlib
import shutil
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]


class Build:
    """A build folder and the sources it was made of (where scenes and weights are read)."""

    def __init__(self, folder, source):
        self.folder, self.source = pathlib.Path(folder).resolve(), pathlib.Path(source).resolve()
        self.program = self.folder / "graupel"
        if not self.program.exists():
            sys.exit(f"golden: {self.program} is missing. Build it first (./run build), or name another folder")

    def command(self, words):
        """`bench` is a verb of the reference and may be a program of its own in the new build."""
        if words[0] == "bench" and (self.folder / "graupel-bench").exists():
            return [str(self.folder / "graupel-bench"), *words[1:]]
        if words[0] == "train":
            return [str(self.folder / "graupel-train"), *words[1:]]
        return [str(self.program), *words]

    def run(self, words, environment=None, timeout=1800):
        """Runs a verb in the source folder of the new tree; returns the completed process."""
        return subprocess.run(self.command(words), cwd=ROOT, env={**os.environ, **(environment or {})}, text=True,
                              capture_output=True, timeout=timeout)


def reference_build(commit, build, source, cmake_args, jobs):
    if build:
        return Build(build, source or ROOT)
    folder = ROOT / "build" / "golden" / commit
    if not source:
        source = folder / "source"
        if not source.exists():
            folder.mkdir(parents=True, exist_ok=True)
            temporary = folder / "source.part"
            shutil.rmtree(temporary, ignore_errors=True)
            subprocess.run(["git", "clone", "-q", "--shared", str(ROOT), str(temporary)], check=True)
            subprocess.run(["git", "-C", str(temporary), "checkout", "-q", commit], check=True)
            temporary.rename(source)
    target = folder / "build"
    log = folder / "build.log"
    print(f"golden: building {commit} in {target} (log: {log})", flush=True)
    folder.mkdir(parents=True, exist_ok=True)
    with open(log, "w") as out:
        for command in (["cmake", "-S", str(source), "-B", str(target), "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release",
                         "-DGRAUPEL_TESTS=OFF", "-DGRAUPEL_BENCH=OFF", *cmake_args],
                        ["ninja", "-C", str(target), "-j", str(jobs)]):
            if subprocess.run(command, stdout=out, stderr=out).returncode:
                sys.exit(f"golden: the reference could not be built, see {log}")
    return Build(target, source)
