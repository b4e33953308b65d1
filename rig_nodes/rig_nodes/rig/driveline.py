# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The driveline of a rig from its structure and its values.

runs.plan, transmission and the picture of a rig use it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict
from types import SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np

from ..driveline import Driveline, System, Table, table_of, torque_refused
from ..plant import part as parts
from .structure import Device, Element, Follows, GearHeld, Mesh, PlanetarySet, Points, Structure

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Inertia = Callable[[str], float]  # returns the inertia of a body by its name, 0 for a massless one


def inertias_of(structure: Structure, values: Mapping) -> dict[str, float]:
    """Return the inertia of each body with what devices add to it [kg m2].

    Parameters
    ----------
    structure : Structure
        What the rig is made of.
    values : mapping
        Values of the sections by name, as dataclasses or as plain maps.

    Returns
    -------
    dict of str to float
        Inertia by body; 0 for a massless one.
    """

    def inertia(name: str) -> float:
        value = values[name]
        return float(value["inertia"] if isinstance(value, Mapping) else value.inertia)

    out = {body: 0.0 if body in structure.massless else inertia(body) for body in structure.bodies}
    for device in structure.devices:
        if adds := parts.part(device.part).inertia:
            out[device.wires["body"]] += adds(values[device.name])
    return out


def _given(section: Mapping[str, float] | DataclassInstance) -> dict[str, float]:
    """The values of a section that are written, by the names that driveline.builder has for them."""
    return dict(section) if isinstance(section, Mapping) else asdict(section)


def _frame(structure: Structure, inertias: Mapping[str, float], values: Mapping, lossless: bool) -> Driveline:
    """Bodies, wheels, planetary sets and relations, without what joins them by friction or is compliant."""
    out = Driveline()
    for body in structure.bodies:
        out.inertia(body, inertias[body], None if body in structure.massless else _given(values[body]).get("speed"))
    for one in structure.of_kind("state"):
        _state(out, one.name, **_given(values[one.name]))
    for name, mesh in zip(structure.mesh_names, structure.meshes):
        if (mesh.lossy or mesh.table) and not lossless:
            out.mesh(name, *mesh.bodies, 1.0 / mesh.ratio, **_efficiencies(mesh, values.get(name)))
        else:
            out.gear(mesh.bodies[1], mesh.bodies[0], mesh.ratio, name)
    for one in structure.planetary_sets:
        loses = _efficiencies(one, values.get(one.name)) if (one.lossy or one.table) and not lossless else {}
        out.planetary(one.name, one.sun, one.ring, one.carrier, one.ratio, **loses)
    for one in structure.of_kind("relation"):
        out.relation(one.name, dict(zip(one.bodies, one.coefficients)))
    return out


def bodies_shown(structure: Structure) -> tuple[str, ...]:
    """Return the bodies whose speed is needed by a transducer, a device, the input or the output, in the order of the file."""
    used = {one.shows.removesuffix(".speed") for one in structure.transducers}
    used |= {body for device in structure.devices for body in parts.bodies_of(device.part, device.wires)}
    ends = ("driving", "driven")  # of a device between two bodies that pushes both
    used |= {device.wires[end] for device in structure.devices for end in ends if end in parts.part(device.part).wires}
    used |= {end.body for end in (structure.input, structure.output) if end}
    return tuple(body for body in structure.bodies if body in used)


def has_element(device: Device) -> bool:
    """Return whether a device is a friction element of the driveline."""
    return "element" in parts.part(device.part).wires


def shaft_of(device: Device) -> str:
    """Return the name of the driveline's shaft that a device owns, which is not one of the rig's names."""
    return f"{device.name} shaft"


def owns_shaft(device: Device) -> bool:
    """Return whether a device has a compliant shaft of its own between the bodies that it joins."""
    return "shaft" in parts.part(device.part).wires


def build_driveline(structure: Structure, inertias: Mapping[str, float], values: Mapping, lossless: bool = False) -> System:
    """Build the whole driveline; an element has the name of its device.

    Parameters
    ----------
    structure : Structure
        What the rig is made of.
    inertias : mapping of str to float
        Inertia of each body [kg m2].
    values : mapping
        Values of the sections by name, as dataclasses or as plain maps.
    lossless : bool
        True when only ratios and inertias count, so that meshes and sets lose nothing.

    Returns
    -------
    System
        The driveline.

    Raises
    ------
    RigError
        As driveline.builder raises it.
    """
    out = _frame(structure, inertias, values, lossless)
    for shaft in structure.shafts:
        out.shaft(shaft.name, *shaft.bodies, **_given(values[shaft.name]), table=_columns(shaft.table), hysteresis=shaft.hysteresis)
    for device in filter(owns_shaft, structure.devices):
        given = values[device.name]
        stiffness, damping = parts.part(device.part).shaft(SimpleNamespace(**given) if isinstance(given, Mapping) else given)
        out.shaft(shaft_of(device), *device.wires["joins"], stiffness=stiffness, damping=damping)
    for device in structure.devices:
        if device.role == parts.FREEWHEEL:
            out.freewheel(device.name, *device.wires["joins"])
        elif "joins" in device.wires:
            out.clutch(device.name, *device.wires["joins"])
        elif has_element(device):
            out.brake(device.name, device.wires.get("brakes") or device.wires["body"])
    for one in structure.of_kind("clutch", "brake"):
        _clutch(out, one, _given(values[one.name]))
    for one in structure.elements:
        if one.kind == "slider_crank":
            out.slider_crank(one.name, *one.bodies, **_given(values[one.name]))
        elif one.kind == "motion":
            out.motion(one.name, *one.bodies)
        elif one.kind == "torque":
            out.torque(one.name, *one.bodies, of=one.follows.of or None, by=one.follows.by, **_law(one.follows))
        elif one.kind == "variator" and lossless:
            out.gear(one.bodies[0], one.bodies[1], _first_ratio(one, **_given(values[one.name])), one.name)
        elif one.kind == "variator":
            follows = {"of": one.follows.of or None, **_law(one.follows)} if one.follows else {}
            out.variator(one.name, *one.bodies, **_given(values[one.name]), **follows)
        elif one.kind == "varying_inertia":
            out.varying_inertia(one.name, *one.bodies, **_law(one.follows))
        elif one.kind in ("clutch", "brake") and one.follows:
            out.capacity(one.name, one.follows.of, by=one.follows.by, **_law(one.follows))
    for state in structure.of_kind("state"):
        for of, share in () if lossless else state.heat:
            out.heat(state.name, of, share)
    system = out.build()
    for body in system.balanced:
        turned = (device.name for device in structure.devices if body in parts.bodies_of(device.part, device.wires))
        by = next(turned, "an input" if body in structure.inputs else None)
        if by is not None:
            raise torque_refused(body, by)
    return system


def _columns(points: Points) -> tuple | None:
    """The two columns of a table; None when there is no table."""
    return tuple(zip(*points)) if points else None


def _grid(points: Points) -> tuple | None:
    """The columns of a table; of one over two quantities the grid, of which it has every point."""
    table = _columns(points)
    if points and len(points[0]) == 3:
        values = {point[:2]: point[2] for point in points}
        first, second = (sorted(set(column)) for column in table[:2])
        table = first, second, [[values[x, u] for u in second] for x in first]
    return table


def _efficiencies(one: Mesh | PlanetarySet, values: Mapping[str, float] | DataclassInstance | None) -> dict:
    """The efficiencies of what loses, for the driveline."""
    return {"efficiency": _grid(one.table), "back": _grid(one.back_table)} if one.table else _given(values)


def _law(follows: Follows) -> dict:
    """The table, its period and the angle at the start."""
    return {"table": _grid(follows.table), "period": follows.period or None, "angle": follows.angle}


def _first_ratio(one: Element, ratio: float = 1.0) -> float:
    """The ratio of a variator at the start, where that of its input is ``ratio``."""
    if one.follows is None:
        return ratio
    angles, ratios = zip(*one.follows.table)
    return ratio * float(np.interp(one.follows.angle, angles, ratios, period=one.follows.period or None))


def _clutch(out: Driveline, one: Element, given: dict[str, float]) -> None:
    """Add a clutch or brake that is not a device."""
    stick = given.pop("stick", 1.0)
    given["stick"] = (stick, given.pop("stick_back", stick))
    (out.clutch if one.kind == "clutch" else out.brake)(one.name, *one.bodies, friction=_columns(one.friction), **given)


def _state(out: Driveline, name: str, capacity: float, start: float, conductance: float = 0.0, surroundings: float = 0.0) -> None:
    """Add a temperature, with its flow to the surroundings: the table reaches from absolute zero to far above what can be given."""
    out.state(name, capacity, start)
    if conductance > 0.0:
        ends = (-273.15, 1e5)
        flows = [conductance * (surroundings - end) for end in ends]
        out.torque(f"{name} to its surroundings", name, by="state", table=(ends, flows))


def inputs_of(structure: Structure) -> dict[str, Table]:
    """Return the rig's tables over time, by the name of the element or body to which they are applied."""
    return {name: table_of(f"the input '{name}'", _columns(points)) for name, points in structure.inputs.items()}


def held_ratio(system: System, clutches: Iterable[str], at_input: str, at_output: str) -> float:
    """Return the speed of the input divided by that of the output while some clutches hold.

    Parameters
    ----------
    system : System
        The driveline.
    clutches : iterable of str
        Names of the elements that hold.
    at_input, at_output : str
        Bodies of the input and the output.

    Returns
    -------
    float
        The ratio.

    Raises
    ------
    ValueError
        When the clutches leave the ratio open, or hold the input or the output.
    """
    free = _left_free(system.w[[system.elements.index(name) for name in clutches]])
    into, out = (system.bodies_from_speeds[system.bodies.index(name)] for name in (at_input, at_output))
    if len(free) == 0:
        raise ValueError("they let nothing turn")
    ways = np.array([[into @ one, out @ one] for one in free])
    if np.linalg.matrix_rank(ways, tol=1e-9) != 1:
        raise ValueError("they leave the ratio of input to output open")
    way = ways[np.abs(ways).sum(axis=1).argmax()]
    if abs(way[1]) < 1e-9 or abs(way[0]) < 1e-9:
        raise ValueError("they let the output stand" if abs(way[1]) < 1e-9 else "they hold the input")
    return float(way[0] / way[1])


def overrunning(system: System, gear: GearHeld, at_input: str, at_output: str) -> list[str]:
    """Return the free-wheels of a gear that would overrun, instead of holding it, when the input drives against a load.

    Parameters
    ----------
    system : System
        The driveline.
    gear : GearHeld
        The gear.
    at_input, at_output : str
        Bodies of the input and the output.

    Returns
    -------
    list of str
        Names of the free-wheels.

    Raises
    ------
    ValueError
        As of :func:`held_ratio`.
    """
    ratio = held_ratio(system, gear.held, at_input, at_output)
    into, out = (system.bodies_from_speeds[system.bodies.index(name)] for name in (at_input, at_output))
    rows = system.w[[system.elements.index(name) for name in gear.held]]
    torques = np.linalg.lstsq(rows.T, into - ratio * out, rcond=None)[0]  # of the elements that hold, for 1 Nm at the input
    return [name for name, torque in zip(gear.held, torques) if name in gear.freewheels and torque < 1e-9]


def _left_free(rows: np.ndarray) -> np.ndarray:
    """Speeds (k, n) at which these slips (m, n) are all zero, by elimination, which rounds little."""
    rows, n, pivots = rows.copy(), rows.shape[1], []
    for column in range(n):
        below = np.abs(rows[len(pivots) :, column])
        if len(pivots) == len(rows) or below.max() < 1e-9:
            continue
        best, at = len(pivots) + int(below.argmax()), len(pivots)
        rows[[at, best]] = rows[[best, at]]
        rows[at] /= rows[at, column]
        for k in range(len(rows)):
            if k != at:
                rows[k] -= rows[k, column] * rows[at]
        pivots.append(column)
    out = []
    for free in (column for column in range(n) if column not in pivots):
        way = np.zeros(n)
        way[free] = 1.0
        for k, pivot in enumerate(pivots):
            way[pivot] = -rows[k, free]
        out.append(way)
    return np.array(out).reshape(len(out), n)
