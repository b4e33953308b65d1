# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The driveline of a rig from its structure and its values; used by testbench.plan, transmission and the picture of a rig."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

import numpy as np

from ..parts import part as parts
from ..plant.driveline import Driveline, System
from .structure import Structure

Inertia = Callable[[str], float]  # of a body by its name, 0 of a massless one


def inertias_of(structure: Structure, values: Mapping) -> dict[str, float]:
    """Inertia of each body [kg m2]. values: of its sections by name, as dataclasses or as plain maps."""
    def inertia(name: str) -> float:
        value = values[name]
        return float(value["inertia"] if isinstance(value, Mapping) else value.inertia)

    return {body: 0.0 if body in structure.massless else inertia(body) for body in structure.bodies}


def frame(structure: Structure, inertias: Mapping[str, float]) -> Driveline:
    """Bodies, wheels and planetary sets; what joins them by friction or gives way is not in it yet."""
    out = Driveline()
    for body in structure.bodies:
        out.inertia(body, inertias[body])
    for mesh in structure.meshes:
        out.gear(mesh.bodies[1], mesh.bodies[0], mesh.ratio)
    for one in structure.planetary_sets:
        out.planetary(one.name, one.sun, one.ring, one.carrier, one.ratio)
    return out


def has_element(device) -> bool:
    """True of a device that is a friction element of the driveline."""
    return "element" in parts.part(device.part).wires


def build_driveline(structure: Structure, inertias: Mapping[str, float], shafts: Mapping[str, tuple[float, float]]) -> System:
    """The whole driveline; an element is named as its device. shafts: stiffness and damping by name. RigError as
    plant.driveline has it."""
    out = frame(structure, inertias)
    for shaft in structure.shafts:
        out.shaft(shaft.name, *shaft.bodies, stiffness=shafts[shaft.name][0], damping=shafts[shaft.name][1])
    for device in structure.devices:
        if device.role == parts.FREEWHEEL:
            out.freewheel(device.name, *device.wires["joins"])
        elif "joins" in device.wires:
            out.clutch(device.name, *device.wires["joins"])
        elif has_element(device):
            out.brake(device.name, device.wires.get("brakes") or device.wires["body"])
    return out.build()


def held_ratio(system: System, clutches: Iterable[str], at_input: str, at_output: str) -> float:
    """Speed of the input over that of the output while these clutches hold.

    ValueError where they leave that open, or let the output stand.
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


def overrunning(system: System, gear, at_input: str, at_output: str) -> list[str]:
    """The free-wheels of a gear (GearHeld) that would let go as the input drives against a load, instead of holding it."""
    ratio = held_ratio(system, gear.held, at_input, at_output)
    into, out = (system.bodies_from_speeds[system.bodies.index(name)] for name in (at_input, at_output))
    rows = system.w[[system.elements.index(name) for name in gear.held]]
    torques = np.linalg.lstsq(rows.T, into - ratio * out, rcond=None)[0]  # of what holds, for 1 Nm at the input
    return [name for name, torque in zip(gear.held, torques) if name in gear.freewheels and torque < 1e-9]


def _left_free(rows: np.ndarray) -> np.ndarray:
    """Speeds (k, n) that these slips (m, n) let turn, one after the other; by elimination, which rounds less than it need."""
    rows, n, pivots = rows.copy(), rows.shape[1], []
    for column in range(n):
        below = np.abs(rows[len(pivots):, column])
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
