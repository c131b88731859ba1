"""Exceptions by kind, with the program's messages and exit codes."""


class Error(Exception):
    """Any error of Graupel."""

    exit_code = 1


class ConfigError(Error, ValueError):
    """A scene, setting or array that asks for something impossible."""

    exit_code = 2


class InputError(Error, ValueError):
    """A file that is missing, damaged or of another kind."""

    exit_code = 3


class DivergedError(Error, ArithmeticError):
    """A run that blew up."""

    exit_code = 4


class IoError(Error, OSError):
    """Writing failed: disk full, folder not writable."""

    exit_code = 5
