"""The command: flags, progress, messages and exit codes."""
import argparse
import json
import math
import os
import signal
import sys
import time
import traceback

from .conversion import Conversion
from .errors import ConfigError, ConvertError, Interrupted, writing
from .metadata import json_text
from .scenes import Program
from .series import SPLITS

FOOTER = """\
Positions keep their bits. Types: gns and tfrecord 3 obstacle, 4 jelly, 5 water, 6 sand, 7 toothpaste (goop), 8 snow;
lagrangebench 0 water, 1 obstacle (wall), 2 stationary (moving wall), 4 jelly, 6 sand, 7 toothpaste, 8 snow.
Other programs' data have no scene: walls come from their bounds, gravity is 0 unless --set says otherwise.
Their pickles are never executed. The output appears when all of it is written.
Weights (.safetensors) take --numbers f32, f16, bf16 or i8 (8 bits for matrices but those
that begin with the names of --keep) alone; a scene (.json) is written with every key, after --set.

Examples:
  graupel convert data/hgn data/hgn-gns --format gns
  graupel convert WaterDropSample data/water --set gravity=[0,-9.8,0]
  graupel convert 3D_LDC_8160_10kevery100 data/ldc --types 2=obstacle --split train,valid
  graupel convert runs/hgn/weights.safetensors models/hgn.safetensors --numbers f16"""


FORMATS = ("graupel", "gns", "lagrangebench", "tfrecord")


def above_zero(text):
    value = float(text)
    if not (math.isfinite(value) and value > 0):
        raise ValueError
    return value


above_zero.__name__ = "number above 0"


class Parser(argparse.ArgumentParser):
    def error(self, message):
        raise ConfigError(f"{message}\nRun 'graupel convert --help' for the flags.")


def parse(arguments):
    parser = Parser(prog="graupel convert", epilog=FOOTER, formatter_class=argparse.RawDescriptionHelpFormatter,
                    description="Convert data sets: Graupel's, geoelements/gns, LagrangeBench, TFRecord; shorten weights")
    parser.add_argument("input", help="Folder of a data set; its files say which format it has. Or weights, or a scene")
    parser.add_argument("output", help="Folder, or file of weights, to make")
    parser.add_argument("-f", "--format", choices=FORMATS, default="graupel",
                        help="Format of the output: graupel (default), gns (.npz), lagrangebench (.h5) or tfrecord "
                             "(learning_to_simulate)")
    parser.add_argument("--types", default="",
                        help="Particle types of the other program: NUMBER=MATERIAL,..., or NUMBER=obstacle; the rest as below")
    parser.add_argument("--split", action="append", default=[], metavar="NAME",
                        help="Convert these alone: train,valid,test (default: all there are)")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE",
                        help="Change a key of the scenes that are made: --set gravity=[0,-9.8,0] --set domain.dx=0.02")
    parser.add_argument("--connectivity-radius", type=above_zero, metavar="R",
                        help="Written to metadata.json for graph networks [m]; default the input's")
    parser.add_argument("--numbers", choices=("f32", "f16", "bf16", "i8"),
                        help="Of weights; i8: matrices of a network in 8 bits")
    parser.add_argument("--keep", metavar="NAMES", help="Of weights in i8: what stays in 16 bits, down.0.,up.0.")
    parser.add_argument("--json", default="", metavar="FILE", help="Write the result as JSON to a file, or - for standard output")
    parser.add_argument("--threads", help=argparse.SUPPRESS)  # every verb takes it; it changes nothing here
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
        print(json.dumps(result, indent=2))
    elif options.json:
        with writing(options.json), open(options.json, "w", encoding="utf-8") as file:
            file.write(json_text(result))


def ended(code, message=""):
    """Ends the process at once: HDF5 1.10 crashes when it cleans up a file that a full disk kept from closing."""
    if message:
        print(message, file=sys.stderr)
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


def main(arguments):
    """Exit codes: 0 ok, 1 failed, 2 usage, 3 bad input, 5 I/O, 130 interrupted."""
    sys.excepthook = sys.unraisablehook = lambda *_: None  # h5py reports there what it cannot close; errors are told below
    try:
        options = parse(arguments)
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
