"""Builds of Graupel: finds or makes the programs of a source tree, and runs them."""

import os
import re
import subprocess
from pathlib import Path


class GoldenError(Exception):
    """What stops a comparison, as one message for the user."""


class ProgramFailed(Exception):
    """A program that ended with another exit code than 0."""

    def __init__(self, command, code, output):
        self.code, self.output = code, output
        lines = [line for line in output.strip().splitlines() if line.strip()]
        super().__init__(f"exit code {code} of '{command}': " + (lines[-1][:300] if lines else "no output"))


class Build:
    """One side of a comparison: programs in `folder`, inputs (scenes, models, README) in `source`."""

    def __init__(self, name, folder, source):
        self.name, self.folder, self.source = name, Path(folder).resolve(), Path(source).resolve()
        if not self.program("graupel").exists():
            raise GoldenError(f"no program '{self.program('graupel')}'. Build it, or name another folder")

    def program(self, name):
        return self.folder / name

    def has(self, name):
        return self.program(name).exists()

    def run(self, words, inputs, environment=None, timeout=900, check=True):
        """Runs a program of this build in the folder `inputs`; standard output and error as one text."""
        program, rest = self.program(words[0]), [str(word) for word in words[1:]]
        variables = {key: value for key, value in os.environ.items() if not key.startswith("GRAUPEL_")}
        variables.update(environment or {})
        command = " ".join([words[0]] + rest)
        try:
            done = subprocess.run([str(program)] + rest, cwd=inputs, env=variables, timeout=timeout,
                                  stdout=subprocess.PIPE, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL)
        except subprocess.TimeoutExpired:
            raise ProgramFailed(command, "none", f"not done after {timeout} s") from None
        except OSError as error:
            raise ProgramFailed(command, "none", str(error)) from None
        output = done.stdout.decode(errors="replace")
        if check and done.returncode != 0:
            raise ProgramFailed(command, done.returncode, output)
        return output if check else (done.returncode, output)

    def bench(self, kind):
        """Words that start the benchmark `kind` (mpm, graph, rom): of graupel-bench where that has it."""
        for words in (["graupel-bench", kind], ["graupel", "bench", kind]):
            if self.has(words[0]) and self.run(words + ["--help"], "/", check=False)[0] == 0:
                return words
        raise ProgramFailed(f"bench {kind}", "none", f"neither graupel-bench nor graupel in '{self.folder}' has it")


# What decides which products compilers fuse with sums. nvcc hands other code to the C++ compiler than the source has.
SETTINGS = ("CMAKE_BUILD_TYPE", "CMAKE_CXX_COMPILER", "CMAKE_CXX_FLAGS", "GRAUPEL_NATIVE", "GRAUPEL_CUDA")


def settings_of(build_folder):
    """SETTINGS of a build's cache; empty where there is none. GRAUPEL_CUDA is OFF where no nvcc was found."""
    cache = Path(build_folder) / "CMakeCache.txt"
    if not cache.exists():
        return {}
    entries = dict(re.findall(r"^(\w+):\w+=(.*)$", cache.read_text(), re.MULTILINE))
    found = {name: entries.get(name, "") for name in SETTINGS}
    if entries.get("CMAKE_CUDA_COMPILER", "NOTFOUND").endswith("NOTFOUND"):
        found["GRAUPEL_CUDA"] = "OFF"
    return found


def check_alike(reference, new):
    """GoldenError where two builds have other settings: their last bits differ whatever the sources are."""
    a, b = settings_of(reference.folder), settings_of(new.folder)
    unlike = [f"{name} ('{a[name]}', '{b[name]}')" for name in SETTINGS if a and b and a[name] != b[name]]
    if unlike:
        raise GoldenError(f"'{reference.folder}' and '{new.folder}' differ in {', '.join(unlike)}, and so in last bits. "
                          "Build both with the same settings")


def configure_and_build(source, folder, settings, cmake_arguments):
    """Build of the programs of `source` in `folder`, with the settings of another build (see settings_of)."""
    configure = ["cmake", "-S", str(source), "-B", str(folder), "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release",
                 "-DGRAUPEL_TESTS=OFF", *(f"-D{name}={value}" for name, value in settings.items()), *cmake_arguments]
    _quietly(configure, "cmake")
    targets = _quietly(["ninja", "-C", str(folder), "-t", "targets", "all"], "ninja")
    programs = [name for name in ("graupel", "graupel-train", "graupel-bench")
                if re.search(rf"^{name}: ", targets, re.MULTILINE)]
    _quietly(["ninja", "-C", str(folder), *programs], "ninja")


def reference_source(repository, commit):
    """A worktree of `commit` in build/golden/<commit>/source."""
    folder = repository / "build" / "golden" / commit
    source = folder / "source"
    if not (source / "CMakeLists.txt").exists():
        folder.mkdir(parents=True, exist_ok=True)
        _quietly(["git", "-C", str(repository), "worktree", "prune"], "git worktree")
        _quietly(["git", "-C", str(repository), "worktree", "add", "--detach", str(source), commit], "git worktree")
    return source


def source_of(build_folder):
    """The source tree that a build folder was configured for."""
    cache = Path(build_folder) / "CMakeCache.txt"
    if cache.exists():
        found = re.search(r"^CMAKE_HOME_DIRECTORY:INTERNAL=(.*)$", cache.read_text(), re.MULTILINE)
        if found and Path(found.group(1)).exists():
            return Path(found.group(1))
    raise GoldenError(f"the source tree of '{build_folder}' is not known. Give --reference-source")


def _quietly(command, what):
    try:
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    except OSError as error:
        raise GoldenError(f"{what} cannot be started ({error})") from None
    if done.returncode != 0:
        tail = "\n".join(done.stdout.strip().splitlines()[-15:])
        raise GoldenError(f"'{' '.join(command)}' failed:\n{tail}")
    return done.stdout
