"""The command: progress, messages and exit codes."""
import json
import os
import signal
import sys
import time
import traceback

from .conversion import Conversion
from .errors import ConfigError, ConvertError, Interrupted, printing
from .flags import make_parser
from .metadata import json_text
from .outputs import check_json_file, write_text
from .scenes import Program
from .series import SPLITS


def parse(arguments):
    parser = make_parser()
    if any(word in ("", "--json=") for word in arguments):
        parser.error("an argument is empty (allowed: the name of a file or folder). Give one, or leave it out")
    with printing():  # --help
        options = parser.parse_args(arguments)
    options.split = [name for names in options.split for name in names.split(",")]
    for name in options.split:
        if name not in SPLITS:
            parser.error(f"--split '{name}' is not known (allowed: {', '.join(SPLITS)})")
    if options.numbers or options.keep:
        raise ConfigError(f"--numbers is for weights ('{options.input}' is not a .safetensors file). Leave it out")
    return options


def program_path():
    beside = os.path.join(os.path.dirname(os.path.abspath(__file__)), "../../../../build/graupel")  # in the sources
    return os.environ.get("GRAUPEL_PROGRAM") or (os.path.normpath(beside) if os.path.exists(beside) else "graupel")


class Progress:
    """A line on standard error every ten seconds; stops the work once SIGINT or SIGTERM came."""

    def __init__(self):
        self.last, self.stop = time.monotonic(), False
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._signalled)

    def _signalled(self, number, frame):
        self.stop = True

    def __call__(self, done, total):
        if self.stop:
            raise Interrupted("interrupted; nothing was written")
        if time.monotonic() - self.last > 10:
            self.last = time.monotonic()
            print(f"convert: {done} of {total}", file=sys.stderr, flush=True)


def training_settings(scene, radius, network):
    """Those of `graupel train` that must be those of the data, and those that go with their radius as the defaults with
    0.035 m."""
    words = [f"frame_time={scene.frame_time!r}", f"dx={scene.dx!r}",
             f"{'radius' if network == 'gns' else 'spacing'}={radius!r}", f"wall_clamp={8 * radius!r}"]
    if scene.dimensions == 2:
        words.append("dimensions=2")
    return "".join(f" --set {network}.{word}" for word in words)


def result_of(options, conversion):
    """What was made."""
    return {"output": options.output, "from": conversion.source, "format": options.format,
            "splits": {name: {"trajectories": split.trajectories, "most_frames": split.most_frames,
                              "most_particles": split.most_particles}
                       for name, split in sorted(conversion.figures.items())},
            "trajectories_whose_obstacles_are_left_out": conversion.with_obstacles}


def report(options, conversion):
    figures = conversion.figures
    counts = ", ".join(f"{figures[name].trajectories} {name}" for name in SPLITS if name in figures)
    print(f"{options.output}: {counts} trajectories, {conversion.source} to {options.format}", file=sys.stderr)
    if conversion.with_obstacles:
        print(f"convert: the obstacles of {conversion.with_obstacles} trajectories are left out ({options.format} knows them as "
              "particles only)", file=sys.stderr)
    scene = conversion.scenes.first
    for network in ("hgn", "gns") if scene else ():
        print(f"Train by: graupel train {network} --data {options.output}"
              + training_settings(scene, conversion.metadata.radius, network), file=sys.stderr)
    result = result_of(options, conversion)
    if options.json == "-":
        with printing():
            print(json.dumps(result, indent=2))
    elif options.json:
        write_text(options.json, json_text(result))


def ended(code, message=""):
    """Ends the process at once: HDF5 1.10 crashes when it cleans up a file that a full disk kept from closing."""
    if message:
        print(message, file=sys.stderr)
    sys.stderr.flush()
    os._exit(code)


def main(arguments):
    """Exit codes: 0 ok, 1 failed, 2 usage, 3 bad input, 5 I/O, 130 interrupted."""
    sys.excepthook = sys.unraisablehook = lambda *_: None  # h5py reports there what it cannot close; errors are told below
    try:
        options = parse(arguments)
        check_json_file(options)
        conversion = Conversion(options, Program(program_path()), Progress())
        conversion.run()
        report(options, conversion)
        ended(0)
    except ConvertError as error:
        ended(error.code, f"graupel: {error}")
    except MemoryError:
        ended(1, "graupel: out of memory. Convert fewer or smaller trajectories")
    except SystemExit as done:  # --help
        ended(done.code or 0)
    except Exception:
        ended(1, "graupel: convert failed\n" + traceback.format_exc())
