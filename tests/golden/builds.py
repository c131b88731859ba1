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
        environment = {key: value for key, value in os.environ.items() if not key.startswith("GRAUPEL_")}
        environment.update(environment or {})
        command = " ".join([words[0]] + rest)
        try:
            done = subprocess.run([str(program)] + rest, cwd=inputs, env=environment, timeout=timeout,
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


def configure_and_build(source, folder, cmake_arguments):
    """Release build of the programs of `source` in `folder`."""
    configure = ["cmake", "-S", str(source), "-B", str(folder), "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release",
                 "-DGRAUPEL_TESTS=OFF", *cmake_arguments]
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
