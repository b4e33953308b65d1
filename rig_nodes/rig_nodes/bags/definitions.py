# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Message definitions: their source, and the place of each field in an encoded message.

Publishers use the texts in ``interfaces``, which are those of the rig's messages and of the ROS 2 messages that a run records, and
for any other type that of the ROS 2 around; the reader uses those that a bag carries.
"""

from __future__ import annotations

import os
import re
import struct
from dataclasses import dataclass, field
from functools import cache, cached_property, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from ..base import RigError, kept, kept_folder, version_of
from . import limits

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rosbags.typesys.store import Typestore

# Type names of the .msg language -> struct code; a number's size is also its alignment in CDR.
CODES = {
    "bool": "?",
    "byte": "B",
    "char": "B",
    "int8": "b",
    "uint8": "B",
    "int16": "h",
    "uint16": "H",
    "int32": "i",
    "uint32": "I",
    "int64": "q",
    "uint64": "Q",
    "float32": "f",
    "float64": "d",
}
INTERFACES = Path(__file__).with_name("interfaces")  # <package>/msg/<Name>.msg
TIME, HEADER = "builtin_interfaces/msg/Time", "std_msgs/msg/Header"
_WIDE = re.compile(r"\s*wstring[\s\[<]")
_TYPE = re.compile(r"[A-Za-z]\w{0,199}(/msg)?/[A-Za-z]\w{0,199}", re.ASCII)


@dataclass(frozen=True)
class Node:
    """The type of one field: ``kind`` is number, string, message, array or sequence.

    ``name`` is the base type or message type, ``count`` the length of an array or the bound of a sequence or
    string (0: none), ``item`` the element of an array or sequence, ``fields`` the members of a message.
    """

    kind: str
    name: str = ""
    count: int = 0
    item: Node | None = None
    fields: tuple[tuple[str, Node], ...] = ()

    @property
    def code(self) -> str:
        """The struct code of a number."""
        return CODES[self.name]

    @property
    def ends_aligned(self) -> bool:
        """True when the encoded field always ends at a multiple of 4 bytes."""
        if self.kind == "number":
            return self.size >= 4
        if self.kind == "message":
            return self.fields[-1][1].ends_aligned
        return self.kind != "string" and self.item.ends_aligned

    @property
    def many(self) -> bool:
        """True when the field contains a sequence of messages or texts, so that one byte may become an object."""
        if self.kind == "sequence":
            return self.item.kind != "number"
        return any(node.many for _, node in self.fields) if self.kind == "message" else bool(self.item and self.item.many)

    @property
    def size(self) -> int:
        """Size of a number, which is also its alignment [bytes]."""
        return struct.calcsize("=" + CODES[self.name])


@dataclass(frozen=True)
class Leaf:
    """A number or array of numbers at a fixed place: ``path`` like ``stamp.sec``, ``offset`` in the body."""

    path: str
    node: Node
    count: int
    offset: int


@dataclass(frozen=True, eq=False)
class Definition:
    """One message type: its text as a bag stores it, its RIHS01 hash and its tree of fields.

    ``leaves`` are the fields whose place does not depend on the content; ``tail`` holds the top-level fields from
    the first of variable size on. ``size`` is the number of bytes up to the end of the leaves, encapsulation included; when
    the tail is empty it is the size of every message.
    """

    name: str
    text: str
    type_hash: str
    tree: Node
    leaves: tuple[Leaf, ...]
    tail: tuple[tuple[str, Node], ...]
    size: int
    # lengths of messages with lists that were exact -> the bytes of their lists' lengths, each with its place (cdr.exact)
    met: dict[int, tuple[tuple[slice, bytes], ...]] = field(default_factory=dict, repr=False)

    @property
    def fixed(self) -> bool:
        """True when every message of the type has the same size."""
        return not self.tail

    @cached_property
    def store(self) -> Typestore:
        """What decodes its messages; it is made with the first one."""
        return _parsed(self.name, self.text)[2]

    @cached_property
    def counted(self) -> bool:
        """True for a message of the rig's own form: it starts with ``header`` and ``seq``."""
        return _counted(self.tree)

    def sized(self, data: bytes) -> np.dtype | None:
        """Return :meth:`numbers_in` of a message without the bytes that may follow its lists.

        The result is None when the tail holds anything but lists of numbers or the message is too short.
        """
        end = self.end_of(data)
        return None if end is None else self.numbers_in(data[:end])

    @cached_property
    def lists(self) -> bool:
        """True when the tail consists only of lists of numbers."""
        return bool(self.tail) and all(node.kind == "sequence" and node.item.kind == "number" for _, node in self.tail)

    def end_of(self, data: bytes) -> int | None:
        """Return a message's size [bytes] by the lengths of its lists; None when it is shorter or of another form."""
        places = self._places(data)
        if not places:
            return None
        _, first, count = places[-1]
        end = first + self.tail[-1][1].item.size * count
        return end if end <= len(data) else None

    def lengths(self, data: bytes) -> tuple[tuple[slice, bytes], ...]:
        """Return the bytes of a message that hold the lengths of its lists, each with its place (:attr:`lists`)."""
        places = [slice(at, at + 4) for at, _, _ in self._places(data)]
        return tuple((place, data[place]) for place in places)

    def numbers_in(self, data: bytes) -> np.dtype:
        """Return the numpy record of all numbers of a message of this type, as long as the message.

        Its fields are the leaves, and those of the tail up to the first one that is no text, number or list of numbers; the length
        of a list is there as ``name#``. Messages with texts and lists of the same lengths have the same record.
        """
        found = [(leaf.path, _numpy_format(leaf), 4 + leaf.offset) for leaf in self.leaves]
        at = self.size
        for name, node in self.tail:
            if node.kind == "number":
                at += -(at - 4) % node.size
                found.append((name, _numpy_format(Leaf(name, node, 0, 0)), at))
                at += node.size
                continue
            at += -(at - 4) % 4
            count, length_at = int.from_bytes(data[at : at + 4], "little"), at
            at += 4
            if node.kind == "string":
                at += count
            elif node.kind == "sequence" and node.item.kind == "number":
                at += -(at - 4) % node.item.size if count else 0
                found.append((f"{name}#", "<u4", length_at))
                found.append((name, (_numpy_format(Leaf(name, node.item, 0, 0)), (count,)), at))
                at += count * node.item.size
            else:
                break
        names, formats, offsets = zip(*found)
        return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": len(data)})

    def _places(self, data: bytes) -> list[tuple[int, int, int]]:
        """Return for each list of the tail the places of its length and first number, and its count; empty for a cut message."""
        places, end = [], self.size
        for _, node in self.tail if self.lists else ():
            at = end + -end % 4
            if len(data) < at + 4:
                return []
            count = int.from_bytes(data[at : at + 4], "little")
            first = at + 4 + (-at % node.item.size if count else 0)
            end = first + node.item.size * count
            places.append((at, first, count))
        return places

    def dtype(self) -> np.dtype:
        """Return the numpy record of the leaves; its item size is ``size``, so that joined messages can be viewed."""
        return np.dtype(
            {
                "names": [leaf.path for leaf in self.leaves],
                "formats": [_numpy_format(leaf) for leaf in self.leaves],
                "offsets": [4 + leaf.offset for leaf in self.leaves],
                "itemsize": self.size,
            }
        )


def _numpy_format(leaf: Leaf) -> str | tuple[str, tuple[int]]:
    base = "?" if leaf.node.name == "bool" else "<" + np.dtype(leaf.node.code).str[1:]
    return (base, (leaf.count,)) if leaf.count else base


@cache
def installed(ros_type: str) -> Definition:
    """Return the definition of an installed type, e.g. ``rig_msgs/msg/Measurement``.

    Raises
    ------
    RigError
        When the package or the message is not installed.
    """
    return parse(ros_type, _text_of(ros_type))


@cache
def _text_of(ros_type: str) -> str:
    """Return the text of an installed type as a bag stores it; RigError when it is not installed."""
    texts: dict[str, str] = {}
    _collect(ros_type, texts)
    separator = "=" * 80
    text = texts.pop(ros_type).rstrip() + "\n"
    for name, part in texts.items():
        text += f"{separator}\nMSG: {_short(name)}\n{part.rstrip()}\n"
    return text


def message_file(ros_type: str) -> Path:
    """Return the .msg file of an installed type.

    Parameters
    ----------
    ros_type : str
        Message type.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    RigError
        When the package or the message is not installed.
    """
    package, folder, short = ([*ros_type.split("/"), "", ""])[:3]
    if folder != "msg" or not _TYPE.fullmatch(ros_type):
        raise RigError(f"'{ros_type}' is not a message type; expected package/msg/Name")
    places = [
        INTERFACES / package,
        *(Path(one, "share", package) for one in os.environ.get("AMENT_PREFIX_PATH", "").split(":") if one),
    ]
    for place in places:
        if (path := place / "msg" / f"{short}.msg").is_file():
            return path
    if any(place.is_dir() for place in places):
        raise RigError(f"the package '{package}' has no message '{short}'")
    raise RigError(f"the message package '{package}' is not installed; './rig doctor' lists what is")


@lru_cache(maxsize=256)
def _kept(ros_type: str, text: str) -> tuple[Node, str]:
    """Return tree and hash of an installed type, kept on disk, because parsing those of a run takes a tenth of a second."""
    place = kept_folder("message-definitions") / f"{ros_type.replace('/', '-')}.json"
    about = Path(__file__).read_bytes() + version_of("rosbags").encode() + f"{ros_type}\n{text}".encode()
    tree, type_hash = kept(place, about, lambda: _for_json(*_parsed(ros_type, text)[:2]))
    return _of_lists(tree), type_hash


def _for_json(tree: Node, type_hash: str) -> list:
    return [_as_lists(tree), type_hash]


def _as_lists(node: Node) -> list:
    """A type of a field as JSON holds it."""
    item = _as_lists(node.item) if node.item else None
    return [node.kind, node.name, node.count, item, [[name, _as_lists(field)] for name, field in node.fields]]


def _of_lists(content: list) -> Node:
    """The type of a field from what JSON holds."""
    kind, name, count, item, fields = content
    return Node(kind, name, count, _of_lists(item) if item else None, tuple((name, _of_lists(field)) for name, field in fields))


@lru_cache(maxsize=256)
def parse(ros_type: str, text: str) -> Definition:
    """Parse a definition from the text that a bag stores: the message itself, then each type it needs after ``MSG:``.

    Parameters
    ----------
    ros_type : str
        Message type.
    text : str
        The text of the definition.

    Returns
    -------
    Definition
        The parsed definition.

    Raises
    ------
    RigError
        When the text is not a message definition or describes more than bags.limits allows.
    """
    try:
        own = _text_of(ros_type) == text
    except RigError:
        own = False
    root, type_hash = _kept(ros_type, text) if own else _parsed(ros_type, text)[:2]
    leaves, tail, end = _lay_out(root)
    return Definition(ros_type, text, type_hash, root, leaves, tail, 4 + end)


def _parsed(ros_type: str, text: str) -> tuple[Node, str, Typestore]:
    """Return the tree and the hash of a type, and the store that decodes its messages."""
    store = get_typestore(Stores.EMPTY)
    try:
        types = get_types_from_msg(_stripped(ros_type, text), ros_type)
        _Size(ros_type, types).check()
        store.register(types)
        return _message(ros_type, store.fielddefs), store.hash_rihs01(ros_type), store
    except RigError:
        raise
    except KeyError as error:
        raise RigError(f"the definition of {ros_type} cannot be read: it uses {error.args[0]}, which it does not define") from None
    except Exception as error:
        # rosbags raises errors of several unrelated classes, with the whole text in their message
        why = f"{type(error).__name__}: {str(error).partition(chr(10))[0][:200]}"
        raise RigError(f"the definition of {ros_type} cannot be read ({why}); expected .msg text") from None


def _stripped(ros_type: str, text: str) -> str:
    """Return a definition without empty lines and comments: the parser's time grows with the square of the number of lines."""
    lines = [line for line in text.replace("\r\n", "\n").split("\n") if line.strip() and not line.lstrip().startswith("#")]
    longest = max(map(len, lines), default=0)
    if not _TYPE.fullmatch(ros_type):
        raise RigError(f"'{ros_type[:100]}' is not a message type; expected package/msg/Name")
    if any(_WIDE.match(line) for line in lines):
        raise RigError(f"the definition of {ros_type} has a wide string (wstring), which is not read")
    if len(lines) > limits.LINES or longest > limits.LINE:
        raise RigError(
            f"the definition of {ros_type} has {len(lines)} lines of up to {longest} characters; at most "
            f"{limits.LINES} lines of {limits.LINE} are read"
        )
    return "\n".join(_qualified(ros_type, lines)) + "\n"


class _Size:
    """Counter of a message type's size with everything it contains, used before the type is built."""

    def __init__(self, ros_type: str, types: Mapping[str, Any]) -> None:
        self._name, self._types = ros_type, types
        self._fields = self._bytes = 0

    def check(self) -> None:
        """Raise RigError when the type is larger than bags.limits allows or contains itself."""
        self._message(self._name, 0)

    def _message(self, name: str, depth: int) -> None:
        if depth > limits.DEPTH:
            raise RigError(
                f"the definition of {self._name} goes deeper than {limits.DEPTH} messages within each other, or "
                f"{name} contains itself"
            )
        for _, description in self._types[name][1]:
            self._field(description, depth)

    def _field(self, description: tuple[Nodetype, Any], depth: int) -> None:
        form, value = description
        self._fields += 1
        if form == Nodetype.NAME:
            self._message(value, depth + 1)
        elif form in (Nodetype.ARRAY, Nodetype.SEQUENCE):
            item, count = value
            if item[0] == Nodetype.BASE and item[1][0] != "string":
                self._bytes += count * struct.calcsize(CODES[item[1][0]]) if form == Nodetype.ARRAY else 0
            else:
                for _ in range(count if form == Nodetype.ARRAY else 1):
                    self._field(item, depth)
        if self._fields > limits.FIELDS or self._bytes > limits.CHUNK:
            raise RigError(
                f"the definition of {self._name} has more than {limits.FIELDS} fields or {limits.CHUNK} bytes, "
                f"which is more than is read"
            )


def _collect(ros_type: str, texts: dict[str, str]) -> None:
    """Put the .msg text of a type and of all types it uses into ``texts``, the type itself first."""
    if ros_type in texts:
        return
    texts[ros_type] = message_file(ros_type).read_text(encoding="utf-8")
    for line in texts[ros_type].splitlines():
        name = re.match(r"\s*([\w/]*)", line)[1]
        if "/" not in name and name[:1].isupper():
            name = f"{ros_type.partition('/')[0]}/{name}"
        if "/" in name:
            package, *_, short = name.split("/")
            _collect(f"{package}/msg/{short}", texts)


def _qualified(ros_type: str, lines: list[str]) -> list[str]:
    """Write out the package of a field of the type Header where it is the package's own: the parser takes std_msgs's for it."""
    package, out = ros_type.partition("/")[0], []
    known = {line[4:].strip().replace("/msg/", "/") for line in lines if line.startswith("MSG:")}
    for line in lines:
        if line.startswith("MSG:"):
            package = line[4:].strip().partition("/")[0]
        own = f"{package}/Header" in known and re.match(r"\s*Header[\s\[]", line)
        out.append(f"{package}/{line.lstrip()}" if own else line)
    return out


def _short(ros_type: str) -> str:
    """Return ``package/Name``, as the heads of nested definitions give it."""
    package, _, name = ros_type.split("/")
    return f"{package}/{name}"


def _message(ros_type: str, types: Mapping[str, Any]) -> Node:
    return Node("message", ros_type, fields=tuple((name, _node(description, types)) for name, description in types[ros_type][1]))


def _node(description: tuple[Nodetype, Any], types: Mapping[str, Any]) -> Node:
    form, value = description
    if form == Nodetype.NAME:
        return _message(value, types)
    if form == Nodetype.BASE:
        name, bound = value
        return Node("string", "string", bound) if name == "string" else Node("number", name)
    item, count = value
    return Node("array" if form == Nodetype.ARRAY else "sequence", count=count, item=_node(item, types))


def _lay_out(tree: Node) -> tuple[tuple[Leaf, ...], tuple[tuple[str, Node], ...], int]:
    """Return the leaves and the tail of a message, and the offset where the leaves end.

    In a message of the rig's own form frame_id counts as empty, so that the fields behind it have fixed places;
    cdr.frameless empties it.
    """
    leaves: list[Leaf] = []
    position, first = 0, 0
    if _counted(tree):
        for path, code, size in (
            ("stamp.sec", "int32", 4),
            ("stamp.nanosec", "uint32", 4),
            ("frame_id#", "uint32", 4),
            ("frame_id", "uint8", 1),
        ):
            leaves.append(Leaf(path, Node("number", code), 0, position))
            position += size
        first = 1
    for index, (name, node) in enumerate(tree.fields[first:], first):
        flat = _flatten(name, node)
        if flat is None:
            return tuple(leaves), tree.fields[index:], position
        for path, number, count in flat:
            position += -position % number.size
            leaves.append(Leaf(path, number, count, position))
            position += number.size * (count or 1)
    return tuple(leaves), (), position


def _counted(tree: Node) -> bool:
    return [(name, node.name) for name, node in tree.fields[:2]] == [("header", HEADER), ("seq", "uint64")]


def _flatten(path: str, node: Node) -> list[tuple[str, Node, int]] | None:
    """Return the numbers of a field in order as (path, number, array length or 0); None when its size varies."""
    if node.kind == "number":
        return [(path, node, 0)]
    if node.kind == "array" and node.item is not None:
        if node.item.kind == "number":
            return [(path, node.item, node.count)]
        parts = [(f"{path}[{i}]", node.item) for i in range(node.count)]
    elif node.kind == "message":
        parts = [(f"{path}.{name}", member) for name, member in node.fields]
    else:
        return None
    flat: list[tuple[str, Node, int]] = []
    for name, member in parts:
        inner = _flatten(name, member)
        if inner is None:
            return None
        flat += inner
    return flat
