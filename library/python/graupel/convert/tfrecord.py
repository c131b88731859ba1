"""TFRecord files as DeepMind's learning_to_simulate reads them: a SequenceExample a trajectory, with 'key' and
'particle_type' in its context and a list 'position' of one f32 array a frame. Written by the formats' descriptions,
without TensorFlow."""
import struct

import numpy as np

from .errors import InputError, writing

CASTAGNOLI = 0x82F63B78  # polynomial of CRC-32C, reversed


def _byte_table():
    table = np.arange(256, dtype=np.uint32)
    for _ in range(8):
        table = np.where(table & 1, (table >> np.uint32(1)) ^ np.uint32(CASTAGNOLI), table >> np.uint32(1))
    return table


TABLE = _byte_table()


def _advance(state, rows):
    """CRC registers [n] after the bytes rows [n, length]."""
    for column in rows.T:
        state = TABLE[(state ^ column) & 0xFF] ^ (state >> np.uint32(8))
    return state


def _zeros_operator(length):
    """The linear map of a register by `length` zero bytes: what each of its 32 bits becomes."""
    bits = np.uint32(1) << np.arange(32, dtype=np.uint32)
    return _advance(bits, np.zeros((32, length), np.uint32))


def _through(operator, register):
    """A register after the bytes of an operator."""
    result = 0
    for column in operator:
        if register & 1:
            result ^= column
        register >>= 1
    return result


def crc32c(data):
    """Of bytes. Pieces of long ones go through NumPy at once, and are joined by what zero bytes do to a register."""
    values, piece, register = np.frombuffer(data, np.uint8), 1024, 0xFFFFFFFF
    count = len(values) // piece
    if count > 1:
        pieces = _advance(np.zeros(count, np.uint32), values[:count * piece].reshape(count, piece).astype(np.uint32))
        operator = _zeros_operator(piece).tolist()
        for one in pieces.tolist():
            register = _through(operator, register) ^ one
        values = values[count * piece:]
    return int(_advance(np.array([register], np.uint32), values[None, :].astype(np.uint32))[0]) ^ 0xFFFFFFFF


def masked(crc):
    return ((crc >> 15 | crc << 17) + 0xA282EAD8) & 0xFFFFFFFF


def _varint(value):
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    out.append(value)
    return bytes(out)


def _message(number, content):
    """A field of bytes, text or a message."""
    return _varint(number << 3 | 2) + _varint(len(content)) + content


def _bytes_feature(content):
    return _message(1, _message(1, content))


def _map_entry(name, value):
    return _message(1, _message(1, name.encode()) + _message(2, value))


def example_bytes(series, key):
    """The SequenceExample of a trajectory."""
    types = np.ascontiguousarray(series.particle_type, "<i8").tobytes()
    context = _map_entry("key", _message(3, _message(1, _varint(key))))
    context += _map_entry("particle_type", _bytes_feature(types))
    frames = b"".join(_message(1, _bytes_feature(np.ascontiguousarray(frame, "<f4").tobytes()))
                      for frame in series.position)
    return _message(1, context) + _message(2, _map_entry("position", frames))


def write_tfrecord_split(path, count, source):
    """One trajectory is in memory at a time. Readers know one number of frames: another one is an InputError."""
    frames = None
    with writing(path), open(path, "wb") as file:
        for i in range(count):
            series = source(i)
            frames = series.frames if frames is None else frames
            if series.frames != frames:
                raise InputError(f"{series.where} has {series.frames} frames, others have {frames} (TFRecord data sets "
                                 "have one number). Cut the longer ones, or convert to gns")
            record = example_bytes(series, i)
            length = struct.pack("<Q", len(record))
            file.write(length + struct.pack("<I", masked(crc32c(length))))
            file.write(record)
            file.write(struct.pack("<I", masked(crc32c(record))))
