# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The choice of the rows for a rig: those of its folder, or the laboratory's programme.

Used by the verbs ``validate``, ``calibrate`` and ``check``; no rig is read, so it is quick.
"""

from __future__ import annotations

from pathlib import Path

from ...base.config import RIGS_DIR, load_yaml
from ...base.errors import RigError, brief
from ...base.names import with_bases
from ...base.schema import check_keys, where_of

ROWS_FILE, CALIBRATION_FILE, LABORATORY = "validation.yaml", "calibration.yaml", "laboratory"
LABORATORY_RIG = "hydmag"  # the rig whose folder has the laboratory's rows
LABORATORY_FOLDER = RIGS_DIR / LABORATORY_RIG


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


def rows_file(rig: str | Path) -> Path:
    """Return the file with the rows of a rig, as :func:`file_of_rig`."""
    return file_of_rig(rig, ROWS_FILE)


def is_laboratory(path: Path) -> bool:
    """Return whether a file refers to the rows of the laboratory's programme; RigError when it names another programme."""
    node = load_yaml(path)
    if not isinstance(node, dict) or "programme" not in node:
        return False
    check_keys(path, node, ("programme",), (), "the validation")
    if node["programme"] != LABORATORY:
        raise RigError(
            f"{where_of(path, node, 'programme')}: programme is {brief(node['programme'])}, expected {LABORATORY}, or rows "
            "in its place"
        )
    return True
