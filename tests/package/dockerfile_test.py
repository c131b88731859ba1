#!/usr/bin/env python3
"""The steps of a Dockerfile, where there is no Docker: each stage is a Debian 12 in a folder, in which RUN, COPY, ENV
and the others are carried out. Then the image's program runs there as the image's user.

    sudo python3 tests/package/dockerfile_test.py [FILE] [--keep FOLDER] [--build-arg NAME=VALUE]

Needs root, debootstrap and its mirror (for CUDA PyPI too), and the time of a whole build. FOLDER keeps the systems;
stages that are whole there are not made again. Not part of tests/run_all.sh.
"""
import argparse
import contextlib
import glob
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import time

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
PATH = "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"


def run(*words, **options):
    done = subprocess.run(words, check=False, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, **options)
    if done.returncode != 0:
        sys.exit(f"dockerfile_test: '{shlex.join(words)}' failed with status {done.returncode}\n{done.stdout[-5000:]}")
    return done.stdout


def steps_of(file):
    """The (word, rest) of each step; comments are left out and continued lines joined."""
    with open(file, encoding="utf-8") as text:
        lines = [line for line in text.read().splitlines() if line.strip() and not line.lstrip().startswith("#")]
    for step in "\n".join(lines).replace("\\\n", " ").splitlines():
        word, rest = step.split(None, 1)
        yield word.upper(), rest.strip()


class Stage:
    """A system in a folder, and what the next step finds: variables, user, work folder."""

    def __init__(self, folder, base):
        self.folder, self.variables, self.user, self.work = folder, {"PATH": PATH}, "root", "/"
        self.entry, self.words = [], []
        self.done = os.path.join(folder, ".whole")
        self.kept = os.path.exists(self.done)
        if not self.kept:
            shutil.rmtree(folder, ignore_errors=True)
            run("cp", "-a", base, folder)
        if "SSL_CERT_FILE" in os.environ:  # a network whose certificates are not the distribution's
            shutil.copy(os.environ["SSL_CERT_FILE"], os.path.join(folder, ".certificates.crt"))
            self.variables["PIP_CERT"] = "/.certificates.crt"

    def inside(self, path):
        return os.path.join(self.folder, os.path.join(self.work, path).lstrip("/"))

    @contextlib.contextmanager
    def mounted(self, places):
        """/proc, and other folders at places of this system, for a while."""
        made = []
        try:
            for kind, source, target in [("proc", "proc", "/proc"), *places]:
                os.makedirs(self.inside(target), exist_ok=True)
                run("mount", *(["-t", "proc"] if kind == "proc" else ["--bind"]), source, self.inside(target))
                made.append(target)
            yield
        finally:
            for target in reversed(made):
                run("umount", self.inside(target))

    def run(self, words, places=()):
        with self.mounted(places):
            return run("chroot", f"--userspec={self.user}", self.folder, "/usr/bin/env", "-i",
                       *[f"{name}={value}" for name, value in self.variables.items()],
                       "/bin/sh", "-c", f"cd {shlex.quote(self.work)} && exec \"$@\"", "sh", *words)

    def image(self, *words):
        """What `docker run IMAGE WORDS` does."""
        return self.run([*self.entry, *(words or self.words)])


class Build:
    def __init__(self, file, folder, arguments):
        self.file, self.folder, self.arguments, self.stages, self.stage = file, folder, arguments, {}, None
        self.base = os.path.join(folder, "debian")
        if not os.path.exists(os.path.join(self.base, "usr/bin/apt-get")):
            run("debootstrap", "--variant=minbase", "bookworm", self.base)
        with open(os.path.join(self.base, "etc/dpkg/dpkg.cfg.d/unsafe-io"), "w", encoding="utf-8") as settings:
            settings.write("force-unsafe-io\n")  # as in Docker's image of Debian

    def carry_out(self):
        for word, rest in steps_of(self.file):
            begun = time.time()
            known = getattr(self, "step_" + word.lower(), None)
            if not known:
                sys.exit(f"dockerfile_test: {self.file} has a step that this test does not know ({word})")
            known(rest)
            if time.time() - begun > 1:
                print(f"{time.time() - begun:6.0f} s  {word} {rest[:80]}", flush=True)
        self.end_stage()
        return self.stage

    def end_stage(self):
        if self.stage:
            open(self.stage.done, "w", encoding="utf-8").close()

    def step_from(self, rest):
        self.end_stage()
        image, *name = re.split(r"\s+[Aa][Ss]\s+", rest)
        if image != "debian:12-slim":
            sys.exit(f"dockerfile_test: the image '{image}' cannot be made here (only debian:12-slim)")
        name = name[0] if name else str(len(self.stages))
        self.stage = self.stages[name] = Stage(os.path.join(self.folder, name), self.base)

    def step_run(self, rest):
        places = []
        while rest.startswith("--"):
            flag, rest = rest.split(None, 1)
            mount = dict(part.split("=") for part in flag.partition("=")[2].split(","))
            source = self.stages[mount["from"]].folder + mount["source"]
            places.append(("bind", source, mount["target"]))
        if not self.stage.kept:
            self.stage.run(["/bin/sh", "-c", rest], places)

    def step_copy(self, rest):
        words = rest.split()
        if self.stage.kept:
            return
        if words[0].startswith("--from="):
            other = self.stages[words.pop(0)[len("--from="):]].folder
            target = self.stage.inside(words.pop())
            os.makedirs(target if len(words) > 1 or rest.endswith("/") else os.path.dirname(target), exist_ok=True)
            for pattern in words:
                run("cp", "-a", *glob.glob(other + pattern), target)
            return
        if words != [".", "."]:
            sys.exit(f"dockerfile_test: 'COPY {rest}' is not known (only 'COPY . .' and COPY --from)")
        files = run("git", "-C", ROOT, "ls-files", "-z", "--cached", "--others", "--exclude-standard")
        run("tar", "-C", ROOT, "--null", "-T", "-", "-cf", self.stage.inside(".context.tar"), input=files)
        run("tar", "-C", self.stage.inside("."), "--no-same-owner", "-xf", self.stage.inside(".context.tar"))
        os.remove(self.stage.inside(".context.tar"))

    def step_env(self, rest):
        for setting in shlex.split(rest):
            name, _, value = setting.partition("=")
            for known, text in self.stage.variables.items():
                value = value.replace("${" + known + "}", text).replace("$" + known, text)
            self.stage.variables[name] = value

    def step_arg(self, rest):
        name, _, value = shlex.split(rest)[0].partition("=")
        self.stage.variables[name] = self.arguments.get(name, value)

    def step_workdir(self, rest):
        self.stage.work = os.path.join(self.stage.work, rest)
        os.makedirs(self.stage.inside("."), exist_ok=True)

    def step_user(self, rest):
        self.stage.user = rest

    def step_entrypoint(self, rest):
        self.stage.entry = json.loads(rest)

    def step_cmd(self, rest):
        self.stage.words = json.loads(rest)


def try_image(image, has_cuda):
    assert "graupel simulate" in image.image(), "the image's own command shows the help"
    assert image.run(["id", "-un"]).strip() != "root", "the image runs as root"
    image.run(["/bin/sh", "-c", "rm -rf ./*"])  # of an earlier call
    print(image.image("doctor"))
    scenes = "/usr/share/graupel/scenes"
    refused = image.run(["/bin/sh", "-c", f"graupel simulate {scenes}/shared/water_steps.json -o gpu.h5 --device cuda "
                         "2>&1; test $? = 2"])
    reason = "no NVIDIA GPU or driver was found" if has_cuda else "this build has no CUDA"
    assert reason in refused, f"there is no GPU here, but the program says: {refused}"
    image.image("simulate", f"{scenes}/shared/water_steps.json", "-o", "steps.h5", "--frames", "10")
    assert "frames: 11" in image.image("inspect", "steps.h5"), "the start and 10 frames"
    image.image("rollout", "/usr/share/graupel/models/hgn.safetensors", f"{scenes}/shared/water_steps.json", "-o",
                "predicted.h5", "--frames", "4")
    image.image("generate", f"{scenes}/recipes/hgn.json", "-o", "data", "--set", "counts.train=1", "--set",
                "counts.valid=0", "--set", "counts.test=0", "--set", "frames=12", "--set", "domain.dx=0.04")
    image.image("convert", "data", "data-gns", "--format", "gns")
    image.image("train", "hgn", "--data", "data", "--out", "run", "--steps", "2", "--set", "rollout_frames=2",
                "--set", "hgn.dx=0.04", "--set", "hgn.latent=8", "--set", "hgn.message_passing=1", "--set",
                "batch_scenes=1")
    print(f"the image runs as {image.user}: it tells its devices, simulates 10 frames, predicts, makes and converts data "
          "and trains two steps")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("file", nargs="?", default=os.path.join(ROOT, "cmake/docker/cpu.Dockerfile"))
    parser.add_argument("--keep", metavar="FOLDER")
    parser.add_argument("--build-arg", action="append", default=[], metavar="NAME=VALUE", help="as docker's")
    options = parser.parse_args()
    folder = options.keep or tempfile.mkdtemp(prefix="graupel-docker-")
    os.makedirs(folder, exist_ok=True)
    try:
        arguments = dict(setting.split("=", 1) for setting in options.build_arg)
        try_image(Build(options.file, folder, arguments).carry_out(), "cuda" in os.path.basename(options.file))
    finally:
        if not options.keep:
            shutil.rmtree(folder)


if __name__ == "__main__":
    main()
