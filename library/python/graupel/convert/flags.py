"""The command's flags. Needs the standard library alone."""
import argparse
import json
import math
import sys

from .errors import ConfigError

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

    def print_help(self, file=None):
        (file or sys.stdout).write(self.format_help())  # argparse passes over what the system says


def make_parser():
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
    return parser


ENDINGS = {"input": [".safetensors", ".json"], "--json": [".json"]}  # of the files that shells offer


def described(action):
    """An argument as core/system/command_description.h knows it."""
    takes_value = action.nargs != 0
    name = action.option_strings[-1] if action.option_strings else action.dest
    return {"flags": action.option_strings, "word": "" if action.option_strings else action.dest,
            "value": (action.metavar or "TEXT") if takes_value else "", "text": action.help,
            "choices": list(action.choices or []), "required": action.required,
            "default": action.default if takes_value and isinstance(action.default, str) else "",
            "repeats": isinstance(action, argparse._AppendAction),
            "names_file": name in ENDINGS, "file_endings": ENDINGS.get(name, []),
            "names_folder": name in ("input", "output")}


def describe():
    """The command line as JSON, for man pages and the completion of shells."""
    parser = make_parser()
    arguments = [described(action) for action in parser._actions if action.help != argparse.SUPPRESS]
    print(json.dumps({"name": "convert", "text": parser.description, "footer": parser.epilog, "options": arguments}))
