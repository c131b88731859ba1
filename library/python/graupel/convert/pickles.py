"""Pickles of NumPy arrays as plain arrays, without executing them.

A pickle is a program that may name any Python function and call it. Here every instruction is checked first: only those
that arrays, numbers, texts, tuples and lists need are let through. The five names that arrays need then lead to stand-ins
of this file, which record what they are given; numpy itself sees only bytes of a checked length and type. Everything else
is refused. Instructions: Lib/pickletools.py of Python; arrays: __reduce__ of numpy.ndarray and numpy.dtype.
"""
import io
import math
import pickle
import pickletools

import numpy as np

from .errors import Unreadable

MOST_VALUES = 1 << 22
MOST_DIMENSIONS = 32
ELEMENTS = ("f4", "f8", "i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8", "b1", "O8", "O4", "f2")
ALLOWED = frozenset("""
    PROTO FRAME STOP NONE NEWTRUE NEWFALSE BININT BININT1 BININT2 LONG1 BINFLOAT
    SHORT_BINSTRING BINSTRING SHORT_BINBYTES BINBYTES BINBYTES8 SHORT_BINUNICODE BINUNICODE BINUNICODE8
    MARK EMPTY_TUPLE TUPLE TUPLE1 TUPLE2 TUPLE3 EMPTY_LIST APPEND APPENDS
    BINPUT LONG_BINPUT MEMOIZE BINGET LONG_BINGET GLOBAL STACK_GLOBAL REDUCE BUILD""".split())


def printable(text):
    """No control codes on the terminal."""
    return "".join(c if " " <= c <= "~" else "?" for c in str(text)[:60])


def refuse(what):
    raise Unreadable(f"its pickle is not read: {what}")


class ArrayClass:
    """Stands for the class numpy.ndarray, which is never called."""


class Element:
    """dtype('f4', False, True); the order of the bytes follows."""

    def __init__(self, *arguments):
        name = text_of(arguments[0]) if arguments else None
        if name not in ELEMENTS:
            refuse(f"it has an array of the element type '{printable(name)}', which is not read")
        self.name, self.order = name, "<"

    def __setstate__(self, state):
        order = text_of(state[1]) if isinstance(state, tuple) and len(state) > 1 else None
        if order not in ("<", ">", "|", "="):
            refuse("it has an element type without an order of its bytes")
        self.order = ">" if order == ">" else "<"

    @property
    def objects(self):
        return self.name[0] == "O"

    def numbers(self, data, shape, fortran):
        kind = np.dtype(self.order + self.name if self.name != "b1" else "u1")
        count = math.prod(shape)
        if not isinstance(data, bytes) or count * kind.itemsize != len(data):
            refuse(f"it has an array of {count} elements with {len(data) if isinstance(data, bytes) else 0} bytes")
        return np.frombuffer(data, kind).reshape(shape, order="F" if fortran else "C")


class Array:
    """What _reconstruct(ndarray, (0,), b'b') makes: `values` are an array of numbers, or a list where they are objects."""

    def __init__(self, *arguments):
        if len(arguments) != 3 or arguments[0] is not ArrayClass:
            refuse("it makes an array of a class that is not numpy.ndarray")
        self.element, self.shape, self.values = None, (), None

    def __setstate__(self, state):
        """(1, shape, dtype, fortran_order, bytes or list)"""
        if self.values is not None or not isinstance(state, tuple) or len(state) != 5:
            refuse("it fills an array without its five parts")
        _, shape, element, fortran, values = state
        if not isinstance(shape, tuple) or not all(type(n) is int for n in shape) or not isinstance(element, Element):
            refuse("it has an array without shape and element type")
        if len(shape) > MOST_DIMENSIONS or any(n < 0 for n in shape):
            refuse("it has an array with a negative size, or more than 32 dimensions")
        self.element, self.shape = element, shape
        if not element.objects:
            values = element.numbers(as_bytes(values), shape, fortran is True)
        elif not isinstance(values, list) or len(values) != math.prod(shape):
            refuse(f"it has an array of {math.prod(shape)} elements with another number of objects")
        self.values = values

    @property
    def objects(self):
        return self.element is not None and self.element.objects


def make_number(*arguments):
    """scalar(dtype, bytes): one number."""
    if len(arguments) != 2 or not isinstance(arguments[0], Element) or arguments[0].objects:
        refuse("it has a number without type and bytes")
    out = Array(ArrayClass, (0,), b"b")
    out.element = arguments[0]
    out.values = out.element.numbers(as_bytes(arguments[1]), (), False)
    return out


def encode(*arguments):
    """encode(text, 'latin1'): how protocol 2 writes bytes."""
    if len(arguments) != 2 or not isinstance(arguments[0], str) or text_of(arguments[1]) not in ("latin1", "latin-1"):
        refuse("it encodes something else than a text as latin1")
    return arguments[0].encode("latin-1")


KNOWN = {("_codecs", "encode"): encode, ("numpy", "ndarray"): ArrayClass, ("numpy", "dtype"): Element}
for core in ("numpy.core", "numpy._core"):  # the second is NumPy 2
    KNOWN[core + ".multiarray", "_reconstruct"] = Array
    KNOWN[core + ".multiarray", "scalar"] = make_number


def text_of(value):
    if isinstance(value, bytes):
        return value.decode("latin-1")
    return value if isinstance(value, str) else None


def as_bytes(value):
    return value.encode("latin-1") if isinstance(value, str) else value


def known(module, name):
    if (module, name) not in KNOWN:
        refuse(f"it names '{printable(module)}.{printable(name)}', which is refused: arrays do not need it")
    return KNOWN[module, name]


class Reader(pickle.Unpickler):
    def find_class(self, module, name):
        return known(module, name)

    def persistent_load(self, pid):
        refuse("it names something outside of it")


def check_instructions(data):
    """Refuses every instruction and name that arrays do not need, before anything is built."""
    count = 0
    for opcode, argument, place in pickletools.genops(data):
        count += 1
        if opcode.name not in ALLOWED:
            if opcode.name in ("INST", "GLOBAL"):
                known(*str(argument).split(" ", 1))
            refuse(f"the instruction {opcode.name}, which arrays do not need, is refused (byte {place})")
        if opcode.name == "GLOBAL":
            known(*argument.split(" ", 1))
        elif opcode.name == "PROTO" and argument > 5:
            refuse(f"its protocol is {argument} (read are those up to 5)")
        elif opcode.name == "LONG1" and not -(1 << 63) <= argument < 1 << 63:
            refuse("it has a whole number of more than 64 bits")
        elif opcode.name == "LONG_BINPUT" and argument > MOST_VALUES or count > MOST_VALUES:
            refuse("it has more than 4 million values")
    if place + 1 != len(data):
        refuse("bytes follow its end")


def read_pickle(data):
    """The value of a pickle, of the classes above and plain Python. Throws Unreadable."""
    try:
        check_instructions(data)
        return Reader(io.BytesIO(data), encoding="bytes").load()
    except Unreadable:
        raise
    except (pickle.UnpicklingError, EOFError, ValueError, TypeError, AttributeError, LookupError, ArithmeticError,
            UnicodeError, MemoryError, AssertionError, ImportError, RecursionError) as error:
        raise Unreadable(f"its pickle is not read: it is cut short or damaged ({printable(error)})") from error
