#!/usr/bin/env python3
"""Data sets of learned simulators from one format to another: Graupel's, geoelements/gns, LagrangeBench.

`graupel convert` runs this file; `python3 tools/convert.py --help` lists the flags.
"""
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


if __name__ == "__main__":
    sys.dont_write_bytecode = True
    need_libraries()
    from graupel_convert.command import main

    main(sys.argv[1:])
