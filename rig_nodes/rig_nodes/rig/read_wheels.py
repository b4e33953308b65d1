# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Toothed wheels from a rig's file: meshes and planetary sets, which may lose by the torque that they pass on; rig.read uses it."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING

from ..base import List, Map, brief, check_keys
from .read_elements import is_name, read_table
from .sections import MeshConfig
from .structure import Mesh, PlanetarySet

if TYPE_CHECKING:
    from collections.abc import Sequence

    from .read import _Reader
    from .structure import Points

MASSLESS = "massless"
MOST_TEETH = 1000
TABLES = ("table", "back_table")  # of an efficiency, in place of a value
MESH_KEYS = ("bodies", "teeth", "reversed", "name", "source", *TABLES)  # in addition to the values of a mesh that loses
SET_KEYS = ("sun", "ring", "carrier", "teeth", "source")
_VALUES = tuple(one.name for one in fields(MeshConfig))


def read_meshes(reader: _Reader) -> tuple[Mesh, ...]:
    """Return the pairs of toothed wheels; RigError with file and line when they are not right."""
    nodes = reader.node.get("meshes", List(reader.node.line))
    if not isinstance(nodes, List):
        raise reader.wrong(reader.node, "meshes", f"meshes must be a list, found {brief(nodes)}")
    out = []
    for k, node in enumerate(nodes):
        what = f"mesh {k + 1}"
        check_keys(reader.path, node, (*MESH_KEYS, *_VALUES), ("bodies", "teeth", "source"), what, reader.at(nodes, k))
        reader.source(node, what)
        turned, name, lossy = node.get("reversed", False), node.get("name", ""), "efficiency" in node
        if not isinstance(turned, bool) and turned not in ("yes", "no"):
            raise reader.wrong(node, "reversed", f"{what}.reversed is {brief(turned)}, expected yes or no")
        if "name" in node:
            if not is_name(name):
                raise reader.wrong(node, "name", f"{what}.name is {brief(name)}, expected letters, digits and _")
            reader.new_name(name, "meshes", node, "name")
        elif lossy or "table" in node:
            key = "efficiency" if lossy else "table"
            raise reader.wrong(node, key, f"{what} has an efficiency and no name; give it one, as its values are found by it")
        bodies = reader.two_bodies(node["bodies"], reader.at(node, "bodies"), f"{what}.bodies")
        tables = _loss(reader, node, name, bodies, what, "both sides of a mesh")
        out.append(Mesh(bodies, _teeth(reader, node, what), turned in (True, "yes"), name, lossy, *tables))
    return tuple(out)


def read_planetary_sets(reader: _Reader) -> tuple[PlanetarySet, ...]:
    """Return the simple planetary sets; RigError with file and line when they are not right."""
    nodes, out = reader.map_of("planetary_sets"), []
    for name, node in nodes.items():
        what = f"planetary_sets.{name}"
        check_keys(reader.path, node, (*SET_KEYS, *TABLES, *_VALUES), SET_KEYS, what, reader.at(nodes, name))
        reader.source(node, what)
        wheels = [reader.body(node[key], reader.at(node, key), f"{what}.{key}", ground=True) for key in SET_KEYS[:3]]
        if len(set(wheels)) < 3:
            raise reader.wrong(nodes, name, f"{what}: sun, ring and carrier must be three bodies, found {', '.join(wheels)}")
        (sun, ring, carrier), teeth = wheels, _teeth(reader, node, what)
        if teeth[1] <= teeth[0]:
            raise reader.wrong(
                node, "teeth", f"{what}.teeth: the ring has {teeth[1]} and the sun {teeth[0]}; give the sun first, which has fewer"
            )
        tables = _loss(reader, node, name, wheels, what, "all members of a set")
        out.append(PlanetarySet(name, sun, ring, carrier, teeth, "efficiency" in node, *tables))
    return tuple(out)


def _teeth(reader: _Reader, node: Map, what: str) -> tuple[int, int]:
    """Return the two numbers of teeth."""
    value = node["teeth"]
    if not isinstance(value, List) or len(value) != 2:
        raise reader.wrong(node, "teeth", f"{what}.teeth must be two whole numbers, found {brief(value)}")
    for number in value:
        if not isinstance(number, int) or isinstance(number, bool) or not 1 <= number <= MOST_TEETH:
            raise reader.wrong(node, "teeth", f"{what}.teeth: {brief(number)} is no number of teeth; expected 1 to {MOST_TEETH}")
    return value[0], value[1]


def _loss(reader: _Reader, node: Map, name: str, bodies: Sequence[str], what: str, members: str) -> tuple[Points, Points]:
    """Return the two tables of the efficiency of what loses, and keep its name among those of the elements."""
    kinds = [(one, other) for one, other in (("efficiency", "back"), TABLES) if one in node or other in node]
    for one, other in kinds:
        if one not in node:
            raise reader.wrong(node, other, f"{what} has the key {other} and no {one}; give both, or none of them")
    if not kinds:
        return (), ()
    if len(kinds) > 1:
        raise reader.wrong(node, "table", f"{what} has the keys efficiency and table; one of them is possible")
    reader.element_names.append(name)
    if light := [body for body in bodies if reader.node["bodies"].get(body) == MASSLESS]:
        raise reader.wrong(
            node,
            kinds[0][0],
            f"{what} loses, and its body '{light[0]}' is {MASSLESS}; {members} with an efficiency need an inertia",
        )
    there, back = (
        read_table(reader, node, key, f"{what}.{key}", ("angular velocity", "ratio"), "torque") if key in node else ()
        for key in TABLES
    )
    return there, back
