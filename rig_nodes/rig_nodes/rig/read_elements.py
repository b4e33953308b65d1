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
    "variators": ("bodies", "of", "table", "period", "angle"),
    "states": ("heat",),
}
ELEMENTS = {
    "relations": "relation",
    "clutches": "clutch",
    "brakes": "brake",
    "torques": "torque",
    "varying_inertias": "varying_inertia",
    "slider_cranks": "slider_crank",
    "motions": "motion",
    "variators": "variator",
    "states": "state",
}
_GIVEN = "inputs of tables"  # what the names of inputs that tables read are among
_ACROSS = {
    "speed": "angular velocity",
    "angle": "angle",
    "ratio": "ratio",
    "input": "ratio",
    "time": "time",
    "state": "temperature",
}


def is_name(name: object) -> bool:
    """Return whether something can be the name of a device, a body or a mesh."""
    return isinstance(name, str) and name.replace("_", "a").isalnum() and name.isascii()


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
    dimensions |= dict.fromkeys(inputs_read(elements), "ratio")
    for one in elements:
        if one.kind in ("clutch", "brake"):
            dimensions[one.name] = "ratio" if one.follows else "torque"
        elif one.kind in ("torque", "motion", "variator"):
            dimensions[one.name] = "angular velocity" if one.kind == "motion" else "ratio"
        elif one.kind == "state":
            dimensions[one.name] = "power"
    capacities = [one.name for one in elements if one.kind in ("clutch", "brake")]
    for name, node in nodes.items():
        where, what = reader.at(nodes, name), f"inputs.{name}"
        if name not in dimensions:
            raise RigError(f"{where}: {what}: nothing of this name takes an input; {meant(name, dimensions)}")
        if isinstance(node, List) and len(node) == 2 and not isinstance(node[0], List) and not _is_file(node[0]):
            points = ((0.0, quantity(_sourced(node, where, what), dimensions[name], f"{where}: {what}")),)
        else:
            points = read_table(reader, nodes, name, what, ("time", dimensions[name]))
        if name in capacities and min(value for _, value in points) < 0.0:
            raise RigError(f"{where}: {what} falls to {min(value for _, value in points):g}; a capacity is at least 0")
        out[name] = points
    return out


def inputs_read(elements: tuple[Element, ...]) -> list[str]:
    """Return the names of the inputs over which elements have tables."""
    laws = [one.follows for one in elements if one.follows and not isinstance(one.follows.by, str)]
    return [str(of) for law in laws for by, of in zip(law.by, law.of) if by == "input"]


def read_table(reader: _Reader, node: Map, key: str, what: str, columns: tuple[str, ...], across: str = "") -> Points:
    """Return the points of a table that stands under a key.

    It is written as ``[[[x, y], ...], "its source"]``, or ``["file.csv", "its source"]``; over two quantities a point has three.

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
    columns : tuple of str
        Dimensions of arguments and values, of base.units.
    across : str
        Dimension of a second argument that the table may have.

    Returns
    -------
    tuple of (float, ...)
        The points [SI].

    Raises
    ------
    RigError
        With file and line, when the table is not right.
    """
    where = reader.at(node, key)
    rows, meaning = _sourced(node[key], where, what), ", ".join(columns)
    whole = (columns[0], across, columns[1]) if across else columns
    if _is_file(rows):
        return _of_file(Path(file_of(reader.path, node, key)).parent / rows, f"{where}: {what}", columns, whole)
    if not isinstance(rows, List) or not rows:
        raise RigError(
            f"{where}: {what} must be a list of points, each [{meaning}], or the name of a .csv file; found {brief(rows)}"
        )
    if len(rows) > MOST_POINTS:
        raise RigError(f"{where}: {what} has {len(rows)} points, expected at most {MOST_POINTS}")
    if isinstance(rows[0], List) and len(rows[0]) == len(whole):
        columns = whole
    out = []
    for k, row in enumerate(rows):
        at = reader.at(rows, k)
        if not isinstance(row, List) or len(row) != len(columns):
            raise RigError(f"{at}: {what}: a point is [{meaning}], each with its unit; found {brief(row)}")
        out.append(tuple(quantity(one, column, f"{at}: {what}") for one, column in zip(row, columns)))
    if len(columns) == 3:
        return _grid(out, f"{where}: {what}")
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


def _grid(points: list[tuple[float, ...]], where: str) -> Points:
    """The points of a table over two quantities; RigError where they are no grid."""
    pairs = {point[:2] for point in points}
    first, second = (sorted({pair[i] for pair in pairs}) for i in (0, 1))
    lacks = next(((x, u) for x in first for u in second if (x, u) not in pairs), None)
    if lacks or len(pairs) < len(points) or min(len(first), len(second)) < 2:
        which = f"that for {lacks[0]:g} and {lacks[1]:g} [SI] is missing" if lacks else "some are given twice or lie in one line"
        raise RigError(
            f"{where} has {len(points)} points with {len(first)} values of the first quantity and {len(second)} of the second; "
            f"one for each pair is needed, two of each at least: {which}"
        )
    return tuple(points)


def _of_file(path: Path, where: str, columns: tuple[str, ...], whole: tuple[str, ...]) -> Points:
    """Points of a CSV file with a heading that has the units, ``speed [rpm], torque [Nm]``; # begins a comment."""
    try:
        with path.open(encoding="utf-8") as file:
            lines = [line for line in file.read(20_000_000).splitlines() if line.strip() and not line.startswith("#")]
    except (OSError, UnicodeDecodeError) as error:
        raise RigError(f"{where}: {path} cannot be read ({error})") from None
    heading, *rows = csv.reader(lines, skipinitialspace=True) if lines else [[]]
    factors, columns = [], whole if len(heading) == len(whole) else columns
    for column, dimension in zip(heading, columns):
        unit = column.strip().partition("[")[2].removesuffix("]")
        if UNITS.get(unit, ("", 0.0))[0] != dimension:
            known = ", ".join(f"[{one}]" for one, (own, _) in UNITS.items() if own == dimension)
            raise RigError(f"{where}: {path.name}: the heading {brief(column)} names no unit of {dimension}; {known} are known")
        factors.append(UNITS[unit][1])
    many = "two" if len(columns) == 2 else "three"
    if len(factors) != len(columns) or not rows or any(len(row) != len(columns) for row in rows) or len(rows) > MOST_POINTS:
        raise RigError(f"{where}: {path.name} needs a heading and 1 to {MOST_POINTS} rows, of {many} columns each")
    out = []
    for k, row in enumerate(rows, 2):
        try:
            out.append(tuple(float(text) * factor for text, factor in zip(row, factors)))
        except ValueError:
            raise RigError(f"{where}: {path.name}: row {k}, {brief(','.join(row))}, is not {many} numbers") from None
        if len(columns) == 2 and k > 2 and out[-1][0] < out[-2][0]:
            raise RigError(f"{where}: {path.name}: row {k}: {row[0]} comes after {rows[k - 3][0]}; the points of a table must rise")
    return _grid(out, f"{where}: {path.name}") if len(columns) == 3 else tuple(out)


class _Element:
    """Reads one element."""

    def __init__(self, reader: _Reader, kind: str, name: str, node: Map, what: str, where: str) -> None:
        self.reader, self.kind, self.name, self.node, self.what, self.where = reader, kind, name, node, what, where

    def element(self) -> Element:
        """Return the element with what its kind takes; RigError with file and line when it is not right."""
        if self.kind == "relation":
            return self.relation()
        if self.kind == "state":
            return Element(self.name, "state", (), heat=self.heat())
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
        elif self.kind == "variator" and "table" in self.node:
            follows = self.follows(self.node, self.what, "ratio", "angle")
        return Element(self.name, self.kind, self.bodies(), (), follows, friction)

    def bodies(self) -> tuple[str, ...]:
        """Return the one or two bodies that it joins or acts on."""
        keys = {"clutch": ("joins",), "torque": ("body", "joins"), "variator": ("bodies",)}.get(self.kind, ("body",))
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
        if written[0] in ("joins", "bodies"):
            return self.reader.two_bodies(self.node[written[0]], at, what, ground=self.kind == "torque")
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

    def heat(self) -> tuple[tuple[str, float], ...]:
        """Return what loses power into a state, with the share of it; the driveline refuses what can lose none."""
        nodes, what = self.node.get("heat", {}), f"{self.what}.heat"
        if not isinstance(nodes, Map):
            raise self.reader.wrong(self.node, "heat", f"{what} must be a map of what loses power, found {brief(nodes)}")
        wheres = {name: self.reader.at(nodes, name) for name in nodes}
        return tuple(
            (name, quantity(_sourced(node, wheres[name], f"{what}.{name}"), "ratio", f"{wheres[name]}: {what}.{name}"))
            for name, node in nodes.items()
        )

    def friction(self) -> Points:
        """Return the factors over the slip."""
        if "friction" not in self.node:
            return ()
        return read_table(self.reader, self.node, "friction", f"{self.what}.friction", ("angular velocity", "ratio"))

    def capacity(self) -> Follows | None:
        """Return what the capacity follows; None when it is not given."""
        if "capacity" not in self.node:
            return None
        node, what = self.node["capacity"], f"{self.what}.capacity"
        check_keys(self.reader.path, node, _LAW, ("table", "of"), what, self.reader.at(self.node, "capacity"))
        return self.follows(node, what, "torque")

    def follows(self, node: Map, what: str, along: str, by: str = "speed") -> Follows:
        """Return a table over the speed or angle of the bodies on which it acts or of what ``of`` names, or over two of _ACROSS."""
        reader = self.reader
        by, of = node.get("by", by), node.get("of", "")
        if isinstance(by, List):
            by, of = self.two_quantities(node, what, by, of)
        elif by not in ("speed", "angle", "state"):
            raise reader.wrong(
                node,
                "by",
                f"{what}.by is {brief(by)}, expected speed, angle, state, or two of {', '.join(_ACROSS)}; what depends on "
                "time alone belongs under inputs",
            )
        elif of or by == "state":
            self.turning(node, of, what, by)
        numbers = [
            quantity(_sourced(node[key], reader.at(node, key), f"{what}.{key}"), "angle", f"{reader.at(node, key)}: {what}.{key}")
            if key in node
            else 0.0
            for key in ("period", "angle")
        ]
        columns = (_ACROSS[by],) if isinstance(by, str) else tuple(_ACROSS[one] for one in by)
        return Follows(read_table(reader, node, "table", f"{what}.table", (*columns, along)), by, of, *numbers)

    def turning(self, node: Map, of: object, what: str, by: str = "speed") -> None:
        """Refuse what is not a body, nor an element with a slip, or by "state" what is not a state."""
        if by == "state":
            if of not in (states := list(self.reader.map_of("states"))):
                raise self.reader.wrong(node, "of", f"{what}.of names {brief(of)}, expected a state; {meant(of, states)}")
            return
        known = [
            *self.reader.bodies,
            *self.reader.map_of("clutches"),
            *self.reader.map_of("brakes"),
            *(name for name, part in self.reader.part_of_device.items() if "element" in part.wires),
        ]
        if of not in known:
            raise self.reader.wrong(
                node,
                "of",
                f"{what}.of names {brief(of)}, expected a body, or a clutch or brake whose slip counts; {meant(of, known)}",
            )

    def two_quantities(self, node: Map, what: str, by: List, of: object) -> tuple[tuple[str, str], tuple]:
        """Return both quantities, and of what each is: a name, two for a ratio, the name of an input, empty for the time."""
        wrong = self.reader.wrong
        if len(by) != 2 or any(one not in _ACROSS for one in by):
            raise wrong(node, "by", f"{what}.by is {brief(list(by))}, expected two of {', '.join(_ACROSS)}")
        if not isinstance(of, List) or len(of) != 2:
            raise wrong(node, "of", f"{what}.of is {brief(of)}, expected a list with what each quantity of {what}.by is of")
        out = []
        for one, which in zip(by, of):
            if one == "time":
                out.append("")
                continue
            if one == "ratio":
                if not isinstance(which, List) or len(which) != 2:
                    raise wrong(node, "of", f"{what}.of: a ratio is of [a, b], whose speeds are divided; found {brief(which)}")
                for name in which:
                    self.turning(node, name, what)
                out.append(tuple(which))
                continue
            if not isinstance(which, str) or not is_name(which):
                raise wrong(node, "of", f"{what}.of: {one} is of one name; found {brief(which)}")
            if one != "input":
                self.turning(node, which, what, one)
            elif (taken := self.reader.names.setdefault(which, _GIVEN)) != _GIVEN:
                raise wrong(node, "of", f"{what}.of: there is '{which}' among the {taken} already; name the input otherwise")
            out.append(which)
        return tuple(by), tuple(out)
