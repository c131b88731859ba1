"""What callers give in Python's own kinds, as the module and the program take it: arrays, JSON, changes of scenes."""
import json
import math
import os
from collections.abc import Mapping

from ._errors import ConfigError


def check_nothing_masked(name, values):
    """Raises ConfigError for a masked array, or a list of such, in which an element is masked."""
    import numpy
    parts = [([i], part) for i, part in enumerate(values)] if isinstance(values, (list, tuple)) else [([], values)]
    for place, part in parts:
        if not isinstance(part, numpy.ma.MaskedArray) or part.dtype.names or not (mask := part.mask).any():
            continue
        first = place + numpy.argwhere(mask)[0].tolist()
        raise ConfigError(f"{name}{''.join(f'[{i}]' for i in first)} is masked (allowed: no masked elements). Leave it "
                          "out, or fill() the array")


def real_array(name, values, kind):
    """`values` as a NumPy array of `kind` ('float32', 'float64', 'int64') in C order; no copy where it is one.

    Raises ConfigError for anything but real numbers, for masked ones and, of an 'int64', for fractions.
    """
    import numpy
    check_nothing_masked(name, values)
    try:
        array = numpy.asarray(values)
        if array.dtype.kind not in "biufO":
            raise TypeError(f"it holds {array.dtype}")
        real = numpy.asarray(array, "float64") if kind == "int64" and array.dtype.kind in "fO" else None
        odd = [] if real is None else numpy.argwhere(~((numpy.floor(real) == real) & (numpy.abs(real) < 2.0**53)))
        if len(odd) == 0:
            return numpy.ascontiguousarray(array, kind)
    except (TypeError, ValueError, OverflowError) as error:
        raise ConfigError(f"{name} is no array of real numbers ({error}). Give a NumPy array") from error
    place = "".join(f"[{i}]" for i in odd[0])
    raise ConfigError(f"{name}{place} = {real[tuple(odd[0])]:g} is no whole number. Round it")


def _plain(item):
    """NumPy's numbers and arrays, and paths."""
    for way in ("tolist", "__fspath__"):
        if hasattr(item, way):
            return getattr(item, way)()
    raise ConfigError(f"a scene's dict holds a {type(item)} (allowed: dict, list, str, numbers, bool, None, NumPy "
                      "arrays). Convert it")


def _not_finite(value, place):
    """The place and value of the first number that is not finite; None where all are."""
    if isinstance(value, float):
        return None if math.isfinite(value) else (place, value)
    if isinstance(value, (str, bytes, int)) or value is None:
        return None
    if isinstance(value, (list, tuple)):
        inside = enumerate(value)
    elif isinstance(value, dict):
        inside = value.items()
    else:
        return _not_finite(_plain(value), place)
    return next((found for key, item in inside if (found := _not_finite(item, f"{place}/{key}"))), None)


def json_text(value, name="scene"):
    """JSON of dicts and lists that may hold NumPy's numbers and arrays. Raises ConfigError, which names the key."""
    try:
        return json.dumps(value, default=_plain, allow_nan=False)
    except (TypeError, ValueError, RecursionError) as error:
        if isinstance(error, ConfigError):
            raise
        odd = _not_finite(value, "") if "JSON compliant" in str(error) else None
        if odd is None:
            raise ConfigError(f"{name} cannot be written as JSON ({error}). Correct it") from error
        raise ConfigError(f"{name}: {odd[0]} = {odd[1]} is not finite. Correct it") from None


def output_path(name, path):
    """The path of an output as text. Raises ConfigError where no file can have it."""
    text = os.fsdecode(path)
    if not text or "\0" in text:
        raise ConfigError(f"{name} is {text!r} (allowed: a path of one character or more, without null bytes). Name a "
                          "file or folder")
    return text


def change_words(changes):
    """{"domain.dx": 0.02} as ["domain.dx=0.02"]."""
    if changes is None:
        return []
    if not isinstance(changes, Mapping):
        raise TypeError(f"changes is a '{type(changes).__name__}' (allowed: a dict of keys, {{'domain.dx': 0.02}}, or "
                        "None)")
    return [f"{key}={json_text(value, f'changes, {key}')}" for key, value in changes.items()]
