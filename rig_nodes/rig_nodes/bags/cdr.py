# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Exact CDR: messages to bytes and back, byte for byte the same on every machine.

Publishers encode each message once with it; DDS carries the bytes and the recorder stores them. The format is little-endian
plain CDR (OMG DDS-RTPS 10.2, CORBA 15.3): 4 bytes of encapsulation, then each number aligned to its own size.

It is written here because rclpy's encoder leaves what the memory held between the fields, so that no two bags would be alike. A
Measurement takes 0.3 us, in a block 0.014 us; by rosbags, whose bytes are the same, 4.6 us, and by rclpy 14 us.
"""

from __future__ import annotations

import struct
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from .definitions import TIME, Definition, Leaf, Node, installed

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

HEADER = b"\x00\x01\x00\x00"
_FRAMELESS, _FRAME = b"\x01\x00\x00\x00\x00", slice(12, 17)  # an empty frame_id, and its place in a message
MET = 64  # number of message lengths remembered per type
_STAMP_SEQ = struct.Struct("<iI8xQ")
_STAMP = struct.Struct("<iI")
_LENGTH = struct.Struct("<I")
_SECOND = 1_000_000_000


class Encoder:
    """Encoder of one message type of the rig's own form (``header``, ``seq``, then values), with an empty frame_id.

    The part of fixed layout is one precompiled struct: a transducer's message costs about a microsecond.
    """

    def __init__(self, definition: Definition) -> None:
        if not definition.counted:
            raise TypeError(f"{definition.name} does not start with header and seq; encode it with encode_any")
        self.name, self._definition = definition.name, definition
        self._fields = definition.tree.fields[2:]
        leaves = definition.leaves
        self._format = _struct_format(leaves)
        self._pack = struct.Struct(self._format).pack
        self._fixed_fields = self._fields[: len(self._fields) - len(definition.tail)]
        # count of numbers in each field; None for a single number
        self._counts = [None if node.kind == "number" else node.count for _, node in self._fixed_fields]
        self._arrays = any(self._counts)
        self._booleans = [i for i, (_, node) in enumerate(self._fields) if node.name == "bool" and node.kind == "number"]
        self._records: dict[tuple[int, ...], np.dtype] = {}  # by the lengths of texts and lists
        self._tail, self._count = definition.tail, len(self._fields)
        # a tail that struct packs at once, in a third of the time: numbers, texts and lists of real numbers
        self._plain_tail = bool(self._tail) and all(
            node.kind == "number"
            or (not node.count and (node.kind == "string" or (node.kind == "sequence" and node.item.name == "float64")))
            for _, node in self._tail
        )
        if not (self._tail or self._arrays or self._booleans):
            self.encode = self._numbers_only

    def encode(self, stamp_ns: int, seq: int, *values: Any) -> bytes:
        """Return the message as bytes, encapsulation included.

        Parameters
        ----------
        stamp_ns : int
            Simulated time [ns].
        seq : int
            Number of the message on its topic.
        *values
            The other fields in the order of the definition; arrays and sequences as lists or numpy arrays.

        Returns
        -------
        bytes
            The encoded message.

        Raises
        ------
        TypeError
            When the number or the type of the values is wrong.
        ValueError
            When a field cannot hold its number.
        """
        if len(values) != self._count:
            raise TypeError(
                f"{self.name} has {len(self._fields)} values after stamp and seq "
                f"({', '.join(name for name, _ in self._fields)}), got {len(values)}"
            )
        fixed = values[: len(self._fixed_fields)] if self._tail else values
        for i in self._booleans:
            # struct would accept any value as a bool.
            if values[i] is not True and values[i] is not False and not isinstance(values[i], np.bool_):
                raise TypeError(f"{self.name}.{self._fields[i][0]} is a bool, got {values[i]!r}")
        if self._plain_tail:
            try:
                return self._with_tail(stamp_ns, seq, fixed, values[len(fixed) :])
            except (struct.error, TypeError, OverflowError, AttributeError):
                pass  # the following code raises the error of the field
        try:
            flat = self._flat(fixed) if self._arrays else fixed
            data = self._pack(HEADER, stamp_ns // _SECOND, stamp_ns % _SECOND, 1, 0, seq, *flat)
        except (struct.error, TypeError, OverflowError):
            self._explain(stamp_ns, seq, fixed)
            raise
        if not self._tail:
            return data
        out = bytearray(data)
        for (name, node), value in zip(self._tail, values[len(fixed) :]):
            _write(out, node, value, f"{self.name}.{name}")
        return bytes(out)

    def _numbers_only(self, stamp_ns: int, seq: int, *values: Any) -> bytes:
        """Encode as :meth:`encode` does, for the message form that most of a run's messages have."""
        try:
            return self._pack(HEADER, stamp_ns // _SECOND, stamp_ns % _SECOND, 1, 0, seq, *values)
        except (struct.error, TypeError, OverflowError):
            return Encoder.encode(self, stamp_ns, seq, *values)  # raises the error of the field

    def encode_each(self, stamp_ns: int, seq: int, numbers: np.ndarray) -> list[bytes]:
        """Return a message for each of some real numbers, all with the same stamp and sequence number.

        Parameters
        ----------
        stamp_ns : int
            Simulated time [ns].
        seq : int
            Number of each message on its topic.
        numbers : (n,) array of float64
            The numbers; each is the only other field of its message, a float64.

        Returns
        -------
        list of bytes
            The n encoded messages.
        """
        size, packed = numbers.itemsize, numbers.tobytes()
        head = self.encode(stamp_ns, seq, 0.0)[:-size]
        return [head + packed[at : at + size] for at in range(0, len(packed), size)]

    def encode_block(self, stamps: np.ndarray, seqs: np.ndarray, *values: Any) -> np.ndarray:
        """Return several messages of one topic as :meth:`encode` makes each of them, in a small part of the time.

        The first one is checked as :meth:`encode` checks it.

        Parameters
        ----------
        stamps : (n,) array of int64
            Simulated times [ns].
        seqs : (n,) array of int64
            Numbers of the messages on their topic.
        *values
            The other fields in the order of the definition: an array with n rows where the field differs from message to message,
            otherwise the value that it has in all of them. Lists have the same length in all.

        Returns
        -------
        (n, size) array of uint8
            The encoded messages.

        Raises
        ------
        TypeError or ValueError
            When a field of the first message does not fit, as :meth:`encode` raises it.
        """
        values_of_first = [value[0] if isinstance(value, np.ndarray) else value for value in values]
        first = self.encode(int(stamps[0]), int(seqs[0]), *values_of_first)
        lengths = tuple(
            [
                len(value.encode() if isinstance(value, str) else value)
                for value in values_of_first[len(self._fixed_fields) :]  # of fixed fields they are always the same
                if isinstance(value, (str, list, tuple, np.ndarray))
            ]
        )
        if lengths not in self._records:
            self._records[lengths] = self._definition.numbers_in(first)
        out = _repeated(first, len(stamps))
        record = np.ndarray(len(out), self._records[lengths], out)
        record["stamp.sec"], record["stamp.nanosec"], record["seq"] = stamps // _SECOND, stamps % _SECOND, seqs
        for (name, _), value in zip(self._fields, values):
            if isinstance(value, np.ndarray):
                record[name] = value
        return out

    def _with_tail(self, stamp_ns: int, seq: int, fixed: Sequence[Any], tail: Sequence[Any]) -> bytes:
        """The message with the tail behind the fixed part, packed at once."""
        flat = self._flat(fixed) if self._arrays else list(fixed)
        pieces = []
        for (_, node), value in zip(self._tail, tail):
            if node.kind == "number":
                pieces.append((None, node.code, node.size))
                flat.append(value)
            elif node.kind == "string":
                text = value.encode() + b"\x00"
                pieces.append((len(text), "s", 1))
                flat += len(text), text
            elif isinstance(value, np.ndarray) and value.dtype == np.float64:
                data = value.tobytes()
                pieces.append((len(data), "s", 8))
                flat += value.size, data
            else:
                pieces.append((len(value), "d", 8))
                flat.append(len(value))
                flat.extend(value)
        pack = _struct_with_tail(self._format, tuple(pieces)).pack
        return pack(HEADER, stamp_ns // _SECOND, stamp_ns % _SECOND, 1, 0, seq, *flat)

    def _flat(self, values: Sequence[Any]) -> list:
        flat: list = []
        for i, (count, value) in enumerate(zip(self._counts, values)):
            if count is None:
                flat.append(value)
            elif len(value) == count:
                flat.extend(value)
            else:
                raise TypeError(f"{self.name}.{self._fields[i][0]} has {count} elements, got {len(value)}")
        return flat

    def _explain(self, stamp_ns: int, seq: int, values: Sequence[Any]) -> None:
        """Raise the error of the field that cannot be encoded."""
        _number(Node("number", "int64"), stamp_ns, f"{self.name}.stamp")
        _number(Node("number", "int32"), stamp_ns // _SECOND, f"{self.name}.stamp.sec")
        _number(Node("number", "uint64"), seq, f"{self.name}.seq")
        for (name, node), value in zip(self._fixed_fields, values):
            _write(bytearray(HEADER), node, value, f"{self.name}.{name}")


def _repeated(message: bytes, count: int) -> np.ndarray:
    """Return a message several times (count, size)."""
    out = np.empty((count, len(message)), np.uint8)
    out[:] = np.frombuffer(message, np.uint8)
    return out


@lru_cache(maxsize=256)
def _struct_with_tail(text: str, pieces: tuple[tuple[int | None, str, int], ...]) -> struct.Struct:
    """Return the struct of a format and, behind it, of the pieces of a tail.

    A piece is its count (None for a single number, which has no length before it), its struct code, and its alignment.
    """
    for count, code, size in pieces:
        if count is not None:
            text += f"{-struct.calcsize(text) % 4}xI"
        # counted from behind the encapsulation's 4 bytes; an empty list is not aligned
        gap = 0 if count == 0 else (4 - struct.calcsize(text)) % size
        text += f"{gap}x{'' if count is None else count}{code}"
    return struct.Struct(text)


def _struct_format(leaves: Iterable[Leaf]) -> str:
    """Return the struct format of encapsulation and leaves, with the padding of CDR written out."""
    text, position = "<4s", 0
    for leaf in leaves:
        text += "x" * (leaf.offset - position) + leaf.node.code * (leaf.count or 1)
        position = leaf.offset + leaf.node.size * (leaf.count or 1)
    return text


@cache
def encoder(ros_type: str) -> Encoder:
    """Return the encoder of an installed rig message; RigError when there is no such type."""
    return Encoder(installed(ros_type))


def encode_any(ros_type: str, message: object) -> bytes:
    """Encode a message of any installed type as exact CDR, with or without a ``std_msgs/Header``.

    Parameters
    ----------
    ros_type : str
        Message type.
    message : object or dict
        An object with the fields as attributes, or a dict with all of them; a time may be given as integer nanoseconds.

    Returns
    -------
    bytes
        The encoded message.

    Raises
    ------
    TypeError or ValueError
        When a field does not fit; the error names it.
    """
    out = bytearray(HEADER)
    _write(out, installed(ros_type).tree, message, ros_type)
    return bytes(out)


class Form:
    """Encoder of a message whose values always stand at the same place; it is some ten times faster than encode_any.

    ``fill(*values)`` gives the message for encode_any. The message starts with a std_msgs/Header or a stamp, and each value, a
    float64, occurs in it once.
    """

    def __init__(self, ros_type: str, fill: Callable[..., object], values: int) -> None:
        """Prepare the encoder; ``values`` is the number of arguments that ``fill`` takes."""
        marks = [-1.0 - number / 7.0 for number in range(values)]
        self._bytes = bytearray(encode_any(ros_type, fill(*marks)))
        places = [self._bytes.index(struct.pack("<d", mark)) for mark in marks]
        self._slots = [(struct.Struct("<d").pack_into, place) for place in places]
        self._record = np.dtype(
            {
                "names": ["sec", "nanosec", *map(str, range(values))],
                "formats": ["<i4", "<u4", *["<f8"] * values],
                "offsets": [len(HEADER), len(HEADER) + 4, *places],
                "itemsize": len(self._bytes),
            }
        )

    def encode(self, stamp_ns: int, *values: float) -> bytes:
        """Return the message as bytes, encapsulation included; ``stamp_ns`` is the simulated time [ns]."""
        _STAMP.pack_into(self._bytes, len(HEADER), *divmod(stamp_ns, _SECOND))
        for (pack_into, place), value in zip(self._slots, values, strict=True):
            pack_into(self._bytes, place, value)
        return bytes(self._bytes)

    def encode_block(self, stamps: np.ndarray, *values: np.ndarray | float) -> np.ndarray:
        """Return messages (n, size) as :meth:`encode` makes them, for stamps (n,) [ns] and values (n,), or one for all of them."""
        out = _repeated(bytes(self._bytes), len(stamps))
        record = np.ndarray(len(out), self._record, out)
        record["sec"], record["nanosec"] = stamps // _SECOND, stamps % _SECOND
        for k, column in enumerate(values):
            record[f"{k}"] = column
        return out


def decode(ros_type: str, data: bytes) -> Any:
    """Decode a message by the installed definition.

    Parameters
    ----------
    ros_type : str
        Message type.
    data : bytes
        CDR with encapsulation.

    Returns
    -------
    object
        The message with its fields as attributes.

    Raises
    ------
    ValueError
        When the bytes are not such a message.
    """
    return decode_as(installed(ros_type), data)


def decode_as(definition: Definition, data: bytes) -> Any:
    """Decode as :func:`decode` does, with a given definition, for example the one that a bag carries."""
    try:
        return definition.store.deserialize_cdr(data, definition.name)
    except Exception as error:
        # rosbags raises errors of several unrelated classes for cut or garbled bytes.
        raise ValueError(f"{len(data)} bytes are no {definition.name} ({error})") from None


def exact(definition: Definition, data: bytes) -> bytes:
    """Return the message without the bytes that DDS appends up to a multiple of 4 between processes.

    Raises
    ------
    ValueError
        When the bytes are not such a message.
    """
    if _met(definition, data):
        return data
    if definition.counted and data[_FRAME] != _FRAMELESS and len(data) >= definition.size:
        out = bytearray(HEADER)
        _write(out, definition.tree, decode_as(definition, data), definition.name)
        return bytes(out)
    if definition.fixed:
        if definition.size <= len(data) < definition.size + 4:
            return data[: definition.size]
        raise ValueError(f"{len(data)} bytes are no {definition.name}, which has {definition.size}")
    if len(data) < definition.size:
        raise ValueError(f"{len(data)} bytes are no {definition.name}, which begins with {definition.size}")
    if definition.lists:
        end = definition.end_of(data)
        if end is None or len(data) >= end + 4:
            raise ValueError(f"{len(data)} bytes are no {definition.name} by the lengths of its lists")
        if len(data) == end and len(definition.met) < MET:
            begins = ((_FRAME, _FRAMELESS),) if definition.counted else ()
            definition.met[end] = (*begins, *definition.lengths(data))
        return data[:end]
    if definition.tree.ends_aligned:
        return data
    out = bytearray(HEADER)
    _write(out, definition.tree, decode_as(definition, data), definition.name)
    return bytes(out)


def _met(definition: Definition, data: bytes) -> bool:
    """Return True for a message with the length and the list lengths of an earlier exact one, as most of a run's messages have."""
    marks = definition.met.get(len(data))
    if marks is None:
        return False
    for place, mark in marks:  # noqa: SIM110  all() of a generator takes twice as long, at each message of a run
        if data[place] != mark:
            return False
    return True


def frameless(definition: Definition, data: bytes) -> bytes:
    """Return a message of the rig's own form with an empty frame_id, as the rig sends it.

    Raises
    ------
    ValueError
        When the bytes are not such a message.
    """
    if data[_FRAME] == _FRAMELESS:
        return data
    message = decode_as(definition, data)
    message.header.frame_id = ""
    out = bytearray(HEADER)
    _write(out, definition.tree, message, definition.name)
    return bytes(out)


def all_frameless(definition: Definition, messages: list[bytes]) -> list[bytes]:
    """Return messages as :func:`frameless` returns each of them; the list itself where they are that already, as nearly always."""
    if b"".join([data[_FRAME] for data in messages]) == _FRAMELESS * len(messages):
        return messages
    return [frameless(definition, data) for data in messages]


class Fields:
    """Decoder of one installed type of the rig's own form: a numpy record of all its numbers.

    The record holds lists of numbers when nothing else follows them. It does not hold strings or anything behind a string.
    """

    def __init__(self, ros_type: str) -> None:
        self._definition = installed(ros_type)
        self._plain = self._definition.dtype()
        self._sized: np.dtype | None = None
        self._lists = [name for name, _ in self._definition.tail] if self._definition.lists else []

    def of(self, data: bytes) -> np.void:
        """Return the fields of a message; ValueError when the bytes are not such a message."""
        if len(data) < self._plain.itemsize or data[1] != 1:  # 1: little-endian, which every DDS on this host sends
            raise ValueError(f"{len(data)} bytes are no {self._definition.name}")
        data = frameless(self._definition, data)
        if not self._lists:
            return np.frombuffer(data, self._plain, 1)[0]
        sized = self._sized
        if sized is not None and len(data) >= sized.itemsize:
            record = np.frombuffer(data, sized, 1)[0]
            if all(record[f"{name}#"] == len(record[name]) for name in self._lists):
                return record
        self._sized = self._definition.sized(data)
        if self._sized is None:
            raise ValueError(f"{len(data)} bytes are no {self._definition.name}")
        return np.frombuffer(data, self._sized, 1)[0]


def stamp_and_seq(data: bytes) -> tuple[int, int]:
    """Return the simulated time [ns] and the sequence number of an encoded message of the rig's own form."""
    if len(data) < 28 or data[:2] != HEADER[:2]:
        raise ValueError(f"{len(data)} bytes are too few or not little-endian CDR; expected header and seq")
    seconds, nanoseconds, seq = _STAMP_SEQ.unpack_from(data, 4)
    return seconds * _SECOND + nanoseconds, seq


def stamp(data: bytes) -> int:
    """Return the time [ns] of an encoded message that starts with a stamp or a ``std_msgs/Header``."""
    if len(data) < 12 or data[:2] != HEADER[:2]:
        raise ValueError(f"{len(data)} bytes are too few or not little-endian CDR; expected a stamp")
    seconds, nanoseconds = _STAMP.unpack_from(data, 4)
    return seconds * _SECOND + nanoseconds


def _write(out: bytearray, node: Node, value: Any, where: str) -> None:
    """Append one value; alignment counts from the end of the encapsulation."""
    if node.kind == "number":
        out += bytes(-(len(out) - 4) % node.size)
        out += _number(node, value, where)
    elif node.kind == "string":
        if not isinstance(value, str):
            raise TypeError(f"{where} is a string, got {value!r}")
        text = value.encode()
        if node.count and len(text) > node.count:
            raise ValueError(f"{where} holds at most {node.count} bytes, got {len(text)}")
        _write_length(out, len(text) + 1)
        out += text + b"\x00"
    elif node.kind == "message":
        _write_message(out, node, value, where)
    else:
        _write_list(out, node, value, where)


def _write_length(out: bytearray, length: int) -> None:
    out += bytes(-(len(out) - 4) % 4)
    out += _LENGTH.pack(length)


def _write_message(out: bytearray, node: Node, value: Any, where: str) -> None:
    if node.name == TIME and isinstance(value, (int, np.integer)):
        value = {"sec": int(value) // _SECOND, "nanosec": int(value) % _SECOND}
    names = [name for name, _ in node.fields]
    if isinstance(value, dict):
        unknown = [key for key in value if key not in names]
        missing = [name for name in names if name not in value]
        if unknown or missing:
            raise TypeError(
                f"{where} needs exactly the fields {', '.join(names)}; missing: "
                f"{', '.join(missing) or 'none'}, unknown: {', '.join(unknown) or 'none'}"
            )
        parts = [value[name] for name in names]
    else:
        missing = [name for name in names if not hasattr(value, name)]
        if missing:
            raise TypeError(f"{where} needs the fields {', '.join(names)}, got {type(value).__name__} without {', '.join(missing)}")
        parts = [getattr(value, name) for name in names]
    for (name, member), part in zip(node.fields, parts):
        _write(out, member, part, f"{where}.{name}")


def _write_list(out: bytearray, node: Node, value: Any, where: str) -> None:
    if isinstance(value, (str, bytes)) and node.item.name not in ("byte", "uint8", "char"):
        raise TypeError(f"{where} is a list, got {value!r}")
    numbers = _numbers(node.item, value, where) if node.item.kind == "number" else None
    length = len(value if numbers is None else numbers)
    if node.kind == "array" and length != node.count:
        raise TypeError(f"{where} has {node.count} elements, got {length}")
    if node.kind == "sequence":
        if node.count and length > node.count:
            raise ValueError(f"{where} holds at most {node.count} elements, got {length}")
        _write_length(out, length)
    if numbers is not None:
        if length:
            out += bytes(-(len(out) - 4) % node.item.size)
            out += numbers.tobytes()
    else:
        for i, item in enumerate(value):
            _write(out, node.item, item, f"{where}[{i}]")


def _numbers(node: Node, value: Any, where: str) -> np.ndarray:
    """Return values as a flat little-endian array; a table is taken row by row."""
    wanted = np.dtype("?" if node.name == "bool" else "<" + np.dtype(node.code).str[1:])
    if isinstance(value, (bytes, bytearray)):
        value = np.frombuffer(value, np.uint8)
    try:
        array = np.asarray(value).reshape(-1)
    except ValueError:
        raise TypeError(f"{where} is a list of {node.name}, got lists of different lengths") from None
    if array.size == 0:
        return array.astype(wanted)
    allowed = {"b": "b", "f": "fiu"}.get(wanted.kind, "iu")
    if array.dtype.kind not in allowed:
        raise TypeError(f"{where} is a list of {node.name}, got elements of type {array.dtype}")
    if wanted.kind in "iu":
        limits = np.iinfo(wanted)
        if int(array.min()) < limits.min or int(array.max()) > limits.max:
            raise ValueError(f"{where} holds {limits.min} to {limits.max}, got {array.min()} to {array.max()}")
    return array.astype(wanted, copy=False)


def _number(node: Node, value: Any, where: str) -> bytes:
    """Return one number as little-endian bytes, without padding."""
    if node.name == "bool":
        if not isinstance(value, (bool, np.bool_)):
            raise TypeError(f"{where} is a bool, got {value!r}")
    elif node.name in ("float32", "float64"):
        if not isinstance(value, (int, float, np.integer, np.floating)):
            raise TypeError(f"{where} is a number ({node.name}), got {value!r}")
    elif not isinstance(value, (int, np.integer)):
        raise TypeError(f"{where} is an integer ({node.name}), got {value!r}")
    try:
        return struct.pack("<" + node.code, value)
    except (struct.error, OverflowError):
        raise ValueError(f"{where} is a {node.name}, which cannot hold {value!r}") from None
