# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a name on the command line means: which file, which rig, for which rig a sequence is written.

All that loads a rig or a sequence and the launch file use it; no values are read and nothing is computed here. Every error on
an unknown name is made by :func:`unknown`.
"""

from __future__ import annotations

import difflib
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from .config import CONFIG_DIR, RIGS_DIR, load_yaml
from .entry_points import Group
from .errors import RigError, brief, no_file
from .yaml_file import where_of

DEFAULT_RIG = "hydmag"  # of command lines that name none; nothing below them has a default
RIG_FILE = "rig.yaml"
RIGS = Group("rigs", "rig")  # of other packages: each is a folder with a rig.yaml

MOST_NAMED = 24  # names in one error
MOST_LETTERS = 60  # of a name that are compared
MOST_BASES = 8


def unknown(what: str, name: str, known: Iterable[str]) -> str:
    """Return the text of an error on a name that does not exist, with the most similar names or all known ones.

    Capitals do not count, and a part of a name finds the whole: "m_wej" finds the topic "/motor/m_wej".

    Parameters
    ----------
    what : str
        The kind of thing, without an article ("signal", "key of gearbox").
    name : str
        The name that was given.
    known : iterable of str
        The names that exist.

    Returns
    -------
    str
        The text.
    """
    return f"there is no {what} {brief(str(name))}; {meant(name, known)}"


def meant(name: object, known: Iterable[object]) -> str:
    """Return only the hint of :func:`unknown`: the most similar names, or all known ones."""
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
    """Return the text of an error on a ``key`` of --set that is not a ``part.name``.

    Parameters
    ----------
    key : str
        The key that was given.
    parts : dict of str to iterable of str
        Names of the values by part.

    Returns
    -------
    str
        The text.
    """
    part, _, name = key.partition(".")
    named_so = [f"{one}.{key}" for one, names in parts.items() if key in names]
    if part in parts:
        return (
            unknown(f"value of {part}", name, parts[part])
            if name
            else f"'{key}' is a part of the rig; name one of its values, e.g. {key}.{next(iter(parts[part]))}"
        )
    if named_so:
        return f"there is no value {brief(key)}; did you mean {' or '.join(map(repr, named_so[:3]))}?"
    return (
        unknown("value", key, [f"{one}.{name}" for one, names in parts.items() for name in names])
        if name
        else unknown("part of the rig", key, parts)
    )


def find_config(kind: str, name: str | Path) -> Path:
    """Return the path of an installed rig or controller, a rig of another package among them, or of a file.

    Parameters
    ----------
    kind : str
        "rigs" or "controllers".
    name : str or Path
        Name of an installed one, a file, or a rig's folder.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    RigError
        When there is no such file, or the package that adds the rig is at fault.
    """
    text = str(name)
    if kind == "rigs":
        folder = os.path.expanduser(text)
        own, ours = os.path.join(folder, RIG_FILE), RIGS_DIR / text / RIG_FILE
        if os.path.isdir(folder) and ("/" in text or os.path.isfile(own) or not os.path.isfile(ours)):
            if not os.path.isfile(own):
                raise RigError(f"{text}: the folder has no {RIG_FILE}; ./rig new rig FOLDER writes one to begin with")
            return Path(folder) / RIG_FILE
    if text.endswith((".yaml", ".yml")) or "/" in text:
        path = os.path.expanduser(text)
        if not os.path.isfile(path):  # also False for what cannot be the name of a file
            raise RigError(f"{text}: {no_file(path)}")
        return Path(path)
    path = RIGS_DIR / text / RIG_FILE if kind == "rigs" else CONFIG_DIR / kind / f"{text}.yaml"
    if not os.path.isfile(path):
        if os.path.isdir(text):
            raise RigError(f"{text}: {no_file(text)}")
        added = RIGS.added() if kind == "rigs" else {}
        if text in added:
            return RIGS.folder(added[text], RIG_FILE) / RIG_FILE
        raise RigError(f"{unknown(kind[:-1], text, [*installed(kind), *added])} (or name a .yaml file)")
    return path


def installed(kind: str) -> list[str]:
    """Return the names of the rigs or controllers that are installed with the package."""
    if kind == "rigs":
        return sorted(path.parent.name for path in RIGS_DIR.glob(f"*/{RIG_FILE}"))
    return sorted(path.stem for path in (CONFIG_DIR / kind).glob("*.yaml"))


def rig_folders() -> dict[str, Path]:
    """Return the folders of all rigs that have a name: those that are installed with the package, then those of other packages.

    Raises
    ------
    RigError
        When a package that adds a rig is at fault.
    """
    own = {name: RIGS_DIR / name for name in installed("rigs")}
    return own | {name: RIGS.folder(point, RIG_FILE) for name, point in RIGS.added().items() if name not in own}


def beside(path: str | Path, name: object) -> str:
    """Return a name that is written in the file ``path``; the name of a file is taken relative to the folder of ``path``."""
    text = str(name)
    if (text.endswith((".yaml", ".yml")) or "/" in text) and not os.path.isabs(os.path.expanduser(text)):
        return str(Path(path).parent / text)
    return text


def with_bases(name: str | Path) -> list[tuple[Path, Any]]:
    """Read the file of a rig and those of its bases, each base after the file that names it.

    Parameters
    ----------
    name : str or Path
        Name of the rig, its folder or its file.

    Returns
    -------
    list of (Path, object)
        Each file with its content.

    Raises
    ------
    RigError
        With file and line, when a base is missing or is based on this rig, or there are more than MOST_BASES.
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
            raise RigError(f"{where}: {brief(str(node['base']))} leads back to this rig; expected another rig")
        if len(out) > MOST_BASES:
            raise RigError(f"{where}: the rig is based on more than {MOST_BASES} others, one on the other")
        out.append((base, load_yaml(base)))
    return out


def find_of_rigs(kind: str, name: str | Path, *rigs: str | Path | None) -> Path:
    """Return the path of a sequence, procedure or profile of a logger by its name, or of a file.

    The name is looked up in each of the rigs with its bases, then in all rigs that have a name, of which only one may have it.

    Parameters
    ----------
    kind : str
        "sequences", "procedures" or "profiles".
    name : str or Path
        The name, or a file.
    *rigs : str, Path or None
        The rigs, the first before the others; None is none.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    RigError
        When there is no such file, or several rigs have one.
    """
    text = str(name)
    if text.endswith((".yaml", ".yml")) or "/" in text:
        return find_config(kind, name)
    own = [path.parent for rig in rigs if rig is not None for path, _ in with_bases(rig)]
    for folder in own:
        if os.path.isfile(path := folder / kind / f"{text}.yaml"):  # false for a name that no file can have
            return path
    others = rig_folders().values()
    found = [path for folder in others if os.path.isfile(path := folder / kind / f"{text}.yaml")]
    if len(found) > 1:
        having = ", ".join(path.parent.parent.name for path in found)
        raise RigError(f"several rigs have a {kind[:-1]} {brief(text)}: {having}; name the rig (or a .yaml file)")
    if found:
        return found[0]
    if os.path.isdir(text):
        raise RigError(f"{text}: {no_file(text)}")
    known = sorted({path.stem for folder in (*own, *others) for path in (folder / kind).glob("*.yaml")})
    single = "; those of the rig's parts, e.g. motor.weak, are in ./rig list faults" if kind == "faults" else ""
    raise RigError(f"{unknown(kind[:-1], text, known)} (or name a .yaml file){single}")


def has_controller(rig: str | Path) -> bool:
    """Return whether the files of a rig name a shift controller."""
    return any(isinstance(node, dict) and "controller" in node for _, node in with_bases(rig))


def rig_with(path: str | Path) -> str | None:
    """Return the rig in whose folder a sequence or procedure stands; None for a file elsewhere."""
    folder = Path(path).absolute().parent.parent
    if not (folder / RIG_FILE).is_file():
        return None
    return folder.name if folder.parent == RIGS_DIR else str(folder)


def rig_of(sequence: str | Path | None, default: str | None) -> str:
    """Return the rig for which a sequence is written; the default one without a sequence.

    Parameters
    ----------
    sequence : str, Path or None
        Its name, which is looked up in the default rig first, or its file.
    default : str or None
        The rig of a file that names none and stands in no rig's folder.

    Returns
    -------
    str
        Name or file of the rig.

    Raises
    ------
    RigError
        When there is no such sequence, or nothing names its rig.
    """
    if not sequence and default is not None:
        return default
    path = find_of_rigs("sequences", sequence or "", default)
    node = load_yaml(path)
    rig = rig_with(path) or default
    if isinstance(node, dict) and "rig" in node:
        rig = beside(path, node["rig"])
        try:
            find_config("rigs", rig)
        except RigError as error:
            raise RigError(f"{where_of(path, node, 'rig')}: rig: {error}") from None
    if rig is None:
        raise RigError(f"{path}: the sequence names no rig and stands in no rig's folder; write 'rig: NAME' in it, or name the rig")
    return rig
