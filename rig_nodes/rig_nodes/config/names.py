"""What a name on the command line means: which file, which kind of rig, which rig a sequence is written for.

Used by everybody who loads a rig or a sequence, and by the launch file: no numerics in here, and no values read. What
is said of a name that nobody knows, wherever one is written, is :func:`unknown`.
"""

from __future__ import annotations

import difflib
import os
from collections.abc import Iterable
from pathlib import Path

from ..errors import RigError, no_file
from . import CONFIG_DIR, load_marked

DEFAULT_RIG = "hydmag"


def unknown(what: str, name: str, known: Iterable[str]) -> str:
    """That there is no such name, with the ones most like it, or with all that there are: the words of a refusal.

    what: the kind of thing, without an article ("signal", "key of gearbox"). Capitals do not count, and a part of a
    name finds the whole: "m_wej" the topic "/motor/m_wej".
    """
    names = list(map(str, known))
    text = str(name).lower()
    spelled = {one.lower(): one for one in reversed(names)}
    near = difflib.get_close_matches(text, spelled, 2) or [one for one in spelled if len(text) > 1 and text in one][:2]
    if near:
        hint = f"did you mean {' or '.join(repr(spelled[one]) for one in near)}?"
    else:
        hint = f"known are {', '.join(names)}" if names else "there is none at all"
    return f"there is no {what} '{name}'; {hint}"


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


def kind_of(name: str | Path) -> str:
    """The kind of an installed rig or of a file, without reading its values; RigError when there is none."""
    from ..catalogue import GEARBOX  # here, as the catalogue itself refuses names by unknown()

    node = load_marked(find_config("rigs", name))
    if isinstance(node, dict) and "base" in node:
        return kind_of(str(node["base"]))
    return str(node.get("kind", GEARBOX)) if isinstance(node, dict) else GEARBOX


def rig_of(sequence: str | Path | None) -> str:
    """The rig that a sequence is written for, by its name or file; the default one without a sequence."""
    node = load_marked(find_config("sequences", sequence)) if sequence else {}
    return str(node.get("rig", DEFAULT_RIG)) if isinstance(node, dict) else DEFAULT_RIG
