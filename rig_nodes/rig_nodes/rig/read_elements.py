# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Elements of the driveline that are not devices, and tables, from a rig's file; rig.read uses it.

Clutches, brakes, torques, inertias over an angle, motions and relations have their names of driveline.builder. What is a
function of Python there is a table here, in the file or in a CSV file beside it.
"""

from __future__ import annotations

import csv
import itertools
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..base import UNITS, List, Map, RigError, brief, check_keys, file_of, meant, quantity
from .structure import Element, Follows, Points

if TYPE_CHECKING:
    from .read import _Reader

GROUND = "ground"
MOST_POINTS = 100_000
_LAW = ("table", "by", "of", "period", "angle")
# group in a rig's file -> keys of its entries that are not values
GROUPS = {
    "bodies": (),
    "shafts": ("joins", "table", "hysteresis"),
    "planetary_sets": ("sun", "ring", "carrier", "teeth", "source"),
    "relations": ("coefficients", "source"),
    "clutches": ("joins", "friction", "capacity"),
    "brakes": ("body", "friction", "capacity"),
    "torques": ("body", "joins", *_LAW),
    "varying_inertias": ("body", "table", "period", "angle"),
    "slider_cranks": ("body",),
    "motions": ("body",),
}
ELEMENTS = {
    "relations": "relation",
    "clutches": "clutch",
    "brakes": "brake",
    "torques": "torque",
    "varying_inertias": "varying_inertia",
    "slider_cranks": "slider_crank",
    "motions": "motion",
}
_ACROSS = {"speed": "angular velocity", "angle": "angle"}


def read_elements(reader: _Reader) -> tuple[Element, ...]:
    """Return all elements of a rig's file, from the reader of rig.read."""
    out = []
    for group, kind in ELEMENTS.items():
        for name, node in reader.map_of(group).items():
            what, where = f"{group}.{name}", reader.at(reader.map_of(group), name)
            if not isinstance(node, Map):
                raise RigError(f"{where}: {what} must be a map of keys, found {brief(node)}")
            out.append(_Element(reader, kind, name, node, what, where).element())
    return tuple(out)


def read_inputs(reader: _Reader, elements: tuple[Element, ...]) -> dict[str, Points]:
    """Return what is applied to the driveline over time, by name: each is a number or a table.

    Parameters
    ----------
    reader : _Reader
        The reader of rig.read.
    elements : tuple of Element
        The elements of the rig.

    Returns
    -------
    dict of str to tuple of (float, float)
        Times [s] and values [SI].

    Raises
    ------
    RigError
        With file and line, when an input is not right.
    """
    nodes, out = reader.map_of("inputs"), {}
    dimensions = dict.fromkeys(reader.bodies, "torque")
    for one in elements:
        if one.kind in ("clutch", "brake"):
            dimensions[one.name] = "ratio" if one.follows else "torque"
        elif one.kind in ("torque", "motion"):
            dimensions[one.name] = "ratio" if one.kind == "torque" else "angular velocity"
    capacities = [one.name for one in elements if one.kind in ("clutch", "brake")]
    for name, node in nodes.items():
        where, what = reader.at(nodes, name), f"inputs.{name}"
        if name not in dimensions:
            raise RigError(f"{where}: {what}: nothing of this name takes an input; {meant(name, dimensions)}")
        if isinstance(node, List) and len(node) == 2 and not isinstance(node[0], List) and not _is_file(node[0]):
            points = ((0.0, quantity(_sourced(node, where, what), dimensions[name], f"{where}: {what}")),)
        else:
            points = read_table(reader, nodes, name, what, "time", dimensions[name])
        if name in capacities and min(value for _, value in points) < 0.0:
            raise RigError(f"{where}: {what} falls to {min(value for _, value in points):g}; a capacity is at least 0")
        out[name] = points
    return out


def read_table(reader: _Reader, node: Map, key: str, what: str, across: str, along: str) -> Points:
    """Return the points of a table that stands under a key.

    It is written as ``[[[x, y], ...], "its source"]``, or ``["file.csv", "its source"]``.

    Parameters
    ----------
    reader : _Reader
        The reader of rig.read.
    node : Map
        The map with the key.
    key : str
        The key.
    what : str
        What the table is, for the errors.
    across, along : str
        Dimensions of arguments and values, of base.units.

    Returns
    -------
    tuple of (float, float)
        The points [SI].

    Raises
    ------
    RigError
        With file and line, when the table is not right.
    """
    where = reader.at(node, key)
    rows = _sourced(node[key], where, what)
    if _is_file(rows):
        return _of_file(Path(file_of(reader.path, node, key)).parent / rows, f"{where}: {what}", across, along)
    if not isinstance(rows, List) or not rows:
        raise RigError(
            f"{where}: {what} must be a list of points, each [{across}, {along}], or the name of a .csv file; found {brief(rows)}"
        )
    if len(rows) > MOST_POINTS:
        raise RigError(f"{where}: {what} has {len(rows)} points, expected at most {MOST_POINTS}")
    out = []
    for k, row in enumerate(rows):
        at = reader.at(rows, k)
        if not isinstance(row, List) or len(row) != 2:
            raise RigError(f"{at}: {what}: a point is [{across}, {along}], each with its unit; found {brief(row)}")
        out.append((quantity(row[0], across, f"{at}: {what}"), quantity(row[1], along, f"{at}: {what}")))
    for k, (before, after) in enumerate(itertools.pairwise(out)):
        if after[0] < before[0]:
            raise reader.wrong(
                rows, k + 1, f"{what}: {brief(rows[k + 1][0])} comes after {brief(rows[k][0])}; the points of a table must rise"
            )
    return tuple(out)


def _is_file(value: object) -> bool:
    return isinstance(value, str) and value.endswith(".csv")


def _sourced(node: object, where: str, what: str) -> Any:
    """The value of ``[value, "its source"]``."""
    if not isinstance(node, List) or len(node) != 2 or not isinstance(node[1], str) or not node[1].strip():
        raise RigError(f'{where}: {what} must be [value with unit or table, "its source"], found {brief(node)}')
    return node[0]


def _of_file(path: Path, where: str, across: str, along: str) -> Points:
    """Points of a CSV file with two columns and a heading with their units, ``speed [rpm], torque [Nm]``; # begins a comment."""
    try:
        with path.open(encoding="utf-8") as file:
            lines = [line for line in file.read(20_000_000).splitlines() if line.strip() and not line.startswith("#")]
    except (OSError, UnicodeDecodeError) as error:
        raise RigError(f"{where}: {path} cannot be read ({error})") from None
    heading, *rows = csv.reader(lines, skipinitialspace=True) if lines else [[]]
    factors = []
    for column, dimension in zip(heading, (across, along)):
        unit = column.strip().partition("[")[2].removesuffix("]")
        if UNITS.get(unit, ("", 0.0))[0] != dimension:
            known = ", ".join(f"[{one}]" for one, (own, _) in UNITS.items() if own == dimension)
            raise RigError(f"{where}: {path.name}: the heading {brief(column)} names no unit of {dimension}; {known} are known")
        factors.append(UNITS[unit][1])
    if len(factors) != 2 or not rows or any(len(row) != 2 for row in rows) or len(rows) > MOST_POINTS:
        raise RigError(f"{where}: {path.name} needs a heading and 1 to {MOST_POINTS} rows, of two columns each")
    out = []
    for k, row in enumerate(rows, 2):
        try:
            out.append(tuple(float(text) * factor for text, factor in zip(row, factors)))
        except ValueError:
            raise RigError(f"{where}: {path.name}: row {k}, {brief(','.join(row))}, is not two numbers") from None
        if k > 2 and out[-1][0] < out[-2][0]:
            raise RigError(f"{where}: {path.name}: row {k}: {row[0]} comes after {rows[k - 3][0]}; the points of a table must rise")
    return tuple(out)


class _Element:
    """Reads one element."""

    def __init__(self, reader: _Reader, kind: str, name: str, node: Map, what: str, where: str) -> None:
        self.reader, self.kind, self.name, self.node, self.what, self.where = reader, kind, name, node, what, where

    def element(self) -> Element:
        """Return the element with what its kind takes; RigError with file and line when it is not right."""
        if self.kind == "relation":
            return self.relation()
        follows, friction = None, ()
        if self.kind in ("clutch", "brake"):
            follows, friction = self.capacity(), self.friction()
        elif self.kind == "torque":
            check_keys(self.reader.path, self.node, ("body", "joins", *_LAW), ("table",), self.what, self.where)
            follows = self.follows(self.node, self.what, "torque")
        elif self.kind == "varying_inertia":
            check_keys(self.reader.path, self.node, ("body", "table", "period", "angle"), ("table",), self.what, self.where)
            follows = self.follows(self.node, self.what, "inertia", "angle")
        elif self.kind == "motion":
            check_keys(self.reader.path, self.node, ("body",), ("body",), self.what, self.where)
        return Element(self.name, self.kind, self.bodies(), (), follows, friction)

    def bodies(self) -> tuple[str, ...]:
        """Return the one or two bodies that it joins or acts on."""
        keys = {"clutch": ("joins",), "torque": ("body", "joins")}.get(self.kind, ("body",))
        written = [key for key in keys if key in self.node]
        if len(written) != 1:
            raise self.reader.wrong(
                self.node,
                None,
                f"{self.what} "
                + (
                    f"lacks the key '{keys[0]}'"
                    if len(keys) == 1
                    else "must have one of the keys body, for what acts on one body, and joins, for what acts between two"
                ),
            )
        at, what = self.reader.at(self.node, written[0]), f"{self.what}.{written[0]}"
        if written == ["joins"]:
            return self.reader.two_bodies(self.node["joins"], at, what, ground=self.kind == "torque")
        return (self.reader.body(self.node["body"], at, what),)

    def relation(self) -> Element:
        """Return a relation between the speeds of bodies, with its coefficients; RigError with file and line otherwise."""
        check_keys(self.reader.path, self.node, GROUPS["relations"], GROUPS["relations"], self.what, self.where)
        self.reader.source(self.node, self.what)
        nodes = self.node["coefficients"]
        if not isinstance(nodes, Map) or len(nodes) < 2:
            raise self.reader.wrong(
                self.node,
                "coefficients",
                f"{self.what}.coefficients must be a map of two bodies or more, each with its coefficient, found {brief(nodes)}",
            )
        for body, value in nodes.items():
            at = self.reader.at(nodes, body)
            self.reader.body(body, at, f"{self.what}.coefficients", ground=True)
            if isinstance(value, bool) or not isinstance(value, (int, float)) or value == 0:
                raise RigError(f"{at}: {self.what}.coefficients.{body} is {brief(value)}, expected a number other than 0")
        return Element(self.name, "relation", tuple(nodes), tuple(map(float, nodes.values())))

    def friction(self) -> Points:
        """Return the factors over the slip."""
        if "friction" not in self.node:
            return ()
        return read_table(self.reader, self.node, "friction", f"{self.what}.friction", "angular velocity", "ratio")

    def capacity(self) -> Follows | None:
        """Return what the capacity follows; None when it is not given."""
        if "capacity" not in self.node:
            return None
        node, what = self.node["capacity"], f"{self.what}.capacity"
        check_keys(self.reader.path, node, _LAW, ("table", "of"), what, self.reader.at(self.node, "capacity"))
        return self.follows(node, what, "torque")

    def follows(self, node: Map, what: str, along: str, by: str = "speed") -> Follows:
        """Return a table over the speed or angle of the bodies on which it acts, or of what ``of`` names."""
        reader = self.reader
        by, of = node.get("by", by), node.get("of", "")
        if by not in _ACROSS:
            raise reader.wrong(
                node,
                "by",
                f"{what}.by is {brief(by)}, expected one of {', '.join(_ACROSS)}; what depends on time belongs under inputs",
            )
        if of:
            known = [
                *reader.bodies,
                *reader.map_of("clutches"),
                *reader.map_of("brakes"),
                *(name for name, part in reader.part_of_device.items() if "element" in part.wires),
            ]
            if of not in known:
                raise reader.wrong(
                    node,
                    "of",
                    f"{what}.of names {brief(of)}, expected a body, or a clutch or brake whose slip counts; {meant(of, known)}",
                )
        numbers = [
            quantity(_sourced(node[key], reader.at(node, key), f"{what}.{key}"), "angle", f"{reader.at(node, key)}: {what}.{key}")
            if key in node
            else 0.0
            for key in ("period", "angle")
        ]
        return Follows(read_table(reader, node, "table", f"{what}.table", _ACROSS[by], along), by, of, *numbers)
