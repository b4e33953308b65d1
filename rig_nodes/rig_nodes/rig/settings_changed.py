# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which settings of a run differ from those in the folder of its rig.

The page of `rig report --html` lists them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import MISSING, fields, is_dataclass
from typing import Any

from ..base import RIGS, installed
from .configuration import load_rig
from .faults import FAULTS
from .sections import LOGGER_RATE
from .settings import INSTRUMENTS, Settings

NOT_SETTINGS = ("name", "structure", FAULTS)


def changed_settings(record: Mapping) -> tuple[list[tuple[str, str, str]], str]:
    """Compare the record of a run with the rig of its name.

    Parameters
    ----------
    record : mapping
        Record of the rig, as the bag of the run holds it.

    Returns
    -------
    rows : list of (str, str, str)
        Name of each setting that differs, its value in the rig's folder and in the run; "-" where one has no such setting. A
        setting that a run of an earlier version does not record had its default.
    note : str
        Why nothing could be compared, or that the parts of the rig differ too; empty otherwise.
    """
    name = str(record.get("name", ""))
    if name not in installed("rigs") and name not in RIGS.added():
        return [], f"The rig '{name}' is not installed here, so its settings are compared with nothing."
    config = load_rig(name)
    own, ran = ({f"{INSTRUMENTS}.logger_rate": LOGGER_RATE} | dict(_flat(one)) for one in (config.as_dict(), record))
    ran = dict(_defaults(config.sections, record)) | ran
    rows = [
        (key, _written(config.settings, key, own.get(key)), _written(config.settings, key, ran.get(key)))
        for key in dict.fromkeys([*own, *ran])
        if own.get(key) != ran.get(key)
    ]
    same = config.structure.plain() == record.get("structure")
    return rows, "" if same else f"The parts of the rig that ran are not those of the present rig '{name}'."


def _defaults(sections: Mapping[str, Any], record: Mapping) -> Iterator[tuple[str, Any]]:
    """Yield the defaults of the settings of those sections that a record has."""
    for name, section in sections.items():
        if isinstance(record.get(name), Mapping) and is_dataclass(section):
            yield from ((f"{name}.{one.name}", one.default) for one in fields(section) if one.default is not MISSING)


def _flat(node: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """Yield each value under its name with dots; a point of a profile is one value, as in ``--set``."""
    if isinstance(node, Mapping):
        for key, value in node.items():
            if name or key not in NOT_SETTINGS:
                yield from _flat(value, "alfa46" if key == "profiles" else f"{name}.{key}".removeprefix("."))
    elif isinstance(node, (list, tuple)) and node and isinstance(node[0], (list, tuple)):
        for number, point in enumerate(node, 1):
            yield f"{name}.P{number}", list(point)
    else:
        yield name, list(node) if isinstance(node, (list, tuple)) else node


def _written(known: Settings, name: str, value: Any) -> str:
    if value is None:
        return "-"
    return known[name].written(value) if name in known else str(value)
