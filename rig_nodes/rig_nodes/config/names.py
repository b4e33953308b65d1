# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a name on the command line means: which file, which kind of rig, which rig a sequence is written for.

Used by everybody who loads a rig or a sequence, and by the launch file: no numerics in here, and no values read. What
is said of a name that nobody knows, wherever one is written, is :func:`unknown`.
"""

from __future__ import annotations

import difflib
import os
from collections.abc import Iterable
from pathlib import Path

from ..errors import RigError, brief, no_file
from . import CONFIG_DIR, load_yaml
from .yaml_file import where_of

DEFAULT_RIG = "hydmag"

MOST_NAMED = 24  # names in a sentence
MOST_LETTERS = 60  # of a name that is compared
MOST_BASES = 8


def unknown(what: str, name: str, known: Iterable[str]) -> str:
    """That there is no such name, with the ones most like it, or with all that there are: the words of a refusal.

    what: the kind of thing, without an article ("signal", "key of gearbox"). Capitals do not count, and a part of a
    name finds the whole: "m_wej" the topic "/motor/m_wej".
    """
    return f"there is no {what} {brief(str(name))}; {meant(name, known)}"


def meant(name: object, known: Iterable[object]) -> str:
    """The hint of :func:`unknown` alone."""
    names = list(map(str, known))
    text = str(name).lower()[:MOST_LETTERS]
    spelled = {one.lower(): one for one in reversed(names)}
    near = difflib.get_close_matches(text, spelled, 2, 0.6 if len(text) > 3 else 0.5)
    near = near or [one for one in spelled if len(text) > 1 and text in one][:2]
    if near:
        return f"did you mean {' or '.join(repr(spelled[one]) for one in near)}?"
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    return f"known are {', '.join(names[:MOST_NAMED])}{more}" if names else "there is none at all"


def unknown_value(key: str, parts: dict[str, Iterable[str]]) -> str:
    """The sentence on a ``key`` of --set that is no ``part.name`` of these parts and their names."""
    part, _, name = key.partition(".")
    named_so = [f"{one}.{key}" for one, names in parts.items() if key in names]
    if part in parts:
        return unknown(f"value of {part}", name, parts[part]) if name else \
            f"'{key}' is a part of the rig; name one of its values, e.g. {key}.{next(iter(parts[part]))}"
    if named_so:
        return f"there is no value {brief(key)}; did you mean {' or '.join(map(repr, named_so[:3]))}?"
    return unknown("value", key, [f"{one}.{name}" for one, names in parts.items() for name in names]) if name else \
        unknown("part of the rig", key, parts)


def find_config(kind: str, name: str | Path) -> Path:
    """Path of an installed ``kind`` (rigs, controllers, sequences) by name, or of a file; RigError otherwise."""
    text = str(name)
    if text.endswith((".yaml", ".yml")) or "/" in text:
        path = os.path.expanduser(text)
        if not os.path.isfile(path):  # False too for what can be no name of a file
            raise RigError(f"{text}: {no_file(path)}")
        return Path(path)
    path = CONFIG_DIR / kind / f"{text}.yaml"
    if not os.path.isfile(path):
        if os.path.isdir(text):
            raise RigError(f"{text}: {no_file(text)}")
        known = sorted(p.stem for p in (CONFIG_DIR / kind).glob("*.yaml"))
        raise RigError(f"{unknown(kind[:-1], text, known)} (or name a .yaml file)")
    return path


def beside(path: str | Path, name: object) -> str:
    """A name that stands in the file ``path``: that of a file is as seen from this file's folder."""
    text = str(name)
    if text.endswith((".yaml", ".yml")) and not os.path.isabs(os.path.expanduser(text)):
        return str(Path(path).parent / text)
    return text


def with_bases(name: str | Path) -> list[tuple[Path, object]]:
    """A rig's file with its content, and those that it stands on, each after the one that names it; RigError with file
    and line when a base is missing, stands on this rig itself, or there are more than MOST_BASES.
    """
    path = find_config("rigs", name)
    out = [(path, load_yaml(path))]
    while isinstance(out[-1][1], dict) and "base" in out[-1][1]:
        path, node = out[-1]
        where = f"{where_of(path, node, 'base')}: base"
        try:
            base = find_config("rigs", beside(path, node["base"]))
        except RigError as error:
            raise RigError(f"{where}: {error}") from None
        if any(os.path.samefile(base, one) for one, _ in out):
            raise RigError(f"{where}: {brief(str(node['base']))} stands on this rig itself; expected another rig")
        if len(out) > MOST_BASES:
            raise RigError(f"{where}: the rig stands on more than {MOST_BASES} others, one on the other")
        out.append((base, load_yaml(base)))
    return out


def kind_of(name: str | Path) -> str:
    """The kind of an installed rig or of a file, without reading its values; RigError when there is none."""
    from ..catalogue import GEARBOX  # here, as the catalogue itself refuses names by unknown()

    node = with_bases(name)[-1][1]
    return str(node.get("kind", GEARBOX)) if isinstance(node, dict) else GEARBOX


def rig_of(sequence: str | Path | None) -> str:
    """The rig that a sequence is written for, by its name or file; the default one without a sequence."""
    path = find_config("sequences", sequence) if sequence else None
    node = load_yaml(path) if path else {}
    return beside(path, node.get("rig", DEFAULT_RIG)) if isinstance(node, dict) else DEFAULT_RIG
