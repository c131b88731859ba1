"""Readers and writers of data sets of learned simulators, and the conversion between them.

tools/convert.py runs the same code as a command, as the package `graupel_convert`, without graupel itself.
"""


def data_set(source, target, *, format="graupel", types="", split=(), changes=None, connectivity_radius=None,
             progress=None):
    """Converts the data set in the folder `source` to the new folder `target`; what was made, as a dict.

    format: of the output, 'graupel', 'gns', 'lagrangebench' or 'tfrecord'; that of the input is found by its files.
    types: of the other program, '5=water,6=obstacle'; split: one or several of train, valid, test; changes: {'gravity':
    [0, -9.8, 0]} of the scenes that are made; connectivity_radius [m], default the input's. progress(done, total) after
    each trajectory; what it raises ends the conversion. Runs in a process of its own. Needs h5py. Raises ConfigError,
    InputError, IoError.
    """
    import os

    from .. import _errors
    from .._plain import change_words, output_path
    from .._program import PROGRAM
    from .arguments import checked_format, checked_radius, checked_split, checked_types
    from .child import Child
    from .errors import ConfigError
    if progress is not None and not callable(progress):
        raise TypeError(f"progress is a '{type(progress).__name__}' (allowed: a function of (done, total), or None)")
    try:
        request = {"input": os.fsdecode(source), "output": output_path("target", target),
                   "format": checked_format(format), "types": checked_types(types), "split": checked_split(split),
                   "connectivity_radius": checked_radius(connectivity_radius), "set": change_words(changes),
                   "program": str(PROGRAM)}
        child = Child(request)
    except ConfigError as error:
        raise _errors.ConfigError(str(error)) from error
    kinds = {kind.exit_code: kind for kind in (_errors.ConfigError, _errors.InputError, _errors.IoError)}
    with child:
        for message in child.messages():
            if "error" in message:
                code, text = message["error"]
                raise kinds.get(code, _errors.Error)(text)
            if "progress" not in message:
                result = message["result"]
            elif progress is not None:
                progress(*message["progress"])
    return result
