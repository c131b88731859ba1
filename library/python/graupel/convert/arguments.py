"""Arguments of data_set(), which the command's flags check by themselves."""
import math

from .errors import ConfigError
from .flags import FORMATS
from .series import SPLITS


def checked_format(form):
    if not isinstance(form, str) or form not in FORMATS:
        raise ConfigError(f"format {form!r} is not known (allowed: {', '.join(FORMATS)}). Choose one of these")
    return form


def checked_types(types):
    if not isinstance(types, str) and types is not None:
        raise ConfigError(f"types is {types!r} (allowed: a text of NUMBER=MATERIAL, with commas). "
                          "Write '5=water,6=sand'")
    return types or ""


def checked_split(split):
    """A list of names; one name is one of one."""
    try:
        names = [split] if isinstance(split, str) else [] if split is None else list(split)
    except TypeError:
        names = [split]
    for name in names:
        if not isinstance(name, str) or name not in SPLITS:
            raise ConfigError(f"split {name!r} is not known (allowed: {', '.join(SPLITS)}). Choose of these")
    return names


def checked_radius(radius):
    """In m, as a float of Python; None stays."""
    if radius is None:
        return None
    try:
        number = math.nan if isinstance(radius, (str, bytes, bool)) else float(radius)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not (math.isfinite(number) and number > 0):
        raise ConfigError(f"connectivity_radius is {radius!r} (allowed: a number above 0, in m). Give 0.035, for "
                          "instance")
    return number
