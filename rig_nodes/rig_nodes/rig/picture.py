# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The driveline of a rig as a picture: bodies, wheels, planetary sets, clutches, and what sits on them.

`rig check` uses it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from ..driveline import Body, Link, svg
from ..plant import part as parts
from .structure import Device, Structure

if TYPE_CHECKING:
    from .transmission import Transmission

    class Drawn(Protocol):
        """What the picture needs of a rig (RigConfig); the values of bodies and meshes are attributes with their names."""

        @property
        def name(self) -> str:
            """Name of the rig."""

        @property
        def description(self) -> str:
            """One line of text about the rig."""

        @property
        def structure(self) -> Structure:
            """What the rig is made of."""

        @property
        def transmission(self) -> Transmission:
            """Transmission of a rig with gears."""


def _links(structure: Structure, config: object) -> list[Link]:
    """Everything that joins two bodies."""
    out = [
        (
            *mesh.bodies,
            "mesh",
            f"{mesh.name} {mesh.teeth[0]} : {mesh.teeth[1]}".lstrip()
            + (f", {getattr(config, mesh.name).efficiency:.3g}" if mesh.lossy else ""),
        )
        for mesh in structure.meshes
    ]
    out += [(*shaft.bodies, "shaft", shaft.name) for shaft in structure.shafts]
    for device in structure.clutches:
        if "joins" in device.wires:
            out.append((*device.wires["joins"], "clutch", _clutch(structure, device)))
    out += [(*device.wires["joins"], "shaft", device.called) for device in structure.of_role(parts.COUPLING)]
    out += [
        (*device.wires["joins"], "freewheel", f"{device.called}: {device.wires['joins'][0]} not faster")
        for device in structure.freewheels
    ]
    out += [(*one.bodies, one.kind, one.name) for one in structure.of_kind("clutch", "torque") if len(one.bodies) == 2]
    for one in structure.of_kind("relation"):
        words = [f"{c:g} {body}" for body, c in zip(one.bodies, one.coefficients)]
        out += [(one.bodies[0], other, "set", f"{one.name}: {words[0]}, {term}") for other, term in zip(one.bodies[1:], words[1:])]
    for one in structure.planetary_sets:
        named = f"{one.name}, {getattr(config, one.name).efficiency:.3g}" if one.lossy else one.name
        if one.ring == "ground":
            out.append((one.sun, one.carrier, "set", f"{named}: sun {one.teeth[0]}, ring {one.teeth[1]} held"))
        out += [
            (one.ring, wheel, "set", f"{named}: {role} {teeth}")
            for wheel, role, teeth in ((one.sun, "sun", one.teeth[0]), (one.carrier, "carrier,", f"ring {one.teeth[1]}"))
        ]
    return [Link(*one) for one in out if one[0] in structure.bodies and one[1] in structure.bodies]


def _attached(structure: Structure) -> dict[str, list[str]]:
    """Text on what sits on each body or acts on it."""
    out: dict[str, list[str]] = {body: [] for body in structure.bodies}
    for device in structure.devices:
        if device.role in (parts.SOURCE, parts.LOAD, parts.LOSS, parts.METER, parts.MASS):
            type_of = device.part.replace("_", " ")
            for body in (device.wires[end] for end in ("body", "driving", "driven") if device.wires.get(end) in out):
                out[body].append(f"{device.called}: {type_of}" if device.called != device.part else type_of)
    for one in structure.of_kind("torque", "varying_inertia", "slider_crank", "motion"):
        if len(one.bodies) == 1:
            out[one.bodies[0]].append(f"{one.name}: {one.kind.replace('_', ' ')}")
    for name in structure.inputs:
        if name in out:
            out[name].append("torque over time")
    return out


def _clutch(structure: Structure, device: Device) -> str:
    """Text on a clutch, with the valve that fills it and the controller's output that drives the valve."""
    valve = structure.valve_of(device.name)
    return f"{device.called} ({valve.called}, output {valve.wires['output']})" if valve else device.called


def driveline_svg(config: Drawn) -> str:
    """Return the picture of a rig's driveline as SVG text, from a configuration of rig.configuration."""
    structure, attached = config.structure, _attached(config.structure)
    bodies = {
        name: Body(name, 0.0 if name in structure.massless else getattr(config, name).inertia, notes=attached[name])
        for name in structure.bodies
    }
    for key in ("input", "output"):
        if end := getattr(structure, key):
            bodies[end.body].end = key
    brakes = [(device.wires["brakes"], _clutch(structure, device)) for device in structure.clutches if "brakes" in device.wires]
    for body, name in [*brakes, *((one.bodies[0], one.name) for one in structure.of_kind("brake"))]:
        bodies[body].brake = ", ".join(filter(None, (bodies[body].brake, name)))
    for device in structure.freewheels:
        a, b = device.wires["joins"]
        if "ground" in (a, b):
            bodies[b if a == "ground" else a].one_way.append((device.called, "not backwards" if a == "ground" else "not forwards"))
    called = {device.name: device.called for device in structure.devices}
    table = [
        f"{gear.name}: {', '.join(called.get(one, one) for one in gear.held)}, ratio {config.transmission.ratios[number]:.4g}"
        for number, gear in enumerate(structure.gears, 1)
    ]
    return svg(
        f"{config.name}: {config.description}",
        list(bodies.values()),
        _links(structure, config),
        f"gears: {'; '.join(table)}" if table else "",
    )
