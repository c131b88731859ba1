"""Runs of graupel in which chosen calls fail, by the library of inject.cpp."""
import collections
import errno
import os
import random
import signal
import struct
import subprocess

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
BUILD = os.path.join(ROOT, "build")
GRAUPEL = os.path.join(BUILD, "graupel")
TRAIN = os.path.join(BUILD, "graupel-train")
INJECT = os.path.join(BUILD, "libgraupel_inject.so")

KINDS = ("open", "write", "sync", "truncate", "close", "rename", "allocate", "thread")
REPORT = struct.Struct(f"{len(KINDS) + 1}Q240s")

# How a call fails: an errno, "short" or "kill", and whether all later ones of its kind fail too. Those that a program
# meets: a full disk lasts, a quota does, a bad sector may not; NFS tells of both when it closes or syncs a file.
VARIANTS = {
    "open": (("ENOSPC", False), ("EACCES", True), ("EMFILE", False), ("kill", False)),
    "write": (("ENOSPC", True), ("EIO", False), ("EDQUOT", False), ("short", False), ("short", True),
              ("EINTR", False), ("kill", False)),
    "sync": (("EIO", False), ("EDQUOT", True), ("EINTR", False), ("kill", False)),
    "truncate": (("ENOSPC", False), ("EIO", True)),
    "close": (("EIO", False), ("EDQUOT", True)),
    "rename": (("EIO", False), ("EACCES", True), ("kill", False)),
    "allocate": (("ENOMEM", False), ("ENOMEM", True)),
    "thread": (("EAGAIN", False), ("EAGAIN", True)),
}

Fault = collections.namedtuple("Fault", "kind at error lasting callers", defaults=("program",))
Run = collections.namedtuple("Run", "code text calls failed first")


def describe(fault):
    lasting = " and all later" if fault.lasting else ""
    callers = f" of {fault.callers}" if fault.kind == "allocate" else ""
    return f"{fault.kind} {fault.at}{lasting}{callers}: {fault.error}"


def environment(extra=None):
    """Of a program under test: one thread that does not spin, messages in English."""
    variables = {**os.environ, "GOMP_SPINCOUNT": "20000", "OMP_NUM_THREADS": "1", "LC_ALL": "C.UTF-8"}
    variables.update(extra or {})
    return {name: value for name, value in variables.items() if value is not None}


def run(words, folder, fault=None, callers="program", limit=120):
    """Runs a program whose calls on files in `folder` are counted, and one of which may fail. A signal is a negative
    code."""
    report = folder.rstrip("/") + ".report"
    with open(report, "wb") as file:
        file.write(bytes(REPORT.size))
    extra = {"LD_PRELOAD": INJECT, "GRAUPEL_FAULT_REPORT": report, "GRAUPEL_FAULT_FOLDER": os.path.realpath(folder),
             "GRAUPEL_FAULT_CALLERS": fault.callers if fault else callers}
    if fault:
        error = fault.error if fault.error in ("short", "kill") else str(getattr(errno, fault.error))
        extra.update(GRAUPEL_FAULT_KIND=fault.kind, GRAUPEL_FAULT_AT=str(fault.at), GRAUPEL_FAULT_ERROR=error,
                     GRAUPEL_FAULT_LASTING=str(int(fault.lasting)))
    code, text = call(words, extra, limit)
    with open(report, "rb") as file:
        *numbers, first = REPORT.unpack(file.read())
    os.remove(report)
    return Run(code, text, dict(zip(KINDS, numbers)), numbers[-1], first.split(b"\0")[0].decode())


def call(words, extra=None, limit=120, cwd=None, prepare=None):
    """Exit code and what was printed; -SIGALRM after `limit` seconds."""
    try:
        done = subprocess.run(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL,
                              env=environment(extra), timeout=limit, check=False, cwd=cwd, preexec_fn=prepare)
    except subprocess.TimeoutExpired as expired:
        return -signal.SIGALRM, (expired.stdout or b"").decode(errors="replace")
    return done.returncode, done.stdout.decode(errors="replace")


def chosen(count, most, seed):
    """Numbers from 1 to count: all, or one of each of `most` equal strata."""
    if count <= most:
        return list(range(1, count + 1))
    draw = random.Random(seed)
    edges = [1 + count * k // most for k in range(most + 1)]
    return [draw.randrange(edges[k], edges[k + 1]) for k in range(most)]


def faults_of(kind, calls, most, seed):
    """The faults of a kind that a run with so many `calls` of it is tried with, `most` of each variant."""
    for number, (error, lasting) in enumerate(VARIANTS[kind]):
        for callers in ("program", "any") if kind == "allocate" else ("program",):
            for at in chosen(calls[callers][kind], most, f"{seed} {kind} {number} {callers}"):
                yield Fault(kind, at, error, lasting, callers)
