"""What a name on the command line means: which file, which kind of rig, which rig a sequence is written for.

Used by everybody who loads a rig or a sequence, and by the launch file: no numerics in here, and no values read.
"""

from __future__ import annotations

import os
from pathlib import Path

from ..catalogue import GEARBOX
from ..errors import RigError, no_file
from . import CONFIG_DIR, load_marked

DEFAULT_RIG = "hydmag"


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
        known = ", ".join(sorted(p.stem for p in (CONFIG_DIR / kind).glob("*.yaml")))
        if os.path.isdir(text):
            raise RigError(f"{text}: {no_file(text)}")
        raise RigError(f"there is no {kind[:-1]} '{text}'; known are {known}, or name a .yaml file")
    return path


def kind_of(name: str | Path) -> str:
    """The kind of an installed rig or of a file, without reading its values; RigError when there is none."""
    node = load_marked(find_config("rigs", name))
    if isinstance(node, dict) and "base" in node:
        return kind_of(str(node["base"]))
    return str(node.get("kind", GEARBOX)) if isinstance(node, dict) else GEARBOX


def rig_of(sequence: str | Path | None) -> str:
    """The rig that a sequence is written for, by its name or file; the default one without a sequence."""
    node = load_marked(find_config("sequences", sequence)) if sequence else {}
    return str(node.get("rig", DEFAULT_RIG)) if isinstance(node, dict) else DEFAULT_RIG
