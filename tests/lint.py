#!/usr/bin/env python3
"""Runs clang-tidy over the sources: tests/lint.py [--all] [FOLDER_OR_FILE..]. Exit status 1 where there are findings.

clang-tidy matches its checks against all headers of every file that it reads, which is nine tenths of its time. Files
of one module whose names do not clash are therefore read together, through a file that includes them. Where such a group
does not compile, because a clash was not foreseen, its halves are read. Files that include libtorch, directly or by
headers of this tree, are read with --all alone, and one by one: clang 14 finds errors in libtorch's headers in C++20,
which are not shown.
"""
import concurrent.futures
import json
import os
import re
import shlex
import subprocess
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
DATABASE = os.path.join(ROOT, "build", "tidy")
MODULES = ["core", "nn", "io", "mpm", "validation", "graph", "sparsegrid", "rom", "hybrid", "compare", "train", "experiments",
           "library", "apps", "bench"]
LARGEST_GROUP = 24
# Files that include OpenVDB take minutes each in clang-tidy 14; g++'s warnings cover them. nanobind comes with Python's
# package alone.
LEFT_OUT = re.compile(r'#include [<"](openvdb|nanobind|library/python)/')
LIBTORCH = re.compile(r'#include [<"](torch|ATen|c10)/')
NEEDS_CUDA = {"core/parallel/cuda_runtime.cpp"}  # build/tidy has no CUDA


def names_of(text):
    """Names that a file declares in the first column: clang-format indents all that is inside of something."""
    names = set()
    for line in text.splitlines():
        macro = re.match(r"#define (\w+)", line)
        if macro:
            names.add(macro[1])
        if not line or not (line[0].isalpha() or line[0] == "_") or line.startswith("namespace"):
            continue
        if line.startswith("using ") and " = " not in line:
            continue
        kind = re.match(r"(?:struct|class|enum class|enum|using) (\w+)", line)
        if kind:
            names.add(kind[1])
        head = re.split(r"[;={]", line)[0]
        names.update(re.findall(r"(?<![\w:~])(\w+)\s*\(", head)[:1])  # members of classes do not clash
        names.update(re.findall(r"(\w+)(?:\[.*)?\s*$", head)[:1])
        if "(" not in head:
            names.update(re.findall(r"(\w+)(?:\[\w*\])? = ", line))
    return names - {"void", "bool", "int", "float", "double", "const", "noexcept"}


def options_of(command):
    """The compiler's options without files, ccache and the compiler, each with its argument, as tuples."""
    words = shlex.split(re.sub(r" -o \S+ -c \S+", "", command))
    words = words[next(i for i, word in enumerate(words) if word.startswith("-")):]
    options = []
    for word in words:
        if word.startswith("-"):
            options.append((word,))
        else:
            options[-1] += (word,)
    return options


def shared_options(files, commands):
    """Options by file: files of one module for the same processor are read with the options of all of them. A file
    without a command, as of CUDA's folders here, is read as the first of its module."""
    key_of, shared = {}, {}
    for file in files:
        module = file.split("/")[0]
        like = file if file in commands else next((f for f in sorted(commands) if f.startswith(module + "/")), None)
        if like is None:
            continue
        options = options_of(commands[like])
        key_of[file] = (module, tuple(o for o in options if o[0].startswith("-m")))
        # A dictionary keeps the order of folders.
        shared.setdefault(key_of[file], {}).update((o, None) for o in options if not o[0].startswith("-O"))
    return {file: tuple(word for option in shared[key] for word in option) for file, key in key_of.items()}


def includes_libtorch(file, known):
    """Whether a file includes libtorch, directly or by headers of this tree."""
    if file not in known:
        known[file] = False
        with open(os.path.join(ROOT, file), encoding="utf-8") as source:
            text = source.read()
        headers = (name for name in re.findall(r'#include "([^"]+)"', text) if os.path.exists(os.path.join(ROOT, name)))
        known[file] = bool(LIBTORCH.search(text)) or any(includes_libtorch(header, known) for header in headers)
    return known[file]


def groups_of(files, options, with_libtorch):
    """Lists of files that are read together; a file whose module has no compile commands is alone."""
    groups, alone, known = {}, [], {}
    for file in files:
        with open(os.path.join(ROOT, file), encoding="utf-8") as source:
            text = source.read()
        if LEFT_OUT.search(text) or file in NEEDS_CUDA:
            continue
        libtorch = includes_libtorch(file, known)
        if libtorch:
            if with_libtorch:
                alone.append([file])
            continue
        names = names_of(text)
        if file not in options:
            alone.append([file])
            continue
        of_module = groups.setdefault((file.split("/")[0], options[file]), [])
        for members, taken in of_module:
            if len(members) < LARGEST_GROUP and not taken & names:
                members.append(file)
                taken |= names
                break
        else:
            of_module.append(([file], set(names)))
    return [members for module in groups.values() for members, _ in module] + alone


def tidy(arguments):
    done = subprocess.run(["clang-tidy", "--quiet"] + arguments, cwd=ROOT, text=True, capture_output=True)
    return done.returncode, done.stdout + done.stderr


def lint(group, options):
    """Findings in a group of files, "" for none."""
    if len(group) == 1:
        status, text = tidy(["-p", DATABASE, group[0]])
        if "IValue" in text:
            text = "\n".join(line for line in text.splitlines() if line.startswith(ROOT) and "-diagnostic-error" not in line)
            return text + "\n" if text else ""
        return text if status != 0 else ""
    unit = os.path.join(DATABASE, "lint", group[0].replace("/", "_"))
    os.makedirs(os.path.dirname(unit), exist_ok=True)
    with open(unit, "w", encoding="utf-8") as out:
        for file in group:
            out.write(f'#include "{os.path.join(ROOT, file)}"  // NOLINT(bugprone-suspicious-include)\n')
    shown = f"--header-filter=.*/({'|'.join(MODULES)})/.*\\.(h|cpp)"
    status, text = tidy([shown, unit, "--", *options[group[0]]])
    if "[clang-diagnostic-error]" in text:
        half = len(group) // 2
        return lint(group[:half], options) + lint(group[half:], options)
    return text if status != 0 else ""


def main():
    with_libtorch = "--all" in sys.argv[1:]
    wanted = [word for word in sys.argv[1:] if word != "--all"] or MODULES
    listed = subprocess.run(["git", "ls-files", "--"] + wanted, cwd=ROOT, text=True, capture_output=True, check=True)
    files = [f for f in listed.stdout.split() if f.endswith(".cpp")]
    with open(os.path.join(DATABASE, "compile_commands.json"), encoding="utf-8") as database:
        commands = {os.path.relpath(entry["file"], ROOT): entry["command"] for entry in json.load(database)}
    options = shared_options(files, commands)
    groups = groups_of(files, options, with_libtorch)
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        texts = list(pool.map(lambda group: lint(group, options), groups))
    findings = [text for text in texts if text]
    print("".join(findings), end="")
    print(f"{len(files)} files in {len(groups)} groups, {len(findings)} groups with findings")
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main())
