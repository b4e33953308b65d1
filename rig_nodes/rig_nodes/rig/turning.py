# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks that a rig's driveline can turn, that each gear gives the output one speed, and that the gears are in order.

rig.configuration uses them.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from itertools import pairwise
from typing import TYPE_CHECKING

from ..base import Map, RigError, where_of
from .driveline import build_driveline, held_ratio, inertias_of, inputs_of, overrunning
from .read_elements import GROUPS

if TYPE_CHECKING:
    from pathlib import Path

    from .structure import Structure


def check_driveline(structure: Structure, sections: Mapping, node: Map, path: str | Path) -> None:
    """Refuse a driveline that cannot turn, a gear that holds nothing or everything, and gears that are not in order.

    Parameters
    ----------
    structure : Structure
        What the rig is made of.
    sections : mapping of str to object
        Values of the bodies, shafts and devices by name.
    node : Map
        The rig's merged file, for the lines in the errors.
    path : str or Path
        The rig's file.

    Raises
    ------
    RigError
        With file and line, when the driveline, a gear or the order of the gears is refused.
    """
    inertias = inertias_of(structure, sections)
    try:
        build_driveline(structure, inertias, sections)
        inputs_of(structure)
        system = build_driveline(structure, inertias, sections, lossless=True)
    except RigError as error:
        raise RigError(f"{_where_named(str(error), node, path)}: {str(error).removeprefix('driveline: ')}") from None
    ratios: dict[object, float] = {}
    for gear, key in zip(structure.gears, node.get("gears") or ()):
        try:
            lets_go = overrunning(system, gear, structure.input.body, structure.output.body)
        except ValueError as error:
            raise RigError(
                f"{where_of(path, node['gears'], key)}: gears.{gear.name}: {', '.join(gear.held)} held alone: {error}; "
                "a gear's clutches give the output one speed"
            ) from None
        ratio = held_ratio(system, gear.held, structure.input.body, structure.output.body)
        if ratio < 0.0:
            _check_direction(structure, node, path, gear.name)
        ratios[key] = ratio
        if lets_go:
            raise RigError(
                f"{where_of(path, node['parts'][lets_go[0]], 'joins')}: parts.{lets_go[0]}.joins: it overruns as the input "
                f"drives in gear {gear.name}, which it is to hold; name its two bodies the other way round"
            )
    _check_order(ratios, node, path)


def _check_order(ratios: Mapping[object, float], node: Map, path: str | Path) -> None:
    """Refuse forward gears by their ratios that are not from the slowest output up: a shift to the next gear counts as one up."""
    forward = [pair for pair in ratios.items() if pair[1] > 0.0]
    for (before, slow), (key, ratio) in pairwise(forward):
        if ratio > slow * (1.0 + 1e-9):  # two ways through the wheels to one ratio differ by rounding
            raise RigError(
                f"{where_of(path, node['gears'], key)}: gears.{key} has the ratio {ratio:.5g} and {before} before it {slow:.5g}; "
                f"gears go from the slowest output up, so {key} stands before {before}"
            )


def _check_direction(structure: Structure, node: Map, path: str | Path, gear: str) -> None:
    """Refuse transducers of the output that begin at zero where a gear turns it backwards."""
    for one in structure.transducers:
        if one.name in (structure.output.speed, structure.output.torque) and one.low >= 0.0:
            raise RigError(
                f"{where_of(path, node['transducers'][one.name], 'range')}: transducers.{one.name}.range begins at "
                f"{one.low:g}, but gear {gear} turns the output backwards, which it could not show; give it both signs"
            )


def _where_named(message: str, node: Map, path: str | Path) -> str:
    """``file:line`` of the first body, wheel or device that an error names; the file alone when it names none."""
    for name in re.findall(r"'(\w+)(?: loss)?'", message):
        for k, mesh in enumerate(node.get("meshes") or ()):
            if mesh.get("name") == name:
                return where_of(path, node["meshes"], k)
        for group in ("parts", *GROUPS):
            if isinstance(node.get(group), Map) and name in node[group]:
                return where_of(path, node[group], name)
    if found := re.search(r"gear (\w+)-(\w+)", message):
        for k, mesh in enumerate(node.get("meshes", ())):
            if {*mesh["bodies"]} == {*found.groups()}:
                return where_of(path, node["meshes"], k)
    return str(path)
