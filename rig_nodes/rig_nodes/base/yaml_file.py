# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""YAML text as marked maps and lists: each stores its own line, and the line of each key or item.

config uses it. A file is bounded in its length, its depth, its number of values and the length of each value, so that no file
takes longer to refuse than to read; an alias counts as often as it is written out.
"""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar

from .errors import RigError, brief

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from ruamel.yaml.error import MarkedYAMLError
    from ruamel.yaml.events import ScalarEvent

    T = TypeVar("T")

MOST_BYTES = 300_000
MOST_VALUES = 30_000
MOST_DEPTH = 40
LONGEST_TEXT = 10_000  # characters of one value
LARGEST = 2**64  # largest whole number

_WORDS = {
    "": None,
    "~": None,
    **{
        word: value
        for low, value in (("null", None), ("true", True), ("false", False))
        for word in (low, low.capitalize(), low.upper())
    },
}
_WHOLE = re.compile(r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+")
_FRACTION = re.compile(r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?")
_NO_NUMBER = re.compile(r"[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)")
_TAGS = {f"tag:yaml.org,2002:{name}" for name in ("str", "int", "float", "bool", "null", "map", "seq")}
_LEVEL = re.compile(r"( *)((?:- +)*)(?=\S)")
_NO_SPACE = re.compile(r" *(?:- +)*(-?[A-Za-z_][\w.]*:)([^\s:/\\].*)")
_NO_DASH_SPACE = re.compile(r" *-([A-Za-z_]\w*:.*)")


class Map(dict):
    """A map of a file; ``line`` is where it begins and ``lines`` is that of each key, both from 0.

    ``files`` has the file of each key that is not in the file from which the map was read (:func:`merged`).
    """

    def __init__(self, line: int) -> None:
        super().__init__()
        self.line, self.lines = line, {}
        self.files: dict[object, object] = {}


class List(list):
    """A list of a file; ``line`` is where it begins and ``lines`` is that of each item, both from 0."""

    def __init__(self, line: int) -> None:
        super().__init__()
        self.line, self.lines = line, []
        self.files: dict[object, object] = {}


def where_of(path: str | Path, node: Any, key: Any = None) -> str:
    """Return ``file:line`` of a key or an item in a map or list of a file, or of the map or list itself."""
    path = file_of(path, node, key)
    try:
        line = node.lines[key] if key is not None else node.line
    except (AttributeError, LookupError, TypeError):
        return str(path)
    return f"{path}:{line + 1}"


def file_of(path: T, node: object, key: object = None) -> str | Path | T:
    """Return the file of a key, an item, or the map or list itself: ``path``, unless :func:`stamped` has set another."""
    files = getattr(node, "files", None)
    return files.get(key, files.get(None, path)) if files else path


def stamped(node: Any, path: str | Path) -> Any:
    """Return the node after setting the file ``path`` in it and in all maps and lists that it contains."""
    if isinstance(node, (Map, List)):
        node.files[None] = path
        for value in node.values() if isinstance(node, Map) else node:
            stamped(value, path)
    return node


def merged(base: Map, node: Map) -> Map:
    """Return the map ``base`` with the values that another file has in their place.

    A map in both is merged in turn; everything else, including a list, is replaced as a whole. So is a map whose ``part`` is
    another, because one type of device does not have the values of another. A key with nothing (``~``) leaves out the base's.

    Parameters
    ----------
    base : Map
        The map of the base, :func:`stamped`.
    node : Map
        The map of the other file, :func:`stamped`.

    Returns
    -------
    Map
        The merged map.
    """
    out = Map(node.line)
    out.files[None] = node.files[None]
    for key in [*base, *(key for key in node if key not in base)]:
        owner = node if key in node else base
        if key in base and owner[key] is None:
            continue
        both = key in node and isinstance(node[key], Map) and isinstance(base.get(key), Map)
        both = both and node[key].get("part", base[key].get("part")) == base[key].get("part")
        out[key] = merged(base[key], node[key]) if both else owner[key]
        out.lines[key], out.files[key] = owner.lines[key], file_of(None, owner, key)
    return out


def read_yaml(path: str | Path, text: str) -> Any:
    """Return the one document of a file's text.

    Parameters
    ----------
    path : str or Path
        The file, for the errors.
    text : str
        Its text.

    Returns
    -------
    Map, List or a scalar
        The document.

    Raises
    ------
    RigError
        With file and line, when the text is not YAML that is accepted here.
    """
    from ruamel.yaml import YAML
    from ruamel.yaml.error import MarkedYAMLError, YAMLError

    try:
        content = _Builder(path).build(YAML(typ="safe", pure=True).parse(text))
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        raise RigError(_syntax(path, text, mark.line if mark else None, error)) from None
    except YAMLError as error:
        line = text.count("\n", 0, getattr(error, "position", 0)) + 1
        raise RigError(f"{path}:{line}: is not YAML ({str(error).splitlines()[0]})") from None
    if content is None:
        raise RigError(f"{path}: it is empty, expected a map of keys")
    return content


class _Builder:
    """Builds a document from the parser's events without recursion, because a deep document must not exhaust Python's stack."""

    def __init__(self, path: str | Path) -> None:
        self.path, self.values, self.line = path, 0, 0
        self.anchors: dict[str, object] = {}

    def refuse(self, why: str) -> NoReturn:
        """Raise RigError with the file and the line that is being read."""
        raise RigError(f"{self.path}:{self.line + 1}: {why}")

    def count(self, values: int = 1) -> None:
        """Add to the number of values of the file; RigError when there are too many."""
        self.values += values
        if self.values > MOST_VALUES:
            self.refuse(f"the file has more than {MOST_VALUES} values, aliases written out")

    def build(self, events: Iterable[Any]) -> Any:
        """Return the one document as Map, List or a scalar, None for an empty file; RigError for what is not accepted."""
        from ruamel.yaml import events as kinds

        found, documents = None, 0
        open_nodes, keys, names = [], [], []  # from the outside in: nodes, the key that waits for its value, anchors
        for event in events:
            kind = type(event)
            if kind in (kinds.StreamStartEvent, kinds.StreamEndEvent, kinds.DocumentEndEvent):
                continue
            self.line = event.start_mark.line
            if kind is kinds.DocumentStartEvent:
                documents += 1
                if documents > 1:
                    self.refuse("a second document begins here ('---'); expected one a file")
                continue
            if kind in (kinds.MappingEndEvent, kinds.SequenceEndEvent):
                value, name = open_nodes.pop(), names.pop()
                keys.pop()
                if name:
                    self.anchors[name] = value
            else:
                self.count()
                if kind is kinds.AliasEvent:
                    if event.anchor not in self.anchors:
                        self.refuse(f"'*{event.anchor}' names nothing that ends before it; '&{event.anchor}' must")
                    value = self.copy(self.anchors[event.anchor], len(open_nodes))
                else:
                    if event.tag is not None and str(event.tag) not in _TAGS:
                        self.refuse(f"the tag {brief(str(event.tag))} is not known here; write the value without it")
                    if kind is kinds.ScalarEvent:
                        value = self.scalar(event)
                        if event.anchor:
                            self.anchors[event.anchor] = value
                    else:
                        if len(open_nodes) == MOST_DEPTH:
                            self.refuse(f"maps and lists stand in each other more than {MOST_DEPTH} deep")
                        value = Map(self.line) if kind is kinds.MappingStartEvent else List(self.line)
                        self.place(open_nodes, keys, value)
                        open_nodes.append(value)
                        keys.append(_NO_KEY)
                        names.append(event.anchor)
                        found = value if found is None else found
                        continue
                self.place(open_nodes, keys, value)
                found = value if found is None and not open_nodes else found
        return found

    def place(self, open_nodes: list[Map | List], keys: list[object], value: object) -> None:
        """Put a value into the innermost open map or list; a key of a map waits for its value."""
        if not open_nodes:
            return
        into = open_nodes[-1]
        if isinstance(into, List):
            into.append(value)
            into.lines.append(self.line)
        elif keys[-1] is _NO_KEY:
            if isinstance(value, (Map, List)):
                self.refuse('a map or list is used as a key; expected a word (a value in braces needs quotes: "${name}")')
            if value == "<<":
                self.refuse("'<<' takes no other map in; write its keys here")
            if value in into:
                self.refuse(f"duplicate key {brief(value)}, first in line {into.lines[value] + 1}; each key may be used once")
            into.lines[value] = self.line
            keys[-1] = value
        else:
            into[keys[-1]] = value
            keys[-1] = _NO_KEY

    def copy(self, node: object, depth: int) -> object:
        """Return a copy of what an alias stands for."""
        if not isinstance(node, (Map, List)):
            return node
        if depth >= MOST_DEPTH:
            self.refuse(f"maps and lists stand in each other more than {MOST_DEPTH} deep")
        self.count(len(node))
        if isinstance(node, Map):
            out = Map(node.line)
            out.update((key, self.copy(value, depth + 1)) for key, value in node.items())
            out.lines = node.lines
            return out
        out = List(node.line)
        out.extend(self.copy(value, depth + 1) for value in node)
        out.lines = node.lines
        return out

    def scalar(self, event: ScalarEvent) -> str | int | float | bool | None:
        """Return the value of a plain or quoted text; RigError for a number that is too large."""
        text = event.value
        if len(text) > LONGEST_TEXT:
            self.refuse(f"a value of {len(text)} characters, expected at most {LONGEST_TEXT}")
        if not event.implicit[0]:  # quoted, or marked by a tag
            return text
        if text in _WORDS:
            return _WORDS[text]
        if _WHOLE.fullmatch(text):
            number = int(text, 0) if text[:2] in ("0o", "0x") else int(text) if len(text) < 30 else LARGEST + 1
            if abs(number) > LARGEST:
                self.refuse(f"{brief(text)} is too large a number")
            return number
        if _FRACTION.fullmatch(text):
            number = float(text)
            if not math.isfinite(number):
                self.refuse(f"{brief(text)} is too large a number")
            return number
        if _NO_NUMBER.fullmatch(text):
            self.refuse(f"{text} is no finite number")
        return text


_NO_KEY = object()


def _syntax(path: str | Path, text: str, line: int | None, error: MarkedYAMLError) -> str:
    """The text of an error on text that is not YAML: what is most likely wrong, and in which line."""
    problem = (error.problem or str(error)).strip().split("\n")[0]
    if line is None:
        return f"{path}: {problem}; expected YAML"
    lines = re.split("\r\n|[\r\n\x85\u2028\u2029]", text)
    line = min(line, len(lines) - 1)
    opened = error.context_mark.line if error.context_mark else line
    for at in (line, _before(lines, line)):
        if slip := no_space(lines[at]):
            return f"{path}:{at + 1}: {slip}"
    at, why = line, f"{problem}; expected YAML"
    if "\\t" in problem:
        why = "a tab stands here; YAML takes spaces only"
    elif "end of stream" in problem and "quoted" in (error.context or ""):
        at, why = opened, "the quote that is opened here is not closed"
    elif found := re.match(r"expected ',' or '([}\]])', but got", problem):
        if "${" in lines[line] or "${" in lines[opened]:
            why = '${...} between braces or brackets needs quotes: "${name}"'
        elif opened != line:
            at, why = opened, f"what is opened in this line is not closed; expected '{found[1]}'"
        else:
            why = f"a comma or '{found[1]}' is missing in column {error.problem_mark.column + 1}"
    elif found := re.match("found character '(.)' that cannot start", problem):
        why = f"a value that begins with '{found[1]}' needs quotes"
    elif found := re.search("but found '([}\\]])'", problem):
        why = f"'{found[1]}' closes nothing that is open"
    elif "mapping values" in problem and len(re.findall(r":(?:\s|$)", lines[line])) > 1:
        why = "a second colon; a value with a colon in it needs quotes"
    elif "mapping values" in problem or "<block end>" in problem:
        why = _level(lines, line) or why
    return f"{path}:{at + 1}: {why}"


def no_space(line: str) -> str:
    """Return the text of an error on ``key:value`` or ``-key: value``; empty for a line that has its spaces."""
    if found := _NO_SPACE.fullmatch(line):
        return f"there is no space after the colon; write {brief(f'{found[1]} {found[2]}')}"
    if found := _NO_DASH_SPACE.fullmatch(line):
        return f"there is no space after the dash; write {brief(f'- {found[1]}')}"
    return ""


def _before(lines: list[str], line: int) -> int:
    """The next line above that is not empty and not a comment."""
    above = (k for k in range(line - 1, -1, -1) if lines[k].strip() and not lines[k].lstrip().startswith("#"))
    return next(above, line)


def _level(lines: list[str], line: int) -> str:
    """What is wrong with the column in which a line begins; empty when nothing is wrong."""

    def columns(text: str) -> tuple[list[int], int]:  # columns of its dashes, and of what follows them
        found = _LEVEL.match(text)
        dashes = [k for k, c in enumerate(found[0]) if c == "-"] if found else []
        return dashes, found.end() if found else 0

    dashes, column = columns(lines[line])
    begins = dashes[0] if dashes else column
    above_dashes, above_keys, at, lowest = [], [], line, begins + 1000
    while (before := _before(lines, at)) != at and lowest > 0:  # levels that are still open
        at = before
        found, key = columns(lines[at])
        lowest, old = min([key, lowest, *found]), lowest
        above_dashes += [k for k in found if k < old]
        above_keys += [key] if key < old else []
    alike, other = (above_dashes, above_keys) if dashes else (above_keys, above_dashes)
    if begins in other and begins not in alike:
        return (
            "a dash stands here where the lines above have none" if dashes else "the dash is missing here that the items above have"
        )
    if begins in alike or not alike:
        return ""
    near = min(alike, key=lambda k: abs(k - begins))
    return f"the line begins in column {begins + 1} and fits no line above; expected column {near + 1}"
