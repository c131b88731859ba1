#!/usr/bin/env python3
"""Data sets of learned simulators from one format to another: Graupel's, geoelements/gns, LagrangeBench.

`graupel convert` runs this file; `python3 tools/convert.py --help` lists the flags.
"""
import importlib.util
import os
import sys

SYSTEM_PYTHON = "/usr/bin/python3"  # Debian's python3-numpy and python3-h5py belong to it


def need_libraries():
    """Ends with a message where numpy or h5py are missing, after a try with Debian's own Python."""
    os.environ["HDF5_PLUGIN_PRELOAD"] = "::"  # files must not load filters from the disk
    try:
        import h5py  # noqa: F401
        import numpy  # noqa: F401
    except ImportError as error:
        if os.path.exists(SYSTEM_PYTHON) and os.environ.get("GRAUPEL_PYTHON_TRIED") != "1":
            os.environ["GRAUPEL_PYTHON_TRIED"] = "1"
            os.execv(SYSTEM_PYTHON, [SYSTEM_PYTHON, os.path.abspath(__file__)] + sys.argv[1:])
        print(f"graupel: 'convert' needs numpy and h5py for Python 3 ({error}). "
              "Install python3-numpy and python3-h5py", file=sys.stderr)
        sys.exit(2)


def load_package():
    """graupel.convert as `graupel_convert`, which needs nothing of the package around it."""
    here = os.path.dirname(os.path.abspath(__file__))
    places = [os.path.join(here, *words) for words in (
        ("graupel_convert",),                               # installed beside
        ("..", "library", "python", "graupel", "convert"),  # the sources
        ("..", "..", "..", "convert"))]                     # inside the Python package
    for place in places:
        file = os.path.join(place, "__init__.py")
        if os.path.isfile(file):
            spec = importlib.util.spec_from_file_location("graupel_convert", file, submodule_search_locations=[place])
            sys.modules["graupel_convert"] = package = importlib.util.module_from_spec(spec)
            spec.loader.exec_module(package)
            return
    print(f"graupel: the package of 'convert' is not there (looked for in {', '.join(map(os.path.normpath, places))}). "
          "Install Graupel again", file=sys.stderr)
    sys.exit(2)


if __name__ == "__main__":
    sys.dont_write_bytecode = True
    if sys.argv[1:] == ["--describe"]:  # for man pages and the completion of shells
        load_package()
        from graupel_convert.flags import describe

        describe()
        sys.exit()
    need_libraries()
    load_package()
    from graupel_convert.command import main

    main(sys.argv[1:])
