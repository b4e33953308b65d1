# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Clutch pressures that are prescribed instead of made by valves and cylinders, as in chapter 9's own simulation.

rig.configuration reads them from a rig's YAML, runs.plan uses them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..base import RigError, brief, build, check_keys, where_of
from ..plant import Force

if TYPE_CHECKING:
    from pathlib import Path

    from ..base import Map
    from .structure import Structure

WAYS = ("engaging", "releasing")
OUTPUT_SPEEDS = ("bounded", "free")
MPA = 1e6


@dataclass(frozen=True)
class Prescribed:
    """Prescribed pressures and forces of the clutches.

    Parameters
    ----------
    forces : tuple of Force
        Force of each clutch.
    pieces : (clutches, 2, rows, 5) array of float
        For engaging and for releasing, rows of the end [s] and the coefficients of a cubic in the time since the switch signal
        [Pa, s], lowest power first; the last row never ends.
    bounded : bool
        True when the output never leaves the speeds of the two gears, whatever the clutches can hold.
    """

    forces: tuple[Force, ...]
    pieces: np.ndarray
    bounded: bool

    def as_dict(self) -> dict:
        """Return plain values; a piece without an end has None as its end."""
        rows = [[[[None if np.isinf(x) else float(x) for x in row] for row in way] for way in clutch] for clutch in self.pieces]
        return {
            "forces": [vars(force) for force in self.forces],
            "pieces": rows,
            "output_speed": OUTPUT_SPEEDS[0 if self.bounded else 1],
        }


def read_prescribed(node: Map, path: str | Path, structure: Structure) -> Prescribed:
    """Read the key ``prescribed`` of a rig.

    It has for each clutch its force, and for each way rows [end s, MPa, MPa/s, MPa/s2, MPa/s3], of which the last has the end
    "end"; and ``output_speed``, which is bounded or free.

    Parameters
    ----------
    node : Map
        The map under the key.
    path : str or Path
        The rig's file.
    structure : Structure
        What the rig is made of.

    Returns
    -------
    Prescribed
        The prescribed pressures.

    Raises
    ------
    RigError
        With file and line, when something is not right.
    """
    clutches = [clutch.name for clutch in structure.clutches]
    keys = (*clutches, "output_speed")
    check_keys(path, node, keys, keys, "prescribed")
    if node["output_speed"] not in OUTPUT_SPEEDS:
        raise RigError(
            f"{where_of(path, node, 'output_speed')}: prescribed.output_speed must be one of "
            f"{', '.join(OUTPUT_SPEEDS)}, found {node['output_speed']!r}"
        )
    bounded = node["output_speed"] == OUTPUT_SPEEDS[0]
    if bounded and (len(clutches) < 2 or structure.input is None or structure.output is None):
        raise RigError(
            f"{where_of(path, node, 'output_speed')}: prescribed.output_speed: bounded keeps the output between the "
            "speeds that two clutches give it, so the rig needs two, an input and an output; choose free"
        )
    forces, tables = [], []
    for name in clutches:
        part = node[name]
        forces.append(build(Force, part, path, f"prescribed.{name}", others=WAYS))
        for way in WAYS:
            if way not in part:
                raise RigError(f"{where_of(path, node, name)}: prescribed.{name} lacks '{way}'")
            tables.append(_rows(part[way], f"{where_of(path, part, way)}: prescribed.{name}.{way}"))
    longest = max(map(len, tables))
    full = [rows + [rows[-1]] * (longest - len(rows)) for rows in tables]
    return Prescribed(tuple(forces), np.array(full).reshape(len(clutches), 2, longest, 5), bounded)


def _rows(node: object, where: str) -> list[list[float]]:
    rows, last = [], 0.0
    for row in node if isinstance(node, list) else []:
        row = row if isinstance(row, list) else [row]
        numbers = [x for x in row[1:] if isinstance(x, (int, float)) and not isinstance(x, bool)]
        end = np.inf if row and row[0] == "end" else row[0] if row and isinstance(row[0], (int, float)) else None
        if len(row) != 5 or len(numbers) != 4 or end is None or not end > last:
            raise RigError(
                f'{where}: a row is [end in s or "end", MPa, MPa/s, MPa/s2, MPa/s3] with rising ends, found {brief(row)}'
            )
        rows.append([float(end), *(MPA * float(x) for x in numbers)])
        last = end
    if not rows or not np.isinf(rows[-1][0]):
        raise RigError(f'{where} must be a list of rows, the last of them up to "end"')
    return rows
