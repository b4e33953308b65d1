# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""The driveline of a rig as a picture: bodies, wheels, planetary sets, clutches, and what sits on them.

`rig check` uses it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from ..driveline import Body, Link, svg
from ..plant import part as parts
from .structure import Device, Mesh, PlanetarySet, Structure

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


def _losing(one: Mesh | PlanetarySet, config: object) -> str:
    """Text on the efficiency of teeth; empty where they lose nothing."""
    return f"efficiency {getattr(config, one.name).efficiency:.3g}" if one.lossy else "efficiency by table" * bool(one.table)


def _links(structure: Structure, config: object) -> list[Link]:
    """Everything that joins two bodies."""
    out: list[Link] = []
    for mesh in structure.meshes:
        losing = _losing(mesh, config)
        first, second = mesh.teeth
        out.append(Link(*mesh.bodies, "mesh", ", ".join(filter(None, (mesh.name, losing))), (f"{first} teeth", f"{second} teeth")))
    out += [Link(*shaft.bodies, "shaft", shaft.name) for shaft in structure.shafts]
    joins = [(one, *one.wires["joins"]) for one in structure.devices if "joins" in one.wires]
    out += [Link(a, b, "clutch", _clutch(structure, one)) for one, a, b in joins if one in structure.clutches]
    out += [Link(a, b, "shaft", one.called) for one, a, b in joins if one in structure.of_role(parts.COUPLING)]
    out += [Link(a, b, "freewheel", f"{one.called}: {a} not faster") for one, a, b in joins if one in structure.freewheels]
    out += [Link(*one.bodies, one.kind, one.name) for one in structure.of_kind("clutch", "torque") if len(one.bodies) == 2]
    out += [Link(one.bodies[0], one.bodies[1], "mesh", f"{one.name}: its ratio varies") for one in structure.of_kind("variator")]
    for one in structure.of_kind("relation"):
        words = [f"{c:g} {body}" for body, c in zip(one.bodies, one.coefficients)]
        out += [Link(one.bodies[0], other, "set", one.name, (words[0], term)) for other, term in zip(one.bodies[1:], words[1:])]
    for one in structure.planetary_sets:
        named = ", ".join(filter(None, (one.name, _losing(one, config))))
        sun, ring = f"sun {one.teeth[0]}", f"ring {one.teeth[1]}"
        if one.ring == "ground":
            out.append(Link(one.sun, one.carrier, "set", f"{named}: {ring} held", (sun, "carrier")))
        out += [Link(one.ring, one.sun, "set", named, (ring, sun)), Link(one.ring, one.carrier, "set", named, (ring, "carrier"))]
    for one in structure.devices:
        if one.wires.get("driving") in structure.bodies and one.wires.get("driven") in structure.bodies:
            out.append(Link(str(one.wires["driving"]), str(one.wires["driven"]), "torque", one.called, ("driving", "driven")))
    return [one for one in out if one.a in structure.bodies and one.b in structure.bodies]


def _attached(structure: Structure) -> dict[str, list[str]]:
    """Text on what sits on each body or acts on it."""
    out: dict[str, list[str]] = {body: [] for body in structure.bodies}
    for device in structure.devices:
        if device.role in (parts.SOURCE, parts.LOAD, parts.LOSS, parts.METER, parts.MASS):
            type_of = device.part.replace("_", " ")
            if (body := device.wires.get("body")) in out:
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


def driveline_drawn(config: Drawn) -> tuple[list[Body], list[Link]]:
    """Return the bodies of a rig's driveline and what joins two of them, from a configuration of rig.configuration."""
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
    return list(bodies.values()), _links(structure, config)


def driveline_svg(config: Drawn) -> str:
    """Return the picture of a rig's driveline as SVG text, from a configuration of rig.configuration."""
    structure = config.structure
    called = {device.name: device.called for device in structure.devices}
    table = [
        f"{gear.name}: {', '.join(called.get(one, one) for one in gear.held)}, ratio {config.transmission.ratios[number]:.4g}"
        for number, gear in enumerate(structure.gears, 1)
    ]
    return svg(f"{config.name}: {config.description}", *driveline_drawn(config), f"gears: {'; '.join(table)}" if table else "")
