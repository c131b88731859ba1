"""Errors by exit code; texts are "problem (value, allowed range). Remedy"."""
import contextlib
import errno
import sys


class ConvertError(Exception):
    code = 1


class ConfigError(ConvertError):
    """Flags that are wrong, or do not fit the data."""
    code = 2


class InputError(ConvertError):
    """Files that are damaged, of another kind, or do not fit each other."""
    code = 3


class OutputError(ConvertError):
    """Disk full, no permission."""
    code = 5


class Interrupted(ConvertError):
    code = 130


class Unreadable(Exception):
    """What is wrong inside a file; its reader adds the name of the file."""


def disk_is_full(error):
    """Also where HDF5 failed once more while it closed the file."""
    while error is not None:
        if getattr(error, "errno", None) == errno.ENOSPC or "No space left" in str(error):
            return True
        error = error.__context__
    return False


@contextlib.contextmanager
def writing(path):
    """Turns the system's errors while `path` is written into OutputError."""
    try:
        yield
    except (OSError, RuntimeError) as error:  # h5py raises RuntimeError where a file cannot be flushed or closed
        text = "No space left on device" if disk_is_full(error) else str(error)
        raise OutputError(f"cannot write '{path}' ({text}). Free space on that disk or choose another folder") from error


@contextlib.contextmanager
def printing():
    """Turns the system's errors while the standard output is written into OutputError."""
    try:
        try:
            yield
        finally:
            sys.stdout.flush()
    except OSError as error:
        raise OutputError(f"cannot write to standard output ({error.strerror}). Free space there, or print to another file") from error
