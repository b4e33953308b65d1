# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The choice of the rows for a rig: those of its folder, or the programme of a laboratory.

Used by the verbs ``validate``, ``calibrate`` and ``check``; no rig is read, so it is quick.
"""

from __future__ import annotations

from pathlib import Path

from ...base import RIGS_DIR, RigError, brief, check_keys, load_yaml, where_of, with_bases

ROWS_FILE, CALIBRATION_FILE = "validation.yaml", "calibration.yaml"
PACKAGE = __name__.partition(".")[0]


def file_of_rig(rig: str | Path, name: str) -> Path:
    """Return a file of a rig's folder, or of the nearest base that has one.

    Parameters
    ----------
    rig : str or Path
        Name or file of the rig.
    name : str
        Name of the file.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    RigError
        When neither the rig nor a base has one.
    """
    folders = [path.parent for path, _ in with_bases(rig)]
    found = next((folder / name for folder in folders if (folder / name).is_file()), None)
    if found is None:
        raise RigError(f"the rig '{rig}' has no {name}; write one beside its rig.yaml: docs/how_to/rigs.md")
    return found


def has_file(rig: str | Path, name: str) -> bool:
    """Return whether a rig's folder or one of its bases has a file."""
    return any((path.parent / name).is_file() for path, _ in with_bases(rig))


def rows_file(rig: str | Path) -> Path:
    """Return the file with the rows of a rig, as :func:`file_of_rig`."""
    return file_of_rig(rig, ROWS_FILE)


def programme_of(path: Path) -> str | None:
    """Return the package of the programme that a file with rows refers to, or None for a file with rows of its own.

    Only an installed rig has a programme: a package in the folder of the file, with the module programme.py.

    Raises
    ------
    RigError
        When there is no such package.
    """
    node = load_yaml(path)
    if not isinstance(node, dict) or "programme" not in node:
        return None
    check_keys(path, node, ("programme",), (), "the validation")
    name = node["programme"]
    known = [] if path.parent.parent != RIGS_DIR else [file.parent.name for file in path.parent.glob("*/programme.py")]
    if name not in known:
        expected = " or ".join([*known, "rows in its place"])
        raise RigError(f"{where_of(path, node, 'programme')}: programme is {brief(name)}, expected {expected}")
    return f"{PACKAGE}.rigs.{path.parent.name}.{name}"
