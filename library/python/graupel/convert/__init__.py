"""Readers and writers of data sets of learned simulators, and the conversion between them.

tools/convert.py runs the same code as a command, as the package `graupel_convert`, without graupel itself.
"""


def data_set(source, target, *, format="graupel", types="", split=(), changes=None, connectivity_radius=None,
             progress=None):
    """Converts the data set in the folder `source` to the new folder `target`; what was made, as a dict.

    format: of the output, 'graupel', 'gns', 'lagrangebench' or 'tfrecord'; that of the input is found by its files.
    types: of the other program, '5=water,6=obstacle'; split: of train, valid, test; changes: {'gravity': [0, -9.8, 0]}
    of the scenes that are made; connectivity_radius [m], default the input's; progress(done, total). Needs h5py. Raises
    ConfigError, InputError, IoError.
    """
    import argparse
    import os

    from .. import _errors
    from .._plain import change_words
    from .._program import PROGRAM
    os.environ.setdefault("HDF5_PLUGIN_PRELOAD", "::")  # files must not load filters from the disk
    try:
        from .command import result_of
        from .conversion import Conversion
        from .errors import ConvertError
        from .flags import FORMATS
        from .scenes import Program
    except ImportError as error:
        raise _errors.ConfigError(f"converting data sets needs h5py ({error}). Run pip install h5py") from error
    if format not in FORMATS:
        raise _errors.ConfigError(f"format '{format}' is not known (allowed: {', '.join(FORMATS)}). Choose one of "
                                  "these")
    options = argparse.Namespace(input=os.fsdecode(source), output=os.fsdecode(target), format=format, types=types,
                                 split=list(split), connectivity_radius=connectivity_radius,
                                 set=change_words(changes))
    try:
        conversion = Conversion(options, Program(str(PROGRAM)), progress or (lambda done, total: None))
        conversion.run()
    except ConvertError as error:
        kinds = {2: _errors.ConfigError, 3: _errors.InputError, 5: _errors.IoError}
        raise kinds.get(error.code, _errors.Error)(str(error)) from error
    return result_of(options, conversion)
